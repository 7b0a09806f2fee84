"""Three flaps a blade in all that is built around a plant: actions, observations, wrappers, adapter, pictures."""

from __future__ import annotations

import itertools
import json

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from stable_baselines3.common.env_checker import check_env as check_for_sb3

from flapgym.adapters.sb3 import FlapVecEnv
from flapgym.envs import FlapEnv, FlapVectorEnv
from flapgym.envs.rendering import BLADE_COLOURS, BLADE_SPAN, Screen
from flapgym.model import save_model
from flapgym.wrappers.single import Residual, TargetAngle
from flapgym.wrappers.vector import VectorResidual, VectorTargetAngle
from tests.synthetic import synthetic_model

MODEL = synthetic_model(flaps=3)
LIMITS = np.array([[flap.angle_limit, flap.rate_limit, flap.acceleration_limit] for flap in MODEL.flaps]).T
OBSERVE = {"observe": ("rbm", "flap_angle", "flap_rate")}
BACKENDS = ["numba", "numpy"]


def _env(cls=FlapEnv, **keywords):
    return cls(model=MODEL, task=OBSERVE, duration=0.7, **keywords)


@pytest.mark.parametrize("single_blade", [False, True])
@pytest.mark.parametrize("backend", BACKENDS)
def test_actions_and_motion_are_blade_by_blade_and_flap_by_flap(backend, single_blade):
    env = _env(backend=backend, single_blade=single_blade, full_info=True)
    blades = 1 if single_blade else 3
    assert env.action_space.shape == (3 * blades,)
    assert {name: len(place) for name, place in env.observed.items()} == {
        "rbm": blades,
        "flap_angle": 3 * blades,
        "flap_rate": 3 * blades,
    }
    high = env.observation_space.high[env.observed["flap_angle"]]
    np.testing.assert_allclose(high, np.tile(LIMITS[0], blades), rtol=1e-7)
    for flap in range(3 * blades):
        env.reset(seed=0)
        action = np.zeros(3 * blades, dtype=np.float32)
        action[flap] = 0.1
        observation, *_, info = env.step(action)
        expected = np.zeros(3 * blades)
        expected[flap] = 0.1 * LIMITS[2][flap % 3] * 0.035
        np.testing.assert_allclose(info["flap_rate"], expected, rtol=1e-6, atol=1e-15)
        np.testing.assert_allclose(observation[env.observed["flap_rate"]], expected, rtol=1e-6, atol=1e-12)
        np.testing.assert_array_equal(env.flap_motion()[1], info["flap_rate"])
    assert info["flap_stopped"].shape == info["flap_travel"].shape == (3 * blades,)


@pytest.mark.parametrize("backend", BACKENDS)
def test_each_flap_keeps_its_own_stops(backend):
    env = _env(backend=backend, full_info=True)
    env.reset(seed=0)
    for _ in range(20):
        observation, reward, _, _, info = env.step(np.ones(9))
        assert observation in env.observation_space
        assert np.isfinite(reward)
    np.testing.assert_array_equal(info["flap_angle"], np.tile(LIMITS[0], 3))
    assert info["flap_stopped"].all()


def test_a_flap_that_is_not_finite_is_named():
    env, many = _env(), _env(FlapVectorEnv, num_envs=2)
    env.reset(seed=0)
    many.reset(seed=0)
    with pytest.raises(ValueError, match="got nan for blade 2, flap 3$"):
        env.step(np.array([0.0] * 5 + [np.nan] + [0.0] * 3))
    actions = np.zeros((2, 9))
    actions[1, 3] = np.inf
    with pytest.raises(ValueError, match="got inf for blade 2, flap 1 of environment 1$"):
        many.step(actions)


def test_reset_options_are_one_a_flap():
    env = _env(full_info=True)
    angle = 0.5 * np.tile(LIMITS[0], 3) * np.linspace(-1.0, 1.0, 9)
    _, info = env.reset(seed=0, options={"flap_angle": angle, "flap_rate": 0.01})
    np.testing.assert_array_equal(info["flap_angle"], angle)
    np.testing.assert_array_equal(info["flap_rate"], np.full(9, 0.01))
    with pytest.raises(ValueError, match="options.flap_angle: expected finite numbers within"):
        env.reset(options={"flap_angle": np.tile(LIMITS[0][::-1], 3)})


