"""The sections in the mean load: drag, pitching moment and elastic axis by hand; lift slopes in two dimensions."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import hankel2

from flapgym.aerodynamics import build_aerodynamics, mean_loads, steady_circulation, transfer_function
from flapgym.aerodynamics.lattice import Inflow, build_lattice
from flapgym.aerodynamics.model import assemble
from flapgym.aerodynamics.rotor import blade_edges, elastic_axis
from flapgym.aerodynamics.steady import Sections, incidence_downwash, profile_loads, sections

CHORD, SPAN, SPEED, DENSITY = 2.0, 3.0, 40.0, 1.2
CHORD_OF_LONG_WING = 0.5


def lone_wing(leading, trailing, velocity, panels=4, **size):
    """A straight wing in translation, wake rows as long as its panels."""
    flow = np.asarray(velocity, dtype=float)
    inflow = Inflow(velocity=flow, rotor_speed=0.0, wake_velocity=flow)
    step = np.linalg.norm(trailing[0] - leading[0]) / panels / np.linalg.norm(flow)
    lattice = build_lattice(leading, trailing, panels, inflow, step)
    return assemble(lattice, inflow, time_step=step, air_density=DENSITY, **{"wake_rows": 2, **size})


@pytest.fixture
def wing():
    """Chord along y, span along z from root to tip, wind along y with a part along the span."""
    leading = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.5 * SPAN], [0.0, 0.0, SPAN]])
    return lone_wing(leading, leading + [0.0, CHORD, 0.0], [0.0, SPEED, 15.0])


def test_drag_and_moment_of_a_strip_are_coefficient_times_pressure_times_area(wing):
    found = Sections(incidence=np.zeros(2), drag=np.array([0.01, 0.02]), moment=np.array([-0.1, -0.05]))
    point, drag, moment = profile_loads(wing, found)
    # The wind's part along the span loads nothing: 0.5 x 1.2 x 40^2 = 960 Pa, 3 m^2 a strip.
    np.testing.assert_allclose(drag, [[0.0, 28.8, 0.0], [0.0, 57.6, 0.0]], atol=1e-9)
    np.testing.assert_allclose(moment, [[0.0, 0.0, -576.0], [0.0, 0.0, -288.0]], atol=1e-9)
    np.testing.assert_allclose(point, [[0.0, 0.5, 0.75], [0.0, 0.5, 2.25]], atol=1e-12)


def test_moment_is_positive_where_it_raises_the_incidence(wing):
    """Turned by a small positive moment's axis, the wing meets the wind with more downwash."""
    _, _, moment = profile_loads(wing, Sections(np.zeros(2), np.zeros(2), np.full(2, 0.1)))
    axis = moment[0] / np.linalg.norm(moment[0])
    chord = np.array([0.0, CHORD, 0.0])
    turned = chord + 0.01 * np.cross(axis, chord)
    leading = wing.lattice.leading_edge
    nose_up = lone_wing(leading, leading + turned, wing.inflow.velocity)
    level, raised = (incidence_downwash(aero, np.zeros(2)) for aero in (wing, nose_up))
    np.testing.assert_allclose(raised - level, 0.01 * SPEED, rtol=1e-3)


def test_incidence_is_read_from_a_flat_plate_s_circulation(case, rotor):
    """Gamma = pi c V (alpha - alpha_0): the strips' incidence and the drag of the NACA 64 polar on the outer blade."""
    chord = np.linalg.norm(rotor.lattice.chord_vector, axis=1)
    quarter = rotor.lattice.on_surface(np.array([0.25]))[0]
    middle = 0.5 * (quarter[1:] + quarter[:-1])
    along = np.diff(quarter, axis=0)
    along /= np.linalg.norm(along, axis=1)[:, None]
    flow = np.array([11.0, 0.0, 0.0]) - np.cross([case.rotor_speed, 0.0, 0.0], middle)
    speed = np.linalg.norm(np.cross(flow, along), axis=1)
    wanted = np.radians(5.0)
    zero_lift = np.radians(-3.88)  # of the NACA 64, outboard of 44.55 m
    circulation = np.tile(np.pi * chord * speed * (wanted - zero_lift), 10)
    found = sections(case, rotor, circulation)
    np.testing.assert_allclose(found.incidence[-4:], wanted, rtol=1e-6)
    np.testing.assert_allclose(found.drag[-4:], 0.0058, rtol=1e-6)
    np.testing.assert_allclose(found.moment[-4:], -0.1240, rtol=1e-6)


def test_profile_adds_drag_and_moment_and_leaves_the_lift(case, rotor):
    plain = mean_loads(case, rotor)
    whole = mean_loads(replace(case, airloads=replace(case.airloads, profile="mean")), rotor)
    np.testing.assert_array_equal(whole.circulation, plain.circulation)
    # Drag of some 0.006 to 0.01 at a lift of some 1, with the flow at 6 to 20 degrees to the rotor's plane.
    assert 0.93 < whole.torque / plain.torque < 0.98
    assert 1.0 < whole.thrust / plain.thrust < 1.01
    along = np.diff(rotor.lattice.on_surface(np.array([0.25]))[0], axis=0)
    assert (np.einsum("si,si->s", whole.couple, along) < 0.0).all()  # nose down


