"""What it costs the actuator: duty of a flap on record, and of PD and PID brought to the LQG's load."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, fields, replace

import numpy as np
from scipy.optimize import brentq

from flapgym.aeroelastic.model import TurbineModel
from flapgym.control import (
    PDGains,
    PIDGains,
    Weights,
    agent_design,
    closed_loop,
    design_model,
    pd_agent,
    pid_agent,
    stationary_rms,
    synthesise,
)
from flapgym.evaluation import Record, root_mean_square
from flapgym.state_space import Array, StateSpace

CALM = Weights(rbm=0.5, flap_angle=1.0, acceleration=3.6, measurement_noise=0.1)
"""An LQG that weighs acceleration a thousand times as heavily as the shipped one and expects 10 % of noise."""

AT_STOP = 0.999
"""Share of the largest angle from which a flap counts as at its stop."""


@dataclass(frozen=True, eq=False)
class Duty:
    """Of each realisation, arrays (N,), blades averaged.

    Attributes
    ----------
    travel, rate_rms : path of a flap per second, rms of its rate [rad/s]
    inertial_power : mean modulus of rate times acceleration: W per kg m^2 of flap about its hinge [rad^2/s^3]
    hinge_power : mean modulus of angle times rate: W per N m/rad of hinge stiffness [rad^2/s]
    at_stop : share of the time at a stop of the angle
    """

    travel: Array
    rate_rms: Array
    inertial_power: Array
    hinge_power: Array
    at_stop: Array


def measure_duty(record: Record, angle_limit: float) -> Duty:
    """Duty from every sample."""
    angle, rate, dt = record.flap_angle, record.flap_rate, record.time_step
    acceleration, swing = np.diff(rate, axis=1) / dt, np.diff(angle, axis=1) / dt
    mean_rate, mean_angle = (0.5 * (each[:, 1:] + each[:, :-1]) for each in (rate, angle))
    return Duty(
        travel=np.abs(swing).mean(axis=(1, 2)),
        rate_rms=root_mean_square(rate.reshape(len(rate), -1)),
        inertial_power=np.abs(mean_rate * acceleration).mean(axis=(1, 2)),
        hinge_power=np.abs(mean_angle * swing).mean(axis=(1, 2)),
        at_stop=(np.abs(angle) >= AT_STOP * angle_limit).mean(axis=(1, 2)),
    )


@dataclass(frozen=True)
class EqualLoad:
    """Stationary duty of a controller at a given rms of the root bending moment; stops left out.

    Attributes
    ----------
    rbm_change : float
        Against open loop, a fraction.
    angle_rms, rate_rms : float
        [rad, rad/s].
    travel : float
        Mean modulus of the rate [rad/s].
    inertial_power, hinge_power : float
        As of `Duty`. Of Gaussian signals, and rate is uncorrelated with angle and with acceleration in a stationary
        motion: the mean modulus of a product is 2 / pi of the product of the rms.
    """

    rbm_change: float
    angle_rms: float
    rate_rms: float
    travel: float
    inertial_power: float
    hinge_power: float


def at_equal_load(model: TurbineModel, weights: Weights, noise: float) -> dict[str, EqualLoad]:
    """An LQG, and PD, PID and a calm LQG with gains at which they leave the same rms moment, by Lyapunov equations.

    Parameters
    ----------
    model : TurbineModel
    weights : Weights
        Of the LQG that sets the load, on the clamped blade; PD and PID are the shipped ones but for their gain.
    noise : float
        Rms of the measurement noise over the open-loop rms moment, white at every step.
    """
    reference = stationary_rms(model)["rbm"]
    sigma = noise * model.rbm_rms
    design = design_model(model)
    target = stationary_rms(model, synthesise(design, weights), measurement_noise=sigma)
    found = {"lqg": _stationary(target, reference)}
    pd = PDGains(**{each.name: agent_design("pd")[each.name] for each in fields(PDGains)})
    pid = PIDGains(**{each.name: agent_design("pid")[each.name] for each in fields(PIDGains)})
    families: dict[str, tuple[Callable[[float], StateSpace], float]] = {
        "pd": (lambda gain: pd_agent("pd", model, replace(pd, proportional=gain)).system, pd.proportional),
        "pid": (
            lambda gain: pid_agent("pid", model, replace(pid, proportional=gain)).system,
            pid.proportional,
        ),
        "lqg_calm": (lambda weight: synthesise(design, replace(CALM, rbm=weight)), CALM.rbm),
    }
    for name, (family, start) in families.items():

        def excess(log_gain: float, family: Callable[[float], StateSpace] = family) -> float:
            system = family(float(np.exp(log_gain)))
            if closed_loop(model, system).spectral_radius() >= 1.0:
                return -1.0
            return stationary_rms(model, system, measurement_noise=sigma)["rbm"] / target["rbm"] - 1.0

        gain = float(np.exp(brentq(excess, np.log(0.3 * start), np.log(3.0 * start), xtol=1e-4)))
        found[name] = _stationary(stationary_rms(model, family(gain), measurement_noise=sigma), reference)
    return found


def _stationary(rms: dict[str, float], reference: float) -> EqualLoad:
    angle, rate, acceleration = rms["flap_angle"], rms["flap_rate"], rms["flap_acceleration"]
    return EqualLoad(
        rbm_change=rms["rbm"] / reference - 1.0,
        angle_rms=angle,
        rate_rms=rate,
        travel=float(np.sqrt(2.0 / np.pi) * rate),
        inertial_power=2.0 / np.pi * rate * acceleration,
        hinge_power=2.0 / np.pi * angle * rate,
    )


def as_array(found: dict[str, EqualLoad]) -> Array:
    """One row a controller, columns in the order of the fields."""
    return np.array([list(asdict(each).values()) for each in found.values()])
