"""What the LQG's load costs the actuator of PD, PID and a calm LQG, brought to it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, fields, replace

import numpy as np
from scipy.optimize import brentq

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
from flapgym.core.arrays import Array
from flapgym.core.state_space import StateSpace
from flapgym.model.turbine_model import TurbineModel

CALM = Weights(rbm=0.5, flap_angle=1.0, acceleration=3.6, measurement_noise=0.1)
"""An LQG that weighs acceleration a thousand times as heavily as the shipped one and expects 10 % of noise."""


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
    pd, pid = shipped_gains(model)
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


def shipped_gains(model: TurbineModel) -> tuple[PDGains, PIDGains]:
    """Of the shipped PD and PID."""
    pd, pid = agent_design("pd", model), agent_design("pid", model)
    return (
        PDGains(**{each.name: pd[each.name] for each in fields(PDGains)}),
        PIDGains(**{each.name: pid[each.name] for each in fields(PIDGains)}),
    )


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
