"""Wrappers around turbines whose blades pitch: flaps come first, and what an agent does not move stays free."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest

import flapgym  # noqa: F401 (registers the environments)
from flapgym.adapters.sb3 import FlapVecEnv
from flapgym.wrappers.single import Residual, TargetAngle
from flapgym.wrappers.vector import VectorResidual, VectorTargetAngle

ID = "flapgym/NREL5MWPitch-v0"
TASK = {"observe": ("flap_angle", "rbm", "flap_rate", "azimuth")}


def test_target_angles_are_of_the_flaps_and_pitch_passes_as_it_is():
    env = TargetAngle(gymnasium.make(ID, full_info=True, duration=4.0))
    many = VectorTargetAngle(gymnasium.make_vec(ID, num_envs=2, duration=4.0))
    env.reset(seed=0)
    many.reset(seed=0)
    action = np.array([0.5, -0.2, 0.1, 0.3, -0.4, 0.2])
    for _ in range(110):
        *_, info = env.step(action)
        *_, infos = many.step(np.stack([action, action]))
    limits = env.unwrapped.model.flaps[0].angle_limit, env.unwrapped.model.pitch_actuator.angle_limit
    np.testing.assert_allclose(info["flap_angle"], action[:3] * limits[0], atol=1e-6)
    np.testing.assert_allclose(info["pitch_angle"], action[3:] * limits[1], atol=1e-4)
    np.testing.assert_allclose(infos["pitch_angle"][0], info["pitch_angle"], atol=1e-12)


def test_a_correction_moves_pitch_beside_an_agent_of_the_flaps():
    env = Residual(gymnasium.make(ID, task=TASK, steps_per_action=1, full_info=True), "lqg", scale=0.5)
    many = VectorResidual(gymnasium.make_vec(ID, num_envs=2, task=TASK, steps_per_action=1), "lqg", scale=0.5)
    env.reset(seed=0)
    many.reset(seed=0)
    action = np.array([0.0, 0.0, 0.0, 1.0, 0.0, -1.0])
    for _ in range(300):
        *_, info = env.step(action)
        *_, infos = many.step(np.stack([action, action]))
    assert info["agent_action"].shape == (6,)
    limit = env.unwrapped.model.pitch_actuator.angle_limit
    np.testing.assert_allclose(info["pitch_angle"], 0.5 * limit * action[3:], atol=0.02 * limit)
    np.testing.assert_allclose(infos["pitch_angle"][0], info["pitch_angle"], atol=1e-12)


def test_an_agent_that_pitches_is_refused_where_pitch_stays():
    env = gymnasium.make("flapgym/NREL5MWSite-v0", task=TASK)
    with pytest.raises(
        ValueError, match=r"^agent individual_pitch: moves the blades' pitch; take an environment"
    ):
        Residual(env, "individual_pitch")


def test_blades_that_pitch_are_no_environments_of_their_own():
    envs = gymnasium.make_vec(ID, num_envs=2, autoreset_mode="SameStep")
    with pytest.raises(ValueError, match=r"^per_blade: expected False with pitch=True"):
        FlapVecEnv(envs, per_blade=True)
    assert FlapVecEnv(envs).action_space.shape == (6,)
