"""The flap actuator: a double integrator from acceleration to rate and angle between hard stops (paper section III)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flapgym.state_space import Array

FEW = 16
"""Number of flaps at a stop up to which they are stepped one by one."""


@dataclass(frozen=True)
class Actuator:
    """Angle and rate of a flap over the steps of one action, during which its acceleration a is held.

    rate' = clip(rate + a dt, +-rate_limit), angle' = angle + dt / 2 (rate + rate'), clipped at
    +-angle_limit, where the stop zeroes the rate that points into it. Exact for a held acceleration
    as long as no stop is met; at a stop the trapezoid cuts one step short.

    Parameters
    ----------
    angle_limit, rate_limit : float
        Stops of the angle [rad] and of the rate [rad/s].
    time_step : float
        Sampling time dt [s].
    steps : int
        Plant steps k per action.
    """

    angle_limit: float
    rate_limit: float
    time_step: float
    steps: int

    def __post_init__(self) -> None:
        for name in ("angle_limit", "rate_limit", "time_step"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"actuator.{name}: expected a positive number, got {value}")
        if self.steps < 1:
            raise ValueError(f"actuator.steps: expected at least one, got {self.steps}")

    @cached_property
    def _free(self) -> Array:
        """Motion without stops, (2 (k + 1), 3): angle and rate of samples 0..k in turn, from (angle, rate, a)."""
        time = self.time_step * np.arange(self.steps + 1)
        one, zero = np.ones_like(time), np.zeros_like(time)
        angle, rate = np.stack([one, time, time**2 / 2], axis=1), np.stack([zero, one, time], axis=1)
        return np.stack([angle, rate], axis=1).reshape(-1, 3)

    @cached_property
    def _limits(self) -> Array:
        """The stop that belongs to each row of the motion, (2 (k + 1), 1)."""
        return np.tile([self.angle_limit, self.rate_limit], self.steps + 1)[:, None]

    def move(self, command: Array) -> tuple[Array, NDArray[np.bool_] | None]:
        """Motion of the flaps over one action.

        Parameters
        ----------
        command : (n, 3, blades) float
            Angle [rad] and rate [rad/s] at the start, and the held acceleration [rad/s^2].

        Returns
        -------
        motion : (n, 2 (k + 1), blades) float
            Angle and rate at sample 0, angle and rate at sample 1, and so on to sample k.
        stopped : (n, blades) bool or None
            Flaps that met a stop; None if none did, which is the cheap and the usual case.
        """
        motion = self._free @ command
        beyond = np.abs(motion) > self._limits
        if not beyond.any():
            return motion, None
        stopped = np.asarray(beyond.any(axis=1))
        turbine, blade = np.nonzero(stopped)
        start = command[turbine, :, blade]
        march = self._march_singly if turbine.size <= FEW else self._march_together
        motion[turbine, :, blade] = march(start)
        return motion, stopped

    def _march_together(self, start: Array) -> Array:
        """Step by step with the stops, for flaps that meet one: commands (m, 3), motion (m, 2 (k + 1))."""
        angle, rate, acceleration = start.T
        motion = np.empty((angle.size, self.steps + 1, 2))
        motion[:, 0, 0], motion[:, 0, 1] = angle, rate
        gain = acceleration * self.time_step
        for step in range(1, self.steps + 1):
            reached = np.minimum(np.maximum(rate + gain, -self.rate_limit), self.rate_limit)
            free = angle + 0.5 * self.time_step * (rate + reached)
            angle = np.minimum(np.maximum(free, -self.angle_limit), self.angle_limit)
            into_stop = (free != angle) & (free * reached > 0.0)
            rate = np.where(into_stop, 0.0, reached)
            motion[:, step, 0], motion[:, step, 1] = angle, rate
        return motion.reshape(angle.size, -1)

    def _march_singly(self, start: Array) -> Array:
        """The same, bit for bit, one flap at a time: for a few flaps plain floats are ten times as fast."""
        top_angle, top_rate, dt = self.angle_limit, self.rate_limit, self.time_step
        motion = []
        for angle, rate, acceleration in start.tolist():
            path = [angle, rate]
            gain = acceleration * dt
            for _ in range(self.steps):
                reached = min(max(rate + gain, -top_rate), top_rate)
                angle = angle + 0.5 * dt * (rate + reached)
                rate = reached
                if angle > top_angle:
                    angle, rate = top_angle, min(rate, 0.0)
                elif angle < -top_angle:
                    angle, rate = -top_angle, max(rate, 0.0)
                path += [angle, rate]
            motion.append(path)
        return np.array(motion)
