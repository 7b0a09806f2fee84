"""The rotor's lattice: orientation, symmetry, independence of the chordwise count, z-domain against marching."""

from dataclasses import replace

import numpy as np
import pytest

from flapgym.aerodynamics import (
    build_aerodynamics,
    flap_downwash,
    gust_downwash,
    march,
    root_moment_load,
    steady_circulation,
    transfer_function,
)
from flapgym.aerodynamics.biot_savart import ring_velocity
from flapgym.aerodynamics.lattice import rotation_about_x, wake_ages, wake_nodes


def beam_axis(aero):
    """The strips' edges at the quarter chord."""
    return aero.lattice.on_surface(np.array([0.25]))[0]


def steady_root_moment(aero, case, downwash):
    circulation = steady_circulation(aero, downwash[:, None])
    return (root_moment_load(aero, case) @ aero.force.sum(axis=0) @ circulation).item()


def test_lattice_of_the_paper(rotor, case):
    assert rotor.lattice.node.shape == (11, 11, 3)
    assert rotor.wake_rows == 409
    assert rotor.wake_influence.shape == (2, 100, 10, 409)
    radius = np.linalg.norm(beam_axis(rotor), axis=1)
    np.testing.assert_allclose(radius, case.turbine.blade_sections_12.radius[2:])


def test_blade_meets_the_air_with_its_leading_edge(rotor, case):
    chord = np.tile(rotor.lattice.chord_vector, (10, 1))
    assert (np.einsum("ni,ni->n", rotor.relative_velocity, chord) > 0).all()
    assert (rotor.lattice.leading_edge[:, 1] < 0).all()
    assert (rotor.normal[:, 0] > 0.9).all()
    # The tip is upwind of the rotor plane (precone) and the twisted root's leading edge upwind of its trailing edge.
    assert rotor.lattice.leading_edge[-1, 0] < rotor.lattice.leading_edge[0, 0]
    assert rotor.lattice.leading_edge[0, 0] < rotor.lattice.trailing_edge[0, 0]
    # Wind along the shaft, rotation about +x: at the tip 11 m/s against 77 m/s.
    tip = rotor.inflow.relative_velocity(np.array([0.0, 0.0, case.turbine.rotor.radius]))
    np.testing.assert_allclose(tip, [11.0, 77.0, 0.0])


def test_wake_is_the_trace_of_the_trailing_edge_in_still_axes(rotor, case):
    node = wake_nodes(rotor.lattice, rotor.inflow, wake_ages(rotor.time_step, 50))
    time = 30.25 * rotor.time_step
    # Air that left the blade at -time, when the blade stood at azimuth -Omega time, seen from the blade now.
    still = rotor.lattice.trailing_edge @ rotation_about_x(-case.rotor_speed * time).T + [
        11.0 * time,
        0.0,
        0.0,
    ]
    np.testing.assert_allclose(node[30], still, atol=1e-12)
    # It trails towards +y, behind the blade.
    assert (node[30, :, 1] > rotor.lattice.trailing_edge[:, 1]).all()


def test_components_sum_to_the_blade_itself(rotor, single_blade):
    for both, alone in [
        (rotor.bound_influence, single_blade.bound_influence),
        (rotor.wake_influence, single_blade.wake_influence),
    ]:
        np.testing.assert_allclose(both[0].real + 2 * both[1].real, 3 * alone[0].real, atol=1e-12)


