"""Geometrically exact beams and the turbine made of them, linear about the equilibrium (Section II.A, B)."""

from flapgym.structure.assembly import assemble, hub_velocity, parked_modes
from flapgym.structure.beam import Beam, Configuration
from flapgym.structure.blade import blade_beam, linear_blade
from flapgym.structure.body import LinearBlade
from flapgym.structure.equilibrium import EquilibriumError, solve_equilibrium
from flapgym.structure.support import LinearSupport, linear_support

__all__ = [
    "Beam",
    "Configuration",
    "EquilibriumError",
    "LinearBlade",
    "LinearSupport",
    "assemble",
    "blade_beam",
    "hub_velocity",
    "linear_blade",
    "linear_support",
    "parked_modes",
    "solve_equilibrium",
]
