"""What the disturbance and fault keywords do, each against what it says it does."""

from __future__ import annotations

import json
from dataclasses import fields

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec

from flapgym.adapters.sb3 import FlapVecEnv
from flapgym.envs import FlapEnv, FlapVectorEnv
from flapgym.envs.settings import Actuators, Sensors, Settings
from flapgym.envs.task import Task
from flapgym.model import load_model
from flapgym.wind import Wind, gust_of
from flapgym.wind.gusts import GUSTS
from tests.synthetic import synthetic_blade, synthetic_model

STEP = 0.007
START = {"realisation_seed": 3, "azimuth": 0.7}
GUST = {"kind": "extreme_operating_gust", "start": 0.5}


def _series(env, actions, options=START):
    """Moments, wind and flap angles at every plant sample, the first included."""
    _, info = env.reset(seed=0, options=options)
    rbm, wind, angle = [info["rbm"][None]], [[info["wind_perturbation"]]], [info["flap_angle"][None]]
    for action in actions:
        samples = env.step(action)[4]["samples"]
        rbm.append(samples["rbm"])
        wind.append(samples["wind"])
        angle.append(samples["flap_angle"])
    return np.concatenate(rbm), np.concatenate(wind), np.concatenate(angle)


def _env(cls=FlapEnv, **keywords):
    return cls(model=synthetic_model(), record_samples=True, full_info=True, **keywords)


def _actions(count=100, flaps=3):
    return np.random.default_rng(5).uniform(-1, 1, (count, flaps)).astype(np.float32)


def test_a_gust_and_turbulence_add_up():
    actions, still = _actions(), np.zeros((100, 3), dtype=np.float32)
    both = _series(_env(wind={"gust": GUST}), actions)
    turbulence = _series(_env(), actions)
    gust = _series(_env(wind={"gust": GUST, "turbulence_intensity": 0.0}), still)
    for part in (0, 1):
        np.testing.assert_allclose(
            both[part], turbulence[part] + gust[part], atol=1e-10 * np.abs(both[part]).max()
        )
    time = STEP * np.arange(len(gust[1]))
    sized = {**GUST, "rotor_diameter": 126.0, "hub_height": 90.0}
    np.testing.assert_allclose(gust[1], gust_of(sized).wind(time, 11.0), atol=1e-12)


def test_a_recorded_gust_is_made_again_from_json(tmp_path):
    path = tmp_path / "wind.csv"
    path.write_text("time [s], wind [m/s]\n0, 12\n10, 12\n30, 10\n")
    env = gymnasium.make(
        "flapgym/NREL5MW-v1",
        wind={"gust": {"kind": "recorded", "file": str(path)}, "turbulence_intensity": 0.0},
        duration=5.0,
        full_info=True,
    )
    again = gymnasium.make(EnvSpec.from_json(env.spec.to_json()))
    (_, first), (_, other) = env.reset(seed=0), again.reset(seed=0)
    assert other["wind_perturbation"] == pytest.approx(1.0)
    np.testing.assert_array_equal(first["rbm"], other["rbm"])
    # It always blew at 12 m/s: the loads begin steady.
    after = again.step(np.zeros(3, dtype=np.float32))[4]["rbm"]
    np.testing.assert_allclose(after.mean(), first["rbm"].mean(), rtol=1e-6)


@pytest.mark.parametrize("delay", [1, 7])
def test_late_moments_are_the_true_ones_of_some_samples_ago(delay):
    env = _env(sensors={"delay": delay * STEP}, task={"observe": ("flap_angle", "rbm")})
    observation, info = env.reset(seed=0)
    history = [np.tile(info["rbm"], (delay + 1, 1))]
    np.testing.assert_allclose(observation[3:], 1e-6 * info["rbm"], rtol=1e-6)
    for action in _actions():
        observation, _, _, _, info = env.step(action)
        history.append(info["samples"]["rbm"])
        np.testing.assert_allclose(
            observation[3:], 1e-6 * np.concatenate(history)[-delay - 1], rtol=1e-6, atol=1e-7
        )
        np.testing.assert_allclose(observation[:3], info["flap_angle"], rtol=1e-6, atol=1e-8)


def test_a_lagging_flap_follows_the_first_order_law():
    lag, acceleration = 0.05, np.deg2rad(600.0)
    env = _env(actuators={"lag": lag}, wind={"turbulence_intensity": 0.0})
    env.reset(seed=0)
    command = 0.5
    info = env.step(np.full(3, command, dtype=np.float32))[4]
    time = STEP * np.arange(1, 6)
    rate = command * acceleration * (time - lag * (1.0 - np.exp(-time / lag)))
    np.testing.assert_allclose(info["samples"]["flap_rate"][:, 0], rate, rtol=1e-9)


