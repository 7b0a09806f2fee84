"""The keywords' families: objects or mappings, the old keywords' new places, and one plant behind every form."""

from __future__ import annotations

import copy
import dataclasses
import json
import pickle
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec

from flapgym.envs import FlapEnv, FlapVectorEnv
from flapgym.envs.settings import _MOVED, Actuators, Sensors, Settings
from flapgym.envs.task import Task
from flapgym.wind import Wind
from tests.synthetic import synthetic_model

MAPPINGS: dict[str, Any] = {
    "wind": {
        "turbulence_intensity": 0.08,
        "length_scale": 100.0,
        "gust": {"kind": "step", "size": 1.0, "start": 0.1},
    },
    "task": {"observe": ("rbm", "flap_angle", "azimuth"), "flap_angle_weight": 0.2, "tower_weight": 0.5},
    "actuators": {"lag": 0.05, "stuck": (None, 0.03, None), "effectiveness": (1.0, 1.0, 0.6)},
    "sensors": {"noise": 1e4, "delay": 0.014},
}
CLASSES: dict[str, Any] = {"wind": Wind, "task": Task, "actuators": Actuators, "sensors": Sensors}
OBJECTS = {family: CLASSES[family](**fields) for family, fields in MAPPINGS.items()}
EVERY_FORM: dict[str, Any] = {
    "plain": {},
    "numpy": {"backend": "numpy"},
    "noise": {"sensors": {"noise": 1e4}},
    "delay": {"sensors": {"delay": 0.014}},
    "single precision": {"precision": "float32"},
    "single blade": {"single_blade": True},
    "everything": MAPPINGS,
    "everything in numpy": {**MAPPINGS, "backend": "numpy"},
}


def _env(cls=FlapEnv, **keywords):
    return cls(model=synthetic_model(), duration=0.7, **keywords)


def _actions(env, count, seed=0):
    return np.random.default_rng(seed).uniform(-1, 1, (count, *env.action_space.shape)).astype(np.float32)


def _assert_steps_equal(one, other, actions):
    for action in actions:
        got, expected = one.step(action), other.step(action)
        for part, wanted in zip(got[:4], expected[:4], strict=True):
            np.testing.assert_array_equal(part, wanted)


@pytest.mark.parametrize("cls", [FlapEnv, FlapVectorEnv])
def test_a_family_is_the_same_as_an_object_or_as_a_mapping(cls):
    env, twin = _env(cls, **MAPPINGS), _env(cls, **OBJECTS)
    assert env.settings.task == twin.settings.task == OBJECTS["task"]
    np.testing.assert_array_equal(env.reset(seed=1)[0], twin.reset(seed=1)[0])
    _assert_steps_equal(env, twin, _actions(env, 10))
    twin.set_state(env.get_state())


def test_a_family_left_out_or_empty_is_its_default():
    assert Settings(wind={}, task={}, actuators={}, sensors={}) == Settings()


def test_families_are_frozen_and_changed_by_replacing():
    with pytest.raises(dataclasses.FrozenInstanceError):
        OBJECTS["sensors"].noise = 0.0
    quiet = dataclasses.replace(OBJECTS["sensors"], noise=0.0)
    assert _env(sensors=quiet).settings.sensors == Sensors(delay=0.014)


# `make_vec` hands `max_episode_steps` on, so a vector takes it.
@pytest.mark.parametrize(
    "cls, name",
    [(FlapEnv, name) for name in _MOVED]
    + [(FlapVectorEnv, name) for name in _MOVED if name != "max_episode_steps"],
)
def test_an_old_keyword_is_refused_with_its_new_place(cls, name):
    with pytest.raises(TypeError) as refused:
        _env(cls, **{name: 1})
    line = str(refused.value)
    assert line == f"{cls.__name__}.__init__() got an unexpected keyword argument {name!r}; {_MOVED[name]}"


def test_every_new_place_is_one():
    """What the refusals say is a keyword of today, and its field."""
    for name, hint in _MOVED.items():
        if name in ("kernel", "max_episode_steps"):
            continue
        family, field = hint.removeprefix("it is ").split("={")
        assert field.split('"')[1] in {each.name for each in dataclasses.fields(CLASSES[family])}
    assert {each.name for each in dataclasses.fields(Settings)} >= {"backend", "duration"}


def test_a_specification_of_objects_goes_through_json(model_file):
    for keywords in (MAPPINGS, OBJECTS):
        env = gymnasium.make("flapgym/NREL5MW-v1", model=model_file, duration=0.7, **keywords)
        text = env.spec.to_json()
        assert json.loads(text)["kwargs"]["sensors"] == MAPPINGS["sensors"]
        again = gymnasium.make(EnvSpec.from_json(text))
        np.testing.assert_array_equal(env.reset(seed=3)[0], again.reset(seed=3)[0])
        vector = gymnasium.make_vec(
            "flapgym/NREL5MW-v1", num_envs=2, model=model_file, duration=0.7, **keywords
        )
        again = gymnasium.make_vec(EnvSpec.from_json(vector.spec.to_json()))
        np.testing.assert_array_equal(vector.reset(seed=3)[0], again.reset(seed=3)[0])


def test_a_caller_s_mapping_is_neither_changed_nor_kept():
    given = copy.deepcopy(MAPPINGS)
    env, twin = _env(**given), _env(**MAPPINGS)
    assert given == MAPPINGS
    given["wind"]["gust"]["size"] = 9.0
    given["task"].clear()
    np.testing.assert_array_equal(env.reset(seed=1)[0], twin.reset(seed=1)[0])
    _assert_steps_equal(env, twin, _actions(env, 5))


