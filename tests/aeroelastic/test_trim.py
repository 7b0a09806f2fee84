"""The aeroelastic equilibrium: balanced, independent of the path, and near what others publish."""

from dataclasses import replace

import numpy as np
import pytest

from flapgym.aeroelastic.trim import nodal_load, trim
from flapgym.structure import linear_blade
from flapgym.structure.rotation import rigid_displacement
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
