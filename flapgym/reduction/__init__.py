"""Model reduction: modal for the structure, balanced for the aerodynamics and for the coupled whole (Section II.D)."""

from flapgym.reduction.balanced import ReducedSystem, balanced_reduction
from flapgym.reduction.modal import normal_modes
from flapgym.reduction.weighted import Balanced, balance, output_rms, relative_error

__all__ = [
    "Balanced",
    "ReducedSystem",
    "balance",
    "balanced_reduction",
    "normal_modes",
    "output_rms",
    "relative_error",
]
