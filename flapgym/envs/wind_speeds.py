"""At which wind speeds of a set of models episodes are flown, which is next, and the space of observations at all."""

from __future__ import annotations

import copy
import os
from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np

from flapgym.core.fields import Quantity
from flapgym.core.wording import number, shown
from flapgym.envs.settings import Settings
from flapgym.envs.task import observable
from flapgym.envs.turbines import with_blade_rms
from flapgym.model.model_set import ModelSet, load_model_set

SEEDS = 2**63
"""Up to which the number is drawn that a wind speed is made of."""


def chosen_set(model: object) -> ModelSet:
    """The set meant, read if it is a name or a file; raises ValueError or FileNotFoundError if there is none."""
    if isinstance(model, ModelSet):
        return model
    if not isinstance(model, str | os.PathLike):
        raise ValueError(
            f"model: expected the name of a shipped set of models, a file of one or a ModelSet, got "
            f"{shown(model) if isinstance(model, int | float | None) else type(model).__name__}"
        )
    return load_model_set(model)


def drawn_speed(generator: np.random.Generator, wind_speeds: tuple[float, ...]) -> float:
    """The wind speed of an episode [m/s], each as likely as another.

    Made of what a copy of the generator would give next: the generator itself is left to the draws of `FlapEnv`, whose
    episode of the same seed it then is. A generator of its own makes it, for the azimuth comes of the same number.
    """
    ahead = copy.deepcopy(generator).integers(SEEDS)
    return wind_speeds[int(np.random.default_rng(ahead).integers(len(wind_speeds)))]


def chosen_speed(options: object, wind_speeds: tuple[float, ...]) -> tuple[float | None, Any]:
    """The wind speed of a reset's options [m/s], None if it is to be drawn, and what else there is."""
    if not isinstance(options, Mapping):
        return None, options  # which it refuses, unless there are none
    further = {name: value for name, value in options.items() if name != "wind_speed"}
    given = options.get("wind_speed")
    return None if given is None else among(given, wind_speeds, "options.wind_speed"), further


def among(given: object, wind_speeds: tuple[float, ...], name: str) -> float:
    """The one of the wind speeds that is meant [m/s]; raises ValueError if there is none."""
    asked = float(Quantity("speed").check(given, name))
    for speed in wind_speeds:
        if np.isclose(speed, asked, rtol=1e-9, atol=0.0):
            return speed
    raise ValueError(f"{name}: expected one of {', '.join(map(number, wind_speeds))} m/s, got {shown(given)}")


def widest(
    models: ModelSet, wind_speeds: tuple[float, ...], settings: Settings, observed: Mapping[str, range]
) -> gymnasium.spaces.Box[np.float32]:
    """The space that holds the observations at all wind speeds: bounds of moments go with the model's rms."""
    there = [models.at(speed) for speed in wind_speeds]
    if settings.single_blade:
        there = [with_blade_rms(model) for model in there]
    high = np.empty(sum(map(len, observed.values())), dtype=np.float32)
    for name, place in observed.items():
        high[place] = np.max(
            [np.resize(observable(name, model).bound(model), len(place)) for model in there], axis=0
        )
    return gymnasium.spaces.Box(-high, high, dtype=np.float32)


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
    if low > high:
        raise ValueError(f"wind_speed: expected the lowest first, got {number(low)}, then {number(high)} m/s")
    within = tuple(speed for speed in models.wind_speeds if low <= speed <= high)
    if not within:
        raise ValueError(
            f"wind_speed: expected a range that holds one of {there} m/s, got {number(low)} to {number(high)} m/s"
        )
    return within
