"""The inner loop that brings a flap to an angle: time-optimal for the actuator's double integrator, without overshoot.

An acceleration is held for the time T of an action. With at most a, the flap can be stopped from a rate of n a T in n
actions over the distance n^2 a T^2 / 2; between these points the distance is taken linear, which makes the braking that
follows exactly a an action (so the law knows its own future) and ends at the target exactly. Where the acceleration
lags behind its command, a linear law with three equal real poles takes its place.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from flapgym.core.arrays import Array

PEAK_ACCELERATION, PEAK_RATE = 0.30, 0.35
"""Of a way of length one behind three equal poles of one, (2 - sqrt 2) exp(sqrt 2 - 2) / sqrt 2 = 0.231 and 2 / e^2 =
0.271, and room for the steps of an action."""


@dataclass(frozen=True)
class Servo:
    """Law from angle, rate and target to commanded acceleration.

    Attributes
    ----------
    acceleration_limit, rate_limit : float
        [rad/s^2, rad/s].
    angle_limit : float
        Stop of the flap to either side [rad]; a way from stop to stop stays within the other two limits.
    period : float
        Time T for which a command is held [s].
    lag : float
        Time constant of the acceleration behind its command [s]; 0 for none.
    """

    acceleration_limit: float
    rate_limit: float
    angle_limit: float
    period: float
    lag: float = 0.0

    def __call__(self, angle: Array, rate: Array, lagged: Array, target: Array) -> Array:
        """Command [rad/s^2] for the next action.

        Parameters
        ----------
        angle, rate, target : float arrays of one shape
            [rad, rad/s, rad].
        lagged : float array
            Acceleration that acts now [rad/s^2]; without a lag of no importance.
        """
        if self.lag > 0.0:
            state = np.stack([angle - target, rate, lagged], axis=-1)
            return np.clip(-state @ self._gain, -self.acceleration_limit, self.acceleration_limit)
        return self._fastest(angle, rate, target)

    def carried(self, lagged: Array, command: Array) -> Array:
        """Acceleration that acts at the end of an action."""
        decay = np.exp(-self.period / self.lag) if self.lag > 0.0 else 0.0
        return command + (lagged - command) * decay

    def _fastest(self, angle: Array, rate: Array, target: Array) -> Array:
        """Acceleration after which the rate v' leaves just enough distance to stop at the target.

        That is e = T (v + v') / 2 + d(v'), with e the distance now and d that of stopping. Rate and acceleration are
        kept within their limits.
        """
        step = self.acceleration_limit * self.period
        left = target - angle - 0.5 * self.period * rate
        scaled = 2.0 * np.abs(left) / (step * self.period)
        # Points n of the law are at scaled = n^2 + n.
        whole = np.floor(0.5 * (np.sqrt(1.0 + 4.0 * scaled) - 1.0))
        reached = np.sign(left) * step * (whole + (scaled - whole * (whole + 1.0)) / (2.0 * (whole + 1.0)))
        reached = np.clip(reached, -self.rate_limit, self.rate_limit)
        return np.clip((reached - rate) / self.period, -self.acceleration_limit, self.acceleration_limit)

    @property
    def bandwidth(self) -> float:
        """Poles of the law for a lagging actuator [rad/s]: as fast as the stops allow, but not faster than the lag."""
        way = 2.0 * self.angle_limit
        return min(
            (self.acceleration_limit / (PEAK_ACCELERATION * way)) ** 0.5,
            self.rate_limit / (PEAK_RATE * way),
            1.0 / self.lag,
        )

    @cached_property
    def _gain(self) -> Array:
        """Feedback (3,) of angle, rate and lagged acceleration, by Ackermann's formula."""
        T, lag = self.period, self.lag
        decay = np.exp(-T / lag)
        late = lag * (1.0 - decay)
        A = np.array([[1.0, T, lag * T - lag * late], [0.0, 1.0, late], [0.0, 0.0, decay]])
        B = np.array([0.5 * T**2 - lag * T + lag * late, T - late, 1.0 - decay])
        shifted = A - np.exp(-self.bandwidth * T) * np.eye(3)
        reach = np.stack([B, A @ B, A @ A @ B], axis=1)
        return np.asarray(np.linalg.solve(reach.T, [0.0, 0.0, 1.0]) @ shifted @ shifted @ shifted)


@dataclass(frozen=True)
class RotorServo:
    """The laws of all flaps of a rotor, whose arrays end in (blades F,), blade by blade and on each flap by flap.

    Attributes
    ----------
    servos : tuple of Servo
        Of flaps 1 to F, the same on every blade.
    """

    servos: tuple[Servo, ...]

    def __call__(self, angle: Array, rate: Array, lagged: Array, target: Array) -> Array:
        """Command [rad/s^2] for the next action; see Servo."""
        command = np.empty_like(angle)
        for flap, servo in enumerate(self.servos):
            own = (..., slice(flap, None, len(self.servos)))
            command[own] = servo(angle[own], rate[own], lagged[own], target[own])
        return command

    def carried(self, lagged: Array, command: Array) -> Array:
        """Acceleration that acts at the end of an action."""
        return self.servos[0].carried(lagged, command)

    def limits(self, name: str, count: int) -> Array:
        """A limit of the servos for each of `count` flaps of a rotor."""
        return np.resize([getattr(servo, name) for servo in self.servos], count)
