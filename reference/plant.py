"""The plainest stepping of the same plant, one turbine and one sample at a time, against which the fast one is tested.

The matrices of the model file as they are, wind and flaps together, no modes, no lifting, no superposition.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from flapgym.core.arrays import BLADES, Array
from flapgym.core.multiblade import to_blades, to_components
from flapgym.model.turbine_model import ModelFlap, TurbineModel
from flapgym.plant.actuator import TOUCH
from flapgym.turbine import Pitch


@dataclass(frozen=True, eq=False)
class Run:
    """Samples 0 to T of one turbine.

    Attributes
    ----------
    outputs : mapping of str to float arrays
        What the model tells, by name: (T + 1, 3) of a quantity of the blades, (T + 1, 1) in the fixed frame.
    flap_angle, flap_rate : (T + 1, 3 F) float
        Flap by flap on each blade [rad, rad/s].
    pitch_angle, pitch_rate : (T + 1, 3) float
        [rad, rad/s]
    """

    outputs: Mapping[str, Array]
    flap_angle: Array
    flap_rate: Array
    pitch_angle: Array
    pitch_rate: Array


def run(
    model: TurbineModel,
    acceleration: Array,
    wind: Array,
    azimuth: float = 0.0,
    state: Array | None = None,
    flap_angle: Array | None = None,
    flap_rate: Array | None = None,
    effectiveness: Array | float = 1.0,
    lag: float = 0.0,
    pitch: Array | None = None,
) -> Run:
    """Simulate T steps under flap accelerations (T, 3 F) [rad/s^2] and wind (T + 1,) [m/s].

    Parameters
    ----------
    model : TurbineModel
    acceleration, wind : float arrays
    azimuth : float
        Of blade 1 at sample 0 [rad].
    state : (n,) float, optional
        Of the turbine at sample 0; rest by default.
    flap_angle, flap_rate : (3 F,) float, optional
        At sample 0 [rad, rad/s]; zero by default.
    effectiveness : float or (3 F,) float
        Factor on what each flap does to the air.
    lag : float
        Time constant [s] of the acceleration behind its command; it acts from zero.
    pitch : (T, 3) float, optional
        Demanded pitch of each blade [rad], which starts at zero.
    """
    system, dt, steps = model.turbine, model.time_step, acceleration.shape[0]
    flaps = model.flaps * BLADES
    x = np.zeros(system.order) if state is None else np.array(state, dtype=float)
    angle = np.zeros(len(flaps)) if flap_angle is None else np.array(flap_angle, dtype=float)
    rate = np.zeros(len(flaps)) if flap_rate is None else np.array(flap_rate, dtype=float)
    lagged = np.zeros(len(flaps))
    outputs = np.empty((steps + 1, len(system.outputs)))
    angles, rates = np.empty((steps + 1, len(flaps))), np.empty((steps + 1, len(flaps)))
    pitched, pitches = np.zeros((3, BLADES)), np.zeros((steps + 1, 2, BLADES))
    theta = azimuth + model.rotor_speed * dt * np.arange(steps + 1)
    for n in range(steps + 1):
        angles[n], rates[n] = angle, rate
        u = np.zeros(len(system.inputs))
        of_flaps = [_components(effectiveness * each, theta[n]) for each in (angle, rate)]
        u[: 6 * len(model.flaps)] = np.concatenate(of_flaps)
        u[system.inputs.index("wind")] = wind[n]
        if pitch is not None:
            now = min(n, steps - 1)
            assert model.pitch_actuator is not None
            moved = [
                _pitch_step(model.pitch_actuator, dt, *each)
                for each in zip(*pitched[:2], pitch[now], strict=True)
            ]
            after = np.array(moved).T
            acceleration_after = (after[1] - pitched[1]) / dt
            pitches[n] = pitched[:2]
            place = system.inputs.index("pitch_angle_0")
            u[place : place + 9] = np.concatenate([to_components(each, theta[n]) for each in pitched])
        outputs[n] = system.C @ x + system.D @ u
        if pitch is not None:
            u[place + 6 : place + 9] = to_components(acceleration_after, theta[n])
            pitched = np.array([*after, acceleration_after])
        x = system.A @ x + system.B @ u
        if n == steps:
            break
        acting = acceleration[n]
        if lag:
            # Mean over the step of the exponential from the lagged acceleration to the command.
            acting = acting + (lagged - acting) * lag / dt * (1.0 - math.exp(-dt / lag))
            lagged = acceleration[n] + (lagged - acceleration[n]) * math.exp(-dt / lag)
        for flap, limits in enumerate(flaps):
            angle[flap], rate[flap] = _flap_step(limits, dt, angle[flap], rate[flap], acting[flap])
    return Run(_by_name(model, outputs, theta), angles, rates, pitches[:, 0], pitches[:, 1])


def _components(of_flaps: Array, azimuth: float) -> Array:
    """Components 0, c, s of flap 1, then of flap 2 and so on, from a number of each flap of each blade."""
    return to_components(of_flaps.reshape(BLADES, -1).T, azimuth).ravel()


def _by_name(model: TurbineModel, outputs: Array, azimuth: Array) -> dict[str, Array]:
    names = model.turbine.outputs
    of_blades = {
        name: to_blades(outputs[:, [names.index(f"{name}_{part}") for part in "0cs"]], azimuth)
        for name in model.blade_outputs
    }
    return of_blades | {name: outputs[:, [names.index(name)]] for name in model.fixed_outputs}


def _pitch_step(
    pitch: Pitch, time_step: float, angle: float, rate: float, demand: float
) -> tuple[float, float]:
    """One step of the actuator of second order by the implicit midpoint rule, and its stops."""
    w = 2.0 * np.pi * pitch.natural_frequency
    system = np.array([[0.0, 1.0], [-(w**2), -2.0 * pitch.damping * w]])
    half = 0.5 * time_step * system
    right = (np.eye(2) + half) @ [angle, rate] + time_step * np.array([0.0, w**2 * demand])
    free = np.linalg.solve(np.eye(2) - half, right)
    return _flap_step(pitch, time_step, angle, rate, float(free[1] - rate) / time_step)


def _flap_step(
    limits: ModelFlap | Pitch, time_step: float, angle: float, rate: float, acceleration: float
) -> tuple[float, float]:
    """One step of a flap, in the words of the working definition."""
    reached = rate + acceleration * time_step
    reached = min(max(reached, -limits.rate_limit), limits.rate_limit)
    moved = angle + 0.5 * time_step * (rate + reached)
    # At the very stop round-off must not decide.
    if abs(moved) > limits.angle_limit * (1.0 - TOUCH) and moved * reached > 0.0:
        moved, reached = math.copysign(limits.angle_limit, moved), 0.0
    return min(max(moved, -limits.angle_limit), limits.angle_limit), reached
