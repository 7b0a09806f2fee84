"""The march of the moving wake against its linear part, and the step of wind against a free wake's."""

from dataclasses import replace

import numpy as np

from benchmarks.wake import (
    DURATION,
    FREE_WAKE,
    figures,
    march_moving_wake,
    shed_by,
    step_responses,
    with_lift_slope,
    working_slopes,
    zero_lift_angles,
)
from flapgym.aerodynamics import build_aerodynamics, moving_wake_response, steady_circulation, wake_transport
from flapgym.aerodynamics.lattice import Inflow, build_lattice
from flapgym.aerodynamics.model import assemble
from flapgym.turbine import load_case


def test_linear_response_is_the_small_limit_of_the_march():
    """A gust that rises and turns past half a diameter of wake, in the bound circulations."""
    case = load_case("nrel5mw-rated")
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


def test_step_of_wind_has_the_level_of_the_free_wake_with_its_lift_slopes():
    case = load_case("nrel5mw-rated")
    shed = shed_by(case)
    found = step_responses(case, wake_transport(case, shed), shed, working_slopes(case))
    for name, within in (("moving, 2 D", 0.07), ("short and state", 0.08)):
        time = np.linspace(0.0, DURATION, len(found[name]))
        np.testing.assert_allclose(figures(time, found[name]), FREE_WAKE, rtol=within)


def test_a_long_straight_wing_has_the_lift_slope_it_is_given():
    flow = np.array([0.0, 1.0, 0.0])
    leading = np.array([[0.0, 0.0, -5e3], [0.0, 0.0, 5e3]])
    inflow = Inflow(velocity=flow, rotor_speed=0.0, wake_velocity=flow)
    lattice = build_lattice(leading, leading + 0.5 * flow, 4, inflow, 0.125)
    wing = assemble(lattice, inflow, time_step=0.125, wake_rows=800, air_density=1.0, wake_end="open")
    steady = steady_circulation(with_lift_slope(wing, np.array([0.8])), np.ones((4, 1)))
    # Half the chord times the speed times the lift coefficient.
    np.testing.assert_allclose(steady[-1], 0.5 * 0.5 * 0.8 * 2.0 * np.pi, rtol=2e-3)
