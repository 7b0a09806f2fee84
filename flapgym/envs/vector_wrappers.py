"""The wrappers of `flapgym.envs.wrappers` for the vector environment; `FlapVecEnv` takes them for Stable-Baselines3."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper
from numpy.typing import ArrayLike, NDArray

from flapgym.control import Agent
from flapgym.envs.wrappers import (
    Observation,
    averaged,
    checked_action,
    checked_hold,
    checked_scale,
    fitted_agent,
    flap_model,
    servo_of,
)
from flapgym.state_space import Array

Vector = VectorEnv[Observation, Any, Any]
Step = tuple[Observation, Array, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]


class VectorTargetAngle(VectorWrapper[Observation, Any, Observation, Any, Any]):
    """`flapgym.envs.wrappers.TargetAngle` on every environment.

    Parameters
    ----------
    env : FlapVectorEnv
    """

    def __init__(self, env: Vector) -> None:
        super().__init__(env)
        self._servo = servo_of(env.unwrapped)
        self._limit = flap_model(env.unwrapped).flap_angle_limit
        self._flaps = np.zeros((3, *(env.action_space.shape or ())))
        """Angle, rate, and the acceleration that acts."""
        self._mode = AutoresetMode(env.metadata["autoreset_mode"])
        self._ended = np.zeros(env.num_envs, dtype=bool)

    def reset(
        self, *, seed: Any = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin episodes."""
        observation, info = self.env.reset(seed=seed, options=options)
        mask = (options or {}).get("reset_mask", np.ones(self.num_envs, dtype=bool))
        self._keep(info, mask)
        self._ended &= ~mask
        return observation, info

    def step(self, actions: ArrayLike) -> Step:
        """Move the flaps toward the target angles for the time of one action."""
        target = self._limit * np.clip(checked_action(actions, self.action_space.shape or ()), -1.0, 1.0)
        angle, rate, acting = self._flaps
        command = self._servo(angle, rate, acting, target)
        self._flaps[2] = self._servo.carried(acting, command)
        step = self.env.step(command / self._servo.acceleration_limit)
        before, self._ended = self._ended, step[2] | step[3]
        self._keep(step[4], before if self._mode is AutoresetMode.NEXT_STEP else self._ended)
        return step

    def _keep(self, info: dict[str, Any], begun: NDArray[np.bool_]) -> None:
        """Flap motion of the environments that tell theirs; where an episode has begun nothing acts yet."""
        told = info["_flap_angle"]
        self._flaps[:2, told] = info["flap_angle"][told], info["flap_rate"][told]
        self._flaps[2, begun] = 0.0


class VectorResidual(VectorWrapper[Observation, Any, Observation, Any, Any]):
    """`flapgym.envs.wrappers.Residual` on every environment.

    Parameters
    ----------
    env : FlapVectorEnv
    agent : str or Agent
    scale : float
    hold : int
        Where one environment begins or ends an episode, the others' correction is held no longer either.
    """

    def __init__(self, env: Vector, agent: str | Agent, scale: float = 0.5, hold: int = 1) -> None:
        super().__init__(env)
        self.agent, self._columns = fitted_agent(agent, env.unwrapped)
        self.scale, self.hold = checked_scale(scale), checked_hold(hold)
        self._mode = AutoresetMode(env.metadata["autoreset_mode"])
        self._observation: Observation = np.zeros(0, dtype=np.float32)
        self._state: Array | None = None
        self._starts = np.ones(env.num_envs, dtype=bool)
        self._ended = np.zeros(env.num_envs, dtype=bool)

    def reset(
        self, *, seed: Any = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin episodes; the agent forgets the last ones."""
        self._observation, info = self.env.reset(seed=seed, options=options)
        mask = (options or {}).get("reset_mask", np.ones(self.num_envs, dtype=bool))
        self._starts |= mask
        self._ended &= ~mask
        return self._observation.copy(), info

    def step(self, actions: ArrayLike) -> Step:
        """Correct the agent's next `hold` actions."""
        correction = self.scale * checked_action(actions, self.action_space.shape or ())
        rewards, infos = [], []
        for _ in range(self.hold):
            own, self._state = self.agent.predict(
                self._observation[:, self._columns], self._state, self._starts
            )
            self._observation, reward, terminated, truncated, info = self.env.step(
                np.clip(own + correction, -1.0, 1.0)
            )
            rewards.append(reward)
            infos.append(info)
            begun = self._ended if self._mode is AutoresetMode.NEXT_STEP else np.zeros_like(self._ended)
            self._ended = terminated | truncated
            self._starts = self._ended if self._mode is AutoresetMode.SAME_STEP else begun
            if self._ended.any() or begun.any():
                break
        info = infos[-1] | averaged(infos)
        info |= {"agent_action": own, "_agent_action": np.ones(self.num_envs, dtype=bool)}
        mean = np.mean(rewards, axis=0)
        return self._observation.copy(), mean, terminated, truncated, info