def test_faults_are_one_a_blade_or_one_a_flap():
    one_a_blade = _env(actuators={"stuck": (None, 0.02, None)}, full_info=True)
    one_a_flap = _env(actuators={"stuck": (None,) * 4 + (0.02,) + (None,) * 4}, full_info=True)
    for env, stuck in ((one_a_blade, [3, 4, 5]), (one_a_flap, [4])):
        env.reset(seed=0)
        info = env.step(np.full(9, 0.5))[4]
        assert np.flatnonzero(info["flap_angle"] == 0.02).tolist() == stuck
    with pytest.raises(
        ValueError, match="actuators.stuck: expected 3 entries, one a blade, or 9, one a flap, got 2"
    ):
        _env(actuators={"stuck": (None, None)})


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("single_blade", [False, True])
def test_one_is_many_to_round_off(backend, single_blade):
    keywords = {"backend": backend, "single_blade": single_blade, "sensors": {"noise": 1e3}}
    many, ones = _env(FlapVectorEnv, num_envs=2, **keywords), [_env(**keywords) for _ in range(2)]
    many.reset(seed=3)
    for seed, env in enumerate(ones, start=3):
        env.reset(seed=seed)
    rng = np.random.default_rng(0)
    for _ in range(15):
        actions = rng.uniform(-1, 1, many.action_space.shape).astype(np.float32)
        observation, reward, *_ = many.step(actions)
        steps = [env.step(action) for env, action in zip(ones, actions, strict=True)]
        np.testing.assert_allclose(observation, [step[0] for step in steps], rtol=2e-7, atol=1e-12)
        np.testing.assert_allclose(reward, [step[1] for step in steps], rtol=1e-12)


@pytest.mark.parametrize("cls", [FlapEnv, FlapVectorEnv])
def test_a_state_goes_on_bit_for_bit(cls):
    env, twin = _env(cls), _env(cls)
    actions = np.random.default_rng(1).uniform(-1, 1, (12, *env.action_space.shape))
    env.reset(seed=0)
    for action in actions[:6]:
        env.step(action)
    twin.set_state(json.loads(json.dumps(env.get_state())))
    for action in actions[6:]:
        np.testing.assert_array_equal(env.step(action)[0], twin.step(action)[0])


def test_checkers_pass(tmp_path):
    save_model(MODEL, tmp_path / "three.safetensors")
    for keywords in ({}, {"single_blade": True}):
        env = gymnasium.make(
            "flapgym/NREL5MW-v1", model=tmp_path / "three.safetensors", task=OBSERVE, **keywords
        )
        check_env(env.unwrapped)
        check_for_sb3(env.unwrapped)
        check_for_sb3(TargetAngle(env))


