"""Simulated rms against the Lyapunov equation, open and closed loop, within sampling error (design section 5)."""

import numpy as np
import pytest

from flapgym.control import OpenLoop, Weights, lqg_agent, stationary_rms
from flapgym.evaluation import root_mean_square, simulate
from flapgym.model import load_model
from tests.synthetic import synthetic_model

SETTLED = 3000
"""Samples after which the closed loop, which starts with calm flaps, is stationary."""


@pytest.fixture(scope="module", params=["synthetic", "nrel5mw-rated"])
def model(request):
    return synthetic_model() if request.param == "synthetic" else load_model(request.param)


def _assert_within_sampling_error(series, expected):
    """Mean square over independent realisations: its standard error is theirs over the square root of their number."""
    squares = np.square(root_mean_square(series, axis=1)).reshape(series.shape[0], -1).mean(axis=1)
    error = squares.std(ddof=1) / np.sqrt(squares.size)
    assert abs(squares.mean() - expected**2) < 4.0 * error
    # The test must be able to fail: the error it allows is a small part of the value.
    assert 4.0 * error < 0.5 * expected**2


def _check(record, rms):
    _assert_within_sampling_error(record.rbm[:, SETTLED:], rms["rbm"])
    _assert_within_sampling_error(record.tip_deflection[:, SETTLED:], rms["tip_deflection"])
    _assert_within_sampling_error(record.tower_fore_aft[:, SETTLED:], rms["tower_fore_aft"])
    _assert_within_sampling_error(record.wind[:, SETTLED:], rms["wind"])


def test_open_loop_rms_agrees_with_the_lyapunov_equation(model):
    rms = stationary_rms(model)
    assert rms["rbm"] == pytest.approx(model.rbm_rms, rel=5e-3)
    _check(simulate(OpenLoop(), model, range(100, 196), 60.0), rms)


def test_closed_loop_rms_of_an_unsaturated_lqg_agrees_with_the_lyapunov_equation(model):
    agent = lqg_agent("lqg", model, Weights(0.25))
    record = simulate(agent, model, range(100, 148), 60.0)
    assert np.abs(record.flap_angle).max() < model.flaps[0].angle_limit
    rms = stationary_rms(model, agent.system)
    _check(record, rms)
    _assert_within_sampling_error(record.flap_angle[:, SETTLED:], rms["flap_angle"])


def test_paired_reduction_agrees_with_the_lyapunov_equation_to_a_percent(model):
    """The same wind in both: the ratio is far better known than either rms."""
    agent = lqg_agent("lqg", model, Weights(0.25))
    seeds = range(300, 316)
    with_flap, without = (simulate(each, model, seeds, 60.0) for each in (agent, OpenLoop()))
    ratio = root_mean_square(with_flap.rbm[:, SETTLED:], axis=None) / root_mean_square(
        without.rbm[:, SETTLED:], axis=None
    )
    expected = stationary_rms(model, agent.system)["rbm"] / stationary_rms(model)["rbm"]
    assert ratio == pytest.approx(expected, abs=0.01)
