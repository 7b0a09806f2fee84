"""One form of the turbine transformed into the other: blades' own frames and multi-blade coordinates."""

from dataclasses import replace

import numpy as np
import pytest

from flapgym.aeroelastic.blade_lattice import reduce_component
from flapgym.aeroelastic.build import assemble_parts
from flapgym.aeroelastic.coupling import multiblade_aerodynamics
from flapgym.aeroelastic.equations import periodic_equations
from flapgym.aeroelastic.periodic import periodic_model, step_matrices
from flapgym.aeroelastic.transform import spread_matrix, step_in_multiblade
from flapgym.core.multiblade import to_components
from flapgym.core.state_space import StateSpace
from flapgym.turbine import load_case

CASE = load_case("nrel5mw-rated")
STEPS = 120  # a revolution
STEP = 2.0 * np.pi / (CASE.rotor_speed * STEPS)
MODES, TOWER, AIR = 3, 4, 8


@pytest.fixture(scope="module")
def forms():
    """The table of one revolution in the blades' frames, and one of its steps in multi-blade coordinates."""
    reduction = replace(CASE.reduction, blade_modes=MODES, tower_modes=TOWER, aerodynamic_states=AIR)
    grid = replace(CASE.discretisation, chordwise_panels=2, wake_length=0.1, time_step=STEP)
    parts, rotor = assemble_parts(replace(CASE, reduction=reduction, discretisation=grid))
    collective, whirl = (reduce_component(rotor, parts.lattice, m, AIR) for m in (0, 1))
    lattice, equations = multiblade_aerodynamics(collective, whirl, 0.0, STEP), periodic_equations(parts)
    table = periodic_model(equations, lattice, STEP, STEPS)
    turn, azimuth = CASE.rotor_speed * STEP, 0.9
    step = StateSpace(
        *step_matrices(equations, lattice, STEP, azimuth, turn), STEP, table.inputs, table.outputs
    )
    return table, step_in_multiblade(step, azimuth, turn, MODES, TOWER, AIR)


def test_one_step_transformed_is_the_whole_table_in_time(forms):
    """Three flaps and wind through the table of the blades' frames, and through the one constant step."""
    table, still = forms
    steps = 2 * STEPS
    u = np.random.default_rng(4).standard_normal((steps, 7)).cumsum(axis=0) * 0.01
    azimuth = 2.0 * np.pi * np.arange(steps) / STEPS
    ours = table.simulate(u, 0.0)
    components = [to_components(u[:, :3], azimuth), to_components(u[:, 3:6], azimuth), u[:, 6:]]
    theirs = still.simulate(np.hstack(components))
    ours = np.hstack([to_components(ours[:, :3], azimuth), to_components(ours[:, 3:6], azimuth), ours[:, 6:]])
    size = np.abs(theirs).max(axis=0)
    np.testing.assert_allclose(ours / size, theirs / size, atol=1e-9)


@pytest.mark.parametrize("frequency", [0.05, 0.3, 1.0])
def test_harmonic_response_of_the_periodic_turbine_is_the_time_invariant_frequency_response(forms, frequency):
    """Wind and one multi-blade flap component at one frequency: the table's periodic answer, solved for exactly."""
    table, still = forms
    z = np.exp(2j * np.pi * frequency * STEP)
    into = [np.zeros((STEPS, 7)), np.zeros((STEPS, 7))]
    into[0][:, 6] = 1.0
    for n in range(STEPS):
        into[1][n, :3] = spread_matrix(2.0 * np.pi * n / STEPS)[:, 1]
    expected = still.frequency_response([frequency])[0][:, [6, 1]]
    for drive, response in zip(into, expected.T, strict=True):
        # x^n = z^n p^n with p of the revolution's period; one revolution from an unknown p^0.
        product, forced = np.eye(table.A.shape[1], dtype=complex), np.zeros(table.A.shape[1], dtype=complex)
        for n in range(STEPS):
            product = table.A[n] @ product / z
            forced = (table.A[n] @ forced + table.B[n] @ drive[n]) / z
        p = np.linalg.solve(np.eye(len(product)) - product, forced)
        for n in range(STEPS):
            y = table.C[n] @ p + table.D[n] @ drive[n]
            azimuth = 2.0 * np.pi * n / STEPS
            seen = [np.linalg.solve(spread_matrix(azimuth), part) for part in (y[:3], y[3:6])]
            np.testing.assert_allclose(
                np.concatenate([*seen, y[6:]]) / np.abs(expected).max(axis=1),
                response / np.abs(expected).max(axis=1),
                atol=1e-9,
            )
            p = (table.A[n] @ p + table.B[n] @ drive[n]) / z
