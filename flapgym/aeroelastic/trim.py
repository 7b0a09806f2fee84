"""The aeroelastic equilibrium: blade and lattice in balance at the operating point (Section II.A, steady state).

The mean load bends and twists the blade, the bent blade carries the lattice elsewhere; the two are solved in
turn until they agree. All blades are equal and see the same steady wind, so one of them tells all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flapgym.aerodynamics import (
    Aerodynamics,
    MeanLoads,
    build_aerodynamics,
    build_mean_aerodynamics,
    mean_loads,
    momentum_induction,
)
from flapgym.aerodynamics.rotor import mean_is_perturbations
from flapgym.aeroelastic.interaction import interpolation, lattice_shape
from flapgym.core.arrays import Array
from flapgym.core.wording import number
from flapgym.structure import EquilibriumError, LinearBlade, linear_blade
from flapgym.turbine import Case

MAX_ITERATIONS = 20
TOLERANCE = 1e-6
"""Largest movement of a node between two rounds that counts as balance [m]; each round gains about a digit."""


@dataclass(frozen=True, eq=False)
class Trim:
    """Steady equilibrium of a rotor at its operating point.

    Attributes
    ----------
    blade : LinearBlade
        Blade 1 linearised about the equilibrium.
    rotor : Aerodynamics
        The lattice of all blades in their deflected places, with the wake that the perturbations have.
    mean : Aerodynamics
        The same with the wake behind the mean load, for steady flow only; the one above unless the case has another.
    loads : MeanLoads
        Mean loads there.
    induction : float
        Axial induction that slows the mean wake.
    iterations : int
        Rounds of lattice and beam.
    """

    blade: LinearBlade
    rotor: Aerodynamics
    mean: Aerodynamics
    loads: MeanLoads
    induction: float
    iterations: int


def trim(case: Case, blades: int = 3) -> Trim:
    """Balance the beam and the lattice.

    Parameters
    ----------
    case : Case
    blades : int
        3 for the rotor, 1 for a blade that turns alone.

    Raises
    ------
    ValueError
        If the beam finds no balance under a load, or lattice and beam do not settle; the message says how far
        apart they are.
    """
    case = case.alike()
    grid, point = case.discretisation, case.operating_point

    def bend(load: Array | None, near: LinearBlade | None = None) -> LinearBlade:
        try:
            return linear_blade(case.turbine, grid.blade_elements, case.rotor_speed, point.pitch, load, near)
        except EquilibriumError as error:
            raise ValueError(
                f"operating_point: the blade finds no balance at {number(point.wind_speed)} m/s and "
                f"{case.rotor_speed:.3g} rad/s ({error}); lower wind_speed or tip_speed_ratio"
            ) from error

    airloads = case.airloads
    by_momentum = airloads.mean_wake != "perturbations" and airloads.mean_induction == "momentum"
    blade, induction, move = bend(None), _induction_to_start_with(case), np.inf
    for iteration in range(1, MAX_ITERATIONS + 1):
        mean = build_mean_aerodynamics(case, induction, blades, *lattice_shape(case, blade))
        loads = mean_loads(case, mean)
        # The first loaded shape lies far from the unloaded one, the next ones near it.
        after = bend(nodal_load(blade, loads), blade if iteration > 1 else None)
        move = float(np.linalg.norm(after.position - blade.position, axis=1).max())
        settled = move < TOLERANCE
        if by_momentum and not settled:
            induction = momentum_induction(loads.thrust_coefficient)
        blade = after
        if settled:
            rotor = mean if mean_is_perturbations(case) else deflected_lattice(case, blade, blades)
            return Trim(blade, rotor, mean, loads, induction, iteration)
    raise ValueError(
        f"operating_point: blade and lattice still move by {move:.3g} m after {MAX_ITERATIONS} rounds; "
        "lower wind_speed or tip_speed_ratio"
    )


def _induction_to_start_with(case: Case) -> float:
    if case.airloads.mean_wake == "perturbations":
        return case.discretisation.induction
    chosen = case.airloads.mean_induction
    return 0.0 if chosen == "momentum" else chosen


def deflected_lattice(case: Case, blade: LinearBlade, blades: int) -> Aerodynamics:
    """The lattice on the deflected beam: its axis where the nodes are, its sections turned as they are."""
    return build_aerodynamics(case, blades, *lattice_shape(case, blade))


def nodal_load(blade: LinearBlade, loads: MeanLoads) -> Array:
    """Mean forces and moments as nodal forces and moments (n + 1, 6) in S, the root's own being zero."""
    displacement, _ = interpolation(blade, loads.force_point)
    nodal = displacement.T @ loads.force.ravel()
    if len(loads.couple):
        _, rotation = interpolation(blade, loads.couple_point)
        nodal = nodal + rotation.T @ loads.couple.ravel()
    return np.vstack([np.zeros(6), nodal.reshape(-1, 6)])