def test_a_flap_does_its_share_a_floating_one_nothing_and_a_stuck_one_stays():
    actions = _actions()
    loads = {
        name: _series(_env(actuators={"effectiveness": [1.0, factor, 1.0]}), actions)[0]
        for name, factor in (("full", 1.0), ("half", 0.5), ("none", 0.0))
    }
    np.testing.assert_allclose(
        loads["half"], 0.5 * (loads["full"] + loads["none"]), atol=1e-10 * np.abs(loads["full"]).max()
    )
    other = actions.copy()
    other[:, 1] = 0.0
    floating = _series(_env(actuators={"effectiveness": [1.0, 0.0, 1.0]}), other)
    np.testing.assert_allclose(floating[0], loads["none"], rtol=0.0, atol=1e-13 * np.abs(loads["none"]).max())
    stuck = _env(actuators={"stuck": [None, 0.05, None]})
    angle = _series(stuck, actions)[2]
    np.testing.assert_array_equal(angle[:, 1], 0.05)
    assert np.abs(angle[:, [0, 2]]).max() > 0.1


def test_a_stuck_flap_has_been_so_for_long():
    env = _env(actuators={"stuck": [0.05, 0.05, 0.05]}, wind={"turbulence_intensity": 0.0})
    rbm, *_ = _series(env, np.zeros((20, 3), dtype=np.float32))
    steady = 0.05 * env.model.turbine.dc_gain()[0, 0]
    np.testing.assert_allclose(rbm.mean(axis=1), steady, rtol=1e-9)


def test_the_single_blade_is_the_models_blade():
    env = _env(
        single_blade=True, task={"observe": ("rbm", "flap_angle", "flap_rate", "tip_deflection", "wind")}
    )
    actions = _actions(100, 1)
    still, wind, _ = _series(env, 0.0 * actions)
    rbm, same_wind, angle = _series(env, actions)
    np.testing.assert_array_equal(same_wind, wind)
    env.reset(seed=0, options=START)
    rate = np.concatenate(
        [np.zeros((1, 1)), *(env.step(action)[4]["samples"]["flap_rate"] for action in actions)]
    )
    flap = synthetic_blade().select(inputs=["flap_angle", "flap_rate"], outputs=["rbm"])
    expected = flap.simulate(np.hstack([angle, rate]))
    np.testing.assert_allclose(rbm - still, expected, atol=1e-9 * np.abs(expected).max())


def test_the_single_blade_is_rewarded_by_its_own_open_loop_rms():
    model = load_model()
    env = FlapVectorEnv(
        64, single_blade=True, model=model, record_samples=True, duration=60.0, steps_per_action=10
    )
    env.reset(seed=1)
    rewards, squares = [], []
    for _ in range(850):
        _, reward, _, _, info = env.step(np.zeros((64, 1), dtype=np.float32))
        rewards.append(reward)
        squares.append(np.mean(info["samples"]["rbm"] ** 2, axis=(1, 2)))
    np.testing.assert_allclose(rewards, -np.array(squares) / env.model.rbm_rms**2, rtol=1e-9)
    assert np.mean(rewards) == pytest.approx(-1.0, abs=0.1)


def test_the_single_blade_refuses_what_only_a_turbine_has():
    for task in ({"observe": ("rbm", "azimuth")}, {"observe": ("tower_top",)}, {"tower_weight": 1.0}):
        with pytest.raises(ValueError, match="single blade"):
            _env(single_blade=True, task=task)
    with pytest.raises(ValueError, match="one blade already"):
        FlapVecEnv(_blades(), per_blade=True)


def _blades(**keywords):
    return FlapVectorEnv(2, autoreset_mode="SameStep", model=synthetic_model(), single_blade=True, **keywords)


def test_stable_baselines_takes_the_single_blade():
    env = FlapVecEnv(_blades(duration=0.7))
    assert env.reset().shape == (2, 1)
    for _ in range(20):
        observation, _, dones, _ = env.step(np.zeros((2, 1), dtype=np.float32))
    assert observation.shape == (2, 1)
    assert dones.all()


