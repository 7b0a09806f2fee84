"""Actuators between hard stops: of a flap, from acceleration to rate and angle (paper section III), and of pitch.

And what can be wrong with a flap's: a lag before it, a flap that is stuck, one that carries less load or none.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any

import numpy as np

from flapgym.core.arrays import BLADES, Array
from flapgym.core.fields import OrNone, Quantity, TupleOf, check_fields
from flapgym.turbine import Pitch

TOUCH = 1e-12
"""Of the angle stop: an actuator that is nearer to it, and goes on toward it, is at it. Commands at their bounds bring
flaps back to the very stop, and round-off must not decide whether they meet it."""


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

    effectiveness: Annotated[tuple[float, ...], TupleOf(Quantity("number"))] = (1.0,) * BLADES
    stuck: Annotated[tuple[float | None, ...], TupleOf(OrNone(Quantity("angle")))] = (None,) * BLADES
    lag: Annotated[float, Quantity("time", at_least=0.0)] = 0.0

    def __post_init__(self) -> None:
        check_fields(self, "faults")

    def on(self, blades: int, flaps: int) -> tuple[Array, Array]:
        """Effectiveness, and angle where stuck (NaN for a flap that moves), each (blades flaps,).

        Raises
        ------
        ValueError
            If there is neither one entry for each blade of the rotor nor one for each flap.
        """
        return (
            _for_each("faults.effectiveness", self.effectiveness, blades, flaps),
            _for_each(
                "faults.stuck", [math.nan if one is None else one for one in self.stuck], blades, flaps
            ),
        )


def _for_each(name: str, values: Any, blades: int, flaps: int) -> Array:
    given = np.array(values, dtype=float)
    if given.size not in (BLADES, BLADES * flaps):
        each = f", or {BLADES * flaps}, one a flap" if flaps > 1 else ""
        raise ValueError(f"{name}: expected {BLADES} entries, one a blade{each}, got {given.size}")
    return np.repeat(given, BLADES * flaps // given.size)[: blades * flaps]


@dataclass(frozen=True)
class Law:
    """What accelerates an actuator: command + lag_gain (lagged - command) - stiffness angle - damping rate.

    Attributes
    ----------
    lag_decay, lag_gain : float
        Of a lag before it (`lag_constants`).
    stiffness : float
        [1 / s^2]
    damping : float
        [1 / s]
    """

    lag_decay: float = 0.0
    lag_gain: float = 0.0
    stiffness: float = 0.0
    damping: float = 0.0


def pitch_law(pitch: Pitch, time_step: float) -> Law:
    """Of the actuator of second order that follows a demanded angle; its command is stiffness times that angle.

    angle'' = w^2 (demand - angle) - 2 zeta w angle', with angle and rate those in the middle of the step. So it is
    stable for any step, and rate and angle belong together as the stop rule has it.
    """
    w = 2.0 * np.pi * pitch.natural_frequency
    implicit = 1.0 + pitch.damping * w * time_step + (0.5 * w * time_step) ** 2
    return Law(
        stiffness=w**2 / implicit, damping=(2.0 * pitch.damping * w + 0.5 * w**2 * time_step) / implicit
    )


def flap_step(
    angle: Any, rate: Any, acceleration: Any, time_step: float, angle_limit: Any, rate_limit: Any
) -> tuple[Any, Any, Any, Any]:
    """The stop rule: one plant step of an actuator under an acceleration. Arrays and numbers alike; compiled as it is.

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
    return moved, after, jump, off | (wanted != reached)


def lag_constants(time_step: float, lag: float) -> tuple[float, float]:
    """What a step leaves of the difference between lagged acceleration and command, and its mean over the step.

    Parameters
    ----------
    time_step, lag : float
        Step and time constant [s]; without a lag both are zero.
    """
    if lag == 0.0:
        return 0.0, 0.0
    # Of a lag that is long against the step the difference to one is rounded away.
    return math.exp(-time_step / lag), -math.expm1(-time_step / lag) * lag / time_step


@lru_cache(maxsize=64)
def free_motion(steps: int, time_step: float, law: Law, lags: bool) -> Array:
    """Motion without stops, (2 (k + 1), kinds): angle and rate of samples 0..k.

    From the command, which is held for all k steps, lagged acceleration at the start if anything `lags`, and angle and
    rate there.
    """
    command, lagged, angle, rate = np.eye(4)
    rows = [angle, rate]
    for _ in range(steps):
        acting = command + law.lag_gain * (lagged - command) - law.stiffness * angle - law.damping * rate
        reached = rate + time_step * acting
        angle, rate = angle + 0.5 * time_step * (rate + reached), reached
        lagged = command + law.lag_decay * (lagged - command)
        rows += [angle, rate]
    motion = np.array(rows)[:, [0, 1, 2, 3] if lags else [0, 2, 3]]
    motion.setflags(write=False)  # whoever asks again gets this one
    return motion


def rate_gained(steps: int, time_step: float, law: Law) -> Array:
    """Rate that an actuator without a command gains in steps 1 to k, (k, 2): by angle, by rate at the start."""
    rates = free_motion(steps, time_step, law, False)[1::2, 1:]
    return np.asarray(rates[1:] - rates[:-1])


def stepwise_motion(steps: int, time_step: float) -> Array:
    """What steps add to rest, (2 (k + 1), 2 k): angle and rate of samples 0..k.

    From the rate gained in steps 1 to k, then the jumps of the angle in them: with angle and rate at the start, all
    that a flap does between its stops and at them.
    """
    motion = np.zeros((steps + 1, 2, 2, steps))
    for step in range(steps):
        behind = np.arange(steps - step)
        motion[step + 1 :, 0, 0, step] = time_step * (0.5 + behind)
        motion[step + 1 :, 1, 0, step] = 1.0
        motion[step + 1 :, 0, 1, step] = 1.0
    return motion.reshape(2 * (steps + 1), 2 * steps)
