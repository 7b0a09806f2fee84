"""Observations and rewards of order one for the learner; the scales end up in the agent's file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper

from flapgym.model.turbine_model import TurbineModel


def observation_scale(observe: Sequence[str], model: TurbineModel) -> NDArray[np.float64]:
    """Factor of each observed quantity of a blade, (n,): moment by its open-loop rms, the flap by its stops.

    The tip, by how far slow wind moves it where it moves the moment by that rms.
    """
    gain = model.blade.dc_gain()[:, model.blade.inputs.index("wind")]
    moment, tip = (gain[model.blade.outputs.index(name)] for name in ("rbm", "tip_deflection"))
    factors = {
        "rbm": 1e6 / model.rbm_rms,
        "flap_angle": 1.0 / model.flaps[0].angle_limit,
        "flap_rate": 1.0 / model.flaps[0].rate_limit,
        "tip_deflection": abs(moment / tip) / model.rbm_rms,
    }
    return np.array([factors[name] for name in observe])


class Scaled(VecEnvWrapper):
    """Multiplies observations by fixed factors, and rewards by 1 - gamma, so that values are of order one.

    Parameters
    ----------
    venv : VecEnv
    scale : (n,) float
    gamma : float
        Discount per action: the value of a reward of one at every action is 1 / (1 - gamma).
    """

    def __init__(self, venv: VecEnv, scale: NDArray[np.float64], gamma: float) -> None:
        space = venv.observation_space
        assert isinstance(space, spaces.Box)
        self._scale = scale.astype(np.float32)
        self._reward_scale = np.float32(1.0 - gamma)
        super().__init__(
            venv, spaces.Box(space.low * self._scale, space.high * self._scale, dtype=np.float32)
        )

    def reset(self) -> NDArray[np.float32]:
        """First observations, scaled."""
        return np.asarray(self.venv.reset()) * self._scale

    def step_wait(
        self,
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Observations and rewards, scaled; also the last ones of ended episodes."""
        observation, reward, done, infos = self.venv.step_wait()
        for index in np.flatnonzero(done):
            infos[index]["terminal_observation"] = infos[index]["terminal_observation"] * self._scale
        return np.asarray(observation) * self._scale, reward * self._reward_scale, done, infos
