"""A turbine from cut-in to cut-out: each episode at a mean wind drawn from a range, on the model built for it."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils import seeding
from numpy.typing import ArrayLike, NDArray

from flapgym.envs.settings import Settings
from flapgym.envs.single import FlapEnv
from flapgym.envs.spec import completed
from flapgym.envs.states import read_entry, whole_seed
from flapgym.envs.turbines import Info
from flapgym.envs.wind_speeds import among, chosen_set, chosen_speed, drawn_speed, speeds_within, widest
from flapgym.model.model_set import ModelSet
from flapgym.model.turbine_model import TurbineModel


class FlapRangeEnv(gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    """The turbine of `FlapEnv` at wind speeds of a range, one an episode.

    An episode is that of `FlapEnv` with the same seed at the wind speed drawn. Rotor speed, torque and collective pitch
    are those of the model built for it, which are linear about its operating point. An agent is not told the wind
    speed; it may observe `wind_speed`, the slow estimate that rotor speed and pitch give. `info["wind_speed"]` tells it
    to people.

    Parameters
    ----------
    model : str, path or ModelSet
        Name of a shipped set of models, a file of `flapgym build --wind-speeds`, or a set.
    wind_speed : (float, float) or None
        From which to which mean wind episodes are drawn [m/s]: of the set's speeds within it each as likely as another.
        By default all of them.
    render_mode, **keywords
        As for `FlapEnv`.

    Raises
    ------
    FileNotFoundError, ValueError
        If there is no such set, no speed of it lies within the range, or a keyword is refused.
    """

    metadata = FlapEnv.metadata
    _spec: EnvSpec | None = None

    def __init__(
        self,
        model: str | os.PathLike[str] | ModelSet = "nrel5mw-range",
        wind_speed: tuple[float, float] | None = None,
        render_mode: str | None = None,
        **keywords: Any,
    ) -> None:
        self.models = chosen_set(model)
        self.wind_speeds = speeds_within(self.models, wind_speed)
        Settings.of(keywords, type(self).__name__)  # refused by this class's own name
        self.render_mode = render_mode
        self._keywords = {**keywords, "render_mode": render_mode}
        self._members = dict[float, FlapEnv]()
        self._now = self._member(self.wind_speeds[0])
        if self.settings.sensors.lidar is not None:
            # The faster the wind, the sooner what a lidar sees has passed: refused here, and not at some later reset.
            self._member(self.wind_speeds[-1])
        self.metadata = self._now.metadata
        self.action_space = self._now.action_space
        self.observation_space = widest(self.models, self.wind_speeds, self.settings, self.observed)

    def _member(self, wind_speed: float) -> FlapEnv:
        """The environment at a wind speed of the set, made when it is first met."""
        if wind_speed not in self._members:
            self._members[wind_speed] = FlapEnv(model=self.models.at(wind_speed), **self._keywords)
        return self._members[wind_speed]

    @property
    def model(self) -> TurbineModel:
        """The model of the episode."""
        return self._now.model

    @property
    def settings(self) -> Settings:
        """The settings of the episode."""
        return self._now.settings

    @property
    def observed(self) -> dict[str, range]:
        """Where each observed quantity stands in an observation."""
        return self._now.observed

    @property
    def actions(self) -> int:
        """Actions of an episode."""
        return self._now.actions

    @property
    def spec(self) -> EnvSpec | None:
        """What makes such an environment again, with the number of actions of an episode."""
        return completed(self._spec, self.actions)

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = spec

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], Info]:
        """Begin an episode.

        Parameters
        ----------
        seed : int, optional
            Draws the wind speed, and all else as in `FlapEnv` at that speed.
        options : dict, optional
            Those of `FlapEnv`, and `wind_speed`, one of the set's within the range [m/s].
        """
        given = None if seed is None else whole_seed(seed)
        chosen, further = chosen_speed(options, self.wind_speeds)
        generator = self.np_random if given is None else seeding.np_random(given)[0]
        member = self._member(drawn_speed(generator, self.wind_speeds) if chosen is None else chosen)
        if given is None:
            member.np_random = generator
        # What it refuses it refuses before it changes, so that nothing has been taken from the generator.
        observation, info = member.reset(seed=given, options=further)
        if member is not self._now:
            self._now.close()  # each has a window of its own
        self._now, self._np_random = member, member.np_random
        if given is not None:
            self._np_random_seed = given
        return observation, info | {"wind_speed": member.model.wind_speed}

    def step(self, action: ArrayLike) -> tuple[NDArray[np.float32], float, bool, bool, Info]:
        """As `FlapEnv.step`."""
        observation, reward, terminated, truncated, info = self._now.step(action)
        info["wind_speed"] = self._now.model.wind_speed
        return observation, reward, terminated, truncated, info

    def render(self) -> Any:
        """As `FlapEnv.render`."""
        return self._now.render()

    def close(self) -> None:
        """Close the window, if there is one."""
        self._now.close()

    def flap_motion(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """As `FlapEnv.flap_motion`."""
        return self._now.flap_motion()

    def get_state(self) -> dict[str, Any]:
        """The whole state as plain values, for pickle or JSON: an environment that takes it goes on bit for bit."""
        self._now.np_random = self.np_random
        return {
            "wind_speed": self._now.model.wind_speed,
            "turbine": self._now.get_state() | {"seed": self.np_random_seed},
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Go on from a state that an environment of the same set and keywords gave; raises as `FlapEnv.set_state`."""
        speed = read_entry(
            state, "wind_speed", lambda given: among(given, self.wind_speeds, "state.wind_speed")
        )
        member = self._member(speed)
        member.set_state(read_entry(state, "turbine", dict))
        if member is not self._now:
            self._now.close()
        self._now = member
        self._np_random, self._np_random_seed = member.np_random, member.np_random_seed
