"""Winds that come beside the turbulence or in its place: step, ramp, sinusoid, IEC's extreme gusts, recording.

All are perturbations along the shaft about the mean wind, as functions of the time since an episode's start, and the
same over the disk but for the extreme wind shear (`DiskGust`). An environment takes one as a mapping of plain values in
SI units, `{"kind": "step", "start": 2.0, "size": 1.0}`, or as an object with a `kind` and a method `wind` (`Gust`):
another kind is another such class.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, Protocol, TypeVar, cast, runtime_checkable

import numpy as np

from flapgym.core.arrays import Array
from flapgym.core.fields import Choice, FilePath, Kind, OrNone, Quantity, check_fields
from flapgym.core.wording import number
from flapgym.wind.iec import REFERENCE_INTENSITIES, REFERENCE_SPEEDS, normal_turbulence, turbulence_scale
from flapgym.wind.recording import WindSeries, read_wind

EXTREME_GUST_DURATION = 10.5
"""T of the extreme operating gust [s] (IEC 61400-1:2005, 6.3.2.2)."""
DIRECTION_CHANGE_DURATION = 6.0
"""T of the extreme direction change [s] (6.3.2.4)."""
COHERENT_GUST_DURATION = 10.0
"""Rise time T of the extreme coherent gust with direction change [s] (6.3.2.5)."""
COHERENT_GUST_SPEED = 15.0
"""V_cg of that gust [m/s]."""
EXTREME_SHEAR_DURATION = 12.0
"""T of the extreme wind shear [s] (6.3.2.6)."""
EXTREME_SHEAR_FACTOR = 6.4
"""beta of the extreme wind shear."""
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


@runtime_checkable
class SizedGust(Protocol):
    """A gust whose size depends on the turbine's."""

    def on_turbine(self, rotor_diameter: float | None, hub_height: float | None) -> Gust:
        """The gust with a turbine's rotor diameter and hub height [m], if they are known, where it gives none."""
        ...


@runtime_checkable
class DiskGust(Protocol):
    """A gust that differs over the disk: linear there, so its multi-blade components do not turn with the rotor."""

    def components(self, time: Array, radius: Array, mean: float) -> Array:
        """Perturbation (u_0, u_c, u_s) (T, R, 3) [m/s] at times (T,) [s] and radii (R,) [m] about the mean wind [m/s].

        u_b = u_0 + u_c cos(theta_b) + u_s sin(theta_b), the azimuth theta_b [rad] zero upright and growing clockwise
        for one who looks downwind.
        """
        ...


def gust_components(gust: Gust, time: Array, radius: Array, mean: float) -> Array:
    """Any gust's multi-blade components (T, R, 3) [m/s], as those of `DiskGust`; u_0 alone if it is homogeneous."""
    if isinstance(gust, DiskGust):
        return gust.components(time, radius, mean)
    found = np.zeros((len(time), len(radius), 3))
    found[..., 0] = gust.wind(time, mean)[:, None]
    return found


def gust_on_disk(gust: Gust, time: Array, radius: Array, azimuth: Array, mean: float) -> Array:
    """Any gust's perturbation (T, R, K) [m/s] at times (T,) [s], radii (R,) [m] and azimuths (K,) [rad] of a blade."""
    constant, cosine, sine = np.moveaxis(gust_components(gust, time, radius, mean)[..., None], -2, 0)
    return constant + cosine * np.cos(azimuth) + sine * np.sin(azimuth)


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
        return _sized(self, rotor_diameter, hub_height)

    def magnitude(self, mean: float) -> float:
        """V_gust [m/s] at a mean wind speed V_hub [m/s].

        Raises
        ------
        ValueError
            If it knows neither rotor diameter nor hub height.
        """
        yearly = 0.8 * 1.4 * REFERENCE_SPEEDS[self.turbine_class]
        slowed = 1.0 + 0.1 * _diameters(self)
        return min(1.35 * (yearly - mean), 3.3 * normal_turbulence(self.turbulence_class, mean) / slowed)

    def wind(self, time: Array, mean: float) -> Array:
        """Perturbation [m/s] at times [s]."""
        part = np.clip((time - self.start) / EXTREME_GUST_DURATION, 0.0, 1.0)
        shape = -0.37 * np.sin(3.0 * np.pi * part) * (1.0 - np.cos(2.0 * np.pi * part))
        return self.magnitude(mean) * shape


