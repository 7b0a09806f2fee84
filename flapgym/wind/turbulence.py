"""Kinds of turbulence over the rotor's disk: the spectrum at a point, and the coherence of two points across the wind.

The component along the shaft, frozen along the mean wind, homogeneous over the disk. A kind's coherence at a distance d
depends on frequency through a decay alone, coherence(c d) with c(f) in 1/m. It comes as a mapping of SI values,
`{"kind": "kaimal", "turbulence_class": "B"}`, or an object with the methods of `Turbulence`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, Protocol, cast, runtime_checkable

import numpy as np
import scipy.special

from flapgym.core.arrays import Array
from flapgym.core.fields import Choice, Kind, OrNone, Quantity, check_fields
from flapgym.wind.box_field import BoxFile
from flapgym.wind.iec import (
    REFERENCE_INTENSITIES,
    REFERENCE_SPEEDS,
    extreme_turbulence,
    normal_turbulence,
    turbulence_scale,
)
from flapgym.wind.spectrum import von_karman_spectrum

Intensity = OrNone(Quantity("fraction", at_least=0.0, below=1.0))
Length = OrNone(
    Quantity("length", at_least=1.0, at_most=1e4)
)  # its square roots would fill the memory beyond
LARGE_SCALES = 0.12
"""What the coherence of both models still decays with at zero frequency, in 1 / L (IEC 61400-1, annex B)."""
KAIMAL_DECAY = 12.0
"""Of the exponential coherence (IEC 61400-1:2005, annex B.2)."""
KAIMAL_SCALE = 8.1
"""Integral length of the component along the shaft over Lambda_1 (the same)."""


@runtime_checkable
class Turbulence(Protocol):
    """A turbulence over the disk; `kind` is its name in a mapping and in what is saved."""

    kind: ClassVar[str]

    def __hash__(self) -> int:
        """What is prepared for a turbulence is kept by it, so it does not change."""
        ...

    def on_turbine(
        self, turbulence_intensity: float | None, length_scale: float | None, hub_height: float | None
    ) -> Turbulence:
        """The same with a case's intensity, von Karman length [m] and hub height [m], where it gives none itself."""
        ...

    def deviation(self, mean: float) -> float:
        """Standard deviation [m/s] at a mean wind [m/s]."""
        ...

    def spectrum(self, frequency: Array, mean: float) -> Array:
        """One-sided power spectral density at a point over the variance [1/Hz], at frequencies [Hz]."""
        ...

    def decay(self, frequency: Array, mean: float) -> Array:
        """The c [1/m] of `coherence(c d)` at frequencies [Hz], d the distance of two points; it rises."""
        ...

    def coherence(self, separation: Array) -> Array:
        """Cross-spectrum of two points over their spectrum, at c d; real, 1 at zero."""
        ...


@dataclass(frozen=True)
class VonKarman:
    """Isotropic turbulence with von Karman's spectrum, that of the homogeneous gust.

    Parameters
    ----------
    turbulence_intensity : float or None
        Standard deviation over the mean wind; the case's by default (`on_turbine`).
    length_scale : float or None
        Integral length along the wind [m]; the case's by default.
    """

    kind: ClassVar[str] = "von_karman"
    turbulence_intensity: Annotated[float | None, Intensity] = None
    length_scale: Annotated[float | None, Length] = None

    def __post_init__(self) -> None:
        check_fields(self, "field")

    def on_turbine(
        self, turbulence_intensity: float | None, length_scale: float | None, hub_height: float | None
    ) -> VonKarman:
        """The same with a case's intensity and length [m] where it gives none itself."""
        return replace(
            self,
            turbulence_intensity=_first(self.turbulence_intensity, turbulence_intensity),
            length_scale=_first(self.length_scale, length_scale),
        )

    def deviation(self, mean: float) -> float:
        """Standard deviation [m/s] at a mean wind [m/s]."""
        return _known(self.turbulence_intensity, "turbulence_intensity") * mean

    def spectrum(self, frequency: Array, mean: float) -> Array:
        """Over the variance [1/Hz]; `von_karman_spectrum`."""
        # Of unit variance: the intensity that this takes is the deviation over the mean wind, and linear.
        half = von_karman_spectrum(frequency, mean, 0.5, _known(self.length_scale, "length_scale"))
        return half / (0.5 * mean) ** 2

    def decay(self, frequency: Array, mean: float) -> Array:
        """The decay c = 2 pi sqrt((f/U)^2 + (0.12/L)^2) [1/m]."""
        length = _known(self.length_scale, "length_scale")
        return 2.0 * np.pi * np.hypot(frequency / mean, LARGE_SCALES / length)

    def coherence(self, separation: Array) -> Array:
        """2/Gamma(5/6) ((e/2)^(5/6) K_5/6(e) - (e/2)^(11/6) K_1/6(e)), e = c d (IEC 61400-1:1999, annex B).

        What isotropy makes of the spectrum. It is negative from e = 2.26 on, down to -0.037: eddies turn, and what
        goes ahead here comes back beside it.
        """
        e = np.asarray(separation, dtype=np.float64)
        coherence = np.zeros(e.shape)
        near = e < 40.0  # beyond, it is 1e-16; the Bessel functions take long
        # K is infinite at zero, where the whole tends to 1 as 1 - 3.4 e^(5/3): below 1e-12 that is 1 to the last digit.
        half = 0.5 * np.maximum(e[near], 1e-12)
        fifth, first = scipy.special.kv(5.0 / 6.0, 2.0 * half), scipy.special.kv(1.0 / 6.0, 2.0 * half)
        sides = half ** (5.0 / 6.0) * fifth - half ** (11.0 / 6.0) * first
        coherence[near] = 2.0 / scipy.special.gamma(5.0 / 6.0) * sides
        return coherence


