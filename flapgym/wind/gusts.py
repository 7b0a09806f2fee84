"""Winds that come beside the turbulence or in its place: step, ramp, sinusoid, IEC extreme operating gust, recording.

All are homogeneous perturbations along the shaft about the mean wind, as functions of the time since an episode's
start. An environment takes one as a mapping of plain values in SI units, `{"kind": "step", "start": 2.0, "size": 1.0}`,
or as an object with a `kind` and a method `wind` (`Gust`): another kind is another such class.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, Protocol, cast, runtime_checkable

import numpy as np

from flapgym.core.arrays import Array
from flapgym.core.fields import Choice, FilePath, Kind, OrNone, Quantity, check_fields
from flapgym.core.wording import number
from flapgym.wind.iec import REFERENCE_INTENSITIES, REFERENCE_SPEEDS, normal_turbulence, turbulence_scale
from flapgym.wind.recording import WindSeries, read_wind

EXTREME_GUST_DURATION = 10.5
"""T of the extreme operating gust [s] (IEC 61400-1:2005, 6.3.2.2)."""
ROUNDING = 1e-9
"""Time [s] by which a recording may end early."""
STRONGEST = 100.0
"""Largest perturbation [m/s]: no wind has more, and the model is linear."""

Perturbation = Quantity("speed", at_least=-STRONGEST, at_most=STRONGEST)
Moment = Quantity("time", at_least=-1e12, at_most=1e12)  # recordings may count from 1970
Dimension = OrNone(Quantity("length", at_least=1.0, at_most=1000.0))


@runtime_checkable
class Gust(Protocol):
    """A wind given in advance; `kind` is its name in a mapping and in what is saved."""

    kind: ClassVar[str]

    def wind(self, time: Array, mean: float) -> Array:
        """Perturbation [m/s] at times [s] since the episode's start, same shape, about the mean wind speed [m/s].

        At negative times it is what blew before: the turbine begins in equilibrium with the last of it.
        """
        ...


@dataclass(frozen=True)
class Step:
    """Nothing before `start` [s], `size` [m/s] from then on."""

    kind: ClassVar[str] = "step"
    size: Annotated[float, Perturbation]
    start: Annotated[float, Moment] = 0.0

    def __post_init__(self) -> None:
        check_fields(self, "gust")

    def wind(self, time: Array, mean: float) -> Array:
        """Perturbation [m/s] at times [s]."""
        return np.where(time >= self.start, self.size, 0.0)


@dataclass(frozen=True)
class Ramp:
    """A straight rise to `size` [m/s] over `duration` [s] from `start` [s], which then stays."""

    kind: ClassVar[str] = "ramp"
    size: Annotated[float, Perturbation]
    duration: Annotated[float, Quantity("time", at_least=1e-3, at_most=1e6)]
    start: Annotated[float, Moment] = 0.0

    def __post_init__(self) -> None:
        check_fields(self, "gust")

    def wind(self, time: Array, mean: float) -> Array:
        """Perturbation [m/s] at times [s]."""
        return self.size * np.clip((time - self.start) / self.duration, 0.0, 1.0)


@dataclass(frozen=True)
class Sinusoid:
    """`amplitude` [m/s] times the sine of `frequency` [Hz], which begins at `start` [s]."""

    kind: ClassVar[str] = "sinusoid"
    amplitude: Annotated[float, Perturbation]
    # The plant's samples may show less: `check_samples`.
    frequency: Annotated[float, Quantity("frequency", at_least=1e-6, at_most=50.0)]
    start: Annotated[float, Moment] = 0.0

    def __post_init__(self) -> None:
        check_fields(self, "gust")

    def check_samples(self, time_step: float) -> None:
        """Refuse, with a ValueError, a frequency that samples a time step [s] apart would show as another one."""
        if self.frequency > 0.5 / time_step:
            raise ValueError(
                f"gust.frequency: expected at most {0.5 / time_step:.4g} Hz, half the frequency of the model's time "
                f"steps of {time_step:g} s, got {self.frequency:g} Hz"
            )

    def wind(self, time: Array, mean: float) -> Array:
        """Perturbation [m/s] at times [s]."""
        since = np.maximum(time - self.start, 0.0)
        return self.amplitude * np.sin(2.0 * np.pi * self.frequency * since)


@dataclass(frozen=True)
class ExtremeOperatingGust:
    """The extreme operating gust of IEC 61400-1:2005 (third edition), 6.3.2.2, at hub height.

    -0.37 V_gust sin(3 pi t / T) (1 - cos(2 pi t / T)) for 0 <= t <= T = 10.5 s, with V_gust = min(1.35 (V_e1 - V_hub),
    3.3 sigma_1 / (1 + 0.1 D / Lambda_1)), V_e1 = 0.8 * 1.4 V_ref, sigma_1 = I_ref (0.75 V_hub + 5.6 m/s) and Lambda_1
    0.7 times the hub height up to 60 m, 42 m above. A dip, a peak of 0.74 V_gust after 5.25 s, and a dip.

    Parameters
    ----------
    turbine_class, turbulence_class : str
        "I" to "III" and "A" to "C"; they give V_ref and I_ref.
    start : float
        [s].
    rotor_diameter, hub_height : float
        D and the hub height [m]; those of the turbine it strikes by default (`on_turbine`).
    """

    kind: ClassVar[str] = "extreme_operating_gust"
    turbine_class: Annotated[str, Choice(tuple(REFERENCE_SPEEDS))] = "I"
    turbulence_class: Annotated[str, Choice(tuple(REFERENCE_INTENSITIES))] = "A"
    start: Annotated[float, Moment] = 0.0
    rotor_diameter: Annotated[float | None, Dimension] = None
    hub_height: Annotated[float | None, Dimension] = None

    def __post_init__(self) -> None:
        check_fields(self, "gust")

    def on_turbine(self, rotor_diameter: float | None, hub_height: float | None) -> ExtremeOperatingGust:
        """The gust with a turbine's rotor diameter and hub height [m], if they are known, where it gives none."""
        return replace(
            self,
            rotor_diameter=rotor_diameter if self.rotor_diameter is None else self.rotor_diameter,
            hub_height=hub_height if self.hub_height is None else self.hub_height,
        )

    def magnitude(self, mean: float) -> float:
        """V_gust [m/s] at a mean wind speed V_hub [m/s].

        Raises
        ------
        ValueError
            If it knows neither rotor diameter nor hub height.
        """
        if self.rotor_diameter is None or self.hub_height is None:
            missing = "rotor_diameter" if self.rotor_diameter is None else "hub_height"
            raise ValueError(f"gust.{missing}: the model's case does not tell it; give it in m")
        yearly = 0.8 * 1.4 * REFERENCE_SPEEDS[self.turbine_class]
        sigma = normal_turbulence(self.turbulence_class, mean)
        scale = turbulence_scale(self.hub_height)
        return min(1.35 * (yearly - mean), 3.3 * sigma / (1.0 + 0.1 * self.rotor_diameter / scale))

    def wind(self, time: Array, mean: float) -> Array:
        """Perturbation [m/s] at times [s]."""
        part = np.clip((time - self.start) / EXTREME_GUST_DURATION, 0.0, 1.0)
        shape = -0.37 * np.sin(3.0 * np.pi * part) * (1.0 - np.cos(2.0 * np.pi * part))
        return self.magnitude(mean) * shape


