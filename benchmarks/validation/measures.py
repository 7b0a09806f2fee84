"""What is compared of a series: sizes in turbulence, bands, and the shape of a step; the same for every program."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.signal

from benchmarks.validation.reference import WIND_SPEED, Series
from flapgym.core.arrays import Array
from flapgym.evaluation.metrics import damage_equivalent_load
from flapgym.model import TurbineModel

STARTUP = 20.0
"""Left out of every series [s]: OpenFAST starts from an unbent blade and no wake."""

TIME_STEP = 0.02
"""Of the series when they are compared [s]."""

SEGMENT = 2048
"""Samples of a segment of Welch's spectra, 41 s: some nine of them in 200 s."""

BANDS = ((0.02, 0.1), (0.1, 0.3), (0.3, 0.6), (0.6, 1.2), (1.2, 3.0))
"""[Hz]"""


def respond(model: TurbineModel, series: Series) -> Series:
    """The model's blade and tower under the wind of a series, at its times; perturbations about the trim."""
    time = np.arange(series.time[0], series.time[-1] + model.time_step, model.time_step)
    wind = np.interp(time, series.time, series.wind) - WIND_SPEED
    # Uniform wind moves all blades alike, so that the collective components are those of a blade.
    outputs = ("rbm_0", "tip_deflection_0", "tower_fore_aft")
    loads = model.turbine.select(inputs=["wind"], outputs=outputs).simulate(wind[:, None])
    return Series(time, wind + WIND_SPEED, *loads.T).at(series.time)


def aligned(series: Series) -> Series:
    """The series without its start-up, in the steps in which all are compared."""
    return series.at(np.arange(STARTUP, series.time[-1] + 1e-9, TIME_STEP))


@dataclass(frozen=True)
class Statistics:
    """Size of a blade's loads in turbulence, about their means.

    Attributes
    ----------
    rbm_std, tip_std, tower_std : float
        Standard deviations [N m, m, m].
    rbm_del : float
        Damage equivalent load [N m].
    bands : tuple of float
        Rms of the root moment in each of BANDS [N m].
    """

    rbm_std: float
    tip_std: float
    tower_std: float
    rbm_del: float
    bands: tuple[float, ...]


def statistics(series: Series) -> Statistics:
    """Of an aligned series."""
    return Statistics(
        rbm_std=float(series.rbm.std()),
        tip_std=float(series.tip.std()),
        tower_std=float(series.tower.std()),
        rbm_del=damage_equivalent_load(series.rbm, series.time_step),
        bands=band_rms(series.rbm, series.time_step),
    )


def spectrum(values: Array, time_step: float) -> tuple[Array, Array]:
    """Frequencies [Hz] and one-sided power spectral density by Welch's method with Hann's window."""
    return scipy.signal.welch(values, 1.0 / time_step, nperseg=SEGMENT)


def band_rms(values: Array, time_step: float) -> tuple[float, ...]:
    """Rms in each of BANDS."""
    frequency, density = spectrum(values, time_step)
    inside = [(low <= frequency) & (high >= frequency) for low, high in BANDS]
    return tuple(float(np.sqrt(np.trapezoid(density[kept], frequency[kept]))) for kept in inside)


def correlation(one: Series, other: Series) -> float:
    """Of the root moments."""
    return float(np.corrcoef(one.rbm, other.rbm)[0, 1])


@dataclass(frozen=True)
class Step:
    """Answer to a step of the wind.

    Attributes
    ----------
    rbm, tip, tower : float
        Means over the last revolution less those over the last one before the step, per m/s [N m, m, m].
    rise : float
        Time from the step until the root moment has gone nine tenths of its way [s].
    peak_time : float
        Time from the step to the largest root moment of the first revolution [s].
    """

    rbm: float
    tip: float
    tower: float
    rise: float
    peak_time: float


def step_answer(series: Series, revolution: float) -> Step:
    """Of a series whose wind steps up once.

    Parameters
    ----------
    series : Series
    revolution : float
        Time of one [s]: what the tower does to a blade once a turn goes out of the means.
    """
    at = int(np.argmax(np.diff(series.wind)))
    size = float(series.wind[-1] - series.wind[at])
    stepped = float(series.time[at])
    before, after = (
        series.between(stepped - revolution, stepped),
        series.between(series.time[-1] - revolution),
    )

    def gain(name: str) -> float:
        return float(getattr(after, name).mean() - getattr(before, name).mean()) / size

    first = series.between(stepped, stepped + revolution)
    moved = (first.rbm - before.rbm.mean()) / (size * gain("rbm"))
    since = first.time - stepped
    return Step(
        rbm=gain("rbm"),
        tip=gain("tip"),
        tower=gain("tower"),
        rise=float(since[np.argmax(moved >= 0.9)]),
        peak_time=float(since[np.argmax(moved)]),
    )
