"""The reduced model keeps what it promises, measured in time on fresh inputs."""

import numpy as np
import pytest

from flapgym.core.multiblade import to_blades, to_components
from flapgym.model import load_model
from flapgym.model.reduced import activity, reduced_model

MODEL = load_model("nrel5mw-rated")


def test_reduced_model_keeps_every_output_within_its_tolerance_in_simulation():
    reduced = reduced_model(MODEL, 1e-2)
    assert reduced.turbine.order < 100
    u = activity(MODEL).simulate(np.random.default_rng(4).standard_normal((40_000, 7)))
    exact, ours = MODEL.turbine.simulate(u)[5000:], reduced.turbine.simulate(u)[5000:]
    error = np.sqrt(((ours - exact) ** 2).mean(axis=0) / (exact**2).mean(axis=0))
    assert error.max() < 1.5e-2  # the tolerance and the sampling error of 280 s


def test_activity_moves_each_blade_s_flap_by_itself_by_half_its_stop_and_the_wind_by_its_intensity():
    driven = activity(MODEL)
    covariance = driven.C @ driven.stationary_covariance() @ driven.C.T
    angle = 0.5 * MODEL.flaps[0].angle_limit
    for azimuth in (0.0, 0.9):
        to_blade = to_blades(np.eye(3), azimuth)  # rows: components
        flaps = to_blade.T @ covariance[:3, :3] @ to_blade
        np.testing.assert_allclose(flaps, angle**2 * np.eye(3), atol=1e-9 * angle**2)
    assert covariance[6, 6] == pytest.approx((MODEL.turbulence_intensity * MODEL.wind_speed) ** 2, rel=1e-9)


def test_activity_s_flaps_move_on_their_blades_as_one_filter_whatever_the_azimuth():
    """One step without noise, read on the blades before and after the turn: rate times step, to second order."""
    driven = activity(MODEL)
    dt, states = MODEL.time_step, driven.order - 6
    blades = np.array([0.05, -0.03, 0.01]), np.array([0.2, 0.1, -0.3])
    x = np.zeros(driven.order)
    x[states::2], x[states + 1 :: 2] = (to_components(part, 0.7) for part in blades)
    after = driven.A @ x
    angle, rate = (
        to_blades(part, 0.7 + MODEL.rotor_speed * dt) for part in (after[states::2], after[states + 1 :: 2])
    )
    np.testing.assert_allclose(angle - blades[0], 0.5 * dt * (rate + blades[1]), atol=1e-3 * dt)


@pytest.mark.parametrize("tolerance", [0.0, 1.0, float("nan")])
def test_tolerance_out_of_range_is_refused(tolerance):
    with pytest.raises(ValueError, match=r"tolerance: expected 0 < number < 1"):
        reduced_model(MODEL, tolerance)
