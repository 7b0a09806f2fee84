"""Registers the environments with Gymnasium; string entry points, so nothing heavy is loaded before `make`."""

from __future__ import annotations

import gymnasium

TURBINE_ID = "flapgym/NREL5MW-v0"


def register_environments() -> None:
    """Register every environment of the package, once."""
    if TURBINE_ID not in gymnasium.registry:
        gymnasium.register(
            id=TURBINE_ID,
            entry_point="flapgym.envs.single:FlapEnv",
            vector_entry_point="flapgym.envs.vector:FlapVectorEnv",
        )
