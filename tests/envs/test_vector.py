"""The vector environment is many single ones."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode

from flapgym.envs import FlapEnv, FlapVectorEnv
from tests.synthetic import synthetic_model

KEYWORDS = {
    "duration": 0.7,
    "task": {"observe": ("rbm", "flap_angle", "azimuth"), "flap_angle_weight": 0.1},
    "sensors": {"noise": 1e4},
    "record_samples": True,
    "full_info": True,
}
STEPS = 60  # three episodes of 20 actions


def _pair(mode, count=4):
    model = synthetic_model()
    native = FlapVectorEnv(count, autoreset_mode=mode, model=model, **KEYWORDS)
    sync = gymnasium.vector.SyncVectorEnv(
        [lambda: FlapEnv(model=model, **KEYWORDS) for _ in range(count)], autoreset_mode=mode
    )
    return native, sync


def _assert_same(got, expected, path="info"):
    assert expected.keys() <= got.keys(), path
    for name, value in expected.items():
        if isinstance(value, dict):
            _assert_same(got[name], value, f"{path}.{name}")
        elif value.dtype == object:
            for one, other in zip(got[name], value, strict=True):
                assert (one is None) == (other is None)
                if one is not None:
                    np.testing.assert_allclose(one, other, rtol=1e-5, atol=1e-6)
        else:
            mask = expected.get(f"_{name}", np.ones(len(value), dtype=bool))
            np.testing.assert_allclose(
                got[name][mask], value[mask], rtol=1e-9, atol=1e-9, err_msg=f"{path}.{name}"
            )


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_trajectories_are_those_of_single_environments_through_every_autoreset(mode):
    native, sync = _pair(mode)
    (observation, info), (expected, expected_info) = native.reset(seed=12), sync.reset(seed=12)
    np.testing.assert_allclose(observation, expected, rtol=1e-6, atol=1e-7)
    _assert_same(info, expected_info)
    rng = np.random.default_rng(0)
    for _ in range(STEPS):
        actions = rng.uniform(-1, 1, (4, 3)).astype(np.float32)
        got, wanted = native.step(actions), sync.step(actions)
        np.testing.assert_allclose(got[0], wanted[0], rtol=1e-6, atol=1e-7)
        np.testing.assert_allclose(got[1], wanted[1], rtol=1e-9)
        np.testing.assert_array_equal(got[2], wanted[2])
        np.testing.assert_array_equal(got[3], wanted[3])
        _assert_same(got[4], wanted[4])
        if mode is AutoresetMode.NEXT_STEP:
            assert not any(
                got[4][name].any() for name in got[4].keys() - wanted[4].keys() if name.startswith("_")
            )


def test_without_autoreset_the_mask_says_who_begins_anew():
    native = FlapVectorEnv(3, autoreset_mode="Disabled", model=synthetic_model(), **KEYWORDS)
    native.reset(seed=1)
    still = np.zeros((3, 3), dtype=np.float32)
    observation, *_ = native.step(still)
    again, info = native.reset(options={"reset_mask": np.array([False, True, False])})
    np.testing.assert_array_equal(again[[0, 2]], observation[[0, 2]])
    assert not np.array_equal(again[1], observation[1])
    assert info["_rbm"].tolist() == [False, True, False]
    truncated = np.zeros(3, dtype=bool)
    for _ in range(19):
        *_, truncated, _ = native.step(still)
    assert truncated.tolist() == [True, False, True]
    with pytest.raises(gymnasium.error.ResetNeeded):
        native.step(still)


def test_make_vec_takes_the_native_environment_and_a_json_able_mode(model_file):
    env = gymnasium.make_vec("flapgym/NREL5MW-v1", num_envs=5, model=model_file, autoreset_mode="SameStep")
    assert isinstance(env.unwrapped, FlapVectorEnv)
    assert env.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    observation, _ = env.reset(seed=[5, 4, 3, 2, 1])
    assert observation in env.observation_space
    assert env.unwrapped.np_random_seed == (5, 4, 3, 2, 1)
    assert env.spec.to_json()


def test_returned_arrays_are_never_used_again():
    env = FlapVectorEnv(2, model=synthetic_model(), **KEYWORDS)
    kept = [env.reset(seed=0)]
    copies = []
    for _ in range(25):
        kept.append(env.step(np.ones((2, 3))))
        copies.append([np.array(part) for part in kept[-1][:4]])
    for step, copy in zip(kept[1:], copies, strict=True):
        for part, expected in zip(step[:4], copy, strict=True):
            np.testing.assert_array_equal(part, expected)
    arrays = [
        part
        for step in kept
        for part in (step[0], *(v for v in step[-1].values() if isinstance(v, np.ndarray)))
        if part.flags.writeable  # not the masks: one serves all entries of a step
    ]
    assert not any(np.shares_memory(one, other) for i, one in enumerate(arrays[:60]) for other in arrays[:i])


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_masks_are_locked_and_later_steps_leave_them(mode):
    env = FlapVectorEnv(2, model=synthetic_model(), autoreset_mode=mode, **KEYWORDS)
    infos = [env.reset(seed=0)[-1]]
    for _ in range(5 if mode is AutoresetMode.DISABLED else 25):
        infos.append(env.step(np.ones((2, 3)))[-1])
    masks = [(info, name) for info in infos for name in info if name.startswith("_")]
    assert not any(info[name].flags.writeable for info, name in masks)
    assert not any(
        np.shares_memory(one["_rbm"], other["_rbm"]) for i, one in enumerate(infos) for other in infos[:i]
    )


def test_a_mask_given_to_a_reset_stays_the_callers():
    env = FlapVectorEnv(2, model=synthetic_model())
    env.reset(seed=0)
    mask = np.array([True, False])
    _, info = env.reset(options={"reset_mask": mask})
    mask[:] = False
    assert info["_rbm"].tolist() == [True, False]


def test_each_environment_may_have_its_own_realisation():
    env = FlapVectorEnv(3, model=synthetic_model())
    _, info = env.reset(seed=0, options={"realisation_seed": [7, 7, 8], "azimuth": 0.0})
    wind = info["wind_perturbation"]
    assert wind[0] == wind[1] != wind[2]


def test_an_unknown_way_of_beginning_anew_is_refused_with_the_known_ones():
    with pytest.raises(ValueError, match="autoreset_mode: expected one of .*SameStep.*, got 'same'"):
        FlapVectorEnv(2, model=synthetic_model(), autoreset_mode="same")


def test_bad_actions_seeds_and_masks_are_refused():
    env = FlapVectorEnv(2, model=synthetic_model())
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(np.zeros((2, 3)))
    with pytest.raises(ValueError, match="seed"):
        env.reset(seed=[1, 2, 3])
    with pytest.raises(ValueError, match="reset_mask"):
        env.reset(options={"reset_mask": np.array([True])})
    env.reset(seed=0)
    with pytest.raises(ValueError, match="environment 1"):
        env.step(np.array([[0.0, 0.0, 0.0], [0.0, np.nan, 0.0]]))
    with pytest.raises(ValueError, match="shape"):
        env.step(np.zeros(3))


def test_actions_for_environments_about_to_begin_anew_may_be_anything():
    env, twin = (FlapVectorEnv(2, model=synthetic_model(), duration=0.7) for _ in range(2))
    zeros = np.zeros((2, 3), dtype=np.float32)
    for one in (env, twin):
        one.reset(seed=0)
        for step in range(20):
            truncated = one.step(zeros)[3]
            if step == 9:
                one.reset(options={"reset_mask": np.array([True, False])})
        assert truncated.tolist() == [False, True]
    anything = np.array([[0.0] * 3, [np.nan, np.inf, 2.0]], dtype=np.float32)
    with pytest.raises(ValueError, match="action: expected finite numbers"):
        env.step(anything[::-1])
    np.testing.assert_array_equal(env.step(anything)[0], twin.step(zeros)[0])
    with pytest.raises(ValueError, match="action: expected finite numbers"):
        env.step(anything)


@pytest.mark.parametrize("mode", list(AutoresetMode), ids=str)
@pytest.mark.parametrize("seed", [None, 100, [7, 8, 9, 10]], ids=str)
def test_a_masked_reset_leaves_the_others_their_last_observation_and_their_seeds(mode, seed):
    native, sync = _pair(mode)
    mask = np.array([True, False, True, False])
    for env in (native, sync):
        env.reset(seed=0)
        for _ in range(5):
            env.step(np.full((4, 3), 0.3, dtype=np.float32))
    got, expected = (env.reset(seed=seed, options={"reset_mask": mask.copy()})[0] for env in (native, sync))
    np.testing.assert_allclose(got, expected, rtol=1e-6, atol=1e-7)
    np.testing.assert_array_equal(native.get_state()["observation"], got)
    assert native.np_random_seed == sync.np_random_seed
    np.testing.assert_allclose(native.reset()[0], sync.reset()[0], rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("seed", [1.5, "ab", -1, [1, -1], [1, 2.0], [1, 2, 3], {1, 2}], ids=str)
def test_impossible_seeds_are_refused_by_name_and_change_nothing(seed):
    env = FlapVectorEnv(2, model=synthetic_model())
    env.reset(seed=3)
    before = env.get_state()
    with pytest.raises(ValueError, match=r"^seed: expected one whole number of at least 0, or a list of 2"):
        env.reset(seed=seed)
    assert env.get_state() == before


@pytest.mark.parametrize("count", [0, -1, 2.0, "2", True, None], ids=str)
def test_an_impossible_number_of_environments_is_refused_by_name(count):
    with pytest.raises(ValueError, match="^num_envs: expected a whole number from 1 to 1000000, got "):
        FlapVectorEnv(count, model=synthetic_model())


def test_generators_can_be_set_as_in_other_vector_environments():
    env, twin = (FlapVectorEnv(2, model=synthetic_model()) for _ in range(2))
    env.np_random = tuple(np.random.default_rng(seed) for seed in (3, 4))
    assert env.np_random_seed == (-1, -1)
    twin.set_state(env.get_state())
    np.testing.assert_array_equal(env.reset()[0], twin.reset()[0])
    with pytest.raises(ValueError, match="^np_random: expected 2 numpy generators"):
        env.np_random = (np.random.default_rng(3),)


def test_advancing_without_reward_gives_the_observations_and_samples_of_step():
    stepped, advanced = (
        FlapVectorEnv(
            num_envs=3, model=synthetic_model(), duration=1.0, record_samples=True, autoreset_mode="Disabled"
        )
        for _ in range(2)
    )
    rng = np.random.default_rng(0)
    np.testing.assert_array_equal(stepped.reset(seed=4)[0], advanced.reset(seed=4)[0])
    ended = False
    while not ended:
        actions = rng.uniform(-1.0, 1.0, (3, 3)).astype(np.float32)
        observation, _, _, truncated, info = stepped.step(actions)
        seen, samples = advanced.advance(actions)
        np.testing.assert_array_equal(seen, observation)
        for name, columns in advanced.sampled.items():
            np.testing.assert_array_equal(samples.take(columns, axis=2), info["samples"][name])
        ended = bool(truncated.all())
    with pytest.raises(ResetNeeded, match="advance: call reset"):
        advanced.advance(np.zeros((3, 3)))
