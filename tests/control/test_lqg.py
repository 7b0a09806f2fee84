"""The LQG synthesis as identities: Riccati residuals, separation, cost, error covariance."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from flapgym.control.lqg import (
    RBM_UNIT,
    Weights,
    design_model,
    initial_estimate,
    predictor_gain,
    regulator_gain,
    synthesise,
    with_actuator,
)
from flapgym.core.state_space import StateSpace
from tests.synthetic import synthetic_model

WEIGHTS = Weights(rbm=5.0)


@pytest.fixture(scope="module")
def design():
    return design_model(synthetic_model())


@pytest.fixture(scope="module")
def design_with_feedthrough(design):
    """The same with white noise that also reaches the measurement at once."""
    return replace(design, H=np.array([[0.02]]))


def _noise(design):
    return (WEIGHTS.measurement_noise * design.rbm_rms) ** 2


def test_regulator_solves_its_riccati_equation(design):
    a, b, c = with_actuator(design)
    gain, x = regulator_gain(design, WEIGHTS)
    q = WEIGHTS.rbm * c.T @ c
    q[-2, -2] += WEIGHTS.flap_angle
    residual = a.T @ x @ (a - b @ gain) + q - x
    assert np.abs(residual).max() < 1e-10 * np.abs(x).max()


def test_predictor_solves_its_riccati_equation_with_cross_covariance(design_with_feedthrough):
    d = design_with_feedthrough
    gain, p = predictor_gain(d, WEIGHTS)
    residual = d.A @ p @ (d.A - gain @ d.C).T + d.G @ (d.G - gain @ d.H).T - p
    assert np.abs(residual).max() < 1e-10 * np.abs(p).max()


def test_predictor_error_has_the_riccati_covariance(design_with_feedthrough):
    d = design_with_feedthrough
    gain, p = predictor_gain(d, WEIGHTS)
    drive = d.G - gain @ d.H
    lyapunov = scipy.linalg.solve_discrete_lyapunov(
        d.A - gain @ d.C, drive @ drive.T + _noise(d) * gain @ gain.T
    )
    np.testing.assert_allclose(lyapunov, p, atol=1e-9 * np.abs(p).max())


def test_leaving_out_the_cross_covariance_predicts_worse(design_with_feedthrough):
    d = design_with_feedthrough
    _, p = predictor_gain(d, WEIGHTS)
    blind, _ = predictor_gain(replace(d, H=np.zeros((1, 1))), WEIGHTS)
    drive = d.G - blind @ d.H
    worse = scipy.linalg.solve_discrete_lyapunov(
        d.A - blind @ d.C, drive @ drive.T + _noise(d) * blind @ blind.T
    )
    assert (d.C @ worse @ d.C.T)[0, 0] > 1.01 * (d.C @ p @ d.C.T)[0, 0]


def test_the_first_estimate_leaves_an_error_that_the_measurement_does_not_explain(design_with_feedthrough):
    d = design_with_feedthrough
    gain = initial_estimate(d, WEIGHTS)[:, :1] * RBM_UNIT
    stationary = scipy.linalg.solve_discrete_lyapunov(d.A, d.G @ d.G.T)
    measured = d.C @ stationary @ d.C.T + d.H @ d.H.T + _noise(d)
    np.testing.assert_allclose(gain @ measured, stationary @ d.C.T, atol=1e-10)
    assert (d.C @ gain)[0, 0] == pytest.approx(1.0, abs=0.002)


def _single_blade_loop(design, controller):
    """Design model, actuator and controller closed by hand; inputs white noise and measurement noise [MN m]."""
    a, b, c = with_actuator(design)
    n, m = a.shape[0], controller.order
    units = np.concatenate([design.angle_limit, design.rate_limit])
    flap = np.zeros((2, n))
    flap[0, -2], flap[1, -1] = units
    measured = np.vstack([RBM_UNIT * c, flap])
    to_limit = b / design.acceleration_limit
    loop = np.block(
        [
            [a + to_limit @ controller.D @ measured, to_limit @ controller.C],
            [controller.B @ measured, controller.A],
        ]
    )
    noise_gain = RBM_UNIT * controller.B[:, :1]
    white = np.vstack([design.G, np.zeros((2, 1)), noise_gain @ design.H])
    measurement = np.vstack([np.zeros((n, 1)), noise_gain]) * np.sqrt(_noise(design))
    acceleration = np.hstack([controller.D @ measured, controller.C]) / design.acceleration_limit
    outputs = np.vstack(
        [np.hstack([c, np.zeros((1, m))]), np.eye(1, n + m, n - 2), acceleration],
    )
    return StateSpace(
        loop,
        np.hstack([white, measurement]),
        outputs,
        np.zeros((3, 2)),
        design.time_step,
        ("white", "measurement"),
        ("rbm", "flap_angle", "acceleration"),
    )


def test_closed_loop_poles_are_those_of_regulator_and_predictor(design):
    loop = _single_blade_loop(design, synthesise(design, WEIGHTS))
    a, b, _ = with_actuator(design)
    regulator, _ = regulator_gain(design, WEIGHTS)
    predictor, _ = predictor_gain(design, WEIGHTS)
    expected = np.concatenate(
        [np.linalg.eigvals(a - b @ regulator), np.linalg.eigvals(design.A - predictor @ design.C)]
    )
    found = np.linalg.eigvals(loop.A)
    for value in expected:
        assert np.abs(found - value).min() < 1e-6


def test_mean_cost_of_the_loop_is_the_riccati_value(design):
    """J = tr(X G G') + tr(P K' (R + B' X B) K): regulator's share plus the price of not knowing the state."""
    loop = _single_blade_loop(design, synthesise(design, WEIGHTS))
    variance = np.diag(loop.C @ loop.stationary_covariance() @ loop.C.T)
    cost = variance @ [WEIGHTS.rbm, WEIGHTS.flap_angle, WEIGHTS.acceleration]
    gain, x = regulator_gain(design, WEIGHTS)
    _, p = predictor_gain(design, WEIGHTS)
    _, b, _ = with_actuator(design)
    n = design.A.shape[0]
    weight = WEIGHTS.acceleration + (b.T @ x @ b)[0, 0]
    known = np.trace(x[:n, :n] @ design.G @ design.G.T)
    unknown = weight * (gain[:, :n] @ p @ gain[:, :n].T)[0, 0]
    assert cost == pytest.approx(known + unknown, rel=1e-7)


def test_measured_cost_of_the_loop_is_the_riccati_value_within_sampling_error(design):
    """Four hundred stationary minutes: some two thousand independent gusts, 3 % of the mean square."""
    loop = _single_blade_loop(design, synthesise(design, WEIGHTS))
    values, vectors = np.linalg.eigh(loop.stationary_covariance())
    rng = np.random.default_rng(0)
    x = vectors @ (np.sqrt(np.maximum(values, 0.0))[:, None] * rng.standard_normal((loop.order, 400)))
    steps, squares = round(60.0 / design.time_step), np.zeros(3)
    for _ in range(steps):
        squares += np.mean((loop.C @ x) ** 2, axis=1)
        x = loop.A @ x + loop.B @ rng.standard_normal((2, 400))
    measured = squares / steps @ [WEIGHTS.rbm, WEIGHTS.flap_angle, WEIGHTS.acceleration]
    gain, cost = regulator_gain(design, WEIGHTS)
    _, p = predictor_gain(design, WEIGHTS)
    _, b, _ = with_actuator(design)
    n = design.A.shape[0]
    known = np.trace(cost[:n, :n] @ design.G @ design.G.T)
    unknown = (WEIGHTS.acceleration + (b.T @ cost @ b)[0, 0]) * (gain[:, :n] @ p @ gain[:, :n].T)[0, 0]
    assert measured == pytest.approx(known + unknown, rel=0.1)


def test_scaling_leaves_the_design_models_response(design):
    model = synthetic_model()
    system = StateSpace(
        design.A, design.B, design.C, design.D, model.time_step, ("flap_angle", "flap_rate"), ("rbm",)
    )
    frequency = [0.0, 0.3, 1.0, 10.0]
    blade = model.blade.select(["flap_angle", "flap_rate"], ["rbm"]).frequency_response(frequency)
    (flap,) = model.flaps
    units = [flap.angle_limit / RBM_UNIT, flap.rate_limit / RBM_UNIT]
    np.testing.assert_allclose(system.frequency_response(frequency), blade * units, rtol=1e-9)


@pytest.mark.parametrize("name", ["flap_angle", "acceleration", "measurement_noise"])
def test_weights_that_make_no_design_are_refused(name):
    with pytest.raises(ValueError, match=f"weights.{name}"):
        Weights(rbm=1.0, **{name: 0.0})