@pytest.mark.parametrize(
    "keywords, message",
    [
        ({"wind": {"gust": {"kind": "hurricane"}}}, "gust.kind"),
        ({"wind": {"gust": {"kind": "recorded", "file": "nowhere.csv"}}}, "nowhere.csv"),
        ({"wind": {"gust": GUST, "pool": 4}}, "wind.pool: expected 0 beside a gust, .*got 4"),
        (
            {"sensors": {"delay": 0.01}},
            "sensors.delay: expected a multiple of the time step 0.007 s, such as 0.007 s",
        ),
        ({"sensors": {"delay": -0.007}}, "sensors.delay: expected"),
        ({"actuators": {"lag": float("nan")}}, "actuators.lag: expected"),
        ({"actuators": {"stuck": [0.0, None]}}, "actuators.stuck: expected 3"),
        ({"actuators": {"stuck": [None, 0.3, None]}}, "actuators.stuck: expected angles within .* got 0.3"),
        ({"actuators": {"stuck": [None, "jammed", None]}}, "actuators.stuck"),
        ({"actuators": {"effectiveness": [1.0, None, 1.0]}}, "actuators.effectiveness"),
        ({"actuators": {"effectiveness": [1.0, -0.5, 1.0]}}, "actuators.effectiveness"),
        ({"actuators": {"effectiveness": 0.5}}, "actuators.effectiveness: expected"),
    ],
)
def test_impossible_keywords_are_refused_by_name(keywords, message):
    with pytest.raises(ValueError, match=message):
        _env(**keywords)


def test_a_recording_that_ends_early_is_refused_before_the_first_episode(tmp_path):
    path = tmp_path / "wind.csv"
    path.write_text("time [s], wind [m/s]\n0, 12\n10, 12\n")
    with pytest.raises(ValueError, match=r"lasts 10 s .* at most 9\.975 s.* got 20 s"):
        _env(wind={"gust": {"kind": "recorded", "file": str(path)}})


def test_the_faults_of_one_are_those_of_many():
    keywords = {
        "sensors": {"delay": 0.021, "noise": 1e4},
        "actuators": {"lag": 0.05, "stuck": [None, None, 0.03], "effectiveness": [0.6, 1.0, 1.0]},
        "wind": {"gust": GUST},
        "duration": 2.0,
    }
    many = FlapVectorEnv(3, model=synthetic_model(), **keywords)
    ones = [FlapEnv(model=synthetic_model(), **keywords) for _ in range(3)]
    observation, _ = many.reset(seed=2)
    np.testing.assert_allclose(
        observation, [env.reset(seed=2 + i)[0] for i, env in enumerate(ones)], rtol=1e-6
    )
    rng = np.random.default_rng(0)
    for _ in range(50):
        actions = rng.uniform(-1, 1, (3, 3)).astype(np.float32)
        observation, reward, *_ = many.step(actions)
        steps = [env.step(action) for env, action in zip(ones, actions, strict=True)]
        np.testing.assert_allclose(observation, [step[0] for step in steps], rtol=1e-5, atol=1e-6)
        np.testing.assert_allclose(reward, [step[1] for step in steps], rtol=1e-9)


def test_a_state_of_late_moments_survives_json():
    keywords = {"model": synthetic_model(), "sensors": {"delay": 0.049, "noise": 1e4}}
    env, twin = FlapEnv(**keywords), FlapEnv(**keywords)
    env.reset(seed=1)
    for action in _actions(20):
        env.step(action)
    twin.reset(seed=9)
    twin.set_state(json.loads(json.dumps(env.get_state())))
    for action in _actions(20):
        np.testing.assert_array_equal(env.step(action)[0], twin.step(action)[0])


def test_a_state_belongs_to_a_wind_whatever_it_is_called(tmp_path):
    first, second = tmp_path / "first.csv", tmp_path / "second.csv"
    for path in (first, second):
        path.write_text("time [s], wind [m/s]\n0, 11\n30, 12\n")
    env, same = (_env(wind={"gust": {"kind": "recorded", "file": str(path)}}) for path in (first, second))
    first.write_text("time [s], wind [m/s]\n0, 11\n30, 30\n")
    changed = _env(wind={"gust": {"kind": "recorded", "file": str(first)}})
    for one in (env, same, changed):
        one.reset(seed=1)
    same.set_state(env.get_state())
    np.testing.assert_array_equal(same.step(np.zeros(3))[0], env.step(np.zeros(3))[0])
    before = changed.get_state()
    with pytest.raises(ValueError, match="made by an environment with gust"):
        changed.set_state(env.get_state())
    assert changed.get_state() == before
    short, long = (
        _env(wind={"gust": {"kind": "step", "size": 1}}),
        _env(wind={"gust": {"kind": "step", "size": 1.0, "start": 0.0}}),
    )
    short.reset(seed=1)
    long.set_state(short.get_state())


def test_every_keyword_stands_in_the_manual():
    manual = FlapEnv.__doc__ or ""
    arguments = manual[manual.index("## Arguments") : manual.index("## Gusts")]
    families = {"wind": Wind, "task": Task, "actuators": Actuators, "sensors": Sensors}
    for field in fields(Settings):
        within = (
            [f".{part.name}" for part in fields(families[field.name])] if field.name in families else [""]
        )
        for part in within:
            assert f"`{field.name}{part}`" in arguments, field.name + part
    for kind in GUSTS:
        assert f'| `"{kind}"` |' in manual
