"""Wind beyond what a linear model is taken at its word for is warned of, once."""

from __future__ import annotations

import warnings

import gymnasium
import numpy as np
import pytest

from flapgym.envs import FlapEnv, FlapVectorEnv, linear_range
from flapgym.envs.linear_range import LINEAR_SHARE, LinearRangeWarning, whence

STEP = {"kind": "step", "size": 1.0}
FIELD = {"kind": "kaimal", "turbulence_class": "B"}


@pytest.fixture(autouse=True)
def _nothing_told(monkeypatch):
    monkeypatch.setattr(linear_range, "_TOLD", set())


def _warned(env, **reset):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        env.reset(**reset)
    return [str(each.message) for each in caught if each.category is LinearRangeWarning]


def _calm(model_file, gust):
    return FlapEnv(model=model_file, wind={"turbulence_intensity": 0.0, "gust": gust})


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_step_just_beyond_the_range_is_warned_of_and_one_within_is_not(model_file, sign):
    edge = LINEAR_SHARE * _calm(model_file, STEP).model.wind_speed
    assert not _warned(_calm(model_file, STEP | {"size": sign * 0.999 * edge}))
    (message,) = _warned(_calm(model_file, STEP | {"size": sign * 1.001 * edge}))
    assert message.startswith("wind: gust step")
    assert "\n" not in message


def test_the_same_wind_is_warned_of_once_and_another_by_itself(model_file):
    strong = STEP | {"size": 5.0}
    env = _calm(model_file, strong)
    assert len(_warned(env)) == 1
    assert not _warned(env)
    assert not _warned(_calm(model_file, strong))
    assert len(_warned(_calm(model_file, {"kind": "ramp", "size": 5.0, "duration": 2.0}))) == 1


def test_the_extreme_operating_gust_s_own_environment_warns_with_its_peak():
    """Of class IA at 11 m/s it rises by 4.2 m/s (the environment's page)."""
    (message,) = _warned(gymnasium.make("flapgym/NREL5MWGust-v1", backend="numpy"), seed=3)
    begin, peak = message.split(" m/s over the rotor")[0].rsplit(" ", 1)
    assert begin == "wind: gust extreme_operating_gust, seed 3:"
    assert float(peak) == pytest.approx(4.2, abs=0.05)


WINDS = {
    "homogeneous": {},
    "pool": {"pool": 3},
    "gust": {"gust": {"kind": "ramp", "size": -2.0, "duration": 1.0}},
    "field": {"field": FIELD},
    "field in a pool": {"field": FIELD, "pool": 3},
    "field and gust": {"field": FIELD, "gust": STEP},
}


@pytest.mark.parametrize("name", WINDS)
def test_the_strongest_wind_of_an_episode_is_the_largest_that_it_tells(name):
    env = FlapVectorEnv(
        3, model="nrel5mw-site", wind=WINDS[name], duration=3.0, autoreset_mode="Disabled", backend="numpy"
    )
    _, info = env.reset(seed=[1, 2, 3])
    told = [info["wind_perturbation"]]
    for _ in range(env._turbines.stepping.intervals):
        told.append(env.step(np.zeros((3, 3)))[-1]["wind_perturbation"])
    strongest = np.abs(told).max(axis=0)
    np.testing.assert_allclose(env._turbines.plant.strongest_wind, strongest, rtol=1e-12)


def test_of_unequal_blades_the_strongest_wind_is_known_too():
    env = FlapEnv(model="nrel5mw-corrected-heavy-blade", duration=2.0, steps_per_action=1)
    told = [env.reset(seed=1)[1]["wind_perturbation"]]
    told += [
        env.step(np.zeros(3, dtype=np.float32))[-1]["wind_perturbation"]
        for _ in range(env._turbines.stepping.intervals)
    ]
    np.testing.assert_allclose(env._turbines.plant.strongest_wind, [np.abs(told).max()], rtol=1e-12)


def test_what_is_steady_over_the_disk_does_not_count():
    inflow = {"shear_exponent": 1.0, "tower_shadow": True}  # twice the wind at the top of what is at the hub
    env = FlapEnv(model="nrel5mw-site", wind={"turbulence_intensity": 0.0, "inflow": inflow})
    assert not _warned(env)


def test_a_realisation_is_named_by_its_number_and_else_by_the_seed_if_anybody_gave_one():
    assert whence(np.random.default_rng(5), 7) == ", realisation 7"
    assert whence(np.random.default_rng(5), None) == ", seed 5"
    assert whence(np.random.default_rng(), None) == ""
