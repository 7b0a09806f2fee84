"""Episodes at wind speeds of a range: each is that of the single environment at its speed."""

import copy
import json
import pickle
from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from flapgym.envs import FlapEnv, FlapRangeEnv, FlapRangeVectorEnv, FlapVectorEnv
from flapgym.model import ModelSet, load_model_set, save_model_set
from flapgym.plant.field_response import _synthesis
from flapgym.plant.kernel import _kernel
from flapgym.wind.upwind import upwind_turbulence
from flapgym.wrappers.single import TargetAngle
from flapgym.wrappers.vector import VectorTargetAngle
from tests.envs.test_vector import KEYWORDS, _assert_same
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


def test_a_later_episode_is_that_of_the_single_environment_that_had_all_before(models):
    """The wind speed is drawn beside the generator, which is left to what the single environment draws."""
    env = FlapRangeEnv(models, duration=0.1)
    alone = {speed: FlapEnv(model=models.at(speed), duration=0.1) for speed in SPEEDS}
    env.reset(seed=4)
    for each in alone.values():
        each.reset(seed=4)
    for _ in range(5):
        observation, info = env.reset()
        expected = {speed: each.reset()[0] for speed, each in alone.items()}
        np.testing.assert_array_equal(observation, expected[info["wind_speed"]])


def test_the_space_holds_the_observations_at_every_wind_speed():
    windy = [replace(synthetic_model(), wind_speed=speed, rbm_rms=speed * 1e6) for speed in SPEEDS]
    env = FlapRangeEnv(ModelSet.of(windy), task={"observe": ("flap_angle", "rbm")}, duration=0.1)
    bounds = [
        FlapEnv(model=model, task={"observe": ("flap_angle", "rbm")}).observation_space.high
        for model in windy
    ]
    np.testing.assert_array_equal(env.observation_space.high, np.max(bounds, axis=0))
    for speed in SPEEDS:
        assert env.reset(seed=1, options={"wind_speed": speed})[0] in env.observation_space


def test_a_lidar_that_the_fastest_wind_passes_is_refused_at_once(models):
    lidar = {"range": 18.0, "radius": 0.0, "beams": 1, "delay": 1.8}
    assert FlapEnv(model=models.at(7.0), sensors={"lidar": lidar}, duration=0.1)
    for made in (FlapRangeEnv, FlapRangeVectorEnv):
        with pytest.raises(ValueError, match="^sensors.lidar"):
            made(model=models, sensors={"lidar": lidar}, duration=0.1)


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


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_many_are_single_ones_side_by_side_through_every_autoreset(models, mode):
    native = FlapRangeVectorEnv(5, autoreset_mode=mode, model=models, **KEYWORDS)
    sync = SyncVectorEnv([lambda: FlapRangeEnv(models, **KEYWORDS)] * 5, autoreset_mode=mode)
    (observation, info), (expected, expected_info) = native.reset(seed=12), sync.reset(seed=12)
    np.testing.assert_allclose(observation, expected, rtol=1e-6, atol=1e-7)
    _assert_same(info, expected_info)
    rng, met = np.random.default_rng(0), set(info["wind_speed"])
    for _ in range(70):
        actions = rng.uniform(-1, 1, (5, 3)).astype(np.float32)
        got, wanted = native.step(actions), sync.step(actions)
        np.testing.assert_allclose(got[0], wanted[0], rtol=1e-6, atol=1e-7)
        np.testing.assert_allclose(got[1], wanted[1], rtol=1e-9)
        np.testing.assert_array_equal(got[3], wanted[3])
        _assert_same(got[4], wanted[4])
        met |= set(got[4]["wind_speed"])
    assert met == set(SPEEDS)


def test_a_crowd_at_one_wind_speed_finds_room(models):
    env = FlapRangeVectorEnv(7, model=models, duration=0.7)
    observation, info = env.reset(seed=3, options={"wind_speed": 9.0})
    alone = FlapVectorEnv(7, model=models.at(9.0), duration=0.7)
    np.testing.assert_allclose(observation, alone.reset(seed=3)[0], rtol=1e-6, atol=1e-7)
    assert set(info["wind_speed"]) == {9.0}
    actions = np.random.default_rng(2).uniform(-1, 1, (7, 3))
    np.testing.assert_allclose(env.step(actions)[0], alone.step(actions)[0], rtol=1e-6, atol=1e-7)


def test_each_of_many_takes_its_wind_speed_and_intensity(models):
    intensities, speeds = (0.05, 0.1, 0.2), [11.0, 7.0, 11.0]
    env = FlapRangeVectorEnv(3, model=models, wind={"turbulence_intensity": intensities}, duration=0.1)
    observation, info = env.reset(seed=3, options={"wind_speed": speeds})
    assert info["wind_speed"].tolist() == speeds
    for row, (speed, intensity) in enumerate(zip(speeds, intensities, strict=True)):
        alone = FlapEnv(model=models.at(speed), wind={"turbulence_intensity": intensity}, duration=0.1)
        np.testing.assert_allclose(observation[row], alone.reset(seed=3 + row)[0], rtol=1e-6, atol=1e-7)


def test_advancing_without_reward_gives_the_observations_and_samples_of_step(models):
    stepped, advanced = (
        FlapRangeVectorEnv(5, "Disabled", model=models, duration=0.2, record_samples=True) for _ in range(2)
    )
    np.testing.assert_array_equal(stepped.reset(seed=4)[0], advanced.reset(seed=4)[0])
    rng, ended = np.random.default_rng(0), False
    while not ended:
        actions = rng.uniform(-1, 1, (5, 3))
        observation, _, _, truncated, info = stepped.step(actions)
        seen, samples = advanced.advance(actions)
        np.testing.assert_array_equal(seen, observation)
        for name, columns in advanced.sampled.items():
            np.testing.assert_array_equal(samples.take(columns, axis=2), info["samples"][name])
        ended = bool(truncated.all())
    with pytest.raises(ResetNeeded, match="advance: call reset"):
        advanced.advance(np.zeros((5, 3)))


