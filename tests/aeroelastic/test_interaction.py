"""The tie between beam and lattice: rigid motions, virtual work, and forces that add up."""

import numpy as np
import pytest

from flapgym.aerodynamics import build_aerodynamics, root_moment_load
from flapgym.aeroelastic.blade_lattice import blade_lattice
from flapgym.aeroelastic.equations import root_moment, tip_deflection
from flapgym.aeroelastic.interaction import (
    displacement_downwash,
    hub_turn_downwash,
    interpolation,
    velocity_downwash,
)
from flapgym.structure import linear_blade
from flapgym.structure.rotation import rigid_displacement
from flapgym.turbine import load_case

CASE = load_case("nrel5mw-rated")
RNG = np.random.default_rng(2)


@pytest.fixture(scope="module")
def blade():
    return linear_blade(CASE.turbine, 12, CASE.rotor_speed)


@pytest.fixture(scope="module")
def aero():
    return build_aerodynamics(CASE, blades=1)


def rigid_nodes(blade):
    """Nodal displacements (6 n, 6) of the blade moved as a rigid body about the apex."""
    out = np.zeros((12, 6, 6))
    out[:, :3] = rigid_displacement(blade.position[1:]).reshape(12, 3, 6)
    out[:, 3:, 3:] = np.eye(3)
    return out.reshape(72, 6)


def test_points_follow_a_rigid_motion_of_the_beam_exactly(blade, aero):
    displacement, rotation = interpolation(blade, aero.collocation)
    np.testing.assert_allclose(
        displacement @ rigid_nodes(blade), rigid_displacement(aero.collocation), atol=1e-10
    )
    np.testing.assert_allclose(
        (rotation @ rigid_nodes(blade)).reshape(-1, 3, 6)[:, :, 3:],
        np.broadcast_to(np.eye(3), (100, 3, 3)),
        atol=1e-12,
    )


def test_panel_forces_keep_their_resultant_force_and_moment_on_the_beam(blade, aero):
    displacement, _ = interpolation(blade, aero.force_point)
    force = RNG.standard_normal(aero.force_point.size)
    nodal = displacement.T @ force
    np.testing.assert_allclose(
        rigid_nodes(blade).T @ nodal, rigid_displacement(aero.force_point).T @ force, rtol=1e-10
    )


def test_turning_the_blade_about_the_shaft_meets_the_same_wind(blade, aero):
    displacement, rotation = interpolation(blade, aero.collocation)
    about_shaft = rigid_nodes(blade)[:, 3:4]
    downwash = displacement_downwash(
        aero, CASE.rotor_speed, displacement @ about_shaft, rotation @ about_shaft
    )
    assert np.abs(downwash).max() < 1e-9


def test_pitching_a_section_leading_edge_down_loses_downwash_by_the_relative_speed(blade, aero):
    """A rotation of the blade about its own axis by a small angle changes the normal's dip into the wind."""
    displacement, rotation = interpolation(blade, aero.collocation)
    span = blade.position[-1] - blade.position[0]
    axis = span / np.linalg.norm(span)
    twist = rigid_nodes(blade)[:, 3:] @ axis[:, None]
    ours = displacement_downwash(aero, CASE.rotor_speed, displacement @ twist, rotation @ twist)[:, 0]

    def downwash(angle):
        cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
        turn = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
        point, normal = aero.collocation @ turn.T, aero.normal @ turn.T
        flow = np.array([CASE.operating_point.wind_speed, 0, 0]) - np.cross([CASE.rotor_speed, 0, 0], point)
        return (normal * flow).sum(axis=1)

    np.testing.assert_allclose(ours, (downwash(1e-4) - downwash(-1e-4)) / 2e-4, rtol=1e-6)


def test_moving_downwind_with_the_wind_cancels_a_gust(blade, aero):
    lattice = blade_lattice(CASE, aero, blade, np.eye(72)[:, :1])
    downwind = velocity_downwash(aero, rigid_displacement(aero.collocation))[:, 0]
    np.testing.assert_allclose(-downwind, lattice.downwash @ lattice.select("gust").sum(axis=1), rtol=1e-12)


def test_tilting_the_rotor_is_seen_as_wind_from_below(aero):
    """Turned about y by phi the rotor meets U e_x as U (e_x - phi x e_x): a wind along z."""
    speed = CASE.operating_point.wind_speed
    np.testing.assert_allclose(hub_turn_downwash(aero, speed)[:, 1], speed * aero.normal[:, 2], atol=1e-12)


@pytest.mark.parametrize("axis", [np.eye(3)[1], np.array([0.999, 0.0, 0.0436])], ids=["flap", "edge"])
def test_force_summation_is_the_finite_element_root_reaction(blade, axis):
    """For any motion: load minus inertia, moved to the root, equals what the clamp must bear."""
    q, v, a = RNG.standard_normal((3, 72))
    load = blade.mass @ a + blade.damping @ v + blade.stiffness @ q
    on_apex = rigid_nodes(blade).T @ load
    inertia = blade.mass_rs @ a + blade.damping_rs @ v + blade.stiffness_rs @ q
    summed = root_moment(blade, 0, axis) @ (on_apex - inertia)
    # The loads stand at displaced nodes only in second order, so the linear sum leaves the steady
    # centrifugal force's moment over the displacement to the stiffness terms on both sides.
    reaction = blade.root_mass @ a + blade.root_damping @ v + blade.root_stiffness @ q
    assert summed[0] == pytest.approx(-axis @ reaction[3:], rel=1e-9)


def test_root_moment_row_is_the_lattice_s_own_moment_about_the_root(blade, aero):
    row = root_moment(blade, 0) @ rigid_displacement(aero.force_point).T
    force = aero.force.sum(axis=0) @ RNG.standard_normal(100)
    assert (row @ force)[0] == pytest.approx((root_moment_load(aero, CASE) @ force)[0], rel=1e-5)


def test_tip_deflection_is_normal_to_the_cone_and_downwind():
    row = tip_deflection(CASE, np.eye(72))[0]
    cone = CASE.turbine.rotor.precone
    assert row[66:69] @ [-np.sin(cone), 0.0, np.cos(cone)] == pytest.approx(0.0, abs=1e-15)
    assert row[66] > 0.99
    assert not row[:66].any()
