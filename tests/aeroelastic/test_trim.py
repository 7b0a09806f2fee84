"""The aeroelastic equilibrium: balanced, independent of the path, and near what others publish."""

from dataclasses import replace

import numpy as np
import pytest

from flapgym.aeroelastic.trim import nodal_load, trim
from flapgym.structure import linear_blade
from flapgym.structure.rotation import rigid_displacement, rotation_vector
from flapgym.turbine import load_case

CASE = load_case("nrel5mw-rated")
# A coarse lattice with a short wake, where only the path to balance matters.
COARSE = replace(CASE, discretisation=replace(CASE.discretisation, chordwise_panels=3, wake_length=0.05))


@pytest.fixture(scope="module")
def balance():
    return trim(CASE)


def test_root_bears_the_mean_load_and_the_centrifugal_force(balance):
    """Global balance of the deflected blade, from forces and masses alone."""
    blade, loads = balance.blade, balance.loads
    moment = np.cross(loads.force_point - blade.position[0], loads.force).sum(axis=0)
    inertial = blade.hub_load[:3], blade.hub_load[3:]  # what hub and load exert together, about the apex
    expected = inertial[1] - np.cross(blade.position[0], inertial[0]) - moment
    np.testing.assert_allclose(blade.root_load[3:], expected, rtol=1e-4, atol=1e2)


def test_mean_load_reaches_the_nodes_with_its_force_and_moment(balance):
    load = nodal_load(balance.blade, balance.loads)
    at_nodes = rigid_displacement(balance.blade.position).reshape(-1, 3, 6)
    resultant = np.einsum("nij,ni->j", at_nodes, load[:, :3])
    resultant[3:] += load[:, 3:].sum(axis=0)
    panels = rigid_displacement(balance.loads.force_point).T @ balance.loads.force.ravel()
    np.testing.assert_allclose(resultant, panels, rtol=1e-9, atol=1e-6)


def test_tip_deflects_downwind_by_what_the_turbine_s_definition_shows_below_rated(balance):
    """Jonkman et al. (2009), Figure 9-2: some 5 to 5.5 m out of plane at rated wind; rigid drag-free lift is more."""
    straight = linear_blade(CASE.turbine, 12).position[-1]
    deflection = balance.blade.position[-1] - straight
    assert 4.5 < deflection[0] < 6.5
    assert -1.5 < deflection[1] < 0.0  # the lift also pulls the blade forward, in the sense of rotation


def test_light_wind_bends_the_blade_less_and_settles_as_fast():
    light = replace(COARSE, operating_point=replace(CASE.operating_point, wind_speed=5.0))
    balance = trim(light)
    centrifugal = linear_blade(light.turbine, 12, light.rotor_speed)
    moved = balance.blade.position[-1] - centrifugal.position[-1]
    assert 0.0 < moved[0] < 3.0
    assert balance.iterations < 10


def test_unsettled_trim_says_how_far_apart_it_is(monkeypatch):
    monkeypatch.setattr("flapgym.aeroelastic.trim.MAX_ITERATIONS", 2)
    with pytest.raises(ValueError, match="still move by .* m after 2 rounds"):
        trim(COARSE)


@pytest.fixture(scope="module")
def corrected():
    """The corrected turbine's balance, on three panels along the chord, which move no figure here by a thousandth."""
    case = load_case("nrel5mw-corrected")
    grid = replace(case.discretisation, chordwise_panels=3, time_step=0.0233)
    return trim(replace(case, discretisation=grid))


def test_corrected_blade_carries_the_mean_loads_of_openfast(corrected):
    """BeamDyn: 9.205 MN m at the root and 5.12 m at the tip; blade element momentum theory: a torque of 4.07 MN m."""
    blade = corrected.blade
    assert -blade.root_load[4] == pytest.approx(9.205e6, rel=0.03)
    cone = CASE.turbine.rotor.precone
    bent = blade.position[-1] - linear_blade(CASE.turbine, 12).position[-1]
    assert bent @ [np.cos(cone), 0.0, np.sin(cone)] == pytest.approx(5.12, rel=0.05)
    assert corrected.loads.torque == pytest.approx(4.07e6, rel=0.05)


def test_corrected_wake_is_slowed_by_the_induction_of_its_own_thrust(corrected):
    induction = corrected.induction
    assert corrected.loads.thrust_coefficient == pytest.approx(4.0 * induction * (1.0 - induction), rel=1e-6)
    wind = CASE.operating_point.wind_speed
    assert corrected.mean.inflow.wake_velocity[0] == pytest.approx((1.0 - induction) * wind)
    assert corrected.rotor.inflow.wake_velocity[0] == pytest.approx(wind)


def test_root_bears_drag_and_pitching_moments_too(corrected):
    """Global balance as above, the sections' moments among the loads."""
    blade, loads = corrected.blade, corrected.loads
    moment = np.cross(loads.force_point - blade.position[0], loads.force).sum(axis=0) + loads.couple.sum(
        axis=0
    )
    inertial = blade.hub_load[:3], blade.hub_load[3:]
    expected = inertial[1] - np.cross(blade.position[0], inertial[0]) - moment
    np.testing.assert_allclose(blade.root_load[3:], expected, rtol=1e-4, atol=1e2)


def test_sections_moments_undo_the_twist_that_lift_ahead_of_the_axis_makes(corrected):
    """The lift an eighth of a chord ahead of the axis twists the tip nose up by some 4 degrees, the moments undo it."""
    case = load_case("nrel5mw-corrected")
    grid = replace(case.discretisation, chordwise_panels=3, time_step=0.0233)
    bare = trim(replace(case, discretisation=grid, airloads=replace(case.airloads, profile="none")))
    twist = []
    for blade in (corrected.blade, bare.blade):
        turned = blade.orientation[-1] @ linear_blade(CASE.turbine, 12).orientation[-1].T
        along = blade.position[-1] - blade.position[-2]
        twist.append(np.degrees(rotation_vector(turned) @ along / np.linalg.norm(along)))
    assert abs(twist[0]) < 0.5
    assert 2.5 < twist[1] - twist[0] < 4.5


def test_balance_in_the_perturbations_wake_knows_neither_their_lift_slopes_nor_an_induction():
    sections = replace(COARSE, airloads=replace(COARSE.airloads, lift_slope="sections"))
    ours, theirs = trim(sections), trim(COARSE)
    np.testing.assert_array_equal(ours.blade.position, theirs.blade.position)
    assert ours.induction == theirs.induction == COARSE.discretisation.induction
    assert np.abs(ours.rotor.bound_pair - theirs.rotor.bound_pair).max() > 0.01
