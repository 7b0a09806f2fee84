"""Target angles and residual actions: what the inner loop promises, and single against vector environment."""

from __future__ import annotations

import dataclasses
import json

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import RecordEpisodeStatistics
from hypothesis import given, settings
from hypothesis import strategies as st
from stable_baselines3.common.env_checker import check_env as check_for_sb3

from flapgym.adapters.sb3 import FlapVecEnv
from flapgym.control import load_agent
from flapgym.envs import FlapEnv, FlapVectorEnv
from flapgym.model import load_model
from flapgym.wrappers.servo import Servo
from flapgym.wrappers.single import Residual, TargetAngle
from flapgym.wrappers.vector import VectorResidual, VectorTargetAngle
from tests.synthetic import synthetic_model

DEGREE = np.pi / 180.0
SERVO = Servo(600.0 * DEGREE, 100.0 * DEGREE, 10.0 * DEGREE, 0.035)
FULL = {
    "task": {"observe": ("azimuth", "rbm", "flap_angle", "flap_rate")},
    "steps_per_action": 1,
    "duration": 0.7,
}


def _run(angle, rate, target, steps):
    """Motion of a double integrator under the law: angles and rates, one more than steps."""
    motion = [(angle, rate)]
    for _ in range(steps):
        acceleration = float(SERVO(np.array(angle), np.array(rate), np.array(0.0), np.array(target)))
        assert abs(acceleration) <= SERVO.acceleration_limit * (1.0 + 1e-12)
        reached = rate + acceleration * SERVO.period
        angle, rate = angle + 0.5 * SERVO.period * (rate + reached), reached
        motion.append((angle, rate))
    return np.array(motion)


@settings(max_examples=200, deadline=None)
@given(st.floats(-10, 10), st.floats(-10, 10))
def test_the_inner_loop_reaches_its_target_from_rest_in_least_time_and_without_overshoot(start, target):
    motion = _run(start * DEGREE, 0.0, target * DEGREE, 20)
    way = (target - start) * DEGREE
    gone = (motion[:, 0] - start * DEGREE) * np.sign(way)
    assert (np.diff(gone) >= -1e-12).all()
    assert gone.max() <= abs(way) + 1e-12
    assert np.abs(motion[:, 1]).max() <= SERVO.rate_limit * (1.0 + 1e-12)
    # No motion can take less than accelerating half the way and braking the other half, between rate limits.
    least = 2.0 * np.sqrt(abs(way) / SERVO.acceleration_limit)
    if least > 2.0 * SERVO.rate_limit / SERVO.acceleration_limit:
        least = abs(way) / SERVO.rate_limit + SERVO.rate_limit / SERVO.acceleration_limit
    actions = int(np.ceil(least / SERVO.period)) + 2
    np.testing.assert_allclose(motion[actions], [target * DEGREE, 0.0], atol=1e-12)


@settings(max_examples=100, deadline=None)
@given(st.floats(-10, 10), st.floats(-100, 100), st.floats(-10, 10))
def test_the_inner_loop_comes_to_rest_at_its_target_from_any_motion(start, rate, target):
    motion = _run(start * DEGREE, rate * DEGREE, target * DEGREE, 30)
    np.testing.assert_allclose(motion[-1], [target * DEGREE, 0.0], atol=1e-12)


