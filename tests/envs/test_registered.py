"""Every registered id under the checkers of Gymnasium and Stable-Baselines3 and under Gymnasium's own generic tests.

Warnings are errors throughout.
"""

from __future__ import annotations

import copy
import json
import pickle

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env, data_equivalence
from stable_baselines3.common.env_checker import check_env as check_for_sb3

from flapgym.envs.registration import ENVIRONMENTS

# Gymnasium says of each version 0 that there is a newer one; nothing else may be said.
pytestmark = pytest.mark.filterwarnings("ignore:.*The environment flapgym/.*-v0 is out of date")

every_id = pytest.mark.parametrize("name", [entry.id for entry in ENVIRONMENTS])
STEPS = 25


def _rollout(env, seed, steps=STEPS):
    """Everything an environment returns, from the reset on."""
    env.action_space.seed(seed)
    yield env.reset(seed=seed)
    for _ in range(steps):
        yield env.step(env.action_space.sample())


@every_id
def test_both_checkers_pass_without_a_warning(name):
    env = gymnasium.make(name, render_mode="rgb_array")
    check_env(env.unwrapped)
    check_for_sb3(env.unwrapped)
    env.close()


@every_id
def test_the_same_seed_gives_the_same_episode(name):
    with_checks, without = gymnasium.make(name), gymnasium.make(name, disable_env_checker=True)
    for one, other in zip(_rollout(with_checks, 7), _rollout(without, 7), strict=True):
        assert data_equivalence(one, other, exact=True)
    assert not data_equivalence(without.reset(seed=8), without.reset(seed=7), exact=True)


@every_id
def test_an_episode_does_not_depend_on_the_one_before(name):
    env, fresh = gymnasium.make(name), gymnasium.make(name)
    list(_rollout(env, 1))
    for one, other in zip(_rollout(env, 2), _rollout(fresh, 2), strict=True):
        assert data_equivalence(one, other, exact=True)


@every_id
def test_what_was_returned_is_never_changed_afterwards(name):
    returned, copies = [], []
    for step in _rollout(gymnasium.make(name), 3):
        returned.append(step)
        copies.append(copy.deepcopy(step))
    for one, other in zip(returned, copies, strict=True):
        assert data_equivalence(one, other, exact=True)
    observations = [step[0] for step in returned]
    assert not any(
        np.shares_memory(one, other) for i, one in enumerate(observations) for other in observations[:i]
    )
    infos = [step[-1] for step in returned]
    assert not any(one is other for i, one in enumerate(infos) for other in infos[:i])


@every_id
@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_goes_on_as_the_original(name, copied):
    env = gymnasium.make(name).unwrapped
    list(_rollout(env, 4))
    twin = copied(env)
    action = env.action_space.sample()
    for _ in range(2):  # into the next episode
        for _ in range(10):
            assert data_equivalence(env.step(action), twin.step(action), exact=True)
        assert data_equivalence(env.reset(), twin.reset(), exact=True)


@every_id
@pytest.mark.parametrize("bad", [np.nan, np.inf, "shape", "words"])
def test_a_bad_action_is_refused_and_leaves_the_state_untouched(name, bad):
    env, twin = gymnasium.make(name).unwrapped, gymnasium.make(name).unwrapped
    for one in (env, twin):
        one.reset(seed=8)
    fine = env.action_space.sample()
    wrong = {"shape": np.zeros(7, dtype=np.float32), "words": "full"}.get(bad)
    wrong = np.full_like(fine, bad) if wrong is None else wrong
    for _ in range(3):
        with pytest.raises(ValueError, match="action"):
            env.step(wrong)
        assert data_equivalence(env.step(fine), twin.step(fine), exact=True)


@every_id
def test_a_state_survives_json_and_goes_on_bit_for_bit(name):
    env, twin = gymnasium.make(name).unwrapped, gymnasium.make(name).unwrapped
    list(_rollout(env, 4))
    twin.reset(seed=1)
    twin.set_state(json.loads(json.dumps(env.get_state())))
    action = env.action_space.sample()
    for _ in range(10):
        assert data_equivalence(env.step(action), twin.step(action), exact=True)
    assert data_equivalence(env.reset(), twin.reset(), exact=True)


@every_id
def test_the_spec_survives_pickle_and_json(name):
    env = gymnasium.make(name, duration=1.0)
    assert env.spec is not None
    first = env.reset(seed=3)[0]
    for spec in (pickle.loads(pickle.dumps(env.spec)), EnvSpec.from_json(env.spec.to_json())):
        np.testing.assert_array_equal(gymnasium.make(spec).reset(seed=3)[0], first)


@every_id
def test_every_render_mode_renders(name):
    for mode in gymnasium.make(name).metadata["render_modes"]:
        env = gymnasium.make(name, render_mode=mode)
        assert env.render_mode == mode
        env.reset(seed=0)
        env.step(env.action_space.sample())
        picture = env.render()
        if mode == "rgb_array":
            assert picture.shape == (480, 640, 3)
            assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 10
        env.close()


@every_id
def test_make_vec_gives_the_trajectories_of_single_environments(name):
    vector = gymnasium.make_vec(name, num_envs=3, duration=1.0)
    singles = [gymnasium.make(name, duration=1.0) for _ in range(3)]
    observation, _ = vector.reset(seed=5)
    np.testing.assert_allclose(
        observation, [env.reset(seed=5 + i)[0] for i, env in enumerate(singles)], rtol=1e-5, atol=1e-6
    )
    vector.action_space.seed(0)
    for _ in range(20):
        actions = vector.action_space.sample()
        observation, reward, terminated, truncated, info = vector.step(actions)
        steps = [env.step(action) for env, action in zip(singles, actions, strict=True)]
        np.testing.assert_allclose(observation, [step[0] for step in steps], rtol=1e-5, atol=1e-6)
        np.testing.assert_allclose(reward, [step[1] for step in steps], rtol=1e-9)
        np.testing.assert_array_equal(truncated, [step[3] for step in steps])
        assert not terminated.any()
        assert {name for name in info if not name.startswith("_")} >= set(steps[0][4])


@every_id
def test_ten_thousand_random_actions_leave_every_number_finite_and_in_bounds(name):
    env = gymnasium.make_vec(name, num_envs=64, steps_per_action=10)
    env.action_space.seed(1)
    env.reset(seed=1)
    # Over wind speeds each has a model of its own.
    models = getattr(env.unwrapped, "models", [env.unwrapped.model])
    largest = 10.0 * max(model.rbm_rms for model in models)
    for _ in range(160):
        observation, reward, terminated, _, info = env.step(env.action_space.sample())
        assert env.observation_space.contains(observation)
        assert np.isfinite(reward).all()
        assert not terminated.any()
        assert np.abs(info["rbm"]).max() < largest
