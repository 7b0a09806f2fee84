"""The compact model keeps what it promises, measured in time on fresh inputs."""

import numpy as np
import pytest

from flapgym.aeroelastic import load_model
from flapgym.aeroelastic.compact import activity, compact_model

MODEL = load_model()


def test_compact_model_keeps_every_output_within_its_tolerance_in_simulation():
    compact = compact_model(MODEL, 1e-2)
    assert compact.turbine.order < 100
    u = activity(MODEL).simulate(np.random.default_rng(4).standard_normal((40_000, 7)))
    exact, ours = MODEL.turbine.simulate(u)[5000:], compact.turbine.simulate(u)[5000:]
    error = np.sqrt(((ours - exact) ** 2).mean(axis=0) / (exact**2).mean(axis=0))
    assert error.max() < 1.5e-2  # the tolerance and the sampling error of 280 s


def test_activity_moves_flaps_by_half_their_stop_and_wind_by_its_intensity():
    driven = activity(MODEL)
    covariance = driven.C @ driven.stationary_covariance() @ driven.C.T + driven.D @ driven.D.T
    rms = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(rms[:3], 0.5 * MODEL.flap_angle_limit, rtol=1e-9)
    assert rms[6] == pytest.approx(MODEL.turbulence_intensity * MODEL.wind_speed, rel=1e-9)


@pytest.mark.parametrize("tolerance", [0.0, 1.0, float("nan")])
def test_tolerance_out_of_range_is_refused(tolerance):
    with pytest.raises(ValueError, match=r"tolerance: expected 0 < tolerance < 1"):
        compact_model(MODEL, tolerance)