@pytest.mark.parametrize("lag", [0.02, 0.05, 0.2])
@pytest.mark.parametrize("steps_per_action", [1, 5, 10])
def test_target_angles_are_reached_without_overshoot_through_a_lag(steps_per_action, lag):
    env = TargetAngle(
        FlapEnv(
            model=synthetic_model(),
            steps_per_action=steps_per_action,
            actuators={"lag": lag},
            record_samples=True,
        )
    )
    env.reset(seed=0, options={"flap_angle": -10.0 * DEGREE})
    target, angles = np.array([0.9, 0.1, -0.6]), []
    for _ in range(500 // steps_per_action):
        angles.append(env.step(target)[4]["samples"]["flap_angle"])
    angle = np.concatenate(angles)
    assert (angle.max(axis=0) <= target * 10.0 * DEGREE + 1e-3 * DEGREE).all()
    np.testing.assert_allclose(angle[-1], target * 10.0 * DEGREE, atol=0.01 * DEGREE)


@pytest.mark.parametrize("steps_per_action", [1, 5])
def test_target_angles_are_reached_and_held(model_file, steps_per_action):
    env = TargetAngle(
        gymnasium.make(
            "flapgym/NREL5MW-v1", model=model_file, steps_per_action=steps_per_action, full_info=True
        )
    )
    env.reset(seed=0, options={"flap_angle": [0.1, 0.0, -0.05], "flap_rate": [0.0, 0.5, 0.0]})
    action = np.array([0.5, -1.0, 0.8], dtype=np.float32)
    for _ in range(100 // steps_per_action):
        _, _, _, _, info = env.step(action)
    np.testing.assert_allclose(info["flap_angle"], action * 10.0 * DEGREE, atol=1e-7)
    np.testing.assert_allclose(info["flap_rate"], 0.0, atol=1e-6)


def _wrapped(model_file):
    keywords = dict(FULL, model=model_file)
    return [
        TargetAngle(gymnasium.make("flapgym/NREL5MW-v1", **keywords)),
        Residual(gymnasium.make("flapgym/NREL5MW-v1", **keywords), "pd", scale=0.3, hold=5),
    ]


@pytest.mark.parametrize("which", [0, 1], ids=["TargetAngle", "Residual"])
@pytest.mark.filterwarnings("ignore:.*is different from the unwrapped version:UserWarning")
def test_wrapped_environments_pass_both_checkers(model_file, which):
    env = _wrapped(model_file)[which]
    check_for_sb3(env)
    check_env(env, skip_render_check=True)


@pytest.mark.parametrize("which", [0, 1], ids=["TargetAngle", "Residual"])
def test_wrapped_environments_are_made_again_from_their_spec(model_file, which):
    env = _wrapped(model_file)[which]
    twin = gymnasium.make(EnvSpec.from_json(env.spec.to_json()))
    # Gymnasium counts the actions that the specification tells, too.
    assert str(twin).replace("TimeLimit<FlapEnv<flapgym/NREL5MW-v1>>", "FlapEnv<flapgym/NREL5MW-v1>") == str(
        env
    )
    (first, _), (other, _) = env.reset(seed=4), twin.reset(seed=4)
    np.testing.assert_array_equal(first, other)
    action = np.array([0.4, -0.2, 0.9], dtype=np.float32)
    for _ in range(5):
        one, two = env.step(action), twin.step(action)
        np.testing.assert_array_equal(one[0], two[0])
        assert one[1] == two[1]


@pytest.mark.parametrize("which", [0, 1], ids=["TargetAngle", "Residual"])
def test_the_state_of_a_wrapped_environment_survives_json(model_file, which):
    env, twin = _wrapped(model_file)[which], _wrapped(model_file)[which]
    action = np.array([0.4, -0.2, 0.9], dtype=np.float32)
    env.reset(seed=4)
    for _ in range(5):
        env.step(action)
    twin.reset(seed=1)
    twin.set_state(json.loads(json.dumps(env.get_state())))
    for _ in range(5):
        np.testing.assert_array_equal(env.step(-action)[0], twin.step(-action)[0])


def _many(which, mode=AutoresetMode.NEXT_STEP, agent="pd", scale=0.3):
    env = FlapVectorEnv(3, autoreset_mode=mode, model=synthetic_model(), **FULL, actuators={"lag": 0.05})
    around = RecordEpisodeStatistics(env)  # one of Gymnasium's between, which hands no state through
    return VectorTargetAngle(around) if which == 0 else VectorResidual(around, agent, scale=scale, hold=3)


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP], ids=str)
@pytest.mark.parametrize("which", [0, 1], ids=["TargetAngle", "Residual"])
def test_the_state_of_wrapped_vectors_survives_json_through_their_autoresets(which, mode):
    env, twin = _many(which, mode), _many(which, mode)
    actions = np.random.default_rng(0).uniform(-1, 1, (120, 3, 3)).astype(np.float32)
    env.reset(seed=4)
    # Not all at once, so that some go on in mid-episode.
    for step, action in enumerate(actions[:40]):
        env.step(action)
        if step == 7:
            env.reset(options={"reset_mask": [True, False, False]})
    twin.reset(seed=1)
    twin.set_state(json.loads(json.dumps(env.get_state())))
    for action in actions[40:]:
        for got, expected in zip(env.step(action)[:4], twin.step(action)[:4], strict=True):
            np.testing.assert_array_equal(got, expected)


