"""Other actions for the same environments: target angles, and corrections to what an agent does.

    env = TargetAngle(gymnasium.make("flapgym/NREL5MW-v1"))
    task = {"observe": ("rbm", "flap_angle", "flap_rate")}
    env = Residual(gymnasium.make("flapgym/NREL5MW-v1", task=task, steps_per_action=1), "lqg", scale=0.3)

The same for the vector environment stands in `flapgym.wrappers.vector`.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.utils import RecordConstructorArgs
from numpy.typing import ArrayLike, NDArray

from flapgym.control import load_agent
from flapgym.control.agent import Agent, Floats, blade_entries, check_fit, check_pitch
from flapgym.core.arrays import BLADES, Array
from flapgym.core.fields import is_number
from flapgym.core.wording import shown
from flapgym.envs.actions import numbers
from flapgym.envs.spec import plain
from flapgym.envs.states import checked_numbers, checked_observation, read_entry
from flapgym.envs.task import TURBINE_ONLY
from flapgym.wrappers.servo import RotorServo, Servo

Observation = NDArray[np.float32]
Step = tuple[Observation, float, bool, bool, dict[str, Any]]


class TargetAngle(
    gymnasium.Wrapper[Observation, Any, Observation, Any],
    RecordConstructorArgs,
):
    """The action is the flaps' target angles, -1 to 1 of the angle stop, instead of their accelerations.

    An inner loop (`flapgym.wrappers.servo`) finds the acceleration from the true angle and rate: as fast as
    acceleration and rate limits allow, without overshoot; slower where the actuator lags behind its command. Pitch,
    where it moves, is demanded as an angle already, and passes as it is.

    Parameters
    ----------
    env : gymnasium.Env
        An environment of this package.
    """

    def __init__(self, env: gymnasium.Env[Observation, Any]) -> None:
        RecordConstructorArgs.__init__(self)
        gymnasium.Wrapper.__init__(self, env)
        self._servo = servo_of(env.unwrapped)
        self._count = flap_count(env.unwrapped)
        self._limit = self._servo.limits("angle_limit", self._count)
        self._most = self._servo.limits("acceleration_limit", self._count)
        self._flaps = np.zeros((3, self._count))
        """Angle, rate, and the acceleration that acts."""

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._keep(np.zeros(self._flaps.shape[1:]))
        return observation, info

    def step(self, action: ArrayLike) -> Step:
        """Move the flaps toward the target angles for the time of one action."""
        wanted = np.clip(checked_action(action, self.action_space.shape or ()), -1.0, 1.0)
        angle, rate, acting = self._flaps
        command = self._servo(angle, rate, acting, self._limit * wanted[: self._count])
        acting = self._servo.carried(acting, command)
        observation, reward, terminated, truncated, info = self.env.step(
            np.concatenate([command / self._most, wanted[self._count :]])
        )
        self._keep(acting)
        return observation, float(reward), terminated, truncated, info

    def get_state(self) -> dict[str, Any]:
        """State of the environment with the flap motion the inner loop starts from, as plain values for JSON."""
        state: dict[str, Any] = self.env.get_wrapper_attr("get_state")()
        return state | {"flaps": self._flaps.tolist()}

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Go on from a state that `get_state` gave; nothing is changed if it is refused."""
        flaps = read_entry(state, "flaps", lambda given: checked_numbers("motion", given, self._flaps.shape))
        self.env.get_wrapper_attr("set_state")(state)
        self._flaps = flaps

    def _keep(self, acting: Array) -> None:
        """The flaps' own motion, and the acceleration that acts."""
        flaps: Any = self.env.unwrapped
        self._flaps = np.stack([*flaps.flap_motion(), acting])