@dataclass(frozen=True)
class ExtremeDirectionChange:
    """The extreme direction change (EDC) of IEC 61400-1:2005, 6.3.2.4, as what it takes off the wind along the shaft.

    The direction turns by theta_e (1 - cos(pi t / T)) / 2 within T = 6 s and stays, with theta_e = 4 arctan(sigma_1 /
    (V_hub (1 + 0.1 D / Lambda_1))), at most 180 deg. The perturbation is V_hub (cos(theta) - 1); what the wind then has
    in the rotor plane is left out.

    Parameters
    ----------
    turbulence_class : str
        "A" to "C".
    turns : str
        "left" or "right": whither the wind then blows for one who looks downwind along the shaft. The wind along the
        shaft is the same.
    start : float
        [s].
    rotor_diameter, hub_height : float
        [m]; those of the turbine it strikes by default (`on_turbine`).
    """

    kind: ClassVar[str] = "extreme_direction_change"
    turbulence_class: Annotated[str, Choice(tuple(REFERENCE_INTENSITIES))] = "A"
    turns: Annotated[str, Choice(("left", "right"))] = "left"
    start: Annotated[float, Moment] = 0.0
    rotor_diameter: Annotated[float | None, Dimension] = None
    hub_height: Annotated[float | None, Dimension] = None

    def __post_init__(self) -> None:
        check_fields(self, "gust")

    def on_turbine(self, rotor_diameter: float | None, hub_height: float | None) -> ExtremeDirectionChange:
        """The gust with a turbine's rotor diameter and hub height [m], if they are known, where it gives none."""
        return _sized(self, rotor_diameter, hub_height)

    def magnitude(self, mean: float) -> float:
        """theta_e [rad], without its sign, at a mean wind speed V_hub [m/s].

        Raises
        ------
        ValueError
            If it knows neither rotor diameter nor hub height.
        """
        slope = normal_turbulence(self.turbulence_class, mean) / (mean * (1.0 + 0.1 * _diameters(self)))
        return min(4.0 * math.atan(slope), math.pi)

    def direction(self, time: Array, mean: float) -> Array:
        """Angle between wind and shaft [rad] at times [s], positive to the left of one who looks downwind."""
        sign = 1.0 if self.turns == "left" else -1.0
        return sign * self.magnitude(mean) * _rise(time - self.start, DIRECTION_CHANGE_DURATION)

    def wind(self, time: Array, mean: float) -> Array:
        """Perturbation [m/s] at times [s]."""
        return mean * (np.cos(self.direction(time, mean)) - 1.0)


@dataclass(frozen=True)
class ExtremeCoherentGust:
    """The extreme coherent gust with direction change (ECD) of IEC 61400-1:2005, 6.3.2.5, along the shaft.

    Within T = 10 s the wind rises by V_cg = 15 m/s and turns by theta_cg = 720 deg / (V_hub in m/s), at most 180 deg,
    both as (1 - cos(pi t / T)) / 2, and stays so. The perturbation is (V_hub + rise) cos(theta) - V_hub; what the wind
    then has in the rotor plane is left out.

    Parameters
    ----------
    turns : str
        "left" or "right", as in `ExtremeDirectionChange`.
    start : float
        [s].
    """

    kind: ClassVar[str] = "extreme_coherent_gust"
    turns: Annotated[str, Choice(("left", "right"))] = "left"
    start: Annotated[float, Moment] = 0.0

    def __post_init__(self) -> None:
        check_fields(self, "gust")

    def magnitude(self, mean: float) -> float:
        """theta_cg [rad], without its sign, at a mean wind speed V_hub [m/s]."""
        return math.pi * min(1.0, 4.0 / mean)  # 180 deg up to 4 m/s, 720 deg over the speed above

    def direction(self, time: Array, mean: float) -> Array:
        """Angle between wind and shaft [rad] at times [s], positive to the left of one who looks downwind."""
        sign = 1.0 if self.turns == "left" else -1.0
        return sign * self.magnitude(mean) * _rise(time - self.start, COHERENT_GUST_DURATION)

    def wind(self, time: Array, mean: float) -> Array:
        """Perturbation [m/s] at times [s]."""
        rise = COHERENT_GUST_SPEED * _rise(time - self.start, COHERENT_GUST_DURATION)
        return (mean + rise) * np.cos(self.direction(time, mean)) - mean


