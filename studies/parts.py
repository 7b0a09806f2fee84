"""The parts of a case and its reductions, made when first asked for, and variants of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property

from flapgym.aerodynamics import Aerodynamics
from flapgym.aeroelastic.blade_lattice import blade_lattice, reduce_component
from flapgym.aeroelastic.build import assemble_parts
from flapgym.aeroelastic.coupling import multiblade_aerodynamics
from flapgym.aeroelastic.equations import Parts
from flapgym.reduction import ReducedSystem, normal_modes
from flapgym.structure import linear_support
from flapgym.turbine import Case

Tell = Callable[[str], None]


class Study:
    """A case, its parts about the trim and its reduced lattice, each made when first asked for.

    Parameters
    ----------
    case : Case
    """

    def __init__(self, case: Case) -> None:
        self.case = case

    @cached_property
    def _assembled(self) -> tuple[Parts, Aerodynamics]:
        return assemble_parts(self.case)

    @property
    def parts(self) -> Parts:
        """Blade, support and one blade's lattice."""
        return self._assembled[0]

    @property
    def rotor(self) -> Aerodynamics:
        """Lattice of the whole rotor."""
        return self._assembled[1]

    @property
    def time_step(self) -> float:
        """[s]."""
        return self.case.discretisation.time_step

    @cached_property
    def components(self) -> tuple[ReducedSystem, ReducedSystem]:
        """Collective and whirl component of the lattice, reduced as the case says."""
        return reduce_rotor(self.parts, self.rotor, self.case.reduction.aerodynamic_states)

    def seen(self, rotor_speed: float) -> ReducedSystem:
        """The reduced lattice in coordinates against which the rotor turns at a speed [rad/s]."""
        return multiblade_aerodynamics(*self.components, rotor_speed, self.time_step)


def reduce_rotor(parts: Parts, rotor: Aerodynamics, states: int) -> tuple[ReducedSystem, ReducedSystem]:
    """Collective and whirl component with so many states each; a rotor of about three times as many."""
    collective, whirl = (reduce_component(rotor, parts.lattice, m, states) for m in (0, 1))
    return collective, whirl


def with_modes(parts: Parts, rotor: Aerodynamics, blade_modes: int, tower_modes: int) -> Parts:
    """The same turbine in other numbers of modes of each blade and of the support."""
    kept = replace(parts.case.reduction, blade_modes=blade_modes, tower_modes=tower_modes)
    case = replace(parts.case, reduction=kept)
    frequency, shape = normal_modes(parts.blade.mass, parts.blade.stiffness, blade_modes)
    lattice = blade_lattice(case, rotor, parts.blade, shape, parts.flow)
    return replace(parts, case=case, frequency=frequency, shape=shape, lattice=lattice)


def with_tower(parts: Parts, factor: float) -> Parts:
    """The same turbine on a tower whose bending and torsion stiffness is multiplied by a factor."""
    tower = parts.case.turbine.tower
    softer = replace(
        tower,
        bending_stiffness=factor * tower.bending_stiffness,
        torsion_stiffness=factor * tower.torsion_stiffness,
    )
    turbine = replace(parts.case.turbine, tower=softer)
    support = linear_support(turbine, parts.case.rotor_speed)
    return replace(parts, case=replace(parts.case, turbine=turbine), support=support)
