"""A turbine whose blades differ: its parts, and its equations as they follow the azimuth (Section II.D).

Readings. Each blade is linearised about the steady state of a rotor of three blades like it, so that its own
centrifugal and aerodynamic loads, its deflection and its stiffness are those of its mass, stiffness and pitch. Blades
of one pitch share shapes and lattice, those of the mean mass and stiffness; a blade of another pitch brings a lattice
that is turned, bent and mapped to its beam by itself. How circulations act on each other, and which way their forces
point, is taken from the lattice of the mean blade, which keeps the rotor's cyclic symmetry. The blades' steady loads
on the hub no longer balance: what turns with the rotor shakes the tower once a revolution. Steady differences between
the blades and the change of that turning load with the hub's attitude are left out. Gravity, where it is an input,
pulls at each blade's own masses, at their places in that blade's own steady state.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from flapgym.aerodynamics import Aerodynamics, MeanFlow
from flapgym.aeroelastic.blade_lattice import blade_lattice
from flapgym.aeroelastic.coupling import Equations
from flapgym.aeroelastic.equations import Parts, blade_by_blade
from flapgym.aeroelastic.periodic import PeriodicEquations
from flapgym.aeroelastic.transform import in_multiblade
from flapgym.aeroelastic.trim import Trim, trim
from flapgym.core.arrays import Array
from flapgym.reduction import normal_modes
from flapgym.structure import linear_support
from flapgym.turbine import Case


@dataclass(frozen=True, eq=False)
class UnequalParts:
    """What a turbine of unequal blades is coupled from.

    Attributes
    ----------
    mean : Parts
        Of the mean blade.
    blades : three Parts
        Of each blade.
    lattice : three ints
        Which of ``lattices`` is each blade's.
    lattices : Parts, ...
        One for each pitch.
    """

    mean: Parts
    blades: tuple[Parts, ...]
    lattice: tuple[int, ...]
    lattices: tuple[Parts, ...]


def assemble_unequal(case: Case) -> tuple[UnequalParts, Aerodynamics]:
    """Parts of a case of unequal blades, and the lattice of the whole rotor, that of its mean blade."""
    modes, middle = case.reduction.blade_modes, case.of_mean_blade()
    support = linear_support(case.turbine, case.rotor_speed)
    known: dict[str, Trim] = {}

    def steady(alike: Case) -> Trim:
        key = replace(alike, blades=middle.blades).hash()  # flaps do not enter
        known[key] = known.get(key) or trim(alike)
        return known[key]

    balance = steady(middle)
    frequency, shape = normal_modes(balance.blade.mass, balance.blade.stiffness, modes)

    def in_shapes(own: Case, there: Trim, shape: Array) -> Parts:
        flow = MeanFlow(there.mean, there.loads)
        lattice = blade_lattice(own, there.rotor, there.blade, shape, flow)
        return Parts(own, there.blade, support, frequency, shape, lattice, flow)

    mean = in_shapes(middle, balance, shape)
    offsets = sorted(set(case.blades.pitch_offset))
    lattices = []
    for offset in offsets:
        if len(offsets) == 1:
            lattices.append(mean)
            continue
        turned = _pitched(case, offset)
        there = steady(turned)
        _, modal = normal_modes(there.blade.mass, there.blade.stiffness, modes)
        nearest = aligned(modal, there.blade.mass, shape)
        lattices.append(in_shapes(turned, there, nearest))
    places = tuple(offsets.index(offset) for offset in case.blades.pitch_offset)
    blades = []
    for b, place in enumerate(places):
        own = case.of_blade(b)
        blades.append(replace(lattices[place], case=own, blade=steady(own).blade))
    return UnequalParts(mean, tuple(blades), places, tuple(lattices)), balance.rotor


def aligned(shape: Array, mass: Array, reference: Array) -> Array:
    """Modes (n, m), turned within their own span to lie nearest to a reference's (n, m), orthonormal in the mass."""
    u, _, v = np.linalg.svd(shape.T @ mass @ reference)
    return np.asarray(shape @ (u @ v))


def unequal_equations(parts: UnequalParts) -> PeriodicEquations:
    """The turbine by azimuth, blades in their own frames, with the turning load of their imbalance as an input."""
    steady = np.stack([own.blade.on_hub for own in parts.blades])
    # What the blades have in common is in balance.
    return replace(blade_by_blade(parts.mean, parts.blades, parts.lattice), steady=steady - steady[0])


def multiblade_equations(equations: PeriodicEquations) -> Callable[[float], Equations]:
    """The same in multi-blade coordinates, by azimuth; constant where the blades are equal."""

    def at(azimuth: float) -> Equations:
        return in_multiblade(equations(azimuth), azimuth, equations.rotor_speed, equations.modes)

    return at


def _pitched(case: Case, offset: float) -> Case:
    """Equal blades of the mean mass and stiffness, but of one blade's pitch."""
    blades = replace(case.blades, pitch_offset=(offset, offset, offset))
    return replace(case, blades=blades).of_mean_blade()
