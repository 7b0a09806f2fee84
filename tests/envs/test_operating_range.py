"""Episodes at wind speeds of a range: each is that of the single environment at its speed."""

import json
from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded

from flapgym.envs import FlapEnv, FlapRangeEnv
from flapgym.model import ModelSet, load_model_set, save_model_set
from tests.synthetic import synthetic_model

SPEEDS = (7.0, 9.0, 11.0)


@pytest.fixture(scope="module")
def models():
    return ModelSet.of(
        [replace(synthetic_model(), wind_speed=speed, name=f"at-{speed:g}") for speed in SPEEDS]
    )


def test_an_episode_is_that_of_the_single_environment_at_its_speed(models):
    env = FlapRangeEnv(models, duration=1.0)
    observation, info = env.reset(seed=3, options={"wind_speed": 9.0})
    alone = FlapEnv(model=models.at(9.0), duration=1.0)
    expected, _ = alone.reset(seed=3)
    assert info["wind_speed"] == 9.0
    np.testing.assert_array_equal(observation, expected)
    for action in np.random.default_rng(1).uniform(-1, 1, (5, 3)).astype(np.float32):
        ours, theirs = env.step(action), alone.step(action)
        np.testing.assert_array_equal(ours[0], theirs[0])
        assert ours[1] == theirs[1]


def test_all_speeds_of_the_range_are_met_about_as_often(models):
    env = FlapRangeEnv(models, wind_speed=(8.0, 12.0), duration=0.1)
    env.reset(seed=1)
    met = [env.reset()[1]["wind_speed"] for _ in range(200)]
    assert set(met) == {9.0, 11.0}
    assert 70 < met.count(9.0) < 130


def test_a_seed_draws_the_same_speeds_and_winds(models):
    first, second = (FlapRangeEnv(models, duration=0.1) for _ in range(2))
    for seed in (5, None, None, None):
        one, two = (env.reset(seed=seed) for env in (first, second))
        assert one[1]["wind_speed"] == two[1]["wind_speed"]
        np.testing.assert_array_equal(one[0], two[0])


def test_a_refused_reset_takes_no_seed(models):
    env, other = (FlapRangeEnv(models, duration=0.1) for _ in range(2))
    for each in (env, other):
        each.reset(seed=5)
    for options in ({"azimut": 1.0}, {"wind_speed": 10.0}):
        with pytest.raises(ValueError, match="^options"):
            env.reset(seed=9, options=options)
    np.testing.assert_array_equal(env.reset()[0], other.reset()[0])


def test_a_state_goes_on_bit_for_bit_in_another_environment(models):
    env, other = FlapRangeEnv(models, duration=1.0), FlapRangeEnv(models, duration=1.0)
    env.reset(seed=8)
    env.step(np.ones(3, dtype=np.float32))
    other.set_state(json.loads(json.dumps(env.get_state())))
    action = np.full(3, -0.5, dtype=np.float32)
    np.testing.assert_array_equal(env.step(action)[0], other.step(action)[0])
    assert env.reset()[1]["wind_speed"] == other.reset()[1]["wind_speed"]


@pytest.mark.parametrize(
    "given, said",
    [
        ((12.0, 20.0), "^wind_speed: expected a range that holds one of 7, 9, 11 m/s, got 12 to 20 m/s"),
        (9.0, "^wind_speed: expected two speeds"),
        ((7.0, "fast"), r"^wind_speed\[1\]: expected"),
    ],
)
def test_a_range_without_a_model_is_refused(models, given, said):
    with pytest.raises(ValueError, match=said):
        FlapRangeEnv(models, wind_speed=given)


def test_stepping_before_a_reset_is_refused(models):
    with pytest.raises(ResetNeeded):
        FlapRangeEnv(models).step(np.zeros(3))


def test_a_single_environment_takes_the_member_of_a_set_for_its_wind_speed(models, tmp_path):
    save_model_set(models, path := tmp_path / "set.safetensors")
    assert FlapEnv(model=path, wind_speed=9.0).model.wind_speed == 9.0
    with pytest.raises(
        ValueError, match="^wind_speed: expected one of 7, 9, 11 m/s with the set .*, got none"
    ):
        FlapEnv(model=path)


def test_shipped_set_observes_its_mean_wind_and_speeds_up_with_it():
    """Without turbulence the slow estimate is the operating point's wind."""
    env = gymnasium.make(
        "flapgym/NREL5MWRange-v0", wind={}, gravity=False, task={"observe": ("wind_speed",)}, duration=0.1
    )
    models = load_model_set("nrel5mw-range")
    for speed in (models.wind_speeds[0], models.wind_speeds[-1]):
        still = {"wind_speed": speed, "turbulence_intensity": 0.0}
        observation, _ = env.reset(seed=1, options=still)
        assert observation == pytest.approx([speed])


def test_speed_is_no_observation_of_a_turbine_that_keeps_it():
    with pytest.raises(
        ValueError, match="^task.observe: wind_speed takes a turbine whose rotor speed is controlled"
    ):
        FlapEnv(task={"observe": ("wind_speed",)})
