"""The picture shows the turbine."""

from __future__ import annotations

import copy
import pickle

import gymnasium
import numpy as np
import pytest

from flapgym.envs import FlapEnv, FlapVectorEnv
from flapgym.envs.rendering import _place, _round_step

pygame = pytest.importorskip("pygame")


def _run(env, actions):
    env.reset(seed=0, options={"azimuth": 0.0})
    for action in actions:
        env.step(action)
    return env


def test_a_frame_is_a_picture_that_changes_with_the_state(model_file):
    env = gymnasium.make("flapgym/NREL5MW-v1", model=model_file, render_mode="rgb_array")
    still = _run(env, np.zeros((30, 3))).render()
    moved = _run(env, np.tile([1.0, 0.0, -1.0], (30, 1))).render()
    assert still.shape == (480, 640, 3)
    assert still.dtype == np.uint8
    assert (still != moved).any()
    # Red for a flap that adds lift, blue for one that takes it away.
    assert ((moved == (200, 40, 40)).all(axis=2)).sum() > ((still == (200, 40, 40)).all(axis=2)).sum()
    env.close()


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_pictures_of_a_vector_are_those_of_its_environments_through_an_autoreset(model_file, mode):
    keywords = {"model": model_file, "duration": 0.2, "render_mode": "rgb_array"}
    mode = gymnasium.vector.AutoresetMode(mode)
    many = gymnasium.make_vec("flapgym/NREL5MW-v1", num_envs=2, autoreset_mode=mode, **keywords)
    each = gymnasium.vector.SyncVectorEnv([lambda: FlapEnv(**keywords)] * 2, autoreset_mode=mode)
    for env in (many, each):
        env.reset(seed=0)
        for _ in range(9):  # episodes take six actions
            env.step(np.tile(np.float32([0.5, 0.0, -0.5]), (2, 1)))
    frames = many.render()
    assert isinstance(frames, tuple)
    assert (frames[0] != frames[1]).any()
    np.testing.assert_array_equal(frames, each.render())


COPIED = {"deepcopy": copy.deepcopy, "pickle": lambda env: pickle.loads(pickle.dumps(env))}


@pytest.mark.parametrize("copied", COPIED)
@pytest.mark.parametrize("many", [False, True])
def test_a_copy_of_an_environment_with_pictures_goes_on_as_the_original(model_file, many, copied):
    keywords = {"model": model_file, "render_mode": "rgb_array"}
    env = FlapVectorEnv(2, **keywords) if many else FlapEnv(**keywords)
    action = np.full(env.action_space.shape, 0.4, dtype=np.float32)
    _run(env, [action] * 8)
    twin = COPIED[copied](env)
    np.testing.assert_array_equal(env.render(), twin.render())
    for one in (env, twin):
        one.step(-action)
    np.testing.assert_array_equal(env.render(), twin.render())


def test_a_copy_of_an_environment_with_a_window_leaves_the_window(model_file):
    env = _run(FlapEnv(model=model_file, render_mode="human"), np.zeros((3, 3)))
    twin = copy.deepcopy(env)
    twin.close()
    assert pygame.display.get_init()
    env.close()


LEFT = np.s_[:, :310]
"""The rotor, flaps, time and azimuth; the traces are to the right."""


@pytest.mark.parametrize("single_blade", [False, True])
@pytest.mark.parametrize("cls", [FlapEnv, FlapVectorEnv])
def test_after_a_state_the_picture_is_of_that_instant(model_file, cls, single_blade):
    many = issubclass(cls, FlapVectorEnv)

    def make():
        count = {"num_envs": 1} if many else {}
        return cls(**count, model=model_file, single_blade=single_blade, render_mode="rgb_array")

    def picture(one):
        return one.render()[0] if many else one.render()

    env, twin, blank = make(), make(), picture(make())
    action = np.full(env.action_space.shape, 0.4, dtype=np.float32)
    for one, steps in ((env, 30), (twin, 5)):
        one.reset(seed=steps)
        for _ in range(steps):
            one.step(action)
    twin.set_state(env.get_state())
    # All but the wind, which is not known before the next step.
    np.testing.assert_array_equal(picture(twin)[LEFT][:445], picture(env)[LEFT][:445])
    for one in (env, twin):
        one.step(action)
    np.testing.assert_array_equal(picture(twin)[LEFT], picture(env)[LEFT])
    twin.set_state(make().get_state())
    np.testing.assert_array_equal(picture(twin), blank)


def test_a_vector_has_no_window(model_file):
    with pytest.raises(ValueError, match=r'render_mode: expected None or "rgb_array", got \'human\''):
        FlapVectorEnv(2, model=model_file, render_mode="human")


def test_a_trace_of_any_reach_has_lines_on_each_side():
    for reach in (*np.geomspace(0.01, 1000.0, 301), 8.0, 9.99):
        assert 1.0 < reach / _round_step(reach) < 4.0


def test_seen_from_upwind_the_rotor_turns_clockwise():
    top, later = _place(0.0, 1.0, 0.0), _place(0.1, 1.0, 0.0)
    assert later[0] > top[0]


def test_human_mode_opens_and_closes(model_file):
    env = gymnasium.make("flapgym/NREL5MW-v1", model=model_file, render_mode="human")
    _run(env, np.zeros((3, 3)))
    assert pygame.display.get_init()
    env.close()
    assert not pygame.display.get_init()


def test_rendering_without_a_mode_says_what_is_missing(model_file):
    env = gymnasium.make("flapgym/NREL5MW-v1", model=model_file)
    env.reset(seed=0)
    with pytest.warns(UserWarning, match="render_mode"):
        env.unwrapped.render()
