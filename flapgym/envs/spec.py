"""What an environment's specification says beyond what it was registered with: its length, and keywords for JSON."""

from __future__ import annotations

import copy
import os
from collections.abc import Mapping
from enum import Enum
from typing import Any

import numpy as np
from gymnasium.envs.registration import EnvSpec

from flapgym.core.fields import to_plain
from flapgym.envs.settings import Actuators, Sensors
from flapgym.envs.task import Task
from flapgym.wind import Inflow, Wind
from flapgym.wind.gusts import GUSTS
from flapgym.wind.turbulence import TURBULENCES


def completed(spec: EnvSpec | None, actions: int) -> EnvSpec | None:
    """The specification with an episode's number of actions, on which wrappers that tell the time rely.

    It is not registered with a limit, for `gymnasium.make` would then put a wrapper around each environment that ends
    the episode once more.
    """
    if spec is None:
        return None
    spec = copy.copy(spec)
    spec.max_episode_steps = actions
    spec.kwargs = plain(spec.kwargs)
    return spec


def plain(value: Any) -> Any:
    """Nested keywords with what JSON knows in place of families, NumPy's numbers and arrays, paths and enumerations."""
    if isinstance(value, (Wind, Task, Actuators, Sensors, Inflow, *GUSTS.values(), *TURBULENCES.values())):
        value = to_plain(value)
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, Mapping):
        return {name: plain(entry) for name, entry in value.items()}
    if type(value) in (list, tuple):
        return type(value)(plain(entry) for entry in value)
    return value
