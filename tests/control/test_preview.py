"""Feedforward of a lidar's wind: the optimum of the cost, the best estimate of the wind, and the LQG without it."""

import numpy as np
import pytest

from flapgym.control import Weights, lqg_agent
from flapgym.control.lqg import RBM_UNIT, design_model, with_actuator
from flapgym.control.preview import Estimator, LidarLQG, preview_gains
from flapgym.evaluation.simulate import simulate_together
from flapgym.model import load_model
from flapgym.wind import Kaimal, Lidar
from tests.synthetic import synthetic_model

MODEL = synthetic_model(flaps=2)
WEIGHTS = Weights(rbm=4.0, acceleration=1.0, measurement_noise=0.02)
FIELD = Kaimal(hub_height=90.0)
CONE = Lidar(range=100.0, radius=40.0, delay=0.1)
RNG = np.random.default_rng(3)


@pytest.mark.parametrize("ahead", [0, 1, 10, 60])
def test_the_answer_to_a_known_wind_is_that_of_all_accelerations_at_once(ahead):
    """Least squares over every acceleration of five seconds, from rest, with a pulse of wind so many steps ahead."""
    design, steps = design_model(MODEL), 700
    a, b, c = with_actuator(design)
    blade = MODEL.blade.select(["wind"], design.channels.moments)
    order, flaps = design.A.shape[0] - blade.order, design.channels.flaps
    push = np.concatenate([np.zeros(order), blade.B[:, 0] / design.scale[order:], np.zeros(2 * flaps)])
    # What costs, by the roots of its weights: the moment and the flaps' angles.
    of_angles = np.eye(len(a))[order + blade.order :][:flaps]
    read = np.vstack([np.sqrt(WEIGHTS.rbm) * c, np.sqrt(WEIGHTS.flap_angle / flaps) * of_angles])
    state, pulses = np.column_stack([b, push]), np.empty((steps, 1 + flaps, flaps + 1))
    for step in range(steps):
        pulses[step] = read @ state
        state = a @ state
    response = np.zeros((steps, 1 + flaps, steps, flaps))
    for step in range(steps - 1):
        response[step + 1 :, :, step] = pulses[: steps - 1 - step, :, :flaps]
    wind = np.zeros((steps, 1 + flaps))
    wind[ahead + 1 :] = pulses[: steps - 1 - ahead, :, flaps]
    wind[ahead, 0] += np.sqrt(WEIGHTS.rbm) * blade.D[0, 0] / RBM_UNIT
    matrix = response.reshape(steps * (1 + flaps), -1)
    normal = matrix.T @ matrix + WEIGHTS.acceleration / flaps * np.eye(matrix.shape[1])
    best = -np.linalg.solve(normal, matrix.T @ wind.ravel())[:flaps]
    gains, _ = preview_gains(MODEL, design, WEIGHTS)
    np.testing.assert_allclose(gains[:, ahead], best, rtol=1e-4, atol=1e-4 * np.abs(gains).max())


def test_without_a_share_it_is_the_lqg():
    agent = LidarLQG("told", MODEL, WEIGHTS, CONE, FIELD, share=0.0)
    lqg = lqg_agent("lqg", MODEL, WEIGHTS)
    state, other = None, None
    for _ in range(60):
        of_blades, seen = RNG.standard_normal((4, 15)), RNG.standard_normal((4, 5))
        start = RNG.random(4) < 0.1
        told = np.hstack([of_blades, seen])
        action, state = agent.predict(told, state, start)
        expected, other = lqg.predict(of_blades, other, start)
        np.testing.assert_allclose(action, expected, atol=1e-6)


def test_a_batch_is_as_each_turbine_alone():
    agent = LidarLQG("told", MODEL, WEIGHTS, CONE, FIELD)
    state, alone = None, [None, None]
    for number in range(150):
        told = RNG.standard_normal((2, 20)) * 0.1
        start = np.array([number == 0, number in (0, 70)])
        action, state = agent.predict(told, state, start)
        for turbine in range(2):
            one, alone[turbine] = agent.predict(told[turbine], alone[turbine], start[turbine : turbine + 1])
            np.testing.assert_allclose(action[turbine], one, atol=1e-6)


def test_what_one_frozen_beam_has_measured_is_known_when_it_arrives():
    lidar = Lidar(range=110.0, radius=0.0, beams=1, probe_length=0.0, decay=0.0, sample_rate=4.0)
    estimator = Estimator.of(lidar, FIELD, 11.0)
    measured = np.array([5, 20, 33])
    weights = estimator.mean(estimator.arrives[measured] - 0.1, 0.1)
    # But for what stands for round-off, a measurement is its own estimate.
    np.testing.assert_allclose(weights, np.eye(estimator.count)[measured], atol=0.03)
    assert not estimator.cyclic(np.zeros(1), 0.1).any()


def test_no_weights_leave_less_error_by_the_cross_spectra():
    """The estimate's error against direct sums over frequencies: any other weights have more."""
    lidar, wind, age = Lidar(range=100.0, radius=0.0, beams=1, noise=0.3), 11.0, 0.1
    estimator = Estimator.of(lidar, FIELD, wind)
    weights = estimator.mean(np.array([0.7]), age)[0]
    frequency = 2e-3 * (np.arange(1000) + 0.5)
    power = 2e-3 * FIELD.spectrum(frequency, wind)
    smooth = lidar.averaging(frequency, wind)
    delays = np.exp(-2j * np.pi * np.outer(frequency, 0.7 - (estimator.arrives - age)))

    def error(w):
        told = smooth * (delays @ w)
        of_field = (power * (1.0 - 2.0 * lidar.likeness(frequency, wind) * told.real + abs(told) ** 2)).sum()
        return of_field + (0.3 / FIELD.deviation(wind)) ** 2 * w @ w

    least = error(weights)
    assert 0.0 < least < power.sum()
    for _ in range(20):
        change = 0.05 * RNG.standard_normal(len(weights))
        assert error(weights + change) > least
        assert error(weights - change) > least


@pytest.mark.parametrize("share", [-0.1, float("nan"), "1"])
def test_a_share_that_cannot_be_is_refused(share):
    with pytest.raises(ValueError, match=r"^agent told: share: expected"):
        LidarLQG("told", MODEL, WEIGHTS, CONE, FIELD, share=share)


def test_another_observation_is_refused_in_one_line():
    agent = LidarLQG("told", MODEL, WEIGHTS, CONE, FIELD)
    with pytest.raises(ValueError, match=r"^agent told: expected 20 observations"):
        agent.predict(np.zeros(15))


def test_at_the_site_it_hears_its_lidar_and_meets_the_wind_that_others_do():
    model = load_model("nrel5mw-site")
    field = Kaimal(turbulence_class="B", hub_height=90.0)
    agents = [LidarLQG(f"told {share}", model, WEIGHTS, CONE, field, share) for share in (0.0, 1.0)]
    deaf, hears = simulate_together(
        agents, model, [2000], 3.0, wind={"field": field}, sensors={"lidar": CONE}
    )
    np.testing.assert_array_equal(deaf.wind, hears.wind)
    assert np.isfinite(hears.rbm).all()
    assert np.ptp(hears.flap_angle - deaf.flap_angle) > 1e-3
