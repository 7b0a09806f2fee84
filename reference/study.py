"""The coupled turbine with further loads to look at: edgewise root moments and the tower's base, for studies only."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flapgym.aeroelastic.blade_lattice import reduce_component
from flapgym.aeroelastic.build import assemble_parts, carried_on, slow_wake
from flapgym.aeroelastic.coupling import Equations, Output, couple, multiblade_aerodynamics, turbine_structure
from flapgym.aeroelastic.equations import (
    Parts,
    blade_components,
    modal_blade_matrices,
    root_moment,
    summed_load,
    turbine_equations,
)
from flapgym.core.arrays import Array
from flapgym.core.state_space import StateSpace, delayed, series
from flapgym.model.turbine_model import TURBINE_OUTPUTS
from flapgym.structure.rotation import rigid_displacement
from flapgym.turbine import Case

STUDY_OUTPUTS = ("rbm_edge_0", "rbm_edge_c", "rbm_edge_s", "tower_base_fore_aft", "tower_base_side_side")


def study_turbine(case: Case) -> StateSpace:
    """The turbine of a case's model file with ``STUDY_OUTPUTS`` after its own outputs; takes as long as a build.

    The edgewise root moment [N m], in multi-blade coordinates, turns the blade on in the rotor's direction, about the
    axis square to the coned, untwisted blade. The moments [N m] on the foundation are positive for a thrust downwind
    and for a force to the left of one who looks downwind, the sides on which the tower's top moves positively.
    All by force summation. Where the case's loads leave out the mean circulation in the perturbed flow, in-plane air
    loads come out some 40 % too small, and with them the edgewise moments' share from the air. Gravity is left out.

    Raises
    ------
    ValueError
        If the blades differ, or the case asks for a second reduction of the whole.
    """
    if case.reduction.coupled_tolerance:
        raise ValueError("reduction.coupled_tolerance: expected 0 %, further outputs are not reduced")
    parts, rotor = assemble_parts(case)
    grid, keep = case.discretisation, case.reduction
    order, tolerance = keep.aerodynamic_states, keep.aerodynamic_tolerance
    collective, whirl = (reduce_component(rotor, parts.lattice, m, order, tolerance) for m in (0, 1))
    lattice = multiblade_aerodynamics(collective, whirl, case.rotor_speed, grid.time_step)
    turbine = series(slow_wake(parts), couple(study_equations(parts), lattice, grid.time_step))
    return delayed(carried_on(turbine, case.rotor_speed * grid.time_step)) if grid.input_delay else turbine


def study_equations(parts: Parts) -> Equations:
    """``turbine_equations`` with ``STUDY_OUTPUTS`` after its own outputs."""
    equations = turbine_equations(parts)
    outputs = [equations.output, _edgewise(parts), _tower_base(parts)]
    names = ("acceleration", "velocity", "position", "load")
    output = Output(*(np.vstack([getattr(part, name) for part in outputs]) for name in names))
    return replace(equations, output=output, outputs=(*TURBINE_OUTPUTS, *STUDY_OUTPUTS))


def _edgewise(parts: Parts) -> Output:
    cone = parts.case.turbine.rotor.precone
    row = root_moment(parts.blade, parts.lattice.modes, np.array([np.cos(cone), 0.0, np.sin(cone)]))
    support, shape = parts.modal_support
    own, components = modal_blade_matrices(parts), blade_components(parts, shape)
    structure, rate, acceleration = turbine_structure(own, support, components, parts.case.rotor_speed)
    T = components.reshape(-1, structure.mass.shape[0])
    return summed_load(row, own, T, rate, acceleration)


def _tower_base(parts: Parts) -> Output:
    """The turbine's equations for a rigid turn of all it stands on about the foundation: what the ground takes up."""
    _, shape = parts.modal_support
    wide = np.hstack([shape, rigid_turns(parts)])
    support = parts.support
    mass, damping = (wide.T @ matrix @ wide for matrix in (support.mass, support.damping))
    structure, _, _ = turbine_structure(
        modal_blade_matrices(parts),
        (mass, damping, np.zeros_like(mass)),  # a rigid turn strains nothing above the ground
        blade_components(parts, wide),
        parts.case.rotor_speed,
    )
    rows, columns = slice(-2, None), slice(None, -2)
    return Output(
        acceleration=-structure.mass[rows, columns],
        velocity=-structure.damping[rows, columns],
        position=-structure.stiffness[rows, columns],
        load=structure.work[rows],
    )


def rigid_turns(parts: Parts) -> Array:
    """Motion (N, 2) of the support's nodes in rigid turns about the base: over downwind, and over to the left."""
    support = parts.support
    nodes = np.vstack([support.tower_position[1:], support.apex])
    axes = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]).T
    moves = (rigid_displacement(nodes)[:, 3:] @ axes).reshape(-1, 3, 2)
    return np.concatenate([moves, np.broadcast_to(axes, moves.shape)], axis=1).reshape(-1, 2)
