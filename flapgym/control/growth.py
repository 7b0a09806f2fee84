"""What grows in a loop that is unstable: how fast, and at which frequency."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flapgym.control.agent import Agent
from flapgym.control.blade_controller import BladeController
from flapgym.control.channels import ROTOR, controller_channels
from flapgym.control.closed_loop import closed_loop, growth_per_turn
from flapgym.control.mpc import PredictiveController
from flapgym.control.rotor_controller import RotorController
from flapgym.core.state_space import StateSpace
from flapgym.model.turbine_model import TurbineModel


@dataclass(frozen=True)
class Growth:
    """The fastest growing mode of a loop.

    Attributes
    ----------
    frequency : float
        [Hz]; NaN for a periodic loop, which is followed over turns and does not tell it.
    doubling_time : float
        [s]; infinite for a mode that neither grows nor decays.
    """

    frequency: float
    doubling_time: float

    def __str__(self) -> str:
        verb = "never settles" if np.isinf(self.doubling_time) else "grows"
        place = "" if np.isnan(self.frequency) else f" at {self.frequency:.2f} Hz"
        pace = "" if np.isinf(self.doubling_time) else f", doubling in {self.doubling_time:.3g} s"
        return verb + place + pace


def growth(loop: StateSpace) -> Growth | None:
    """The fastest growing mode; None if all decay."""
    values = np.linalg.eigvals(loop.A)
    size = np.abs(values)
    if size.max(initial=0.0) < 1.0:
        return None
    fastest = values[size.argmax()]
    return Growth(
        float(abs(np.angle(fastest)) / (2.0 * np.pi * loop.time_step)),
        _doubling(float(abs(fastest)), loop.time_step),
    )


def agent_growth(agent: Agent, model: TurbineModel) -> Growth | None:
    """What grows in an agent's linear loop with the turbine, stops left out; None if nothing does or it has none.

    Predictive control counts with no stop in sight. With unequal blades the turbine is the mean over the revolution.
    """
    if isinstance(agent, PredictiveController):
        system = agent.unconstrained
    elif isinstance(agent, BladeController | RotorController):
        system = agent.system
    else:
        return None
    if controller_channels(system.inputs).suffixes != ROTOR.suffixes:
        return growth(closed_loop(model, system))
    factor = growth_per_turn(model, system)
    return Growth(np.nan, _doubling(factor, 2.0 * np.pi / model.rotor_speed)) if factor >= 1.0 else None


def _doubling(factor: float, time: float) -> float:
    """Time [s] in which what grows by a factor in some time doubles."""
    return float(np.log(2.0) * time / np.log(factor)) if factor > 1.0 else np.inf
