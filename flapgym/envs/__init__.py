"""Gymnasium environments over the fast plant: one turbine (`FlapEnv`) or many (`FlapVectorEnv`)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from flapgym.envs.registration import register_environments

if TYPE_CHECKING:
    from flapgym.envs.operating_range import FlapRangeEnv
    from flapgym.envs.range_vector import FlapRangeVectorEnv
    from flapgym.envs.single import FlapEnv
    from flapgym.envs.vector import FlapVectorEnv

__all__ = ["FlapEnv", "FlapRangeEnv", "FlapRangeVectorEnv", "FlapVectorEnv", "register_environments"]


def __getattr__(name: str) -> Any:
    """Load the classes when they are asked for, so that `import flapgym` stays light."""
    if name == "FlapEnv":
        from flapgym.envs.single import FlapEnv

        return FlapEnv
    if name == "FlapRangeEnv":
        from flapgym.envs.operating_range import FlapRangeEnv

        return FlapRangeEnv
    if name == "FlapRangeVectorEnv":
        from flapgym.envs.range_vector import FlapRangeVectorEnv

        return FlapRangeVectorEnv
    if name == "FlapVectorEnv":
        from flapgym.envs.vector import FlapVectorEnv

        return FlapVectorEnv
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
