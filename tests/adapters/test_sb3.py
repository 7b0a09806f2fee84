"""The Stable-Baselines3 adapter: its interface, the ending step, one environment a blade."""

from __future__ import annotations

import subprocess
import sys
import types
from dataclasses import replace

import numpy as np
import pytest
from stable_baselines3.common.vec_env import VecMonitor, VecVideoRecorder

from flapgym.adapters.sb3 import FlapVecEnv
from flapgym.envs import FlapRangeVectorEnv, FlapVectorEnv
from flapgym.model import ModelSet
from tests.synthetic import synthetic_model

KEYWORDS = {"duration": 0.7, "task": {"observe": ("rbm", "flap_angle", "flap_rate")}}


def _vector(count=2, mode="SameStep", **keywords):
    return FlapVectorEnv(count, autoreset_mode=mode, model=synthetic_model(), **KEYWORDS, **keywords)


def test_the_ending_step_hands_over_the_last_observation_and_its_reason():
    env, twin = FlapVecEnv(_vector()), _vector(mode="Disabled")
    env.seed(4)
    np.testing.assert_array_equal(env.reset(), twin.reset(seed=4)[0])
    action = np.full((2, 3), 0.2, dtype=np.float32)
    for _ in range(19):
        _, _, dones, infos = env.step(action)
        last, *_ = twin.step(action)
        assert not dones.any()
        assert infos == [{}, {}]
    observation, rewards, dones, infos = env.step(action)
    last, expected_rewards, *_ = twin.step(action)
    assert dones.all()
    assert rewards.dtype == np.float32
    np.testing.assert_allclose(rewards, expected_rewards, rtol=1e-6)
    for turbine, info in enumerate(infos):
        np.testing.assert_array_equal(info["terminal_observation"], last[turbine])
        assert info["TimeLimit.truncated"] is True
        assert not np.array_equal(observation[turbine], last[turbine])


def test_per_blade_environments_are_the_columns_of_the_turbines():
    whole, blades = FlapVecEnv(_vector()), FlapVecEnv(_vector(), per_blade=True)
    whole.seed(1)
    blades.seed(1)
    full, split = whole.reset(), blades.reset()
    assert split.shape == (6, 3)
    assert blades.action_space.shape == (1,)
    action = np.random.default_rng(0).uniform(-1, 1, (6, 1)).astype(np.float32)
    for _ in range(20):
        for turbine in range(2):
            for blade in range(3):
                np.testing.assert_array_equal(split[3 * turbine + blade], full[turbine, blade::3])
        full, reward, _, _ = whole.step(action.reshape(2, 3))
        split, blade_reward, dones, infos = blades.step(action)
        np.testing.assert_allclose(blade_reward.reshape(2, 3).mean(axis=1), reward, rtol=1e-5)
    assert dones.shape == (6,)
    assert infos[5]["terminal_observation"].shape == (3,)


def test_turbines_over_wind_speeds_hand_over_their_last_observation_and_are_not_split_by_blade():
    models = ModelSet.of([replace(synthetic_model(), wind_speed=speed) for speed in (9.0, 11.0)])
    vector, twin = (
        FlapRangeVectorEnv(3, mode, model=models, **KEYWORDS) for mode in ("SameStep", "Disabled")
    )
    env = FlapVecEnv(vector)
    env.seed(4)
    np.testing.assert_array_equal(env.reset(), twin.reset(seed=4)[0])
    for _ in range(20):
        *_, infos = env.step(np.zeros((3, 3), dtype=np.float32))
        last, *_ = twin.step(np.zeros((3, 3)))
    np.testing.assert_array_equal([info["terminal_observation"] for info in infos], last)
    with pytest.raises(ValueError, match="^per_blade: expected False with an environment over wind speeds"):
        FlapVecEnv(vector, per_blade=True)


def test_episode_statistics_work_through_vec_monitor():
    env = VecMonitor(FlapVecEnv(_vector(), per_blade=True))
    env.reset()
    for _ in range(20):
        *_, infos = env.step(np.zeros((6, 1), dtype=np.float32))
    assert infos[0]["episode"]["l"] == 20


def test_a_quantity_that_belongs_to_no_blade_is_refused_per_blade():
    vector = FlapVectorEnv(
        1, autoreset_mode="SameStep", model=synthetic_model(), task={"observe": ("rbm", "azimuth")}
    )
    with pytest.raises(ValueError, match="azimuth"):
        FlapVecEnv(vector, per_blade=True)


def test_another_autoreset_mode_is_refused():
    with pytest.raises(ValueError, match="SameStep"):
        FlapVecEnv(_vector(mode="NextStep"))


@pytest.mark.parametrize("per_blade", [False, True])
def test_it_shows_the_turbines_side_by_side(per_blade):
    vector = _vector(render_mode="rgb_array")
    env = FlapVecEnv(vector, per_blade)
    env.reset()
    env.step(np.full((env.num_envs, *env.action_space.shape), 0.5))
    pictures = env.get_images()
    np.testing.assert_array_equal(pictures, vector.render())
    height, width, _ = pictures[0].shape
    tiled = env.render()
    np.testing.assert_array_equal(tiled[:height, :width], pictures[0])


def test_a_video_recorder_finds_what_it_needs(monkeypatch, tmp_path):
    # moviepy writes the files and is no dependency of ours; the recorder looks whether it is there.
    monkeypatch.setitem(sys.modules, "moviepy", types.ModuleType("moviepy"))
    env = FlapVecEnv(_vector(render_mode="rgb_array"))
    recorder = VecVideoRecorder(env, str(tmp_path), lambda step: step == 0, video_length=9)
    assert recorder.frames_per_sec == env.base.metadata["render_fps"]
    recorder.reset()
    for _ in range(3):
        recorder.step(np.zeros((2, 3)))
    frames = recorder.recorded_frames
    assert len(frames) == 4
    recorder.recorded_frames = []  # else it says that it has not saved them
    assert {(frame.dtype, frame.shape) for frame in frames} == {(np.dtype(np.uint8), frames[0].shape)}


def test_without_a_render_mode_there_is_no_picture_and_a_word_about_it():
    env = FlapVecEnv(_vector())
    env.reset()
    with pytest.warns(UserWarning, match="render_mode"):
        assert env.render() is None


@pytest.mark.parametrize("per_blade", [False, True])
def test_actions_of_another_shape_are_refused_and_leave_the_state_untouched(per_blade):
    env, twin = (FlapVecEnv(_vector(), per_blade) for _ in range(2))
    for one in (env, twin):
        one.seed(3)
        one.reset()
    expected = (6, 1) if per_blade else (2, 3)
    for shape in ((3, 2), (6,), (1, 6), (2, 3, 1), (2, 3) if per_blade else (6, 1)):
        with pytest.raises(ValueError, match=rf"^action: expected shape \({expected[0]}, {expected[1]}\)"):
            env.step(np.zeros(shape))
    actions = np.arange(6).reshape(expected) / 6.0
    np.testing.assert_array_equal(env.step(actions.tolist())[0], twin.step(actions)[0])


def test_without_stable_baselines_the_extra_is_named():
    code = "import sys; sys.modules['stable_baselines3'] = None; import flapgym.adapters.sb3"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert run.stderr.rstrip().endswith('needs Stable-Baselines3: pip install "flapgym[train]"')