def published(case):
    return replace(case, airloads=replace(case.airloads, elastic_axis="published"))


def test_beam_runs_through_the_published_fraction_of_the_chords(case):
    """Half the chord at the root, 37.5 % from 13.7 m outboard, 40.931 % at 10.7 m."""
    radius = np.array([1.5, 10.7, 13.7, 30.0, 63.0])
    fraction = [0.5, 0.40931, 0.375, 0.375, 0.375]
    np.testing.assert_allclose(elastic_axis(published(case), radius), fraction)
    axis = radius[:, None] * np.array([0.1, 0.0, 1.0])
    leading, trailing = blade_edges(published(case), radius, axis)
    on_axis = leading + np.array(fraction)[:, None] * (trailing - leading)
    np.testing.assert_allclose(on_axis, axis, atol=1e-9)
    chord = np.interp(radius, case.turbine.planform.radius, case.turbine.planform.chord)
    np.testing.assert_allclose(np.linalg.norm(trailing - leading, axis=1), chord)


def test_paper_s_beam_runs_through_the_quarter_chords(case):
    radius = np.linspace(1.5, 63.0, 5)
    axis = radius[:, None] * np.array([0.0, 0.0, 1.0])
    leading, trailing = blade_edges(case, radius, axis)
    np.testing.assert_allclose(0.75 * leading + 0.25 * trailing, axis, atol=1e-12)


def test_published_axis_moves_the_lattice_ahead_and_leaves_its_loads(case, rotor):
    """An eighth of a chord towards the leading edge, by which a straight, rigid rotor hardly changes."""
    moved = build_aerodynamics(published(case))
    step = moved.lattice.leading_edge[1:] - rotor.lattice.leading_edge[1:]
    chord = rotor.lattice.trailing_edge[1:] - rotor.lattice.leading_edge[1:]
    np.testing.assert_allclose(step, -0.125 * chord, atol=1e-9)
    ours, theirs = mean_loads(published(case), moved), mean_loads(case, rotor)
    assert ours.thrust == pytest.approx(theirs.thrust, rel=0.01)


def long_wing(slope, **size):
    leading = np.array([[0.0, 0.0, -5e3], [0.0, 0.0, 5e3]])
    slopes = None if slope is None else np.array([slope])
    return lone_wing(
        leading, leading + [0.0, CHORD_OF_LONG_WING, 0.0], [0.0, 1.0, 0.0], lift_slope=slopes, **size
    )


@pytest.mark.parametrize("slope", [5.0, 7.3])
def test_long_straight_wing_has_the_lift_slope_it_is_given(slope):
    wing = long_wing(slope, wake_rows=800, wake_end="open")
    steady = steady_circulation(wing, np.ones((4, 1)))
    # Half the chord times the speed times the lift coefficient.
    np.testing.assert_allclose(steady[-1], 0.5 * CHORD_OF_LONG_WING * slope, rtol=2e-3)


def test_slope_of_a_flat_plate_changes_nothing():
    plain, given = long_wing(None), long_wing(2.0 * np.pi)
    np.testing.assert_allclose(given.bound_pair, plain.bound_pair, rtol=1e-12)


@pytest.mark.parametrize("slope", [2.0 * np.pi, 5.0, 7.3])
@pytest.mark.parametrize("reduced_frequency", [0.05, 0.3])
def test_section_s_own_wake_acts_on_it_with_the_same_slope(slope, reduced_frequency):
    """Circulation in a flow that oscillates, after von Karman and Sears (1938): a plate's wake takes G - Gamma off it.

    Gamma = G / R, R = -(i pi k / 2) e^ik (H1 + i H0), so that the wake takes (R - 1) Gamma; where a section answers
    with s times a plate's circulation, Gamma = s (G - (R - 1) Gamma).
    """
    panels, k, share = 40, reduced_frequency, slope / (2.0 * np.pi)
    wing = long_wing(slope, panels=panels, wake_rows=100 * panels, wake_end="open")
    n = wing.normal.shape[0]
    around = replace(wing, force=np.eye(n)[None])  # the circulations themselves in place of forces
    z = np.exp(1j * k / (0.5 * CHORD_OF_LONG_WING) * wing.time_step)
    response = transfer_function(around, 0, z, np.ones((n, 1)), np.eye(n)[-1:]).item()
    resistance = -0.5j * np.pi * k * np.exp(1j * k) * (hankel2(1, k) + 1j * hankel2(0, k))
    wanted = np.pi * CHORD_OF_LONG_WING * share / (1.0 + share * (resistance - 1.0))
    assert abs(response - wanted) < 0.01 * abs(wanted)
