"""Duty of a flap on record: what its motion costs the actuator."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flapgym.core.arrays import Array
from flapgym.evaluation import Record, root_mean_square

AT_STOP = 0.999
"""Share of the largest angle from which a flap counts as at its stop."""


@dataclass(frozen=True, eq=False)
class Duty:
    """Of each realisation, arrays (N,), blades averaged.

    Attributes
    ----------
    travel, rate_rms, acceleration_rms : path of a flap per second, rms of its rate and acceleration [rad/s, rad/s,
        rad/s^2]
    inertial_power : mean modulus of rate times acceleration: W per kg m^2 of flap about its hinge [rad^2/s^3]
    hinge_power : mean modulus of angle times rate: W per N m/rad of hinge stiffness [rad^2/s]
    at_stop : share of the time at a stop of the angle
    """

    travel: Array
    rate_rms: Array
    acceleration_rms: Array
    inertial_power: Array
    hinge_power: Array
    at_stop: Array


def measure_duty(record: Record, angle_limit: float) -> Duty:
    """Duty from every sample; `angle_limit` is the stop [rad]."""
    angle, rate, dt = record.flap_angle, record.flap_rate, record.time_step
    acceleration, swing = np.diff(rate, axis=1) / dt, np.diff(angle, axis=1) / dt
    mean_rate, mean_angle = (0.5 * (each[:, 1:] + each[:, :-1]) for each in (rate, angle))
    return Duty(
        travel=np.abs(swing).mean(axis=(1, 2)),
        rate_rms=root_mean_square(rate.reshape(len(rate), -1)),
        acceleration_rms=root_mean_square(acceleration.reshape(len(rate), -1)),
        inertial_power=np.abs(mean_rate * acceleration).mean(axis=(1, 2)),
        hinge_power=np.abs(mean_angle * swing).mean(axis=(1, 2)),
        at_stop=(np.abs(angle) >= AT_STOP * angle_limit).mean(axis=(1, 2)),
    )