@dataclass(frozen=True)
class ExtremeWindShear:
    """The transient part of the extreme wind shear (EWS) of IEC 61400-1:2005, 6.3.2.6.

    (s / D) (2.5 m/s + 0.2 beta sigma_1 (D / Lambda_1)^(1/4)) (1 - cos(2 pi t / T)) for 0 <= t <= T = 12 s, with
    beta = 6.4 and s the distance from the hub towards the side on which the wind grows. The steady shear beside it is
    that of `flapgym.wind.inflow.Inflow`. Places are taken in the rotor plane: tilt and cone are left out.

    Parameters
    ----------
    turbulence_class : str
        "A" to "C".
    stronger : str
        Side on which the wind grows: "above" or "below" (vertical shear), "left" or "right" of one who looks downwind
        (horizontal shear). On the other side it falls.
    start : float
        [s].
    rotor_diameter, hub_height : float
        [m]; those of the turbine it strikes by default (`on_turbine`).
    """

    kind: ClassVar[str] = "extreme_wind_shear"
    turbulence_class: Annotated[str, Choice(tuple(REFERENCE_INTENSITIES))] = "A"
    stronger: Annotated[str, Choice(("above", "below", "left", "right"))] = "above"
    start: Annotated[float, Moment] = 0.0
    rotor_diameter: Annotated[float | None, Dimension] = None
    hub_height: Annotated[float | None, Dimension] = None

    def __post_init__(self) -> None:
        check_fields(self, "gust")

    def on_turbine(self, rotor_diameter: float | None, hub_height: float | None) -> ExtremeWindShear:
        """The gust with a turbine's rotor diameter and hub height [m], if they are known, where it gives none."""
        return _sized(self, rotor_diameter, hub_height)

    def slope(self, time: Array, mean: float) -> Array:
        """Growth of the wind over the distance from the hub [1/s] at times [s].

        Raises
        ------
        ValueError
            If it knows neither rotor diameter nor hub height.
        """
        diameters = _diameters(self)
        assert self.rotor_diameter is not None
        deviation = normal_turbulence(self.turbulence_class, mean)
        size = 2.5 + 0.2 * EXTREME_SHEAR_FACTOR * deviation * diameters**0.25
        part = np.clip((time - self.start) / EXTREME_SHEAR_DURATION, 0.0, 1.0)
        return size / self.rotor_diameter * (1.0 - np.cos(2.0 * np.pi * part))

    def wind(self, time: Array, mean: float) -> Array:
        """Perturbation [m/s] at hub height at times [s]: none."""
        return np.zeros(np.shape(time))

    def components(self, time: Array, radius: Array, mean: float) -> Array:
        """Perturbation (u_0, u_c, u_s) (T, R, 3) [m/s] at times (T,) [s] and radii (R,) [m]."""
        found = np.zeros((len(time), len(radius), 3))
        # A blade point is r cos(theta) above the hub and -r sin(theta) to its left.
        component, sign = {"above": (1, 1.0), "below": (1, -1.0), "left": (2, -1.0), "right": (2, 1.0)}[
            self.stronger
        ]
        found[..., component] = sign * np.outer(self.slope(time, mean), radius)
        return found


_Sized = TypeVar("_Sized", ExtremeOperatingGust, ExtremeDirectionChange, ExtremeWindShear)


def _sized(gust: _Sized, rotor_diameter: float | None, hub_height: float | None) -> _Sized:
    """The gust with the size of a turbine where it gives none."""
    return replace(
        gust,
        rotor_diameter=rotor_diameter if gust.rotor_diameter is None else gust.rotor_diameter,
        hub_height=hub_height if gust.hub_height is None else gust.hub_height,
    )


def _diameters(gust: ExtremeOperatingGust | ExtremeDirectionChange | ExtremeWindShear) -> float:
    """D / Lambda_1: rotor diameter over the turbulence scale."""
    if gust.rotor_diameter is None or gust.hub_height is None:
        missing = "rotor_diameter" if gust.rotor_diameter is None else "hub_height"
        raise ValueError(f"gust.{missing}: the model's case does not tell it; give it in m")
    return gust.rotor_diameter / turbulence_scale(gust.hub_height)


def _rise(since: Array, duration: float) -> Array:
    """Half a cosine from 0 to 1 within a duration [s], at times since its start [s]."""
    return 0.5 * (1.0 - np.cos(np.pi * np.clip(since / duration, 0.0, 1.0)))


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
    gust.kind: gust
    for gust in (
        Step,
        Ramp,
        Sinusoid,
        ExtremeOperatingGust,
        ExtremeDirectionChange,
        ExtremeCoherentGust,
        ExtremeWindShear,
        Recorded,
    )
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
