"""Geometrically exact beams and the turbine made of them, linear about the equilibrium (Section II.A, B)."""

from flapgym.structure.assembly import assemble, hub_velocity, parked_modes
from flapgym.structure.beam import Beam, Configuration
from flapgym.structure.blade import blade_beam, linear_blade, mean_gravity_load
from flapgym.structure.body import LinearBlade
from flapgym.structure.equilibrium import EquilibriumError, solve_equilibrium
from flapgym.structure.modes import Mode, modes_table, named_modes
from flapgym.structure.rotating import multi_blade_matrices, rotating_modes
from flapgym.structure.support import LinearSupport, linear_support

__all__ = [
    "Beam",
    "Configuration",
    "EquilibriumError",
    "LinearBlade",
    "LinearSupport",
    "Mode",
    "assemble",
    "blade_beam",
    "hub_velocity",
    "linear_blade",
    "linear_support",
    "mean_gravity_load",
    "modes_table",
    "multi_blade_matrices",
    "named_modes",
    "parked_modes",
    "rotating_modes",
    "solve_equilibrium",
]