@pytest.mark.parametrize("lag", [0.0, 0.02])
@pytest.mark.parametrize("single_blade", [False, True])
def test_target_angles_are_fractions_of_each_flap_s_stop(single_blade, lag):
    keywords = {"single_blade": single_blade, "actuators": {"lag": lag}, "steps_per_action": 1}
    one = TargetAngle(FlapEnv(model=MODEL, full_info=True, **keywords))
    many = VectorTargetAngle(FlapVectorEnv(2, model=MODEL, **keywords))
    one.reset(seed=0)
    many.reset(seed=0)
    count = one.action_space.shape[0]
    target = np.linspace(-0.8, 0.9, count)
    for _ in range(500):
        *_, info = one.step(target)
        *_, infos = many.step(np.stack([target, -target]))
    reached = target * np.tile(LIMITS[0], count // 3)
    np.testing.assert_allclose(info["flap_angle"], reached, atol=1e-4)
    np.testing.assert_allclose(infos["flap_angle"], [reached, -reached], atol=1e-4)


class Known:
    """An agent of somebody else's, made for such a turbine."""

    name, observe, steps_per_action = "known", ("rbm", "flap_angle"), 1

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        """Pushes every flap back."""
        return -observation[..., 3:], None


def test_an_agent_is_corrected_flap_by_flap():
    one = Residual(FlapEnv(model=MODEL, task=OBSERVE, steps_per_action=1), Known(), scale=0.5)
    many = VectorResidual(FlapVectorEnv(2, model=MODEL, task=OBSERVE, steps_per_action=1), Known(), scale=0.5)
    plain = FlapEnv(model=MODEL, task=OBSERVE, steps_per_action=1)
    observation, _ = plain.reset(seed=0)
    one.reset(seed=0)
    many.reset(seed=0)
    correction = np.linspace(-1.0, 1.0, 9)
    for _ in range(5):
        action = -observation[plain.observed["flap_angle"]] + 0.5 * correction
        observation, *_ = plain.step(action)
        np.testing.assert_allclose(one.step(correction)[0], observation, rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(
            many.step(np.tile(correction, (2, 1)))[0][0], observation, rtol=1e-6, atol=1e-9
        )


def test_stable_baselines_takes_turbines_and_blades_of_three_flaps():
    def vector():
        return _env(FlapVectorEnv, num_envs=2, autoreset_mode="SameStep")

    whole, blades = FlapVecEnv(vector()), FlapVecEnv(vector(), per_blade=True)
    assert (whole.action_space.shape, blades.action_space.shape) == ((9,), (3,))
    whole.seed(1)
    blades.seed(1)
    full, split = whole.reset(), blades.reset()
    assert (full.shape, split.shape) == ((2, 21), (6, 7))
    rng = np.random.default_rng(0)
    for _ in range(20):
        actions = rng.uniform(-1, 1, (6, 3)).astype(np.float32)
        full, reward, _, _ = whole.step(actions.reshape(2, 9))
        split, own_reward, dones, infos = blades.step(actions)
        by_blade = np.concatenate(
            [full[:, :3].reshape(6, 1), full[:, 3:12].reshape(6, 3), full[:, 12:].reshape(6, 3)], axis=1
        )
        np.testing.assert_array_equal(split, by_blade)
        np.testing.assert_allclose(own_reward.reshape(2, 3).mean(axis=1), reward, rtol=1e-5)
        assert all(blades.observation_space.contains(row) for row in split)
    assert dones.all()
    assert infos[5]["terminal_observation"].shape == (7,)
    of_targets = FlapVecEnv(VectorTargetAngle(vector()), per_blade=True)
    of_targets.reset()
    assert of_targets.step(np.zeros((6, 3)))[0].shape == (6, 7)


@pytest.mark.parametrize("single_blade", [False, True])
def test_every_flap_is_in_the_picture(single_blade):
    pytest.importorskip("pygame")
    env = _env(render_mode="rgb_array", single_blade=single_blade)
    env.reset(seed=0, options={"azimuth": 0.0})
    still = env.render()
    count = env.action_space.shape[0]
    pictures = []
    for flap in range(count):
        env.reset(seed=0, options={"azimuth": 0.0, "flap_angle": 0.1 * np.eye(count)[flap]})
        pictures.append(env.render())
        assert (pictures[-1][:390] != still[:390]).any()
    assert len({picture.tobytes() for picture in pictures}) == count
    for _ in range(10):
        env.step(np.linspace(-1, 1, count))
    traces = env.render()[180:290, 345:625].reshape(-1, 3)
    for colour in BLADE_COLOURS[: count // 3]:
        assert (traces == colour).all(axis=1).any()


def test_flaps_of_unknown_place_share_the_blade_s_length():
    pytest.importorskip("pygame")
    spans = Screen(MODEL, "rgb_array", 0.1, lambda: None)._spans
    assert len(spans) == 3
    assert (spans[0][0], spans[-1][1]) == BLADE_SPAN
    assert all(inner[1] == outer[0] for inner, outer in itertools.pairwise(spans))
