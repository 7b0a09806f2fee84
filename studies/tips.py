"""Figure 11: tips of three turning blades under one homogeneous turbulence, and how far they differ."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flapgym.core.arrays import Array
from flapgym.core.multiblade import to_blades
from flapgym.core.state_space import series
from flapgym.model import TurbineModel
from flapgym.wind import realise, von_karman_filter

CYCLES = (28, 37)  # the paper's window
SEED = 11
TIPS = ("tip_deflection_0", "tip_deflection_c", "tip_deflection_s")


@dataclass(frozen=True, eq=False)
class Tips:
    """Three tips about their means.

    Attributes
    ----------
    turns, wind : (T,) float
        Rotor turns since the start; wind perturbation [m/s].
    tips : (T, 3) float
        [m].
    exact_rms : (2,) float
        `exact_rms` of the same turbine [m].
    """

    turns: Array
    wind: Array
    tips: Array
    exact_rms: Array

    @property
    def apart(self) -> Array:
        """Each blade's difference from the mean of the three (T, 3) [m]."""
        return np.asarray(self.tips - self.tips.mean(axis=1, keepdims=True))


def tips_in_turbulence(model: TurbineModel) -> Tips:
    """Figure 11, over the paper's window."""
    turns, wind, tips = simulate_tips(model, CYCLES[1], SEED)
    inside = turns >= CYCLES[0]
    return Tips(turns[inside], wind[inside], tips[inside], np.array(exact_rms(model)))


def simulate_tips(model: TurbineModel, cycles: int, seed: int) -> tuple[Array, Array, Array]:
    """Rotor turns (T,), wind (T,) [m/s] and tips (T, 3) [m] under one realisation of the reference turbulence."""
    turn = model.rotor_speed * model.time_step / (2.0 * np.pi)
    steps = round(cycles / turn)
    shaping = von_karman_filter(
        model.wind_speed, model.turbulence_intensity, model.length_scale, model.time_step
    )
    wind = realise(shaping, steps, np.random.default_rng(seed))[0]
    turns = turn * np.arange(steps, dtype=np.float64)
    tips = model.turbine.select(inputs=["wind"], outputs=TIPS).simulate(wind[:, None])
    return turns, wind, to_blades(tips, 2.0 * np.pi * turns)


def exact_rms(model: TurbineModel) -> tuple[float, float]:
    """Stationary rms [m] of a blade's tip, and of its difference from the mean of the three."""
    shaping = von_karman_filter(
        model.wind_speed, model.turbulence_intensity, model.length_scale, model.time_step
    )
    driven = series(shaping, model.turbine.select(inputs=["wind"], outputs=TIPS))
    variance = np.diag(driven.C @ driven.stationary_covariance() @ driven.C.T + driven.D @ driven.D.T)
    apart = 0.5 * (variance[1] + variance[2])
    return float(np.sqrt(variance[0] + apart)), float(np.sqrt(apart))
