"""Late moments: the observation is that of the plant behind some samples ago, all else is on time."""

from __future__ import annotations

import json

import numpy as np
import pytest

from flapgym.plant.delayed import DelayedPlant
from flapgym.plant.interface import Setup, Start, Task
from flapgym.plant.layout import ANGLE, RBM, ROW, SAMPLE, SAMPLE_RBM
from flapgym.plant.lifted_plant import LiftedPlant
from tests.synthetic import synthetic_model

TASK = Task(
    columns=np.array([ANGLE, RBM, RBM + 1, RBM + 2]),
    factors=np.array([1.0, 1e-6, 1e-6, 1e-6]),
    bounds=np.array([0.2, 50.0, 50.0, 50.0]),
    noisy=np.array([-1, 0, 1, 2]),
    rbm_weight=1e-12,
)
SETUP = Setup(steps_per_action=5, intervals=40, length_scale=147.0)


def _start(plant, noise=0.0):
    rng = np.random.default_rng(0)
    return Start(
        azimuth=np.array([0.3, 1.0]),
        flap_angle=np.zeros((2, 3)),
        flap_rate=np.zeros((2, 3)),
        intensity=np.full(2, 0.1),
        noise=rng.standard_normal((2, plant.noise_count)),
        measurement_noise=noise * rng.standard_normal((2, 41, 3)) if noise else None,
    )


def _step(plant, actions, record=True):
    observation, rows = np.zeros((2, 4), dtype=np.float32), np.zeros((2, ROW))
    samples = np.zeros((2, 5, SAMPLE)) if record else None
    plant.step(actions, observation.reshape(-1), rows.reshape(-1), samples)
    return observation, rows, samples


@pytest.mark.parametrize("delay", [1, 4, 5, 13])
def test_observed_moments_are_those_of_some_samples_ago(delay):
    plain = LiftedPlant(synthetic_model(), 2, SETUP, TASK)
    late = DelayedPlant(LiftedPlant(synthetic_model(), 2, SETUP, TASK), TASK, delay)
    start, both, rng = _start(plain), np.arange(2), np.random.default_rng(1)
    first, rows = plain.reset(both, start)
    np.testing.assert_array_equal(late.reset(both, start)[0], first)
    moments = [np.tile(rows[:, None, RBM : RBM + 3], (1, delay + 1, 1))]
    for _ in range(30):
        actions = rng.uniform(-1, 1, 6)
        observation, rows, samples = _step(plain, actions)
        moments.append(samples[:, :, SAMPLE_RBM : SAMPLE_RBM + 3])
        seen, late_rows, _ = _step(late, actions, record=False)
        np.testing.assert_array_equal(late_rows, rows)
        np.testing.assert_array_equal(seen[:, 0], observation[:, 0])
        history = np.concatenate(moments, axis=1)
        np.testing.assert_allclose(seen[:, 1:], 1e-6 * history[:, -delay - 1], rtol=1e-6)


def test_noise_is_added_to_the_late_moments_as_to_others():
    plain = DelayedPlant(LiftedPlant(synthetic_model(), 2, SETUP, TASK), TASK, 3)
    noisy = DelayedPlant(LiftedPlant(synthetic_model(), 2, SETUP, TASK), TASK, 3)
    start = _start(plain, noise=1e5)
    added = [noisy.reset(np.arange(2), start)[0] - plain.reset(np.arange(2), _start(plain))[0]]
    for _ in range(40):
        added.append(_step(noisy, np.zeros(6))[0] - _step(plain, np.zeros(6))[0])
    expected = 1e-6 * start.measurement_noise
    np.testing.assert_allclose(np.stack(added, axis=1)[:, :, 1:], expected, atol=1e-6)


def test_its_state_survives_json():
    plant, twin = (DelayedPlant(LiftedPlant(synthetic_model(), 2, SETUP, TASK), TASK, 7) for _ in range(2))
    start = _start(plant)
    for each in (plant, twin):
        each.reset(np.arange(2), start)
    for _ in range(10):
        _step(plant, np.full(6, 0.4))
    for turbine in range(2):
        twin.set_state(turbine, json.loads(json.dumps(plant.get_state(turbine))))
    for one, other in zip(_step(plant, np.zeros(6)), _step(twin, np.zeros(6)), strict=True):
        np.testing.assert_array_equal(one, other)
