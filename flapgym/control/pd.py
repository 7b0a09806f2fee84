"""Proportional-derivative control of the root bending moment, the paper's rival to LQG (section I)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flapgym.control.blade_controller import CONTROLLER_INPUTS, CONTROLLER_OUTPUTS, BladeController
from flapgym.core.fields import Quantity
from flapgym.core.state_space import StateSpace
from flapgym.model.turbine_model import TurbineModel

PD_START = np.array([[1.0, 0.0, 0.0]])
"""First state per unit of the first inputs: the low-passed moment is the moment, so its slope begins at zero."""


@dataclass(frozen=True)
class PDGains:
    """A demanded flap angle from the moment and its filtered slope, and the servo that follows it.

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
    system = pd_controller(gains, model.time_step)
    return BladeController(name, system, PD_START, model.acceleration_limit, model.hash)


def pd_controller(gains: PDGains, time_step: float) -> StateSpace:
    """One state, the low-passed moment: inputs [N m, rad, rad/s], output the flap acceleration [rad/s^2].

    a = omega^2 (demand - beta) - 2 zeta omega dbeta/dt, demand = -Kp (M + Td (M - M_f) / tau).
    """
    keep = np.exp(-time_step / gains.filter_time)
    stiffness = gains.servo_frequency**2
    # The slope is (M - M_f) / tau, whose M_f has the opposite sign: hence the plus in C and the minus in D.
    lead = gains.derivative_time / gains.filter_time
    return StateSpace(
        A=np.array([[keep]]),
        B=np.array([[1.0 - keep, 0.0, 0.0]]),
        C=np.array([[stiffness * gains.proportional * lead]]),
        D=np.array(
            [
                [
                    -stiffness * gains.proportional * (1.0 + lead),
                    -stiffness,
                    -2.0 * gains.servo_damping * gains.servo_frequency,
                ]
            ]
        ),
        time_step=time_step,
        inputs=CONTROLLER_INPUTS,
        outputs=CONTROLLER_OUTPUTS,
    )