class Residual(
    gymnasium.Wrapper[Observation, Any, Observation, Any],
    RecordConstructorArgs,
):
    """The action, times `scale`, is added to what an agent does; the sum is clipped to the action space.

    The agent reads its own observations out of the environment's and begins afresh with every episode. It acts at its
    own interval; the correction may be held for several of them, over which the reward is the mean. `info` adds
    `agent_action`, the agent's part of the last action. On a single blade acts an agent that treats each blade alone.

    Parameters
    ----------
    env : gymnasium.Env
        An environment of this package that observes what the agent needs and has its `steps_per_action`.
    agent : str or Agent
        Name of a shipped agent, file of another, or the agent itself.
    scale : float
        Of the correction: 1 can override the agent wholly where it demands nothing.
    hold : int
        Actions of the agent for which a correction is held.
    """

    def __init__(
        self,
        env: gymnasium.Env[Observation, Any],
        agent: str | os.PathLike[str] | Agent,
        scale: float = 0.5,
        hold: int = 1,
    ) -> None:
        RecordConstructorArgs.__init__(self, **plain({"agent": agent, "scale": scale, "hold": hold}))
        gymnasium.Wrapper.__init__(self, env)
        self.agent, self._columns = fitted_agent(agent, env.unwrapped)
        self.scale, self.hold = checked_scale(scale), checked_hold(hold)
        self._observation: Observation | None = None
        self._state: Array | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode; the agent forgets the last one."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._observation, self._state = observation.copy(), None
        return observation, info

    def step(self, action: ArrayLike) -> Step:
        """Correct the agent's next `hold` actions."""
        correction = self.scale * checked_action(action, self.action_space.shape or ())
        if self._observation is None:
            raise ResetNeeded("step: no episode is running; call reset first")
        rewards, infos = [], []
        for _ in range(self.hold):
            own, mind = self.agent.predict(self._observation[self._columns], self._state)
            own = filled(own, correction.shape)
            seen, reward, terminated, truncated, info = self.env.step(np.clip(own + correction, -1.0, 1.0))
            # Only now, in case the environment refuses; and a copy, because what was returned is the caller's.
            self._observation, self._state = seen.copy(), mind
            rewards.append(float(reward))
            infos.append(info)
            if terminated or truncated:
                break
        info = infos[-1] | averaged(infos) | {"agent_action": own}
        return seen, sum(rewards) / len(rewards), terminated, truncated, info

    def get_state(self) -> dict[str, Any]:
        """State of the environment, and what the agent saw and keeps in mind, as plain values for JSON."""
        state: dict[str, Any] = self.env.get_wrapper_attr("get_state")()
        return state | {"agent": self._identity() | memory(self._observation, self._state)}

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Go on from a state of the same agent, scale and hold; nothing is changed if it is refused."""
        check_agent(state, self._identity())
        shape = self.observation_space.shape or ()
        seen, mind = read_entry(
            state, "agent", lambda entry: remembered(entry, self.agent, self._columns, shape)
        )
        self.env.get_wrapper_attr("set_state")(state)
        self._observation, self._state = seen, mind

    def _identity(self) -> dict[str, Any]:
        return identity(self.agent, self.scale, self.hold)


def identity(agent: Agent, scale: float, hold: int) -> dict[str, Any]:
    """What two corrected agents must share for a state of one to mean the same to the other."""
    return {
        "name": agent.name,
        "model_hash": getattr(agent, "model_hash", None),
        "scale": scale,
        "hold": hold,
    }


def check_agent(state: Mapping[str, Any], own: Mapping[str, Any]) -> None:
    """Refuse a state in which another agent acted, or the same otherwise corrected."""
    entry = read_entry(state, "agent", dict)
    for name, value in own.items():
        if entry.get(name) != value:
            raise ValueError(
                f"state: agent: made by one with {name} {shown(entry.get(name))}, this one has {shown(value)}"
            )


def memory(observation: Observation | None, mind: Array | None) -> dict[str, Any]:
    """What an agent saw last and keeps in mind, as plain values."""
    return {
        "observation": None if observation is None else observation.tolist(),
        "mind": None if mind is None else np.asarray(mind).tolist(),
    }


def remembered(
    entry: Mapping[str, Any], agent: Agent, columns: NDArray[np.intp], shape: tuple[int, ...]
) -> tuple[Observation | None, Array | None]:
    """That, read: an observation of the shape given, and what the agent would keep in mind after it."""
    if entry["observation"] is None:
        return None, None
    seen = checked_observation(entry["observation"], shape)
    if entry["mind"] is None:
        return seen, None
    _, own = agent.predict(seen[..., columns], None)
    return seen, checked_numbers("mind", entry["mind"], np.shape(own))  # type: ignore[arg-type]


def flap_model(base: Any) -> Any:
    """Model of an unwrapped environment of this package.

    Raises
    ------
    TypeError
        If it is another environment.
    """
    if not (hasattr(base, "model") and hasattr(base, "settings")):
        raise TypeError(f"env: expected an environment of flapgym, got {type(base).__name__}")
    return base.model


def flap_count(base: Any) -> int:
    """Flaps of all blades of an unwrapped environment: as many of its actions are theirs, and come first."""
    angle, _ = base.flap_motion()
    return int(angle.shape[-1])


def filled(action: NDArray[np.float32], shape: tuple[int, ...]) -> NDArray[np.float32]:
    """An agent's action with zeros behind it for what it does not move."""
    missing = shape[-1] - action.shape[-1]
    return np.pad(action, [(0, 0)] * (action.ndim - 1) + [(0, missing)]) if missing else action


def servo_of(base: Any) -> RotorServo:
    """The inner loop that fits an unwrapped environment."""
    model = flap_model(base)
    period, lag = base.settings.steps_per_action * model.time_step, base.settings.actuators.lag
    return RotorServo(
        tuple(
            Servo(flap.acceleration_limit, flap.rate_limit, flap.angle_limit, period, lag)
            for flap in model.flaps
        )
    )


