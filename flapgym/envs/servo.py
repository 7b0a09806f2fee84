"""The inner loop that brings a flap to an angle: time-optimal for the actuator's double integrator, without overshoot.

An acceleration is held for the time T of an action. With at most a, the flap can be stopped from a rate of n a T in n
actions over the distance n^2 a T^2 / 2; between these points the distance is taken linear, which makes the braking that
follows exactly a an action (so the law knows its own future) and ends at the target exactly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flapgym.state_space import Array


@dataclass(frozen=True)
class Servo:
    """Law from angle, rate and target to acceleration.

    Attributes
    ----------
    acceleration_limit, rate_limit : float
        [rad/s^2, rad/s].
    period : float
        Time T for which an acceleration is held [s].
    """

    acceleration_limit: float
    rate_limit: float
    period: float

    def __call__(self, angle: Array, rate: Array, target: Array) -> Array:
        """Acceleration [rad/s^2] for the next action; angles [rad] and rate [rad/s] of any one shape.

        It is the one after which the rate v' leaves just enough distance to stop at the target: e = T (v + v') / 2 +
        d(v'), with e the distance now and d that of stopping. Rate and acceleration are kept within their limits.
        """
        step = self.acceleration_limit * self.period
        left = target - angle - 0.5 * self.period * rate
        scaled = 2.0 * np.abs(left) / (step * self.period)
        # Points n of the law are at scaled = n^2 + n.
        whole = np.floor(0.5 * (np.sqrt(1.0 + 4.0 * scaled) - 1.0))
        reached = np.sign(left) * step * (whole + (scaled - whole * (whole + 1.0)) / (2.0 * (whole + 1.0)))
        reached = np.clip(reached, -self.rate_limit, self.rate_limit)
        return np.clip((reached - rate) / self.period, -self.acceleration_limit, self.acceleration_limit)
