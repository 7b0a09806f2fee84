"""The march of the moving wake against its linear part, and the step of wind against a free wake's."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.wake import (
    DURATION,
    FREE_WAKE,
    at_work,
    figures,
    march_moving_wake,
    rigid_step,
    shed_by,
    terms,
    wake_steps,
)
from flapgym.aerodynamics import build_aerodynamics, moving_wake_response, wake_transport
from flapgym.aerodynamics.rotor import lift_slopes, zero_lift_angles
from flapgym.turbine import load_case

CORRECTED = load_case("nrel5mw-corrected")


def test_linear_response_is_the_small_limit_of_the_march():
    """A gust that rises and turns past half a diameter of wake, in the bound circulations."""
    case = load_case("nrel5mw-rated")  # flat plates: the march knows no other slope
    grid = replace(case.discretisation, chordwise_panels=3, time_step=0.07, wake_length=0.5)
    case = replace(case, discretisation=grid)
    aero = build_aerodynamics(case)
    wind = 0.01 * np.concatenate([np.linspace(0.0, 1.0, 15), np.linspace(1.0, -0.5, 25)])
    circulation = march_moving_wake(aero, zero_lift_angles(case), wind)
    n, strips = circulation.shape[1], aero.lattice.strips
    as_load = replace(aero, force=np.eye(n)[None])  # the circulations themselves in place of forces
    linear = moving_wake_response(as_load, circulation[0, -strips:], wind, np.eye(n))
    change = circulation - circulation[0]
    np.testing.assert_allclose(change, linear, atol=2e-4 * np.abs(change).max())


@pytest.fixture(scope="module")
def shed():
    return shed_by(CORRECTED)


def test_step_of_wind_comes_to_the_level_of_the_free_wake_with_the_slopes_of_its_polars(shed):
    """Of the corrected rotor's excess of 10 to 13 percent the slopes make three; ten even strips leave two more."""
    state, of = wake_transport(CORRECTED, shed).wind, terms(CORRECTED)
    over = []
    for name in ("the state: the corrected turbine", "lift slopes of the polars from 4 to 6 degrees"):
        moment = rigid_step(of[name][0], state)
        over.append(figures(np.linspace(0.0, DURATION, len(moment)), moment) / FREE_WAKE)
    assert (over[0] < 1.15).all()
    np.testing.assert_allclose(over[1] / over[0], 0.97, atol=0.01)
    np.testing.assert_allclose(over[1], 1.0, atol=0.1)


def test_long_fixed_wake_falls_far_more_after_its_peak_than_the_free_wake(shed):
    falls = {}
    for name, moment in wake_steps(CORRECTED, shed).items():
        _, peak, end = figures(np.linspace(0.0, DURATION, len(moment)), moment)
        falls[name] = end / peak
    wanted = FREE_WAKE[2] / FREE_WAKE[1]
    assert falls["fixed, 2 D"] < wanted - 0.08
    for name in ("moving, 2 D", "short and state"):
        np.testing.assert_allclose(falls[name], wanted, atol=0.01)


def test_slope_at_work_is_read_from_the_polar():
    """NACA 64: lift coefficients of 0.898 and 1.103 at 4 and 6 degrees, on the outer blade."""
    np.testing.assert_allclose(lift_slopes(at_work(CORRECTED))[-4:], (1.103 - 0.898) / np.radians(2.0))
