"""The azimuth-dependent form against the structure's own assembly and against the multi-blade form."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from flapgym.aeroelastic.blade_lattice import BladeLattice, reduce_component
from flapgym.aeroelastic.build import assemble_parts
from flapgym.aeroelastic.coupling import couple, multiblade_aerodynamics
from flapgym.aeroelastic.equations import (
    Parts,
    blade_by_blade,
    periodic_equations,
    turbine_equations,
)
from flapgym.aeroelastic.periodic import periodic_model, step_matrices
from flapgym.core.multiblade import to_blades, to_components
from flapgym.reduction import ReducedSystem, normal_modes
from flapgym.structure import assemble, linear_blade, linear_support
from flapgym.turbine import load_case

CASE = load_case("nrel5mw-rated")


def turbine_parts(modes, tower_modes, damping):
    """An untrimmed turbine with a made-up lattice, whose gains are irrelevant to the structure."""
    turbine = replace(CASE.turbine, blade_damping_ratio=damping, tower_damping_ratio=damping)
    case = replace(CASE, turbine=turbine, reduction=replace(CASE.reduction, tower_modes=tower_modes))
    blade = linear_blade(turbine, 12, case.rotor_speed)
    frequency, shape = normal_modes(blade.mass, blade.stiffness, modes)
    rng = np.random.default_rng(8)
    lattice = BladeLattice(
        rng.standard_normal((4, 2 * modes + 11)),
        rng.standard_normal((modes + 6, 5)),
        modes,
        flaps=1,
        strips=1,
    )
    return Parts(case, blade, linear_support(turbine, case.rotor_speed), frequency, shape, lattice)


@pytest.mark.parametrize("azimuth", [0.0, 1.3, 4.0])
def test_structure_at_an_azimuth_is_the_direct_assembly_in_modes(azimuth):
    parts = turbine_parts(modes=8, tower_modes=66, damping=0.0)
    ours = periodic_equations(parts)(azimuth).structure
    _, support_shape = parts.modal_support
    modes = scipy.linalg.block_diag(parts.shape, parts.shape, parts.shape, support_shape)
    theirs = assemble([parts.blade] * 3, parts.support, azimuth)
    for name, full in zip(("mass", "damping", "stiffness"), theirs, strict=True):
        expected = modes.T @ full @ modes
        error = np.abs(getattr(ours, name) - expected).max() / np.abs(expected).max()
        assert error < 1e-9, name


def quasi_steady(inputs, outputs):
    """A lattice without memory that only the flap angles load."""
    gain = np.zeros((outputs, inputs))
    gain[:, -3] = 1e5 * np.random.default_rng(0).standard_normal(outputs)
    empty = np.zeros((0, 0))
    return ReducedSystem(
        empty, np.zeros((0, 3 * inputs)), np.zeros((3 * outputs, 0)), np.kron(np.eye(3), gain), np.ones(0)
    )


def march(equations, lattice, dt, azimuth, u):
    """Outputs of the azimuth-dependent form stepped at its exact azimuths."""
    x, y = 0.0, []
    for theta, now in zip(azimuth, u, strict=True):
        A, B, C, D = step_matrices(equations, lattice, dt, theta, equations.rotor_speed * dt)
        x = np.zeros(len(A)) if not y else x
        y.append(C @ x + D @ now)
        x = A @ x + B @ now
    return np.array(y)


def test_periodic_and_multiblade_forms_converge_with_the_square_of_the_step():
    """Newmark's rule in two coordinates: the same solution in the limit, apart by order dt^2."""
    parts = turbine_parts(modes=2, tower_modes=4, damping=0.02)
    lattice = quasi_steady(parts.lattice.downwash.shape[1], parts.lattice.modes + 6)
    gaps = []
    for steps in (100, 200, 400):
        dt = 2.0 / steps
        time = dt * np.arange(steps + 1)
        theta = 0.6 + parts.case.rotor_speed * time
        flap = np.outer(1.0 - np.cos(3.0 * time), [0.1, -0.05, 0.02])
        rest = np.zeros((steps + 1, 4))
        ours = march(periodic_equations(parts), lattice, dt, theta, np.hstack([flap, rest]))
        still = couple(turbine_equations(parts), lattice, dt)
        theirs = still.simulate(np.hstack([to_components(flap, theta), rest]))
        gaps.append(np.abs(ours[:, 3:6] - to_blades(theirs[:, 3:6], theta)).max())
    assert 3.5 < gaps[0] / gaps[1] < 4.5
    assert 3.5 < gaps[1] / gaps[2] < 4.5


@pytest.fixture(scope="module")
def small():
    """The real turbine with few states: parts and its lattice in components."""
    reduction = replace(CASE.reduction, blade_modes=3, tower_modes=4, aerodynamic_states=12)
    grid = replace(CASE.discretisation, chordwise_panels=3, wake_length=0.1)
    case = replace(CASE, reduction=reduction, discretisation=grid)
    parts, rotor = assemble_parts(case)
    return parts, [reduce_component(rotor, parts.lattice, m, 12) for m in (0, 1)]


def test_table_refreshed_every_five_steps_follows_the_time_invariant_form(small):
    """Gust and one blade's flap, two revolutions: within a percent of rms, as the paper found no effect."""
    parts, components = small
    dt, speed = parts.case.discretisation.time_step, parts.case.rotor_speed
    table = periodic_model(periodic_equations(parts), multiblade_aerodynamics(*components, 0.0, dt), dt, 147)
    still = couple(turbine_equations(parts), multiblade_aerodynamics(*components, speed, dt), dt)
    time = dt * np.arange(1470)
    theta = 0.3 + speed * time
    flap = np.outer(np.sin(2.0 * time), [0.1, 0.0, 0.0])
    rate = np.outer(2.0 * np.cos(2.0 * time), [0.1, 0.0, 0.0])
    wind = np.sin(0.9 * time)[:, None]
    ours = table.simulate(np.hstack([flap, rate, wind]), 0.3, refresh=5)
    theirs = still.simulate(np.hstack([to_components(flap, theta), to_components(rate, theta), wind]))
    for first in (0, 3):
        blades = to_blades(theirs[:, first : first + 3], theta)
        error = np.sqrt(((ours[:, first : first + 3] - blades) ** 2).mean() / (blades**2).mean())
        assert error < 1e-2


def test_weaker_flap_on_one_blade_moves_that_blade_less_and_leaves_the_others_flaps_alone(small):
    parts, components = small
    dt = parts.case.discretisation.time_step
    aerodynamics = multiblade_aerodynamics(*components, 0.0, dt)
    case, (weaker, usual) = parts.case, ((0.5,) * 3, (1.0,) * 3)
    each = [
        replace(parts, case=replace(case, blades=replace(case.blades, flap_effectiveness=share)))
        for share in (weaker, usual, usual)
    ]
    weak = periodic_model(blade_by_blade(parts, each, (0, 0, 0)), aerodynamics, dt, 24)
    whole = periodic_model(periodic_equations(parts), aerodynamics, dt, 24)
    for flap in range(6):  # three angles, three rates
        u = np.zeros((200, 7))
        u[:, flap] = 0.1
        share = 0.5 if flap % 3 == 0 else 1.0
        expected = share * whole.simulate(u, 0.0)
        size = np.abs(expected).max(axis=0)
        np.testing.assert_allclose(weak.simulate(u, 0.0) / size, expected / size, atol=1e-9)