def test_whirl_weighs_the_next_blade_by_a_third_of_a_turn(rotor):
    rng = np.random.default_rng(0)
    gamma = rng.normal(size=100)
    direct = np.zeros(100, dtype=complex)
    for blade in range(3):
        node = rotor.lattice.node @ rotation_about_x(2 * np.pi * blade / 3).T
        velocity = ring_velocity(rotor.collocation, node).reshape(100, 100, 3)
        direct += np.exp(2j * np.pi * blade / 3) * np.einsum("mnx,mx,n->m", velocity, rotor.normal, gamma)
    np.testing.assert_allclose(rotor.bound_influence[1] @ gamma, direct, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("component", [0, 1])
def test_z_domain_equals_marching(component, rotor, case):
    # A growing oscillation from rest: what the start leaves behind is far below the signal at the end.
    steps = 600
    growth = 1.04 * np.exp(2j * np.pi * 0.8 * rotor.time_step)
    phase = np.exp(2j * np.pi * component * np.arange(3) / 3)
    signal = np.real(growth ** np.arange(1.0 - steps, 1.0)[:, None] * phase)
    inputs = np.column_stack([gust_downwash(rotor)[:, 9], flap_downwash(rotor, case.flaps[0])[0]])
    load = root_moment_load(rotor, case)
    response = transfer_function(rotor, component, growth, inputs, load)[0, 0]
    for column, gain in zip(inputs.T, response, strict=True):
        _, force = march(rotor, signal[:, :, None] * column)
        moment = force[-1].reshape(3, -1) @ load[0]
        np.testing.assert_allclose(moment, np.real(gain * phase), atol=1e-9 * abs(gain))


def test_low_frequency_limit_is_the_steady_solution(rotor, case):
    gust = gust_downwash(rotor).sum(axis=1)
    response = transfer_function(rotor, 0, 1.0, gust[:, None], root_moment_load(rotor, case))
    np.testing.assert_allclose(response.item(), steady_root_moment(rotor, case, gust), rtol=1e-12)


@pytest.mark.parametrize("panels", [5, 20, 40])
def test_steady_gains_do_not_depend_on_the_chordwise_count(panels, rotor, case):
    grid = replace(case.discretisation, chordwise_panels=panels)
    if panels == 5:  # the case's flap needs whole panels; the flap alone does not
        fine_case = replace(case, discretisation=grid, flaps=(replace(case.flaps[0], chord_fraction=0.2),))
    else:
        fine_case = replace(case, discretisation=grid)
    fine = build_aerodynamics(fine_case)
    gust = steady_root_moment(rotor, case, gust_downwash(rotor).sum(axis=1))
    assert steady_root_moment(fine, case, gust_downwash(fine).sum(axis=1)) == pytest.approx(gust, rel=1e-3)
    flap = steady_root_moment(rotor, case, flap_downwash(rotor, case.flaps[0])[0])
    assert steady_root_moment(fine, case, flap_downwash(fine, case.flaps[0])[0]) == pytest.approx(
        flap, rel=1e-3
    )


def test_other_blades_take_load_off(rotor, single_blade, case):
    gust = gust_downwash(rotor).sum(axis=1)
    ratio = steady_root_moment(rotor, case, gust) / steady_root_moment(single_blade, case, gust)
    assert 0.90 < ratio < 0.98


def test_gains_have_the_sign_of_lift(rotor, case):
    assert steady_root_moment(rotor, case, gust_downwash(rotor).sum(axis=1)) > 0
    angle, rate = flap_downwash(rotor, case.flaps[0])
    assert steady_root_moment(rotor, case, angle) > 0
    assert steady_root_moment(rotor, case, rate) > 0
    covered = angle.reshape(10, 10) != 0
    assert covered.sum() == 2
    assert covered[9, 7:9].all()


def test_strip_gusts_sum_to_the_homogeneous_gust(rotor):
    strips = gust_downwash(rotor)
    assert strips.shape == (100, 10)
    np.testing.assert_allclose(strips.sum(axis=1), rotor.normal[:, 0])


def test_positions_replace_the_undeformed_axis(rotor, case):
    axis = beam_axis(rotor)
    same = build_aerodynamics(case, blades=1, positions=axis)
    np.testing.assert_allclose(same.lattice.node, rotor.lattice.node, atol=1e-12)
    moved = build_aerodynamics(case, blades=1, positions=axis + [0.5, 0.0, 0.0])
    np.testing.assert_allclose(
        moved.collocation - rotor.collocation, np.tile([0.5, 0.0, 0.0], (100, 1)), atol=1e-12
    )


def test_several_flaps_add_up_to_the_one_they_make_together(rotor, case):
    inner = flap_downwash(rotor, replace(case.flaps[0], span_start=0.55, span_end=0.8))
    outer = flap_downwash(rotor, replace(case.flaps[0], span_start=0.8, span_end=0.93))
    whole = flap_downwash(rotor, replace(case.flaps[0], span_start=0.55, span_end=0.93))
    for parts, together in zip(zip(inner, outer, strict=True), whole, strict=True):
        np.testing.assert_allclose(sum(parts), together, atol=1e-9)


def test_documented_stations_give_the_same_gains_as_even_strips(rotor, case):
    documented = replace(
        case, discretisation=replace(case.discretisation, blade_elements=48, first_lattice_node=11)
    )
    fine = build_aerodynamics(documented)
    assert fine.lattice.strips == 37
    for inputs in (
        lambda aero: gust_downwash(aero).sum(axis=1),
        lambda aero: flap_downwash(aero, case.flaps[0])[0],
    ):
        coarse_gain = steady_root_moment(rotor, case, inputs(rotor))
        assert steady_root_moment(fine, documented, inputs(fine)) == pytest.approx(coarse_gain, rel=0.03)