@dataclass(frozen=True)
class Recorded:
    """A series from a CSV file (`flapgym.wind.recording`), linear between its samples.

    Parameters
    ----------
    file : str
        Its column is the wind itself, of which the mean wind is taken off, or the perturbation.
    start : float or None
        Moment of the recording at which the episode begins [s]; its first by default. What blew before is taken to
        have been the value at that moment.
    """

    kind: ClassVar[str] = "recorded"
    file: Annotated[str, FilePath("a CSV file")]
    start: Annotated[float | None, OrNone(Moment)] = None

    def __post_init__(self) -> None:
        check_fields(self, "gust")

    def lasts(self) -> float:
        """Time [s] from the episode's start to the recording's end."""
        series, begin = self._from_start()
        return float(series.time[-1]) - begin

    def _from_start(self) -> tuple[WindSeries, float]:
        """The recording, and its moment at which the episode begins [s]."""
        series = read_wind(self.file)
        first, last = float(series.time[0]), float(series.time[-1])
        begin = first if self.start is None else self.start
        if not first <= begin < last:
            raise ValueError(
                f"gust.start: {self.file} holds {number(first)} to {number(last)} s; expected a moment in between, got "
                f"{number(begin)} s"
            )
        return series, begin

    def wind(self, time: Array, mean: float) -> Array:
        """Perturbation [m/s] at times [s].

        Raises
        ------
        ValueError
            If the recording begins later or ends earlier than it is asked for, or the file is unreadable.
        """
        series, begin = self._from_start()
        end = begin + float(np.max(time, initial=0.0))
        if end > series.time[-1] + ROUNDING:
            raise ValueError(
                f"gust.file: {self.file} lasts until {number(series.time[-1])} s, the episode until {number(end)} s; "
                f"expected a duration of at most {number(self.lasts())} s, or an earlier start"
            )
        values = np.interp(begin + np.maximum(time, 0.0), series.time, series.wind)
        perturbation = np.asarray(values if series.perturbation else values - mean)
        largest = float(np.abs(perturbation).max(initial=0.0))
        if largest > STRONGEST:
            raise ValueError(
                f"gust.file: {self.file}: expected perturbations within +-{number(STRONGEST)} m/s, got "
                f"{number(largest)} m/s; check the unit in its header"
            )
        return perturbation


GUSTS: dict[str, type[Any]] = {
    gust.kind: gust for gust in (Step, Ramp, Sinusoid, ExtremeOperatingGust, Recorded)
}
"""Kinds of gust that a mapping can name."""
GUST = Kind(Gust, GUSTS, example={"kind": "step", "start": 2.0, "size": 1.0})
"""What a field that holds a gust may hold."""


def gust_of(given: Any) -> Gust:
    """Gust that a mapping describes: `kind`, and the fields of its class in SI units.

    Raises
    ------
    ValueError
        If it is no such mapping; the message names the entry.
    """
    return cast(Gust, GUST.check(given, "gust"))