def test_a_reset_of_some_leaves_the_others_where_they_are(models):
    env, other = (FlapRangeVectorEnv(4, "Disabled", model=models, duration=0.7) for _ in range(2))
    for each in (env, other):
        each.reset(seed=1)
    mask = np.array([False, True, False, True])
    env.reset(options={"reset_mask": mask})
    actions = np.random.default_rng(2).uniform(-1, 1, (4, 3))
    np.testing.assert_allclose(
        env.step(actions)[0][~mask], other.step(actions)[0][~mask], rtol=1e-6, atol=1e-7
    )


@pytest.mark.parametrize(
    "copied",
    [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env)), "state"],
    ids=["copy", "pickle", "state"],
)
def test_a_copy_of_many_goes_on_bit_for_bit(models, copied):
    env = FlapRangeVectorEnv(6, "SameStep", model=models, duration=0.7)
    rng = np.random.default_rng(1)
    env.reset(seed=8)
    for _ in range(25):
        env.step(rng.uniform(-1, 1, (6, 3)))
    if copied == "state":
        twin = FlapRangeVectorEnv(6, "SameStep", model=models, duration=0.7)
        twin.reset(seed=1)
        twin.set_state(json.loads(json.dumps(env.get_state())))
    else:
        twin = copied(env)
    for _ in range(25):
        actions = rng.uniform(-1, 1, (6, 3))
        one, other = env.step(actions), twin.step(actions)
        np.testing.assert_array_equal(one[0], other[0])
        np.testing.assert_array_equal(one[4]["wind_speed"], other[4]["wind_speed"])


def test_a_damaged_state_of_many_is_refused_and_changes_nothing(models):
    env = FlapRangeVectorEnv(3, model=models, duration=0.7)
    env.reset(seed=1)
    before = env.get_state()
    for entry, value, said in (
        ("place", before["turbines"][1]["place"], "place: expected one for each"),
        ("place", [8.0, 0, 0], "place: expected one of 7, 9, 11 m/s"),
        ("place", [7.0, 0, 99], "place: expected a whole number"),
        ("model", "another", "model: expected"),
    ):
        damaged = copy.deepcopy(before)
        damaged["turbines"][0][entry] = value
        with pytest.raises(ValueError, match=f"^state: turbines: damaged .*{said}"):
            env.set_state(damaged)
        assert env.get_state() == before
    with pytest.raises(ValueError, match="^state: made by an environment with wind_speed"):
        FlapRangeVectorEnv(3, model=models, wind_speed=(7.0, 9.0), duration=0.7).set_state(before)


@pytest.mark.parametrize("given", [10.0, [7.0, 9.0], [7.0, 9.0, 10.0], "fast", [[7.0, 9.0, 7.0]]], ids=str)
def test_wind_speeds_of_a_reset_that_there_are_not_are_refused_and_take_no_seed(models, given):
    env = FlapRangeVectorEnv(3, model=models, duration=0.7)
    env.reset(seed=1)
    before = env.get_state()
    with pytest.raises(ValueError, match=r"^options\.wind_speed: expected"):
        env.reset(seed=9, options={"wind_speed": given})
    assert env.get_state() == before


def test_target_angles_are_reached_at_every_wind_speed(models):
    single = TargetAngle(FlapRangeEnv(models, duration=2.0))
    many = VectorTargetAngle(FlapRangeVectorEnv(3, model=models, full_info=True, duration=2.0))
    options = [{"wind_speed": speed} for speed in SPEEDS]
    many.reset(seed=1, options={"wind_speed": list(SPEEDS)})
    for _ in range(50):
        info = many.step(np.full((3, 3), 0.5))[-1]
    np.testing.assert_allclose(info["flap_angle"], 0.5 * models.at(7.0).flaps[0].angle_limit, rtol=1e-6)
    for each in options:
        single.reset(seed=1, options=each)
        for _ in range(50):
            single.step(np.full(3, 0.5))
        np.testing.assert_allclose(single.unwrapped.flap_motion()[0], info["flap_angle"][0], rtol=1e-6)


def test_a_picture_tells_the_wind_speed_of_its_turbine(models):
    env = FlapRangeVectorEnv(2, "SameStep", "rgb_array", model=models, duration=0.1)
    env.reset(seed=1, options={"wind_speed": [7.0, 11.0]})
    assert [screen.model.wind_speed for screen in env._screens] == [7.0, 11.0]
    slow, fast = env.render()
    assert not np.array_equal(slow, fast)
    for _ in range(3):
        info = env.step(np.zeros((2, 3)))[-1]
    assert [screen.model.wind_speed for screen in env._screens] == info["wind_speed"].tolist()


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


@pytest.mark.parametrize("kept", [_synthesis, _kernel, upwind_turbulence])
def test_what_takes_long_is_kept_for_every_wind_speed_of_the_shipped_set(kept):
    """With fewer places than wind speeds each reset would take a second."""
    assert kept.cache_info().maxsize > len(load_model_set("nrel5mw-range"))


def test_speed_is_no_observation_of_a_turbine_that_keeps_it():
    with pytest.raises(
        ValueError, match="^task.observe: wind_speed takes a turbine whose rotor speed is controlled"
    ):
        FlapEnv(task={"observe": ("wind_speed",)})
