"""The vector environment as Stable-Baselines3 wants it, whole turbines or one environment a blade.

Stable-Baselines3 does not accept Gymnasium's vector environments; its own interface resets in the ending step and hands
the last observation over in `info`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from numpy.typing import NDArray

from flapgym.core.arrays import BLADES, Array
from flapgym.envs.actions import numbers
from flapgym.envs.range_vector import FlapRangeVectorEnv
from flapgym.envs.vector import FlapVectorEnv

try:
    from stable_baselines3.common.vec_env.base_vec_env import VecEnv
except ImportError as error:
    raise ImportError('flapgym.adapters.sb3 needs Stable-Baselines3: pip install "flapgym[train]"') from error


class FlapVecEnv(VecEnv):
    """A `stable_baselines3` VecEnv over a `FlapVectorEnv`, or over one in `flapgym.wrappers.vector`.

    Parameters
    ----------
    env : FlapVectorEnv, FlapRangeVectorEnv or a wrapper of one
        Made with `autoreset_mode="SameStep"`.
    per_blade : bool
        False: one environment a turbine. True: three a turbine, one for each blade in the order of the blades, which
        sees its own moment, flap angles and so on, moves its own flaps, and is rewarded by its own moment (the reward's
        other terms are the turbine's); a policy is then shared by the blades. Refused over wind speeds.

    Notes
    -----
    The infos are empty but at an episode's end, when they hold `terminal_observation` and `TimeLimit.truncated`;
    wrap in `VecMonitor` for episode statistics. `render` tiles the pictures of the turbines if the environment was made
    with `render_mode="rgb_array"`.
    """

    def __init__(self, env: VectorEnv[Any, Any, Any], per_blade: bool = False) -> None:
        base = env.unwrapped
        if not isinstance(base, FlapVectorEnv):
            raise TypeError(f"env: expected a FlapVectorEnv, got {type(base).__name__}")
        if base.autoreset_mode is not AutoresetMode.SAME_STEP:
            raise ValueError(
                'env: expected autoreset_mode="SameStep", got ' + repr(base.autoreset_mode.value)
            )
        self.env: Any = env
        self.base = base
        self.per_blade = per_blade
        space, actions = env.single_observation_space, env.single_action_space
        assert isinstance(space, spaces.Box)
        if per_blade and base.settings.single_blade:
            raise ValueError("per_blade: expected False, each environment is one blade already")
        if per_blade and isinstance(base, FlapRangeVectorEnv):
            raise ValueError(
                "per_blade: expected False with an environment over wind speeds, whose rewards each have a unit of "
                "their own; take one wind speed"
            )
        if per_blade and base.settings.pitch:
            raise ValueError(
                "per_blade: expected False with pitch=True, whose actions are of all flaps first, then of pitch"
            )
        if per_blade:
            self._own = own_columns(base.observed)
            bound = space.high[self._own[0]]
            space = spaces.Box(-bound, bound, dtype=np.float32)
            actions = spaces.Box(-1.0, 1.0, (len(base.model.flaps),), dtype=np.float32)
        self._actions: NDArray[np.float32] | Array | None = None
        super().__init__(env.num_envs * (BLADES if per_blade else 1), space, actions)
        self.metadata |= {"render_fps": base.metadata["render_fps"]}

    def reset(self) -> NDArray[np.float32]:
        """First observations; seeds given to `seed` are used once."""
        seeds = list(self._seeds[: self.env.num_envs])
        observation, _ = self.env.reset(
            seed=None if all(seed is None for seed in seeds) else seeds, options=self._shared_options()
        )
        self._reset_seeds()
        self._reset_options()
        self.reset_infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        return self._rows(observation)

    def step_async(self, actions: NDArray[np.float32]) -> None:
        """Keep the actions (num_envs, ...) for `step_wait`."""
        self._actions = numbers(actions, (self.num_envs, *(self.action_space.shape or ())))

    def step_wait(
        self,
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Advance by the actions kept."""
        assert self._actions is not None
        actions = self._actions.reshape(self.env.action_space.shape)
        observation, reward, terminated, truncated, info = self.env.step(actions)
        ended = terminated | truncated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if self.per_blade:
            scale = -1.0 / self.base.model.rbm_rms**2
            shared = info["reward_flap_angle"] + info["reward_tower"]
            reward = (info["rbm_mean_square"] * scale + shared[:, None]).ravel()
        for turbine in np.flatnonzero(ended):
            last = self._rows(info["final_obs"][turbine][None])
            for row, values in enumerate(last):
                infos[turbine * len(last) + row] = {
                    "terminal_observation": values,
                    "TimeLimit.truncated": bool(truncated[turbine] and not terminated[turbine]),
                }
        done = np.repeat(ended, BLADES) if self.per_blade else ended
        return self._rows(observation), reward.astype(np.float32), done, infos

    def get_images(self) -> list[NDArray[np.uint8]]:
        """Pictures (height, width, 3) of the turbines, also where each blade is an environment."""
        return list(self.env.render() or ())

    def close(self) -> None:
        """Close the environment behind."""
        self.env.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """The attribute of the vector environment, once per environment asked for."""
        return [getattr(self.base, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refused: the environments share their settings."""
        raise NotImplementedError(
            f"set_attr {attr_name}: the turbines share their settings; make a new environment"
        )

    def env_method(
        self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any
    ) -> list[Any]:
        """Refused: there are no single environments behind."""
        raise NotImplementedError(
            f"env_method {method_name}: there is one vector environment, not many single ones"
        )

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """No single environment is wrapped."""
        return [False for _ in self._get_indices(indices)]

    def _rows(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """Observations (turbines, names x blades) as one row an environment."""
        if not self.per_blade:
            return observation
        return np.ascontiguousarray(observation[:, self._own].reshape(-1, self._own.shape[1]))

    def _shared_options(self) -> dict[str, Any] | None:
        """Reset options: the same for all environments, or none."""
        options: Sequence[dict[str, Any]] = self._options
        if any(entry != options[0] for entry in options):
            raise ValueError("set_options: the turbines take the same options; give one dict")
        return dict(options[0]) or None


def own_columns(observed: dict[str, range]) -> NDArray[np.int64]:
    """Which columns of a turbine's observation each blade sees, (blades, own).

    Raises
    ------
    ValueError
        If something is observed that belongs to no blade.
    """
    columns = list[NDArray[np.int64]]()
    for name, place in observed.items():
        if len(place) % BLADES:
            raise ValueError(f"observe: {name} belongs to no blade, so per_blade cannot use it")
        columns.append(np.array(place).reshape(BLADES, -1))
    return np.concatenate(columns, axis=1)
