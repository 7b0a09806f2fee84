"""Winds that come beside the turbulence or in its place: step, ramp, sinusoid, IEC extreme operating gust, recording.

All are homogeneous perturbations along the shaft about the mean wind, as functions of the time since an episode's
start. An environment takes one as a mapping of plain values in SI units, `{"kind": "step", "start": 2.0, "size": 1.0}`.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields, replace
from typing import Any, Protocol

import numpy as np

from flapgym.core.arrays import Array
from flapgym.core.wording import number, shown
from flapgym.wind.recording import WindSeries, read_wind

EXTREME_GUST_DURATION = 10.5
"""T of the extreme operating gust [s] (IEC 61400-1:2005, 6.3.2.2)."""
REFERENCE_SPEEDS = {"I": 50.0, "II": 42.5, "III": 37.5}
"""V_ref of the turbine classes [m/s] (IEC 61400-1:2005, Table 1)."""
REFERENCE_INTENSITIES = {"A": 0.16, "B": 0.14, "C": 0.12}
"""I_ref of the turbulence classes (the same table)."""

ROUNDING = 1e-9
"""Time [s] by which a recording may end early."""
STRONGEST = 100.0
"""Largest perturbation [m/s]: no wind has more, and the model is linear."""
LIMITS = {
    "size": (-STRONGEST, STRONGEST, "m/s"),
    "amplitude": (-STRONGEST, STRONGEST, "m/s"),
    "frequency": (1e-6, 50.0, "Hz"),  # the plant's samples may show less: `Sinusoid.check_samples`
    "duration": (1e-3, 1e6, "s"),
    "start": (-1e12, 1e12, "s"),  # recordings may count from 1970
    "rotor_diameter": (1.0, 1000.0, "m"),
    "hub_height": (1.0, 1000.0, "m"),
}
"""Least and largest value of each number, and its unit."""


class Gust(Protocol):
    """A wind given in advance."""

    def wind(self, time: Array, mean: float) -> Array:
        """Perturbation [m/s] at times [s] since the episode's start, same shape, about the mean wind speed [m/s].

        At negative times it is what blew before: the turbine begins in equilibrium with the last of it.
        """
        ...


@dataclass(frozen=True)
class Step:
    """Nothing before `start` [s], `size` [m/s] from then on."""

    size: float
    start: float = 0.0

    def __post_init__(self) -> None:
        _check(self)

    def wind(self, time: Array, mean: float) -> Array:
        """Perturbation [m/s] at times [s]."""
        return np.where(time >= self.start, self.size, 0.0)


@dataclass(frozen=True)
class Ramp:
    """A straight rise to `size` [m/s] over `duration` [s] from `start` [s], which then stays."""

    size: float
    duration: float
    start: float = 0.0

    def __post_init__(self) -> None:
        _check(self)

    def wind(self, time: Array, mean: float) -> Array:
        """Perturbation [m/s] at times [s]."""
        return self.size * np.clip((time - self.start) / self.duration, 0.0, 1.0)


@dataclass(frozen=True)
class Sinusoid:
    """`amplitude` [m/s] times the sine of `frequency` [Hz], which begins at `start` [s]."""

    amplitude: float
    frequency: float
    start: float = 0.0

    def __post_init__(self) -> None:
        _check(self)

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

    turbine_class: str = "I"
    turbulence_class: str = "A"
    start: float = 0.0
    rotor_diameter: float | None = None
    hub_height: float | None = None

    def __post_init__(self) -> None:
        _check(self)
        for name, known in (
            ("turbine_class", REFERENCE_SPEEDS),
            ("turbulence_class", REFERENCE_INTENSITIES),
        ):
            value = getattr(self, name)
            if not isinstance(value, str) or value not in known:
                raise ValueError(f"gust.{name}: expected one of {', '.join(known)}, got {shown(value)}")

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
        sigma = REFERENCE_INTENSITIES[self.turbulence_class] * (0.75 * mean + 5.6)
        scale = 0.7 * min(self.hub_height, 60.0)
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

    file: str | os.PathLike[str]
    start: float | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.file, (str, os.PathLike)):
            raise ValueError(f"gust.file: expected the path of a CSV file, got {shown(self.file)}")
        object.__setattr__(self, "file", os.fspath(self.file))
        _check(self)

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
    "step": Step,
    "ramp": Ramp,
    "sinusoid": Sinusoid,
    "extreme_operating_gust": ExtremeOperatingGust,
    "recorded": Recorded,
}
"""Kinds of gust by the name that a mapping gives."""


def gust_of(given: Any) -> Gust:
    """Gust that a mapping describes: `kind`, and the fields of its class in SI units.

    Raises
    ------
    ValueError
        If it is no such mapping; the message names the entry.
    """
    if not isinstance(given, Mapping):
        raise ValueError(
            f'gust: expected a mapping such as {{"kind": "step", "start": 2.0, "size": 1.0}}, got {shown(given)}'
        )
    kind = given.get("kind")
    if not isinstance(kind, str) or kind not in GUSTS:
        raise ValueError(f"gust.kind: expected one of {', '.join(GUSTS)}, got {shown(kind)}")
    chosen = GUSTS[kind]
    known = {field.name: field.default is MISSING for field in fields(chosen)}
    entries = {name: value for name, value in given.items() if name != "kind"}
    for name in entries:
        if name not in known:
            raise ValueError(f"gust.{name}: a {kind} has no such entry; known: kind, {', '.join(known)}")
    missing = [name for name, needed in known.items() if needed and name not in entries]
    if missing:
        raise ValueError(f"gust.{missing[0]}: a {kind} needs it; known: kind, {', '.join(known)}")
    gust: Gust = chosen(**entries)
    return gust


def is_number(value: object) -> bool:
    """Whether it is a finite real number, Python's or NumPy's, and no truth value."""
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        return False
    return isinstance(value, int) or math.isfinite(value)  # any int is; those past a double have no float


def _check(gust: Any) -> None:
    """Refuse numbers that are none, or beyond what they can sensibly be."""
    for field in fields(gust):
        value = getattr(gust, field.name)
        if field.name not in LIMITS or (value is None and field.default is None):
            continue
        lowest, highest, unit = LIMITS[field.name]
        if not is_number(value):
            raise ValueError(f"gust.{field.name}: expected a finite number in SI units, got {shown(value)}")
        if not lowest <= value <= highest:
            raise ValueError(
                f"gust.{field.name}: expected a number from {number(lowest)} to {number(highest)} {unit}, got "
                f"{shown(value)}"
            )
