"""The wrappers of `flapgym.wrappers.single` for the vector environment; Stable-Baselines3 takes them, too."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper
from numpy.typing import ArrayLike, NDArray

from flapgym.control import Agent
from flapgym.core.arrays import Array
from flapgym.envs.states import checked_numbers, each_of, read_entry, true_or_false
from flapgym.envs.vector import checked_mask
from flapgym.wrappers.single import (
    Observation,
    averaged,
    check_agent,
    checked_action,
    checked_hold,
    checked_scale,
    filled,
    fitted_agent,
    flap_count,
    identity,
    memory,
    remembered,
    servo_of,
)

Vector = VectorEnv[Observation, Any, Any]
Step = tuple[Observation, Array, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]


class VectorTargetAngle(VectorWrapper[Observation, Any, Observation, Any, Any]):
    """`flapgym.wrappers.single.TargetAngle` on every environment.

    Parameters
    ----------
    env : FlapVectorEnv
    """

    def __init__(self, env: Vector) -> None:
        super().__init__(env)
        self._servo = servo_of(env.unwrapped)
        self._count = flap_count(env.unwrapped)
        self._limit = self._servo.limits("angle_limit", self._count)
        self._most = self._servo.limits("acceleration_limit", self._count)
        self._flaps = np.zeros((3, env.num_envs, self._count))
        """Angle, rate, and the acceleration that acts."""
        self._mode = AutoresetMode(env.metadata["autoreset_mode"])
        self._ended = np.zeros(env.num_envs, dtype=bool)

    def reset(
        self, *, seed: Any = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin episodes."""
        mask = checked_mask(options, self.num_envs)
        observation, info = self.env.reset(seed=seed, options=_plainly_masked(options, mask))
        self._keep(info, mask)
        self._ended &= ~mask
        return observation, info

    def step(self, actions: ArrayLike) -> Step:
        """Move the flaps toward the target angles for the time of one action."""
        wanted = np.clip(checked_action(actions, self.action_space.shape or ()), -1.0, 1.0)
        angle, rate, acting = self._flaps
        command = self._servo(angle, rate, acting, self._limit * wanted[:, : self._count])
        step = self.env.step(np.concatenate([command / self._most, wanted[:, self._count :]], axis=1))
        self._flaps[2] = self._servo.carried(acting, command)
        before, self._ended = self._ended, step[2] | step[3]
        self._keep(step[4], before if self._mode is AutoresetMode.NEXT_STEP else self._ended)
        return step

    def get_state(self) -> dict[str, Any]:
        """State of the environments with the flap motion the inner loop starts from, as plain values for JSON."""
        own = {"flaps": self._flaps.tolist(), "flaps_ended": self._ended.tolist()}
        state: dict[str, Any] = with_state(self.env).get_state() | own
        return state

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Go on from a state that `get_state` gave; nothing is changed if it is refused."""
        flaps = read_entry(state, "flaps", lambda given: checked_numbers("motion", given, self._flaps.shape))
        ended = read_entry(state, "flaps_ended", each_of(self.num_envs, true_or_false))
        with_state(self.env).set_state(state)
        self._flaps, self._ended = flaps, np.array(ended)

    def _keep(self, info: dict[str, Any], begun: NDArray[np.bool_]) -> None:
        """Flap motion of the environments that tell theirs; where an episode has begun nothing acts yet."""
        told = info["_flap_angle"]
        self._flaps[:2, told] = info["flap_angle"][told], info["flap_rate"][told]
        self._flaps[2, begun] = 0.0


class VectorResidual(VectorWrapper[Observation, Any, Observation, Any, Any]):
    """`flapgym.wrappers.single.Residual` on every environment.

    Parameters
    ----------
    env : FlapVectorEnv
    agent : str or Agent
    scale : float
    hold : int
        Where one environment begins or ends an episode, the others' correction is held no longer either.
    """

    def __init__(
        self, env: Vector, agent: str | os.PathLike[str] | Agent, scale: float = 0.5, hold: int = 1
    ) -> None:
        super().__init__(env)
        self.agent, self._columns = fitted_agent(agent, env.unwrapped)
        self.scale, self.hold = checked_scale(scale), checked_hold(hold)
        self._mode = AutoresetMode(env.metadata["autoreset_mode"])
        self._observation: Observation | None = None
        self._state: Array | None = None
        self._starts = np.ones(env.num_envs, dtype=bool)
        self._ended = np.zeros(env.num_envs, dtype=bool)

    def reset(
        self, *, seed: Any = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin episodes; the agent forgets the last ones."""
        mask = checked_mask(options, self.num_envs)
        observation, info = self.env.reset(seed=seed, options=_plainly_masked(options, mask))
        self._observation = observation.copy()
        self._starts |= mask
        self._ended &= ~mask
        return observation, info

    def step(self, actions: ArrayLike) -> Step:
        """Correct the agent's next `hold` actions."""
        correction = self.scale * checked_action(actions, self.action_space.shape or ())
        if self._observation is None:
            raise ResetNeeded("step: call reset first")
        rewards, infos = [], []
        for _ in range(self.hold):
            own, mind = self.agent.predict(self._observation[:, self._columns], self._state, self._starts)
            own = filled(own, correction.shape)
            seen, reward, terminated, truncated, info = self.env.step(np.clip(own + correction, -1.0, 1.0))
            # Only now, in case the environment refuses; and a copy, because what was returned is the caller's.
            self._observation, self._state = seen.copy(), mind
            rewards.append(reward)
            infos.append(info)
            begun = self._ended if self._mode is AutoresetMode.NEXT_STEP else np.zeros_like(self._ended)
            self._ended = terminated | truncated
            self._starts = self._ended if self._mode is AutoresetMode.SAME_STEP else begun
            if self._ended.any() or begun.any():
                break
        info = infos[-1] | averaged(infos)
        info |= {"agent_action": own, "_agent_action": np.ones(self.num_envs, dtype=bool)}
        return seen, np.mean(rewards, axis=0), terminated, truncated, info

    def get_state(self) -> dict[str, Any]:
        """State of the environments, and what the agent saw and keeps in mind, as plain values for JSON."""
        own = memory(self._observation, self._state) | {
            "starts": self._starts.tolist(),
            "ended": self._ended.tolist(),
        }
        state: dict[str, Any] = with_state(self.env).get_state() | {"agent": self._identity() | own}
        return state

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Go on from a state of the same agent, scale and hold; nothing is changed if it is refused."""
        check_agent(state, self._identity())
        own = read_entry(state, "agent", self._read)
        with_state(self.env).set_state(state)
        self._observation, self._state, self._starts, self._ended = own

    def _read(self, entry: Mapping[str, Any]) -> tuple[Any, ...]:
        shape = self.observation_space.shape or ()
        flags = [np.array(each_of(self.num_envs, true_or_false)(entry[name])) for name in ("starts", "ended")]
        return (*remembered(entry, self.agent, self._columns, shape), *flags)

    def _identity(self) -> dict[str, Any]:
        return identity(self.agent, self.scale, self.hold)


def _plainly_masked(options: dict[str, Any] | None, mask: NDArray[np.bool_]) -> dict[str, Any] | None:
    """Options for Gymnasium's vector wrappers, which take a mask only as an array, and take it out."""
    return options | {"reset_mask": mask} if options and "reset_mask" in options else options


def with_state(env: Any) -> Any:
    """The environment or the next one within that has a state: Gymnasium's vector wrappers hand nothing through."""
    while not hasattr(env, "get_state"):
        env = env.env
    return env