DAMAGE = [
    (0, "flaps", lambda state: state.pop("flaps")),
    (0, "flaps", lambda state: state.update(flaps=[[0], [0], [0]])),
    (0, "flaps", lambda state: state.update(flaps=(np.array(state["flaps"]) * np.nan).tolist())),
    (1, "agent", lambda state: state.pop("agent")),
    (1, "agent", lambda state: state.update(agent=3)),
    (1, "agent", lambda state: state["agent"].pop("mind")),
    (1, "agent", lambda state: state["agent"].update(mind=0.0)),
    (1, "agent", lambda state: state["agent"].update(observation=[0.0])),
    (1, "name 'lqg', this one has 'pd'", lambda state: state["agent"].update(name="lqg")),
    (1, "scale 0.1, this one has 0.3", lambda state: state["agent"].update(scale=0.1)),
    (1, "hold 1, this one has", lambda state: state["agent"].update(hold=1)),
]


@pytest.mark.parametrize("many", [False, True])
@pytest.mark.parametrize("which, named, damage", DAMAGE)
def test_a_damaged_state_or_another_agents_is_refused_and_changes_nothing(
    model_file, which, named, damage, many
):
    env, giver = (_many(which) if many else _wrapped(model_file)[which] for _ in range(2))
    for seed, one in enumerate((env, giver)):
        one.reset(seed=seed)
        one.step(np.full(one.action_space.shape, 0.3))
    before, state = env.get_state(), giver.get_state()
    damage(state)
    with pytest.raises(ValueError, match=f"^state: .*{named}"):
        env.set_state(state)
    with pytest.raises(ValueError, match="^state: "):
        env.set_state(giver.unwrapped.get_state())
    assert env.get_state() == before


@pytest.mark.parametrize("many", [False, True])
def test_what_a_caller_does_to_an_observation_does_not_reach_the_agent(model_file, many):
    env, twin = (_many(1) if many else _wrapped(model_file)[1] for _ in range(2))
    env.reset(seed=8)[0][:] = 99.0
    twin.reset(seed=8)
    action = np.zeros(env.action_space.shape)
    for _ in range(3):
        got, expected = env.step(action), twin.step(action)
        np.testing.assert_array_equal(got[4]["agent_action"], expected[4]["agent_action"])
        got[0][:] = 99.0


@pytest.mark.parametrize("many", [False, True])
@pytest.mark.parametrize("which", [0, 1], ids=["TargetAngle", "Residual"])
def test_a_step_before_the_first_reset_is_refused(model_file, which, many):
    env = _many(which) if many else _wrapped(model_file)[which]
    with pytest.raises(gymnasium.error.ResetNeeded, match="call reset first"):
        env.step(np.zeros(env.action_space.shape))


@pytest.mark.parametrize("which", [0, 1], ids=["TargetAngle", "Residual"])
def test_vector_wrappers_take_the_masks_their_environment_takes(which):
    env, twin = _many(which), _many(which)
    for one, masks in ((env, [[True, False, True], None]), (twin, [np.array([True, False, True]), None])):
        one.reset(seed=3)
        one.step(np.ones((3, 3)))
        for mask in masks:
            one.reset(options={"reset_mask": mask})
    np.testing.assert_array_equal(env.step(np.ones((3, 3)))[0], twin.step(np.ones((3, 3)))[0])
    before = env.get_state()
    with pytest.raises(ValueError, match="reset_mask"):
        env.reset(options={"reset_mask": [True]})
    assert env.get_state() == before


def test_no_correction_leaves_the_agent_alone():
    model = synthetic_model()
    agent = load_agent("pd", model)
    plain = FlapEnv(model=model, **FULL)
    corrected = Residual(FlapEnv(model=model, full_info=True, **FULL), agent, hold=4)
    for seed in (1, 2):
        observation, _ = plain.reset(seed=seed)
        corrected.reset(seed=seed)
        state = None
        for _ in range(10):
            rewards = []
            for _ in range(4):
                action, state = agent.predict(observation[2:], state)
                observation, reward, *_ = plain.step(action)
                rewards.append(reward)
            got = corrected.step(np.zeros(3))
            np.testing.assert_array_equal(got[0], observation)
            assert got[1] == pytest.approx(np.mean(rewards))
            assert got[4]["reward_rbm"] == pytest.approx(got[1])
            np.testing.assert_array_equal(got[4]["agent_action"], action)


