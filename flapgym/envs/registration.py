"""Registers the environments with Gymnasium; string entry points, so nothing heavy is loaded before `make`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import gymnasium

TURBINE_ID = "flapgym/NREL5MW-v0"


@dataclass(frozen=True)
class Registered:
    """An environment with an id of its own.

    Attributes
    ----------
    id : str
    summary : str
        What it is, for its page: one sentence, then what a reader has to know.
    keywords : mapping
        Keywords that differ from the defaults of its class.
    single, vector : str
        Where the classes are.
    """

    id: str
    summary: str
    keywords: Mapping[str, Any] = field(default_factory=dict)
    single: str = "flapgym.envs.single:FlapEnv"
    vector: str = "flapgym.envs.vector:FlapVectorEnv"


ENVIRONMENTS = (Registered(TURBINE_ID, "The turbine of three blades in homogeneous turbulence."),)
"""Every environment of the package."""


def register_environments() -> None:
    """Register every environment of the package, once."""
    for entry in ENVIRONMENTS:
        if entry.id not in gymnasium.registry:
            gymnasium.register(
                id=entry.id,
                entry_point=entry.single,
                vector_entry_point=entry.vector,
                kwargs=dict(entry.keywords),
            )