def fitted_agent(agent: str | os.PathLike[str] | Agent, base: Any) -> tuple[Agent, NDArray[np.intp]]:
    """The agent, and which of the environment's observations it reads.

    Raises
    ------
    ValueError
        If the environment does not observe what the agent needs, holds actions for another time, or is a single blade
        and the agent needs a turbine.
    TypeError
        If it is no agent.
    """
    model, settings = flap_model(base), base.settings
    agent = load_agent(agent, model) if isinstance(agent, (str, os.PathLike)) else agent
    lacking = [
        part for part in ("name", "observe", "steps_per_action", "predict") if not hasattr(agent, part)
    ]
    if lacking:
        raise TypeError(
            "agent: expected a shipped agent's name, the path of an agent's .json file, or an agent "
            f"(flapgym.control.Agent), got {type(agent).__name__}, which has no {lacking[0]}"
        )
    places = base.observed
    missing = [name for name in agent.observe if name not in places]
    if missing and settings.single_blade and missing[0] in TURBINE_ONLY:
        raise ValueError(
            f"agent {agent.name} observes {missing[0]}, which a single blade does not have: it needs a turbine"
        )
    if missing:
        raise ValueError(
            f"agent {agent.name} observes {missing[0]}, which the environment does not: make it with "
            f'task={{"observe": {(*settings.task.observe, *missing)}}}'
        )
    if agent.steps_per_action != settings.steps_per_action:
        raise ValueError(
            f"agent {agent.name} holds an action for {agent.steps_per_action} plant steps, the environment for "
            f"{settings.steps_per_action}: make it with steps_per_action={agent.steps_per_action}"
        )
    check_fit(agent, model)
    check_pitch(agent, settings.pitch)
    columns = np.array([index for name in agent.observe for index in places[name]])
    if settings.single_blade:
        flaps = len(model.flaps)
        agent = OneBlade(agent, flaps) if getattr(agent, "per_blade", False) else agent
        _check_one_blade(agent, columns.size, flaps)
    return agent, columns


class OneBlade:
    """An agent that treats each blade alone, on one blade: it is shown three alike, and the first is taken.

    Parameters
    ----------
    agent : Agent
    flaps : int
        Of the blade.
    """

    def __init__(self, agent: Agent, flaps: int) -> None:
        self.name, self.observe, self.steps_per_action = agent.name, agent.observe, agent.steps_per_action
        self.model_hash = getattr(agent, "model_hash", None)
        self._agent, self._flaps = agent, flaps
        sizes = [blade_entries((name,), flaps) for name in agent.observe]
        ends = np.cumsum(sizes)
        # What a blade has of an observation stands together, so three blades alike repeat it name by name.
        self._alike = np.concatenate(
            [np.tile(np.arange(end - size, end), BLADES) for size, end in zip(sizes, ends, strict=True)]
        )

    def predict(
        self,
        observation: Floats,
        state: Array | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], Array | None]:
        """Action (..., F) for an observation (..., n), and the state to hand back next time."""
        alike = np.asarray(observation)[..., self._alike]
        action, state = self._agent.predict(alike, state, episode_start, deterministic)
        return action[..., : self._flaps], state


def _check_one_blade(agent: Agent, size: int, flaps: int) -> None:
    """Refuse an agent that cannot act on one blade's observations; trying tells, also of agents not our own."""
    try:
        action, _ = agent.predict(np.zeros(size, dtype=np.float32), None)
    except (ValueError, TypeError, IndexError) as error:
        found = str(error)
    else:
        if np.shape(action) == (flaps,):
            return
        found = f"it gives actions of shape {np.shape(action)}"
    raise ValueError(
        f"agent {agent.name} cannot act on a single blade: {found}; take one that treats each blade alone, such as lqg"
    )


def checked_action(action: ArrayLike, shape: tuple[int, ...]) -> Array:
    """An action as float; anything but finite numbers of the right shape is refused."""
    values = numbers(action, shape).astype(float)
    if not np.isfinite(values).all():
        raise ValueError(f"action: expected finite numbers, got {shown(action)}")
    return values


def averaged(infos: list[dict[str, Any]]) -> dict[str, Any]:
    """The reward's terms and the mean square of the moments over several actions, from the info of each."""
    means = {"rbm_mean_square", "reward_rbm", "reward_flap_angle", "reward_tower"} & infos[0].keys()
    return {name: sum(info[name] for info in infos) / len(infos) for name in means}


def checked_scale(scale: float) -> float:
    """A positive finite scale."""
    if not (is_number(scale) and scale > 0.0):
        raise ValueError(f"scale: expected a positive number, got {shown(scale)}")
    return float(scale)


def checked_hold(hold: int) -> int:
    """A whole number of at least one."""
    if isinstance(hold, bool) or not isinstance(hold, (int, np.integer)) or hold < 1:
        raise ValueError(f"hold: expected a whole number of at least 1, got {shown(hold)}")
    return int(hold)
