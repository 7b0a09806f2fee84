"""The flap actuator: a double integrator from acceleration to rate and angle between hard stops (paper section III).

And what can be wrong with it: a lag before it, a flap that is stuck, one that carries less load or none.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from flapgym.core.arrays import BLADES, Array

TOUCH = 1e-12
"""Of the angle stop: a flap that is nearer to it, and goes on toward it, is at it. Commands at their bounds bring flaps
back to the very stop, and round-off must not decide whether they meet it."""


@dataclass(frozen=True)
class Faults:
    """What the flaps suffer from; the default is nothing. One entry a blade holds for all flaps of that blade.

    Parameters
    ----------
    effectiveness : tuple of float
        Factor on what a flap does to the air, blade by blade and on each blade flap by flap: 1 for a sound one, 0 for
        one that floats, aligned with the flow.
    stuck : tuple of float or None
        Angle [rad] at which a flap is stuck, its commands ignored; None for one that moves.
    lag : float
        Time constant [s] of a first-order lag between the commanded acceleration and the one that acts; 0 for none.
    """

    effectiveness: tuple[float, ...] = (1.0,) * BLADES
    stuck: tuple[float | None, ...] = (None,) * BLADES
    lag: float = 0.0

    def on(self, blades: int, flaps: int) -> tuple[Array, Array]:
        """Effectiveness, and angle where stuck (NaN for a flap that moves), each (blades flaps,).

        Raises
        ------
        ValueError
            If there is neither one entry for each blade of the rotor nor one for each flap.
        """
        return (
            _for_each("flap_effectiveness", self.effectiveness, blades, flaps),
            _for_each("stuck_flaps", [math.nan if one is None else one for one in self.stuck], blades, flaps),
        )


def _for_each(name: str, values: Any, blades: int, flaps: int) -> Array:
    given = np.array(values, dtype=float)
    if given.size not in (BLADES, BLADES * flaps):
        raise ValueError(
            f"{name}: expected {BLADES} entries, one a blade, or {BLADES * flaps}, one a flap, got {given.size}"
        )
    return np.repeat(given, BLADES * flaps // given.size)[: blades * flaps]


def flap_step(angle, rate, acceleration, time_step, angle_limit, rate_limit):  # type: ignore[no-untyped-def]
    """The stop rule: one plant step of a flap under an acceleration. Arrays and numbers alike; compiled as it is.

    rate' = clip(rate + acceleration dt, +-rate_limit), angle' = angle + dt / 2 (rate + rate') clipped at
    +-angle_limit, where the stop zeroes the rate that points into it. Exact as long as no stop is met; at a stop the
    trapezoid cuts one step short.

    Parameters
    ----------
    angle, rate, acceleration : float
        [rad, rad/s, rad/s^2].
    time_step, angle_limit, rate_limit : float
        [s, rad, rad/s].

    Returns
    -------
    angle, rate : float
        At the end of the step.
    lost : float
        Rate that a stop took away [rad/s].
    jump : float
        By how much the angle is off the trapezoid of the two rates [rad].
    met : bool
        Whether a stop was met.
    """
    wanted = rate + acceleration * time_step
    reached = np.minimum(np.maximum(wanted, -rate_limit), rate_limit)
    going = angle + 0.5 * time_step * (rate + reached)
    into_stop = (np.abs(going) > angle_limit * (1.0 - TOUCH)) & (going * reached > 0.0)
    inside = np.minimum(np.maximum(going, -angle_limit), angle_limit)
    # Exactly the stop: what is added is the difference of two neighbours.
    moved = inside + into_stop * (np.copysign(angle_limit, going) - inside)
    after = reached - into_stop * reached
    off = (going != inside) | into_stop
    # Zero, and not round-off, where nothing was in the way.
    jump = off * (moved - (angle + 0.5 * time_step * (rate + after)))
    return moved, after, after - wanted, jump, off | (wanted != reached)


def lag_constants(time_step: float, lag: float) -> tuple[float, float]:
    """What a step leaves of the difference between lagged acceleration and command, and its mean over the step.

    Parameters
    ----------
    time_step, lag : float
        Step and time constant [s]; without a lag both are zero.
    """
    if lag == 0.0:
        return 0.0, 0.0
    decay = math.exp(-time_step / lag)
    return decay, (1.0 - decay) * lag / time_step


def free_motion(steps: int, time_step: float, lag: float) -> Array:
    """Motion without stops, (2 (k + 1), kinds): angle and rate of samples 0..k.

    From angle, rate and command at the start, and where there is a lag from the lagged acceleration behind them: the
    command is held for all k steps.
    """
    decay, gain = lag_constants(time_step, lag)
    angle, rate, command, lagged = np.eye(4)
    rows = [angle, rate]
    for _ in range(steps):
        reached = rate + time_step * (command + gain * (lagged - command))
        angle, rate = angle + 0.5 * time_step * (rate + reached), reached
        lagged = command + decay * (lagged - command)
        rows += [angle, rate]
    return np.array(rows)[:, : 4 if lag > 0.0 else 3]


def deviations(steps: int, time_step: float) -> Array:
    """What stops do to the motion, (2 (k + 1), 2 k): angle and rate of samples 0..k.

    From the rate lost in step 1 and the jump of the angle in it, then of step 2 and so on.
    """
    motion = np.zeros((steps + 1, 2, steps, 2))
    for step in range(steps):
        behind = np.arange(steps - step)
        motion[step + 1 :, 0, step, 0] = time_step * (0.5 + behind)
        motion[step + 1 :, 1, step, 0] = 1.0
        motion[step + 1 :, 0, step, 1] = 1.0
    return motion.reshape(2 * (steps + 1), 2 * steps)
