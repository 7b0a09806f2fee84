"""The march of the moving wake, not linearised, against its linear part."""

from dataclasses import replace

import numpy as np

from benchmarks.wake import march_moving_wake, zero_lift_angles
from flapgym.aerodynamics import build_aerodynamics, moving_wake_response
from flapgym.turbine import load_case


def test_linear_response_is_the_small_limit_of_the_march():
    """A gust that rises and turns past half a diameter of wake, in the bound circulations."""
    case = load_case()
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
