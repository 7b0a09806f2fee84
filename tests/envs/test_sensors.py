"""Late and noisy sensors: what is observed is the moment of some samples ago, all else is on time."""

from __future__ import annotations

import json

import numpy as np
import pytest

from flapgym.envs.settings import Settings
from flapgym.envs.turbines import Turbines
from tests.synthetic import synthetic_model

MODEL = synthetic_model(flaps=2)
STEP, STEPS, COUNT, MOMENTS = MODEL.time_step, 5, 3, slice(6, 9)
"""Moments stand behind six flap angles in what is observed."""


def _turbines(backend, count=COUNT, **keywords):
    task = {"observe": ("flap_angle", "rbm"), "tower_weight": 0.3}
    settings = Settings(
        model=MODEL, task=task, steps_per_action=STEPS, backend=backend, duration=2.0, **keywords
    )
    return Turbines(settings, count)


def _begin(turbines, seed=0):
    every = np.arange(turbines.count)
    generators = [np.random.default_rng(seed + turbine) for turbine in every]
    return turbines.begin(every, generators, turbines.chosen(every))


def _actions(count, size=40):
    return np.random.default_rng(1).uniform(-1, 1, (size, count, 6))


@pytest.mark.parametrize("backend", ["numpy", "numba"])
@pytest.mark.parametrize("delay", [1, 4, 5, 13])
def test_observed_moments_are_those_of_some_samples_ago(backend, delay):
    plain = _turbines(backend, record_samples=True)
    late = _turbines(backend, sensors={"delay": delay * STEP})
    first, info = _begin(plain)
    np.testing.assert_array_equal(_begin(late)[0], first)
    # Before an episode the moments are taken to have been those of its first sample.
    moments = [np.tile(info["rbm"][:, None], (1, delay + 1, 1))]
    for action in _actions(COUNT):
        observation, reward, _, _, info = plain.step(action)
        moments.append(info["samples"]["rbm"])
        seen, late_reward, _, _, late_info = late.step(action)
        # Neither the reward nor what is told beside it is late.
        np.testing.assert_array_equal(late_reward, reward)
        for name in ("rbm", "tower_top", "flap_angle", "wind_perturbation"):
            np.testing.assert_array_equal(late_info[name], info[name])
        np.testing.assert_array_equal(seen[:, :6], observation[:, :6])
        history = np.concatenate(moments, axis=1)
        np.testing.assert_allclose(seen[:, MOMENTS], 1e-6 * history[:, -delay - 1], rtol=1e-6)


@pytest.mark.parametrize("backend", ["numpy", "numba"])
@pytest.mark.parametrize("delay", [0, 3])
def test_noise_is_added_to_the_moments_whether_late_or_not(backend, delay):
    plain = _turbines(backend, sensors={"delay": delay * STEP})
    noisy = _turbines(backend, sensors={"delay": delay * STEP, "noise": 1e5})
    # Noise is drawn last: turbulence and azimuth are the same without it.
    added = [_begin(noisy)[0] - _begin(plain)[0]]
    for action in _actions(COUNT):
        seen, expected = noisy.step(action), plain.step(action)
        np.testing.assert_array_equal(seen[1], expected[1])
        added.append(seen[0] - expected[0])
    got = np.stack(added, axis=1)
    assert not got[:, :, :6].any()
    expected = np.stack([noisy.own_of(turbine) for turbine in range(COUNT)])[:, : got.shape[1]]
    # Moments of ten millions, in single precision.
    np.testing.assert_allclose(got[:, :, MOMENTS], 1e-6 * expected, atol=4e-6)


def test_noise_is_white_and_as_large_as_asked_for():
    turbines = _turbines("numpy", 60, sensors={"noise": 2e5})
    _begin(turbines)
    noise = np.stack([turbines.own_of(turbine) for turbine in range(60)])
    count = noise.size
    # Four standard errors.
    assert noise.std() == pytest.approx(2e5, rel=4.0 / np.sqrt(2.0 * count))
    for near in (noise[:, 1:] * noise[:, :-1], noise[:, :, 1:] * noise[:, :, :-1], noise[1:] * noise[:-1]):
        assert abs(near.mean()) < 4.0 * 2e5**2 / np.sqrt(near.size)


@pytest.mark.parametrize("backend", ["numpy", "numba"])
def test_past_the_end_of_an_episode_the_last_noise_is_seen_and_none_of_others(backend):
    turbines = _turbines(backend, sensors={"noise": 1e5}, wind={"turbulence_intensity": 0.0})
    quiet = _turbines(backend, wind={"turbulence_intensity": 0.0})
    for each in (turbines, quiet):
        _begin(each)
    intervals = turbines.stepping.intervals
    last = np.stack([turbines.own_of(turbine)[-1] for turbine in range(COUNT)])
    for number in range(1, intervals + 4):
        seen, _, _, over, _ = turbines.step(np.zeros((COUNT, 6)))
        still = quiet.step(np.zeros((COUNT, 6)))[0]
        assert over.all() == (number >= intervals)
        if number >= intervals:
            np.testing.assert_allclose((seen - still)[:, MOMENTS], 1e-6 * last, atol=1e-6)


@pytest.mark.parametrize("backend", ["numpy", "numba"])
def test_a_state_of_late_and_noisy_moments_survives_json(backend):
    keywords = {"sensors": {"delay": 7 * STEP, "noise": 1e4}}
    turbines, twin = (_turbines(backend, **keywords) for _ in range(2))
    _begin(turbines)
    actions = _actions(COUNT, 20)
    for action in actions[:10]:
        turbines.step(action)
    state = json.loads(json.dumps(turbines.get_state()))
    _begin(twin, seed=9)
    twin.go_on(twin.read_state(state, {})["turbines"])
    for action in actions[10:]:
        for one, other in zip(turbines.step(action)[:4], twin.step(action)[:4], strict=True):
            np.testing.assert_array_equal(one, other)


def test_a_delay_is_whole_samples():
    with pytest.raises(ValueError, match="sensors.delay"):
        _turbines("numpy", sensors={"delay": 1.5 * STEP})
