"""Who is compared: shipped controllers, predictive ones with more and more preview, and the bound's own motion."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baselines.rivals.bound import Bound
from baselines.shipped import loaded, shipped_weights
from flapgym.control import Agent, OpenLoop, PredictiveController
from flapgym.control.agent import Floats
from flapgym.control.rotor_controller import RotorController
from flapgym.core.arrays import BLADES, Array
from flapgym.model.turbine_model import TurbineModel

PREVIEWS = (0.2, 0.5, 1.0, 2.0)
"""Seconds of wind known in advance."""

SHIPPED = {
    "pd": "PD, flap just meets its stop",
    "pid": "PID, flap just meets its stop",
    "individual_flap": "collective, tilt and yaw PID",
    "lqg": "LQG, flap just meets its stop",
    "lqg_saturating": "LQG, stops cut it",
    "lqg_multiblade_saturating": "LQG of the whole turbine, stops cut it",
}


@dataclass(frozen=True)
class Rival:
    """A row of the table: what runs, and what the table calls it."""

    agent: Agent
    label: str


def rivals(model: TurbineModel) -> list[Rival]:
    """All but the bound, open loop first.

    Raises
    ------
    ValueError
        If a shipped agent was tuned on another model.
    """
    found = [Rival(OpenLoop(), "open loop")]
    for name, label in SHIPPED.items():
        agent = loaded(name, model)
        found.append(Rival(agent, label))
        if isinstance(agent, RotorController) and name == "individual_flap":
            found.append(Rival(tilt_and_yaw_alone(agent), "tilt and yaw PID alone"))
    found.append(Rival(predictive(model), "MPC, knows the stops"))
    found += [Rival(predictive(model, seconds), f"MPC, {seconds:g} s of wind ahead") for seconds in PREVIEWS]
    return found


def predictive(model: TurbineModel, seconds: float = 0.0) -> PredictiveController:
    """MPC with so much preview; what differs from the saturating LQG is what it knows, not what it weighs."""
    name = f"mpc_{seconds:g}s" if seconds else "mpc"
    preview = round(seconds / model.time_step)
    return PredictiveController(name, model, shipped_weights("lqg_saturating", model), preview)


def tilt_and_yaw_alone(agent: RotorController) -> RotorController:
    """The same without its collective channel, whose flaps then stand still but for the servo."""
    system = agent.system
    c, d = system.C.copy(), system.D.copy()
    moment = system.inputs.index("rbm_0")
    c[0], d[0, moment] = 0.0, 0.0
    return replace(agent, name="tilt_yaw", system=replace(system, C=c, D=d))


class PlannedFlap:
    """Plays the bound's motion, all flaps alike; rounding of the actions is taken back at the next one.

    Parameters
    ----------
    model : TurbineModel
    plans : sequence of Bound
        One a realisation, in the order of the batch.
    hold : int
        Steps for which the plans hold their accelerations.
    """

    name = "bound"
    observe: tuple[str, ...] = ("flap_angle", "flap_rate")
    model_hash: str | None = None

    def __init__(self, model: TurbineModel, plans: list[Bound], hold: int) -> None:
        self.steps_per_action = hold
        self._limit, self._interval = model.flaps[0].acceleration_limit, hold * model.time_step
        self._angle = np.array([plan.angle for plan in plans])
        self._rate = np.array([plan.rate for plan in plans])
        self._acceleration = np.array([plan.acceleration for plan in plans])

    def predict(
        self,
        observation: Floats,
        state: Array | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], Array | None]:
        """Planned accelerations (N, 3) of the interval counted in the state; at rest beyond the plan's end."""
        values = np.asarray(observation, dtype=float)
        k = 0 if state is None else int(state[0])
        if k >= self._acceleration.shape[1]:
            return np.zeros((values.shape[0], BLADES), dtype=np.float32), np.array([k + 1.0])
        # Deadbeat in two intervals for what rounding has left.
        astray = values[:, :BLADES] - self._angle[:, k, None]
        slip = values[:, BLADES:] - self._rate[:, k, None]
        back = astray / self._interval**2 + 1.5 * slip / self._interval
        wanted = (self._acceleration[:, k, None] - back) / self._limit
        return np.clip(wanted, -1.0, 1.0).astype(np.float32), np.array([k + 1.0])