@pytest.mark.parametrize("cls", [FlapEnv, FlapVectorEnv])
@pytest.mark.parametrize("form", EVERY_FORM)
def test_a_state_goes_on_in_another_environment_bit_for_bit(cls, form):
    env, twin = (_env(cls, **EVERY_FORM[form]) for _ in range(2))
    actions = _actions(env, 40)
    env.reset(seed=4)
    for action in actions[:7]:
        env.step(action)
    twin.reset(seed=9)
    twin.step(actions[0])
    twin.set_state(json.loads(json.dumps(env.get_state())))
    assert twin.get_state() == env.get_state()
    _assert_steps_equal(env, twin, actions[7:20])
    assert twin.get_state() == env.get_state()
    np.testing.assert_array_equal(env.reset()[0], twin.reset()[0])


@pytest.mark.parametrize(
    "copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["deepcopy", "pickle"]
)
@pytest.mark.parametrize("cls", [FlapEnv, FlapVectorEnv])
@pytest.mark.parametrize("form", EVERY_FORM)
def test_a_copy_goes_on_by_itself(cls, form, copied):
    env = _env(cls, **EVERY_FORM[form])
    actions = _actions(env, 20)
    env.reset(seed=4)
    for action in actions[:7]:
        env.step(action)
    before, twin = env.get_state(), copied(env)
    for action in actions[7:12]:
        twin.step(-action)
    assert env.get_state() == before  # the copy's steps are its own
    twin.set_state(before)
    _assert_steps_equal(env, twin, actions[7:])


def test_what_a_caller_does_to_a_motion_told_does_not_reach_the_flaps():
    for cls in (FlapEnv, FlapVectorEnv):
        env = _env(cls)
        env.reset(seed=0)
        for part in env.flap_motion():
            part[:] = 9.0
        assert not any(part.any() for part in env.flap_motion())


@pytest.mark.parametrize("cls", [FlapEnv, FlapVectorEnv])
def test_the_state_after_an_episode_s_end_is_of_that_end(cls):
    env = _env(cls)
    env.reset(seed=0)
    for _ in range(20):
        env.step(np.full(env.action_space.shape, 0.3))
    plant = env.get_state()["turbines"][0]["plant"]
    assert plant["elapsed"] == 20
    np.testing.assert_array_equal(np.ravel(env.flap_motion()[0]), plant["flaps"][0])


@pytest.mark.parametrize("form", [form for form in EVERY_FORM if form != "single precision"])
def test_one_is_many_to_round_off(form):
    keywords = {"full_info": True, **EVERY_FORM[form]}
    many = _env(FlapVectorEnv, num_envs=3, autoreset_mode="Disabled", **keywords)
    ones = [_env(**keywords) for _ in range(3)]
    rms = many.model.rbm_rms
    many.reset(seed=2)
    for seed, env in enumerate(ones, start=2):
        env.reset(seed=seed)
    for actions in _actions(many, 20):
        observation, reward, _, truncated, info = many.step(actions)
        for index, (env, action) in enumerate(zip(ones, actions, strict=True)):
            seen, gained, _, ended, told = env.step(action)
            np.testing.assert_allclose(info["rbm"][index], told["rbm"], rtol=0.0, atol=1e-12 * rms)
            np.testing.assert_allclose(info["flap_angle"][index], told["flap_angle"], rtol=0.0, atol=1e-14)
            assert reward[index] == pytest.approx(gained, rel=1e-12, abs=1e-12)
            assert truncated[index] == ended
            # Single precision shows a last digit where the doubles fall to either side of a rounding.
            np.testing.assert_allclose(observation[index], seen, rtol=2e-7, atol=1e-12)


@pytest.mark.parametrize("form", ["plain", "noise", "delay", "single blade", "everything"])
def test_the_compiled_step_is_that_of_numpy_to_round_off(form):
    keywords = {"full_info": True, **EVERY_FORM[form]}
    fast, plain = _env(backend="numba", **keywords), _env(backend="numpy", **keywords)
    assert (fast._compiled is None) == ("delay" in keywords.get("sensors", {}))
    for env in (fast, plain):
        env.reset(seed=2)
    for action in _actions(fast, 20):
        one, other = fast.step(action), plain.step(action)
        np.testing.assert_allclose(one[0], other[0], rtol=2e-7, atol=1e-12)
        assert one[1] == pytest.approx(other[1], rel=1e-12, abs=1e-12)
        assert one[2:4] == other[2:4]
        assert one[4].keys() == other[4].keys()
        for name, value in one[4].items():
            scale = fast.model.rbm_rms**2 if name == "rbm_mean_square" else fast.model.rbm_rms
            scale = scale if name.startswith("rbm") else 1.0
            np.testing.assert_allclose(value, other[4][name], rtol=1e-12, atol=1e-12 * scale, err_msg=name)


@pytest.mark.parametrize("backend", ["numba", "numpy"])
def test_measurement_noise_past_the_end_of_an_episode_is_the_last(backend):
    # Turbines of a vector that wait for their reset are stepped on; there is no more noise drawn for them.
    env = _env(FlapVectorEnv, num_envs=2, backend=backend, sensors={"noise": 1e4})
    env.reset(seed=0)
    for step in range(50):
        observation, *_ = env.step(np.zeros((2, 3)))
        assert np.isfinite(observation).all()
        if step % 7 == 0:
            env.reset(options={"reset_mask": np.array([True, False])})
