"""The plainest stepping of the same plant, one turbine and one sample at a time, against which the fast one is tested.

The matrices of the model file as they are, wind and flaps together, no modes, no lifting, no superposition.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flapgym.core.arrays import BLADES, Array
from flapgym.model.multiblade import to_blades, to_components
from flapgym.model.turbine_model import TurbineModel
from flapgym.plant.actuator import TOUCH


@dataclass(frozen=True, eq=False)
class Run:
    """Samples 0 to T of one turbine.

    Attributes
    ----------
    rbm, tip_deflection : (T + 1, 3) float
        [N m, m].
    tower : (T + 1, 2) float
        [m].
    flap_angle, flap_rate : (T + 1, 3) float
        [rad, rad/s].
    """

    rbm: Array
    tip_deflection: Array
    tower: Array
    flap_angle: Array
    flap_rate: Array


def run(
    model: TurbineModel,
    acceleration: Array,
    wind: Array,
    azimuth: float = 0.0,
    state: Array | None = None,
    flap_angle: Array | None = None,
    flap_rate: Array | None = None,
) -> Run:
    """Simulate T steps under flap accelerations (T, 3) [rad/s^2] and wind (T + 1,) [m/s].

    Parameters
    ----------
    model : TurbineModel
    acceleration, wind : float arrays
    azimuth : float
        Of blade 1 at sample 0 [rad].
    state : (n,) float, optional
        Of the turbine at sample 0; rest by default.
    flap_angle, flap_rate : (3,) float, optional
        At sample 0 [rad, rad/s]; zero by default.
    """
    system, dt = model.turbine, model.time_step
    steps = acceleration.shape[0]
    x = np.zeros(system.order) if state is None else np.array(state, dtype=float)
    angle = np.zeros(BLADES) if flap_angle is None else np.array(flap_angle, dtype=float)
    rate = np.zeros(BLADES) if flap_rate is None else np.array(flap_rate, dtype=float)
    outputs, angles, rates = np.empty((steps + 1, 8)), np.empty((steps + 1, 3)), np.empty((steps + 1, 3))
    theta = azimuth + model.rotor_speed * dt * np.arange(steps + 1)
    for n in range(steps + 1):
        angles[n], rates[n] = angle, rate
        u = np.concatenate([to_components(angle, theta[n]), to_components(rate, theta[n]), wind[n : n + 1]])
        outputs[n] = system.C @ x + system.D @ u
        x = system.A @ x + system.B @ u
        if n < steps:
            angle, rate = _flap_step(model, angle, rate, acceleration[n])
    return Run(
        rbm=to_blades(outputs[:, 0:3], theta),
        tip_deflection=to_blades(outputs[:, 3:6], theta),
        tower=outputs[:, 6:8],
        flap_angle=angles,
        flap_rate=rates,
    )


def _flap_step(model: TurbineModel, angle: Array, rate: Array, acceleration: Array) -> tuple[Array, Array]:
    """One step of the actuator, blade by blade, in the words of the working definition."""
    new_angle, new_rate = np.empty(BLADES), np.empty(BLADES)
    for blade in range(BLADES):
        reached = rate[blade] + acceleration[blade] * model.time_step
        reached = min(max(reached, -model.flap_rate_limit), model.flap_rate_limit)
        moved = angle[blade] + 0.5 * model.time_step * (rate[blade] + reached)
        # At the very stop round-off must not decide.
        if abs(moved) > model.flap_angle_limit * (1.0 - TOUCH) and moved * reached > 0.0:
            moved, reached = math.copysign(model.flap_angle_limit, moved), 0.0
        moved = min(max(moved, -model.flap_angle_limit), model.flap_angle_limit)
        new_angle[blade], new_rate[blade] = moved, reached
    return new_angle, new_rate
