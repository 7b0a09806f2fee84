"""Model reduction before coupling: modal for the structure, balanced for the aerodynamics (Section II.D)."""

from flapgym.reduction.balanced import ReducedSystem, balanced_reduction
from flapgym.reduction.modal import normal_modes

__all__ = ["ReducedSystem", "balanced_reduction", "normal_modes"]
