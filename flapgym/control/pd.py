"""Proportional-derivative control of the root bending moment, the paper's rival to LQG (section I)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flapgym.control.blade_controller import BladeController, acceleration_limits
from flapgym.control.channels import BLADE
from flapgym.core.arrays import Array
from flapgym.core.fields import Quantity
from flapgym.core.state_space import StateSpace
from flapgym.model.turbine_model import TurbineModel


@dataclass(frozen=True)
class PDGains:
    """A demanded flap angle from the moment and its filtered slope, and the servo of each flap that follows it.

    Attributes
    ----------
    proportional : float
        Flap angle per moment [rad/(N m)], positive against the moment.
    derivative_time : float
        Lead: the demand is proportional (M + derivative_time dM/dt) [s].
    filter_time : float
        Time constant of the low-pass through which the slope is taken [s].
    servo_frequency, servo_damping : float
        Natural frequency [rad/s] and damping ratio of the flap angle behind the demand.
    """

    proportional: float
    derivative_time: float
    filter_time: float
    servo_frequency: float
    servo_damping: float

    def __post_init__(self) -> None:
        for name in ("proportional", "derivative_time"):
            Quantity("number").check(getattr(self, name), f"pd.{name}")
        for name in ("filter_time", "servo_frequency", "servo_damping"):
            Quantity("number", above=0.0).check(getattr(self, name), f"pd.{name}")


def pd_agent(name: str, model: TurbineModel, gains: PDGains) -> BladeController:
    """Three copies of the PD controller at the step of `model`, under the name given."""
    flaps = len(model.flaps)
    system = pd_controller(gains, model.time_step, flaps)
    return BladeController(name, system, pd_start(flaps), acceleration_limits(model), model.hash)


def pd_start(flaps: int) -> Array:
    """First state (1, 1 + 2 F) per unit of the first inputs: the low-passed moment is the moment, its slope zero."""
    return np.eye(1, 1 + 2 * flaps)


def pd_controller(gains: PDGains, time_step: float, flaps: int = 1) -> StateSpace:
    """One state, the low-passed moment: inputs [N m, rad, rad/s], outputs the flaps' accelerations [rad/s^2].

    a = omega^2 (demand - beta) - 2 zeta omega dbeta/dt, demand = -Kp (M + Td (M - M_f) / tau). A blade has one moment,
    so its flaps have one demand, each with a servo of its own: what one loses at a stop the others do not make up for.
    """
    keep = np.exp(-time_step / gains.filter_time)
    stiffness = gains.servo_frequency**2
    # The slope is (M - M_f) / tau, whose M_f has the opposite sign: hence the plus in C and the minus in D.
    lead = gains.derivative_time / gains.filter_time
    alike, each, channels = np.ones((flaps, 1)), np.eye(flaps), BLADE.with_flaps(flaps)
    return StateSpace(
        A=np.array([[keep]]),
        B=(1.0 - keep) * np.eye(1, 1 + 2 * flaps),
        C=stiffness * gains.proportional * lead * alike,
        D=np.hstack(
            [
                -stiffness * gains.proportional * (1.0 + lead) * alike,
                -stiffness * each,
                -2.0 * gains.servo_damping * gains.servo_frequency * each,
            ]
        ),
        time_step=time_step,
        inputs=channels.inputs,
        outputs=channels.outputs,
    )
