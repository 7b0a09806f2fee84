"""The flap actuator: a double integrator from acceleration to rate and angle between hard stops (paper section III).

And what can be wrong with it: a lag before it, a flap that is stuck, one that carries less load or none.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flapgym.core.arrays import Array
from flapgym.core.fields import Count, PerBlade, Quantity
from flapgym.plant.layout import TOUCH

FEW = 16
"""Number of flaps at a stop up to which they are stepped one by one."""


@dataclass(frozen=True)
class Faults:
    """What the flaps of blades 1 to 3 suffer from; the default is nothing.

    Parameters
    ----------
    effectiveness : (3,) float
        Factor on what a flap does to the air: 1 for a sound one, 0 for one that floats, aligned with the flow.
    stuck : (3,) float or None
        Angle [rad] at which a flap is stuck, its commands ignored; None for one that moves.
    lag : float
        Time constant [s] of a first-order lag between the commanded acceleration and the one that acts; 0 for none.
    """

    effectiveness: tuple[float, float, float] = (1.0, 1.0, 1.0)
    stuck: tuple[float | None, float | None, float | None] = (None, None, None)
    lag: float = 0.0

    def __post_init__(self) -> None:
        PerBlade("number").check(self.effectiveness, "faults.effectiveness")
        PerBlade("angle").check([value or 0.0 for value in self.stuck], "faults.stuck")
        Quantity("time", at_least=0.0).check(self.lag, "faults.lag")

    @cached_property
    def held(self) -> NDArray[np.bool_]:
        """(3,) which flaps are stuck."""
        return np.array([value is not None for value in self.stuck])

    @cached_property
    def held_angle(self) -> Array:
        """(3,) where they are [rad]; zero for the others."""
        return np.array([value or 0.0 for value in self.stuck])


@dataclass(frozen=True)
class Actuator:
    """Angle and rate of a flap over the steps of one action, during which its command c is held.

    lagged' = c + (lagged - c) exp(-dt / lag), rate' = clip(rate + change, +-rate_limit) with the exact change of
    the lagged acceleration's integral (c dt without a lag), angle' = angle + dt / 2 (rate + rate'), clipped at
    +-angle_limit, where the stop zeroes the rate that points into it. Without a lag exact as long as no stop is
    met; at a stop the trapezoid cuts one step short.

    Parameters
    ----------
    angle_limit, rate_limit : float
        Stops of the angle [rad] and of the rate [rad/s].
    time_step : float
        Sampling time dt [s].
    steps : int
        Plant steps k per action.
    lag : float
        Time constant [s].
    """

    angle_limit: float
    rate_limit: float
    time_step: float
    steps: int
    lag: float = 0.0

    def __post_init__(self) -> None:
        for name in ("angle_limit", "rate_limit", "time_step"):
            Quantity("number", above=0.0).check(getattr(self, name), f"actuator.{name}")
        Count(at_least=1).check(self.steps, "actuator.steps")
        Quantity("time", at_least=0.0).check(self.lag, "actuator.lag")

    @cached_property
    def decay(self) -> float:
        """What a step leaves of the difference between lagged acceleration and command."""
        return math.exp(-self.time_step / self.lag) if self.lag > 0.0 else 0.0

    @cached_property
    def gain(self) -> float:
        """Mean of that difference over a step, per unit at its start."""
        return (1.0 - self.decay) * self.lag / self.time_step if self.lag > 0.0 else 0.0

    @cached_property
    def free(self) -> Array:
        """Motion without stops, (2 (k + 1), 4): angle and rate of samples 0..k, from (angle, rate, lagged, c)."""
        dt, angle, rate, lagged, command = self.time_step, *np.eye(4)
        rows = [angle, rate]
        for _ in range(self.steps):
            reached = rate + dt * (command + self.gain * (lagged - command))
            angle, rate = angle + 0.5 * dt * (rate + reached), reached
            lagged = command + self.decay * (lagged - command)
            rows += [angle, rate]
        return np.array(rows)

    @cached_property
    def _limits(self) -> Array:
        """The stop that belongs to each row of the motion, (2 (k + 1), 1)."""
        return np.tile([self.angle_limit, self.rate_limit], self.steps + 1)[:, None]

    def move(self, start: Array) -> tuple[Array, NDArray[np.bool_] | None]:
        """Motion of the flaps over one action.

        Parameters
        ----------
        start : (n, 4, blades) float
            Angle [rad], rate [rad/s] and lagged acceleration [rad/s^2] at the start, and the held command [rad/s^2].

        Returns
        -------
        motion : (n, 2 (k + 1), blades) float
            Angle and rate at sample 0, angle and rate at sample 1, and so on to sample k.
        stopped : (n, blades) bool or None
            Flaps that met a stop; None if none did, which is the cheap and the usual case.
        """
        motion = self.free @ start
        near = np.asarray((np.abs(motion) > self._limits * (1.0 - TOUCH)).any(axis=1))
        if not near.any():
            return motion, None
        turbine, blade = np.nonzero(near)
        march = self._march_singly if turbine.size <= FEW else self._march_together
        stopped = np.zeros(near.shape, dtype=bool)
        motion[turbine, :, blade], stopped[turbine, blade] = march(start[turbine, :, blade])
        return motion, stopped

    def lagged(self, start: Array) -> Array:
        """Lagged acceleration (n, blades) at the end of the action."""
        return start[:, 3] + self.decay**self.steps * (start[:, 2] - start[:, 3])

    def _march_together(self, start: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Step by step with the stops: starts (m, 4), motion (m, 2 (k + 1)), and who met one (m,)."""
        angle, rate, lagged, command = start.T
        motion, stopped = np.empty((angle.size, self.steps + 1, 2)), np.zeros(angle.size, dtype=bool)
        motion[:, 0, 0], motion[:, 0, 1] = angle, rate
        inner = self.angle_limit * (1.0 - TOUCH)
        for step in range(1, self.steps + 1):
            wanted = rate + (command + (lagged - command) * self.gain) * self.time_step
            lagged = command + (lagged - command) * self.decay
            reached = np.minimum(np.maximum(wanted, -self.rate_limit), self.rate_limit)
            going = angle + 0.5 * self.time_step * (rate + reached)
            into_stop = (np.abs(going) > inner) & (going * reached > 0.0)
            angle = np.minimum(np.maximum(going, -self.angle_limit), self.angle_limit)
            stopped |= into_stop | (wanted != reached) | (going != angle)
            angle = np.where(into_stop, np.copysign(self.angle_limit, going), angle)
            rate = np.where(into_stop, 0.0, reached)
            motion[:, step, 0], motion[:, step, 1] = angle, rate
        return motion.reshape(angle.size, -1), stopped

    def _march_singly(self, start: Array) -> tuple[Array, NDArray[np.bool_]]:
        """The same, bit for bit, one flap at a time: for a few flaps plain floats are ten times as fast."""
        top_angle, top_rate, dt = self.angle_limit, self.rate_limit, self.time_step
        inner = top_angle * (1.0 - TOUCH)
        motion, stopped = [], []
        for angle, rate, lagged, command in start.tolist():
            path, met = [angle, rate], False
            for _ in range(self.steps):
                wanted = rate + (command + (lagged - command) * self.gain) * dt
                reached = min(max(wanted, -top_rate), top_rate)
                lagged = command + (lagged - command) * self.decay
                going = angle + 0.5 * dt * (rate + reached)
                angle, rate = min(max(going, -top_angle), top_angle), reached
                into_stop = abs(going) > inner and going * reached > 0.0
                met |= into_stop or wanted != reached or going != angle
                if into_stop:
                    angle, rate = math.copysign(top_angle, going), 0.0
                path += [angle, rate]
            motion.append(path)
            stopped.append(met)
        return np.array(motion), np.array(stopped)