def test_a_correction_is_scaled_added_and_bounded():
    model = synthetic_model()
    with_another_interval = dict(FULL, steps_per_action=10)
    env, plain = (
        Residual(FlapEnv(model=model, **with_another_interval), "open_loop", scale=0.3),
        FlapEnv(model=model, **with_another_interval),
    )
    env.reset(seed=1)
    plain.reset(seed=1)
    for correction, total in (([1.0, -0.5, 0.0], [0.3, -0.15, 0.0]), ([9.0, 0.0, -9.0], [1.0, 0.0, -1.0])):
        got, expected = env.step(correction), plain.step(total)
        np.testing.assert_allclose(got[0], expected[0], rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("action", [[0.0, np.nan, 0.0], [0.0], 0.0, "up", [[0.0, 0.0, 0.0]]], ids=str)
@pytest.mark.parametrize("which", [0, 1], ids=["TargetAngle", "Residual"])
def test_a_bad_action_is_refused_and_leaves_the_state_untouched(model_file, which, action):
    env, twin = _wrapped(model_file)[which], _wrapped(model_file)[which]
    for one in (env, twin):
        one.reset(seed=8)
        one.step(np.array([0.3, 0.0, -0.2], dtype=np.float32))
    with pytest.raises(ValueError, match="action"):
        env.step(action)
    following = np.array([0.1, 0.2, 0.3], dtype=np.float32)
    np.testing.assert_array_equal(env.step(following)[0], twin.step(following)[0])


@pytest.mark.parametrize("name", ["open_loop", "pd", "pid", "lqg", "lqg_saturating", "ppo", "sac"])
def test_agents_that_treat_each_blade_alone_act_on_one_as_on_each_of_three(name):
    model = load_model()
    agent = load_agent(name, model)
    keywords = {
        "model": model,
        "single_blade": True,
        "task": {"observe": agent.observe},
        "steps_per_action": agent.steps_per_action,
    }
    env = Residual(FlapEnv(**keywords), name)
    many = VectorResidual(FlapVectorEnv(2, **keywords), agent)
    observation, _ = env.reset(seed=5)
    many.reset(seed=5)
    state = None
    for _ in range(10):
        expected, state = agent.predict(np.repeat(observation, 3), state)
        observation, _, _, _, info = env.step(np.zeros(1))
        np.testing.assert_allclose(info["agent_action"], expected[:1], rtol=1e-6)
        together = many.step(np.zeros((2, 1)))[4]["agent_action"]
        np.testing.assert_allclose(together[0], expected[:1], rtol=1e-5, atol=1e-6)


class _Known:
    """An agent of somebody else's."""

    name, observe, steps_per_action = "known", ("rbm",), 5

    def __init__(self, size):
        self.size = size

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        return np.zeros(self.size, dtype=np.float32), None


@pytest.mark.parametrize("vector", [False, True])
def test_agents_that_need_three_blades_are_refused_for_one(vector):
    cls, wrap = (FlapVectorEnv, VectorResidual) if vector else (FlapEnv, Residual)

    def env(steps, *observe):
        return cls(model=load_model(), single_blade=True, task={"observe": observe}, steps_per_action=steps)

    motion = ("rbm", "flap_angle", "flap_rate")
    for name in ("individual_flap", "lqg_multiblade_saturating"):
        with pytest.raises(ValueError, match=f"agent {name} observes azimuth, which a single blade does not"):
            wrap(env(1, *motion), name)
    shared = load_agent("ppo", load_model())
    of_three = dataclasses.replace(
        shared,
        name="of_three",
        per_blade=False,
        offset=np.tile(shared.offset, 3),
        scale=np.tile(shared.scale, 3),
        weights=(np.zeros((3, 9)),),
        biases=(np.zeros(3),),
    )
    with pytest.raises(ValueError, match="agent of_three cannot act on a single blade: .*expected 9"):
        wrap(env(shared.steps_per_action, *shared.observe), of_three)
    with pytest.raises(ValueError, match="agent known cannot act on a single blade: .*shape \\(3,\\)"):
        wrap(env(5, "rbm"), _Known(3))
    wrap(env(5, "rbm"), _Known(1))


def test_what_is_no_agent_is_refused():
    with pytest.raises(
        TypeError, match="agent: expected a shipped agent's name, .* got object, which has no name"
    ):
        Residual(FlapEnv(model=synthetic_model()), object())


def test_what_does_not_fit_is_refused_with_what_to_write_instead():
    model = synthetic_model()
    with pytest.raises(
        ValueError, match=r"observes flap_angle.*task={\"observe\": \('rbm', 'flap_angle', 'flap_rate'\)}"
    ):
        Residual(FlapEnv(model=model, steps_per_action=1), "pd")
    with pytest.raises(ValueError, match="make it with steps_per_action=1"):
        Residual(FlapEnv(model=model, **dict(FULL, steps_per_action=5)), "pd")
    with pytest.raises(ValueError, match="scale: expected a positive"):
        Residual(FlapEnv(model=model, **FULL), "pd", scale=0.0)
    with pytest.raises(ValueError, match="hold: expected a whole"):
        Residual(FlapEnv(model=model, **FULL), "pd", hold=0)
    with pytest.raises(TypeError, match="expected an environment of flapgym, got PendulumEnv"):
        TargetAngle(gymnasium.make("Pendulum-v1"))


@pytest.mark.parametrize("mode", list(AutoresetMode), ids=str)
@pytest.mark.parametrize("which", ["target", "residual"])
def test_vector_wrappers_do_what_the_single_ones_do(mode, which):
    model, count = synthetic_model(), 3
    keywords = FULL | {"actuators": {"lag": 0.05}}
    native = FlapVectorEnv(count, autoreset_mode=mode, model=model, **keywords)
    wraps = {
        "target": (VectorTargetAngle, TargetAngle),
        "residual": (
            lambda env: VectorResidual(env, "pd", scale=0.3, hold=3),
            lambda env: Residual(env, "pd", scale=0.3, hold=3),
        ),
    }[which]
    vector, singles = wraps[0](native), [wraps[1](FlapEnv(model=model, **keywords)) for _ in range(count)]
    observation, _ = vector.reset(seed=7)
    firsts = [env.reset(seed=7 + index)[0] for index, env in enumerate(singles)]
    np.testing.assert_allclose(observation, firsts, rtol=1e-6, atol=1e-7)
    rng = np.random.default_rng(0)
    ended = np.zeros(count, dtype=bool)
    for _ in range(120):
        if mode is AutoresetMode.DISABLED and ended.any():
            observation, _ = vector.reset(options={"reset_mask": ended.copy()})
            for index in np.flatnonzero(ended):
                np.testing.assert_allclose(
                    observation[index], singles[index].reset()[0], rtol=1e-5, atol=1e-6
                )
            ended[:] = False
        actions = rng.uniform(-1, 1, (count, 3)).astype(np.float32)
        observation, reward, _, truncated, _ = vector.step(actions)
        for index, env in enumerate(singles):
            if mode is AutoresetMode.NEXT_STEP and ended[index]:
                np.testing.assert_allclose(observation[index], env.reset()[0], rtol=1e-5, atol=1e-6)
                ended[index] = False
                continue
            one, one_reward, _, one_truncated, _ = env.step(actions[index])
            assert reward[index] == pytest.approx(one_reward, rel=1e-6)
            assert truncated[index] == one_truncated
            ended[index] = one_truncated
            if one_truncated and mode is AutoresetMode.SAME_STEP:
                one, _ = env.reset()
            np.testing.assert_allclose(observation[index], one, rtol=1e-5, atol=1e-6)


def test_stable_baselines_takes_a_wrapped_vector_environment():
    keywords = dict(FULL, task={"observe": ("rbm", "flap_angle", "flap_rate")})
    native = FlapVectorEnv(2, autoreset_mode="SameStep", model=synthetic_model(), **keywords)
    env = FlapVecEnv(VectorTargetAngle(native), per_blade=True)
    assert env.reset().shape == (6, 3)
    for _ in range(40):
        observation, *_ = env.step(np.full((6, 1), 0.5, dtype=np.float32))
    np.testing.assert_allclose(observation[:, 1], 5.0 * DEGREE, atol=1e-6)
