"""The lattice in the two-dimensional limit against the closed forms of thin-aerofoil theory."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import jv

from flapgym.aerodynamics import flap_downwash, march, steady_circulation, transfer_function
from flapgym.aerodynamics.downwash import flap_cover, glauert_lift, glauert_scale, panel_lift, span_cover
from tests.aerodynamics.wings import straight_wing, theodorsen

LOW = np.array([0.02, 0.05, 0.1])
HIGH = np.array([0.2, 0.3])
ACCURACY = [(LOW, 1.0, 0.015), (LOW, 4.0, 0.015), (HIGH, 1.0, 0.05), (HIGH, 2.0, 0.05), (HIGH, 4.0, 0.05)]


def lift_response(wing, k, downwash):
    """Lift coefficient per input, shape (k, inputs)."""
    z = np.exp(2j * k * wing.aero.time_step)
    return transfer_function(wing.aero, 0, z, downwash, wing.lift_load)[:, 0]


@pytest.mark.parametrize("k, courant, tolerance", ACCURACY)
def test_plunge_is_theodorsens(k, courant, tolerance):
    wing = straight_wing(courant=courant)
    response = lift_response(wing, k, np.ones((10, 1)))[:, 0]
    expected = 2 * np.pi * theodorsen(k) + np.pi * 1j * k
    np.testing.assert_array_less(np.abs(response / expected - 1), tolerance)


@pytest.mark.parametrize("k, courant, tolerance", ACCURACY)
def test_pitch_about_mid_chord_is_theodorsens(k, courant, tolerance):
    wing = straight_wing(courant=courant)
    by_angle, by_rate = lift_response(wing, k, np.stack([np.ones(10), wing.station - 0.5], axis=1)).T
    response = by_angle + 2j * k * by_rate
    expected = 2 * np.pi * theodorsen(k) * (1 + 0.5j * k) + np.pi * 1j * k
    np.testing.assert_array_less(np.abs(response / expected - 1), tolerance)


@pytest.mark.parametrize("k, courant, tolerance", ACCURACY)
def test_flap_is_theodorsens(k, courant, tolerance, case):
    wing = straight_wing(courant=courant)
    flap = replace(case.flaps[0], span_start=0.0, span_end=1.0, chord_fraction=0.1, effectiveness="glauert")
    by_angle, by_rate = lift_response(wing, k, np.stack(flap_downwash(wing.aero, flap), axis=1)).T
    response = by_angle + 2j * k * by_rate
    # Hinge at c semichords behind mid-chord; T-functions of NACA report 496.
    c = 0.8
    root, arc = np.sqrt(1 - c**2), np.arccos(c)
    t1, t4 = -root * (2 + c**2) / 3 + c * arc, -arc + c * root
    t10, t11 = root + arc, arc * (1 - 2 * c) + root * (2 - c)
    circulatory = 2 * np.pi * theodorsen(k) * (t10 / np.pi + 1j * k * t11 / (2 * np.pi))
    expected = circulatory - 1j * k * t4 + k**2 * t1
    np.testing.assert_array_less(np.abs(response / expected - 1), tolerance)


@pytest.mark.parametrize("k, courant, tolerance", ACCURACY)
def test_convected_gust_is_sears(k, courant, tolerance):
    wing = straight_wing(courant=courant)
    gust = [np.exp(-2j * kk * (wing.station - 0.5))[:, None] for kk in k]
    response = np.array([lift_response(wing, kk[None], g)[0, 0] for kk, g in zip(k, gust, strict=True)])
    bessel = jv(0, k) - 1j * jv(1, k)
    expected = 2 * np.pi * (bessel * theodorsen(k) + 1j * jv(1, k))
    np.testing.assert_array_less(np.abs(response / expected - 1), tolerance)


def test_sudden_incidence_is_wagners():
    wing = straight_wing(panels=20, wake_chords=10.5)
    steps = 210
    _, force = march(wing.aero, np.ones((steps, 1, 20)))
    lift = force.reshape(steps, -1) @ wing.lift_load[0] / (2 * np.pi)
    # The incidence appears within the first step: on average half a step before the first sample.
    travelled = 2.0 * (np.arange(steps) + 0.5) * wing.aero.time_step
    s = [0.5, 1.0, 2.0, 5.0, 10.0, 20.0]
    wagner = [0.5557, 0.6006, 0.6693, 0.7882, 0.8750, 0.9367]
    np.testing.assert_allclose(np.interp(s, travelled, lift), wagner, rtol=0.015)


def test_open_wake_has_no_starting_vortex_and_gives_the_full_steady_lift():
    wing = straight_wing(wake_chords=20.0, wake_end="open")
    lift = wing.lift_load @ wing.aero.force.sum(axis=0) @ steady_circulation(wing.aero, np.ones((10, 1)))
    assert lift[0, 0] == pytest.approx(2.0 * np.pi, rel=1e-5)


def test_steady_lift_with_a_hundred_chords_of_wake():
    wing = straight_wing()
    lift = wing.lift_load @ wing.aero.force.sum(axis=0) @ steady_circulation(wing.aero, np.ones((10, 1)))
    np.testing.assert_allclose(lift, 2 * np.pi, rtol=0.006)


@pytest.mark.parametrize("panels, ratio", [(5, 1.608), (10, 1.1232), (20, 1.0615), (40, 1.0305)])
def test_flap_lift_is_glauerts_at_any_number_of_panels(panels, ratio, case):
    assert glauert_scale(panels, 0.1) == pytest.approx(ratio, abs=5e-4)
    wing = straight_wing(panels)
    flap = replace(case.flaps[0], span_start=0.0, span_end=1.0, chord_fraction=0.1, effectiveness="glauert")
    angle, _ = flap_downwash(wing.aero, flap)
    steady = wing.aero.force.sum(axis=0) @ steady_circulation(wing.aero, angle[:, None])
    np.testing.assert_allclose(wing.lift_load @ steady, 2.4870, rtol=0.01)
    # The moment is not scaled to: it is out by 8 % where half a panel stands for the flap, by 4 % at one panel.
    np.testing.assert_allclose(wing.moment_load @ steady, -0.5400, rtol=0.09 if panels == 5 else 0.04)


def test_flap_scaled_by_a_number_and_partly_covering_strips(case):
    wing = straight_wing(strips=4)
    flap = replace(case.flaps[0], span_start=0.125, span_end=0.5, chord_fraction=0.2, effectiveness=1.0)
    angle, rate = flap_downwash(wing.aero, flap)
    expected = np.zeros((10, 4))
    expected[8:] = [0.5, 1.0, 0.0, 0.0]
    np.testing.assert_allclose(angle.reshape(10, 4), expected, atol=1e-12)
    arm = np.array([0.0] * 8 + [0.075, 0.175])
    np.testing.assert_allclose(rate.reshape(10, 4), expected * arm[:, None], atol=1e-12)


def test_flap_ends_keep_to_uneven_strips():
    edge = np.array([0.0, 1.0, 3.0, 6.0, 10.0])
    np.testing.assert_allclose(span_cover(edge, 0.05, 0.45), [0.5, 1.0, 0.5, 0.0])
    # A rounding of the radii does not give the neighbouring strips a sliver of flap.
    np.testing.assert_array_equal(span_cover(edge, 0.1004, 0.6003), [0.0, 1.0, 1.0, 0.0])


def test_lattice_lift_of_a_turned_aerofoil_is_exact():
    np.testing.assert_allclose([panel_lift(np.ones(n)) for n in (1, 5, 40)], 2 * np.pi, rtol=1e-12)
    assert glauert_lift(1.0) == pytest.approx(2 * np.pi)
    np.testing.assert_allclose([glauert_lift(0.1), glauert_lift(0.2)], [2.4870, 3.4546], rtol=1e-4)


def test_flap_cover_sums_to_the_flap():
    for panels, fraction in [(5, 0.1), (10, 0.1), (10, 0.25), (40, 0.1), (7, 0.3)]:
        assert flap_cover(panels, fraction)[0].sum() / panels == pytest.approx(fraction)
