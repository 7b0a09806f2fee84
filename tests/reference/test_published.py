"""The turbine as the paper counts it against the form with the joint eliminated."""

from dataclasses import replace

import numpy as np
import pytest

from flapgym.aeroelastic.blade_lattice import reduce_component
from flapgym.aeroelastic.build import assemble_parts
from flapgym.aeroelastic.coupling import multiblade_aerodynamics
from flapgym.aeroelastic.equations import periodic_equations
from flapgym.aeroelastic.periodic import PERIODIC_OUTPUTS, step_matrices
from flapgym.core.state_space import StateSpace, series
from flapgym.reduction import output_rms
from flapgym.turbine import load_case
from reference.published import published_turbine

CASE = load_case("nrel5mw-rated")
DT = CASE.discretisation.time_step


@pytest.fixture(scope="module")
def small():
    """A small turbine, and its lattice on the rotor."""
    reduction = replace(CASE.reduction, blade_modes=3, tower_modes=4, aerodynamic_states=10)
    grid = replace(CASE.discretisation, chordwise_panels=3, wake_length=0.1)
    parts, rotor = assemble_parts(replace(CASE, reduction=reduction, discretisation=grid))
    collective, whirl = (reduce_component(rotor, parts.lattice, m, 10) for m in (0, 1))
    return parts, multiblade_aerodynamics(collective, whirl, 0.0, DT)


def test_multipliers_filter_and_integrator_as_states_change_no_output(small):
    """Stepped side by side from rest under flap accelerations and white noise; the joint is eliminated in one."""
    parts, lattice = small
    published, equations = published_turbine(parts, lattice), periodic_equations(parts)
    turn, steps = CASE.rotor_speed * DT, 150
    rng = np.random.default_rng(2)
    inputs = rng.standard_normal((steps, 4)) * [5.0, 5.0, 5.0, 1.0]
    actuators = published.states[-1].place
    x, z = np.zeros(published.order), None
    ours, theirs = [], []
    for n, now in enumerate(inputs):
        azimuth = 0.4 + turn * n
        wind = published.wind.C @ x[published.states[-2].place]
        u = np.concatenate([x[actuators], wind])
        A, B, C, D = step_matrices(equations, lattice, DT, azimuth, turn)
        z = np.zeros(len(A)) if z is None else z
        theirs.append(C @ z + D @ u)
        z = A @ z + B @ u
        step = published.at(azimuth)
        ours.append(step.C @ x)
        x = step.A @ x + step.B @ now
    ours, theirs = np.array(ours)[:, :8], np.array(theirs)
    size = np.abs(theirs).max(axis=0)
    np.testing.assert_allclose(ours / size, theirs / size, atol=1e-9)


def test_states_are_counted_as_in_the_paper_and_have_a_size(small):
    parts, lattice = small
    published = published_turbine(parts, lattice)
    counts = {group.name: group.count for group in published.states}
    assert counts["multipliers"] == counts["hub velocity"] == counts["double integrator"] == 6
    assert counts["turbulence filter"] == 3
    assert counts["blades position"] == counts["blades acceleration"] == 9
    assert sum(counts.values()) == published.order
    for group in published.states:
        assert np.isfinite(group.scale)
        assert group.scale > 0.0, group.name


def test_inputs_and_outputs_have_a_unit_and_their_size(small):
    """The rms of the outputs is that of the model with the joint eliminated, at the same frozen azimuth."""
    parts, lattice = small
    published = published_turbine(parts, lattice)
    assert [(s.unit, s.scale) for s in published.inputs] == [
        *3 * [("rad/s^2", CASE.flaps[0].acceleration_limit)],
        ("-", 1.0),
    ]
    A, B, C, D = step_matrices(periodic_equations(parts), lattice, DT, 0.0, 0.0)
    step = StateSpace(A, B[:, -1:], C, D[:, -1:], DT, ("wind",), PERIODIC_OUTPUTS)
    rms = output_rms(series(published.wind, step))
    assert [s.name for s in published.outputs[:8]] == list(PERIODIC_OUTPUTS)
    np.testing.assert_allclose([s.scale for s in published.outputs[:8]], rms, rtol=1e-2)
    units = {s.name.removesuffix("_x"): s.unit for s in published.outputs}
    assert (units["rbm_1"], units["tip_deflection_1"], units["tower_fore_aft"]) == ("N m", "m", "m")
    assert (units["hub_velocity"], units["hub_rate"]) == ("m/s", "rad/s")
    assert (units["joint_force"], units["joint_moment"]) == ("N", "N m")


def test_hub_moves_with_the_tower_and_the_joint_carries_the_rotor_s_thrust(small):
    """Steady at a frozen azimuth: multipliers hold the rotor against the gust, and bend the tower by as much."""
    parts, lattice = small
    still = published_turbine(parts, lattice)
    step = still.at(0.0)
    free = slice(0, still.states[-2].place.start)
    filtered = still.states[-2].place
    gust = np.zeros(still.order)
    gust[filtered] = still.wind.C[0] / (still.wind.C[0] @ still.wind.C[0])  # one metre per second, held
    forced = step.A[free, filtered] @ np.linalg.solve(still.wind.A, gust[filtered])
    x = np.linalg.solve(np.eye(free.stop) - step.A[free, free], forced)
    y = step.C[:, free] @ x + step.C[:, filtered] @ gust[filtered]
    joint = y[14:20]
    tower = parts.modal_support[0][2] @ x[still.states[1].place]
    load = -periodic_equations(parts).hub.T @ joint
    np.testing.assert_allclose(tower, load, atol=1e-9 * np.abs(load).max())
    # The gust pushes downwind, on the outer half of the blades: what the root moments share of the thrust says where.
    radius = CASE.turbine.rotor.radius
    assert 0.5 * radius < y[:3].sum() / -joint[0] < 0.75 * radius
