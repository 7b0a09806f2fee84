"""Load and actuation metrics of recorded series: rms, damage-equivalent load, flap use (paper section IV.C)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flapgym.core.fields import Numbers, Quantity, TupleOf
from flapgym.evaluation.cycles import rainflow_cycles
from flapgym.evaluation.record import Record

FATIGUE_SLOPE = 10.0
"""Slope of the S-N curve, typical of composite blades (the paper's choice)."""

EQUIVALENT_FREQUENCY = 1.0
"""Frequency of the constant-range load cycle that does the same damage [Hz]."""


@dataclass(frozen=True, eq=False)
class Metrics:
    """Metrics of each realisation, and of each blade where a blade has one.

    Attributes
    ----------
    rbm_rms, tip_rms, rbm_del : (N, 3) float
        Rms of root bending moment [N m] and tip deflection [m] about zero; damage-equivalent load, a range [N m].
    tower_rms : (N,) float
        Rms of the tower-top displacement [m].
    flap_angle_max, flap_rate_max : (N,) float
        Largest modulus over time, blades and their flaps [rad, rad/s].
    flap_travel : (N,) float
        Path of a flap per unit of time, mean over blades and their flaps [rad/s].
    pitch_travel : (N,) float
        Path of a blade's pitch, likewise; zero where it stays.
    """

    rbm_rms: NDArray[np.float64]
    tip_rms: NDArray[np.float64]
    rbm_del: NDArray[np.float64]
    tower_rms: NDArray[np.float64]
    flap_angle_max: NDArray[np.float64]
    flap_rate_max: NDArray[np.float64]
    flap_travel: NDArray[np.float64]
    pitch_travel: NDArray[np.float64]


def measure(record: Record, slope: float = FATIGUE_SLOPE) -> Metrics:
    """All metrics of a record, damage-equivalent loads at an S-N slope.

    Raises
    ------
    ValueError
        If a series holds what is no finite number, or has not the moments' shape, or the slope is not positive.
    """
    check_record(record)
    duration = (record.flap_angle.shape[1] - 1) * record.time_step
    path = np.abs(np.diff(record.flap_angle, axis=1)).sum(axis=1).mean(axis=1)
    of_pitch = np.zeros(len(record.rbm))
    if record.pitch_angle.size:
        of_pitch = np.abs(np.diff(record.pitch_angle, axis=1)).sum(axis=1).mean(axis=1)
    return Metrics(
        rbm_rms=root_mean_square(record.rbm, axis=1),
        tip_rms=root_mean_square(record.tip_deflection, axis=1),
        rbm_del=np.array(
            [
                [damage_equivalent_load(blade, record.time_step, slope) for blade in realisation.T]
                for realisation in record.rbm
            ]
        ),
        tower_rms=root_mean_square(record.tower_fore_aft, axis=1),
        flap_angle_max=np.abs(record.flap_angle).max(axis=(1, 2)),
        flap_rate_max=np.abs(record.flap_rate).max(axis=(1, 2)),
        flap_travel=path / duration,
        pitch_travel=of_pitch / duration,
    )


def root_mean_square(series: ArrayLike, axis: int = -1) -> NDArray[np.float64]:
    """Root mean square about zero along `axis`."""
    values = Numbers().check(series, "root_mean_square.series")
    return np.sqrt(np.mean(np.square(values), axis=axis))


def damage_equivalent_load(
    series: ArrayLike,
    time_step: float,
    slope: float = FATIGUE_SLOPE,
    equivalent_frequency: float = EQUIVALENT_FREQUENCY,
) -> float:
    """Range of the sinusoid at `equivalent_frequency` that does the damage of the series, in the series' unit.

    (sum n_i S_i^m / (f_eq T))^(1/m) over the rainflow cycles of range S_i, n_i = 1/2 or 1 (ASTM E1049-85), with
    T the series' duration and no binning. A series that only rises or only falls is half a cycle of its range.

    Parameters
    ----------
    series : (T,) array_like
        Load history.
    time_step : float
        Sampling time [s].
    slope : float
        S-N slope m.
    equivalent_frequency : float
        [Hz].

    Raises
    ------
    ValueError
        If an entry is masked or no finite number, or another argument is not positive.
    """
    Quantity("number", above=0.0).check(slope, "damage_equivalent_load.slope")
    (load,) = damage_equivalent_loads(series, time_step, [slope], equivalent_frequency)
    return float(load)


def damage_equivalent_loads(
    series: ArrayLike,
    time_step: float,
    slopes: Sequence[float],
    equivalent_frequency: float = EQUIVALENT_FREQUENCY,
) -> NDArray[np.float64]:
    """`damage_equivalent_load` at each of several S-N slopes, (slopes,), of cycles counted once."""
    name = "damage_equivalent_load"
    values = Numbers(axes=1).check(series, f"{name}.series")
    Quantity("time", above=0.0).check(time_step, f"{name}.time_step")
    Quantity("frequency", above=0.0).check(equivalent_frequency, f"{name}.equivalent_frequency")
    slopes = TupleOf(Quantity("number", above=0.0)).check(slopes, f"{name}.slopes")
    ranges, counts = rainflow_cycles(values)
    largest = ranges.max(initial=0.0)
    if largest == 0.0:
        return np.zeros(len(slopes))
    # Powers of the ratio to the largest range: S^10 of a load in N m would waste the exponent.
    share, periods = ranges / largest, equivalent_frequency * values.size * time_step
    return np.array(
        [largest * (np.sum(counts * share**slope) / periods) ** (1.0 / slope) for slope in slopes]
    )


def summed_damage_load(
    loads: ArrayLike, slope: float = FATIGUE_SLOPE, axis: int | tuple[int, ...] | None = None
) -> NDArray[np.float64]:
    """Damage-equivalent load of histories of one length together: damage adds, S-N slope m, loads as their m-th power.

    (mean of L_i^m)^(1/m) along `axis`, by default over all.
    """
    values = Numbers(at_least=0.0).check(loads, "summed_damage_load.loads")
    Quantity("number", above=0.0).check(slope, "summed_damage_load.slope")
    largest = values.max() or 1.0
    return np.asarray(largest * np.mean((values / largest) ** slope, axis=axis) ** (1.0 / slope))


def check_record(record: Record) -> None:
    """Refuse a record whose series do not belong together or hold what is no load.

    Raises
    ------
    ValueError
        Naming the series.
    """
    Quantity("time", above=0.0).check(record.time_step, "record.time_step")
    blades = Numbers(axes=3).check(record.rbm, "record.rbm").shape
    # As many flaps a blade as the angles tell, at least one.
    flaps = max(1, sum(np.shape(record.flap_angle)[-1:]) // blades[2])
    motion = (*blades[:2], flaps * blades[2])
    shapes = {"tip_deflection": blades, "flap_angle": motion, "flap_rate": motion}
    for name in ("tip_deflection", "flap_angle", "flap_rate", "tower_fore_aft", "tower_side_side", "wind"):
        shape = shapes.get(name, blades[:2])
        found = Numbers().check(getattr(record, name), f"record.{name}").shape
        if found != shape:
            raise ValueError(f"record.{name}: expected shape {shape}, as of the moments, got {found}")
    for name, series in record.further.items():
        shape = Numbers().check(series, f"record.further[{name!r}]").shape
        if shape not in (blades, blades[:2]):
            raise ValueError(
                f"record.further[{name!r}]: expected shape {blades} or {blades[:2]}, got {shape}"
            )
