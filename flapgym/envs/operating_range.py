"""A turbine from cut-in to cut-out: each episode at a mean wind drawn from a range, on the model built for it."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.error import ResetNeeded
from numpy.typing import ArrayLike, NDArray

from flapgym.core.fields import Quantity
from flapgym.core.wording import number, shown
from flapgym.envs.single import FlapEnv
from flapgym.envs.spec import completed
from flapgym.envs.states import generator_of, generator_state, read_entry, seed_number, whole_seed
from flapgym.envs.turbines import Info
from flapgym.model.model_set import ModelSet, load_model_set
from flapgym.model.turbine_model import TurbineModel

SEEDS = 2**63
"""From 0 to which the seeds of episodes are drawn that are given none."""


class FlapRangeEnv(gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    """The turbine of `FlapEnv` at wind speeds of a range, one an episode.

    Rotor speed, torque and collective pitch are those of the model built for the episode's wind, which are linear about
    its operating point. An agent is not told the wind speed; it may observe `wind_speed`, the slow estimate that rotor
    speed and pitch give. `info["wind_speed"]` tells it to people.

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
        self.models = model if isinstance(model, ModelSet) else load_model_set(model)
        self.wind_speeds = speeds_within(self.models, wind_speed)
        self.render_mode = render_mode
        self._keywords = {**keywords, "render_mode": render_mode}
        self._members = dict[float, FlapEnv]()
        self._now = self._member(self.wind_speeds[0])
        self.metadata = self._now.metadata
        self.action_space, self.observation_space = self._now.action_space, self._now.observation_space
        self._running = False

    def _member(self, wind_speed: float) -> FlapEnv:
        """The environment at a wind speed of the set, made when it is first met."""
        if wind_speed not in self._members:
            made = FlapEnv(model=self.models.at(wind_speed), **self._keywords)
            if self._members and made.observation_space != self.observation_space:
                raise ValueError(
                    f"model: expected models with the same bounds of what is observed, got others at "
                    f"{number(wind_speed)} m/s"
                )
            self._members[wind_speed] = made
        return self._members[wind_speed]

    @property
    def model(self) -> TurbineModel:
        """The model of the episode."""
        return self._now.model

    @property
    def observed(self) -> dict[str, range]:
        """Where each observed quantity stands in an observation."""
        return self._now.observed

    @property
    def spec(self) -> EnvSpec | None:
        """What makes such an environment again, with the number of actions of an episode."""
        return completed(self._spec, self._now.actions)

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
        further = dict(options) if isinstance(options, Mapping) else options
        chosen = further.pop("wind_speed", None) if isinstance(further, dict) else None
        if chosen is not None:
            chosen = self._among(chosen)
        # A refused reset must not take the seed: what the member refuses it refuses before it changes.
        before = self._np_random, self._np_random_seed
        super().reset(seed=given)
        drawn = self.wind_speeds[int(self.np_random.integers(len(self.wind_speeds)))]
        own = int(self.np_random.integers(SEEDS)) if given is None else given
        member = self._member(drawn if chosen is None else chosen)
        try:
            observation, info = member.reset(seed=own, options=further)
        except ValueError:
            self._np_random, self._np_random_seed = before
            raise
        self._now, self._running = member, True
        return observation, info | {"wind_speed": member.model.wind_speed}

    def _among(self, given: object) -> float:
        asked = float(Quantity("speed").check(given, "options.wind_speed"))
        for speed in self.wind_speeds:
            if np.isclose(speed, asked, rtol=1e-9, atol=0.0):
                return speed
        raise ValueError(
            f"options.wind_speed: expected one of {', '.join(map(number, self.wind_speeds))} m/s, got {shown(given)}"
        )

    def step(self, action: ArrayLike) -> tuple[NDArray[np.float32], float, bool, bool, Info]:
        """As `FlapEnv.step`."""
        if not self._running:
            raise ResetNeeded("step: no episode is running; call reset first")
        observation, reward, terminated, truncated, info = self._now.step(action)
        info["wind_speed"] = self._now.model.wind_speed
        return observation, reward, terminated, truncated, info

    def render(self) -> Any:
        """As `FlapEnv.render`."""
        return self._now.render()

    def close(self) -> None:
        """Close the windows, if there are any."""
        for member in self._members.values():
            member.close()

    def get_state(self) -> dict[str, Any]:
        """The whole state as plain values, for pickle or JSON: an environment that takes it goes on bit for bit."""
        return {
            "wind_speed": self._now.model.wind_speed,
            "turbine": self._now.get_state(),
            "generator": generator_state(self.np_random),
            "seed": self.np_random_seed,
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Go on from a state that an environment of the same set and keywords gave; raises as `FlapEnv.set_state`."""
        if not isinstance(state, Mapping) or "turbine" not in state:
            raise ValueError("state: expected what get_state of such an environment returned")
        speed = read_entry(state, "wind_speed", self._among)
        generator, seed = read_entry(state, "generator", generator_of), read_entry(state, "seed", seed_number)
        member = self._member(speed)
        member.set_state(state["turbine"])
        self._now, self._running = member, True
        self._np_random, self._np_random_seed = generator, seed


def speeds_within(models: ModelSet, wind_speed: object) -> tuple[float, ...]:
    """Wind speeds of a set within a range [m/s], all for None; raises ValueError if it is no range or holds none."""
    there = ", ".join(map(number, models.wind_speeds))
    if wind_speed is None:
        return models.wind_speeds
    if not isinstance(wind_speed, tuple | list) or len(wind_speed) != 2:
        raise ValueError(
            f"wind_speed: expected two speeds, the lowest and the highest to fly at of {there} m/s, "
            f"got {shown(wind_speed)}"
        )
    low, high = (
        float(Quantity("speed").check(each, f"wind_speed[{i}]")) for i, each in enumerate(wind_speed)
    )
    within = tuple(speed for speed in models.wind_speeds if low <= speed <= high)
    if not within:
        raise ValueError(
            f"wind_speed: expected a range that holds one of {there} m/s, got {number(low)} to {number(high)} m/s"
        )
    return within