@dataclass(frozen=True)
class Kaimal:
    """The Kaimal spectrum with exponential coherence of IEC 61400-1:2005, annex B.2, as strong as it says.

    Parameters
    ----------
    turbulence : {"NTM", "ETM"}
        Normal or extreme turbulence model.
    turbine_class, turbulence_class : str
        "I" to "III", which counts in the extreme model alone, and "A" to "C".
    turbulence_intensity : float or None
        Standard deviation over the mean wind, in the place of what the standard says.
    hub_height : float or None
        [m]; the turbine's by default (`on_turbine`). It gives the scale Lambda_1.
    """

    kind: ClassVar[str] = "kaimal"
    turbulence: Annotated[str, Choice(("NTM", "ETM"))] = "NTM"
    turbine_class: Annotated[str, Choice(tuple(REFERENCE_SPEEDS))] = "I"
    turbulence_class: Annotated[str, Choice(tuple(REFERENCE_INTENSITIES))] = "A"
    turbulence_intensity: Annotated[float | None, Intensity] = None
    hub_height: Annotated[float | None, OrNone(Quantity("length", at_least=1.0, at_most=1000.0))] = None

    def __post_init__(self) -> None:
        check_fields(self, "field")

    def on_turbine(
        self, turbulence_intensity: float | None, length_scale: float | None, hub_height: float | None
    ) -> Kaimal:
        """The same with a turbine's hub height [m] where it gives none; the standard tells how strong it is."""
        return replace(self, hub_height=_first(self.hub_height, hub_height))

    def deviation(self, mean: float) -> float:
        """Standard deviation [m/s] at a mean wind [m/s]."""
        if self.turbulence_intensity is not None:
            return self.turbulence_intensity * mean
        if self.turbulence == "ETM":
            return extreme_turbulence(self.turbine_class, self.turbulence_class, mean)
        return normal_turbulence(self.turbulence_class, mean)

    def _length(self) -> float:
        """Integral length and coherence scale [m], which are one."""
        return KAIMAL_SCALE * turbulence_scale(_known(self.hub_height, "hub_height"))

    def spectrum(self, frequency: Array, mean: float) -> Array:
        """4 (L/U) / (1 + 6 f L/U)^(5/3), over the variance [1/Hz]; its integral is 1."""
        time_scale = self._length() / mean
        return np.asarray(4.0 * time_scale / (1.0 + 6.0 * frequency * time_scale) ** (5.0 / 3.0))

    def decay(self, frequency: Array, mean: float) -> Array:
        """The decay c = 12 sqrt((f/U)^2 + (0.12/L)^2) [1/m]."""
        return KAIMAL_DECAY * np.hypot(frequency / mean, LARGE_SCALES / self._length())

    def coherence(self, separation: Array) -> Array:
        """exp(-c d)."""
        return np.asarray(np.exp(-separation))


def _first(own: float | None, other: float | None) -> float | None:
    return other if own is None else own


def _known(value: float | None, name: str) -> float:
    if value is None:
        raise ValueError(f"field.{name}: expected a number, as the model's case does not tell it, got None")
    return value


TURBULENCES: dict[str, type[Any]] = {field.kind: field for field in (VonKarman, Kaimal, BoxFile)}
"""Kinds that a mapping can name."""
TURBULENCE = Kind(Turbulence, TURBULENCES, example={"kind": "kaimal", "turbulence_class": "B"})
"""What a setting that holds one may hold."""


def turbulence_of(given: Any) -> Turbulence | BoxFile:
    """Turbulence, or a box of it, that a mapping describes: `kind`, and the fields of its class in SI units.

    Raises
    ------
    ValueError
        If it is no such mapping; the message names the entry.
    """
    return cast(Turbulence | BoxFile, TURBULENCE.check(given, "field"))
