"""A lidar in the environments: the same wind with it and without, seen before it comes, and what is refused."""

from __future__ import annotations

import json

import numpy as np
import pytest

from flapgym.envs import FlapEnv, FlapVectorEnv
from tests.envs.test_boxes import MEAN, PLACES, STEP, netcdf
from tests.envs.test_unequal_site import file  # noqa: F401

HUB = {
    "range": 109.725,
    "radius": 0.0,
    "beams": 1,
    "probe_length": 0.0,
    "decay": 0.0,
    "sample_rate": 1 / 0.035,
}
"""One frozen beam that sees each wind 285 actions before it comes."""
AHEAD, ACTIONS = 285, 400
CONE = {"range": 100.0, "radius": 45.0, "noise": 0.1}
SITE = {"model": "nrel5mw-site", "wind": {"field": {"kind": "kaimal"}}, "duration": 2.0}
SEES = ("lidar", "lidar_beams", "rbm", "wind")
STILL = np.zeros(3, dtype=np.float32)


def _flown(env, seed, count):
    """Observations and infos from the reset on."""
    told = [env.reset(seed=seed)]
    for _ in range(count):
        observation, _, _, _, info = env.step(np.zeros(env.action_space.shape, dtype=np.float32))
        told.append((observation, info))
    return np.array([each for each, _ in told]), [info for _, info in told]


@pytest.mark.parametrize("backend", ["numpy", "numba"])
@pytest.mark.parametrize(
    "keywords",
    [
        {},
        {"single_blade": True},
        {"wind": {"pool": 2}},
        {
            "wind": {
                "turbulence_intensity": 0.0,
                "gust": {"kind": "sinusoid", "amplitude": 1.0, "frequency": 0.2},
            }
        },
    ],
)
def test_one_frozen_beam_at_the_hub_sees_each_wind_before_it_comes(backend, keywords):
    env = FlapEnv(
        **keywords,
        backend=backend,
        duration=14.0,
        full_info=True,
        task={"observe": SEES},
        sensors={"lidar": HUB},
    )
    observed, infos = _flown(env, 3, ACTIONS)
    wind = np.array([info["wind_perturbation"] for info in infos])
    seen = np.array([info["lidar"][0] for info in infos])
    assert np.ptp(wind) > 0.5
    np.testing.assert_allclose(seen[:-AHEAD], wind[AHEAD:], atol=1e-9)
    np.testing.assert_allclose(observed[:, :4], np.column_stack([seen, 0 * seen, 0 * seen, seen]), atol=1e-6)


@pytest.mark.parametrize("keywords", [{}, SITE, {**SITE, "precision": "float32"}])
def test_a_seed_brings_the_same_wind_with_a_lidar_and_without(keywords):
    seeing, blind = (
        FlapEnv(**{"duration": 2.0, **keywords}, task={"observe": names}, sensors=sensors)
        for names, sensors in ((SEES, {"lidar": CONE, "noise": 1e4}), (SEES[2:], {"noise": 1e4}))
    )
    for seed in (4, None, None):  # the episodes that follow a seed, too
        expected, _ = _flown(blind, seed, 10)
        observed, _ = _flown(seeing, seed, 10)
        np.testing.assert_array_equal(observed[:, -4:], expected)


@pytest.mark.parametrize("keywords", [{"duration": 2.0}, SITE])
def test_one_and_many_in_either_backend_see_the_same(keywords):
    of_task = {"task": {"observe": SEES}, "sensors": {"lidar": CONE}}
    one, _ = _flown(FlapEnv(**keywords, **of_task, backend="numba"), 8, 12)
    plain, infos = _flown(FlapEnv(**keywords, **of_task, backend="numpy", full_info=True), 8, 12)
    vector = FlapVectorEnv(2, **keywords, **of_task, autoreset_mode="Disabled")
    many, told = _flown(vector, [5, 8], 12)
    np.testing.assert_allclose(one, plain, rtol=1e-5, atol=1e-6)
    np.testing.assert_array_equal(many[:, 1, :7], one[:, :7])
    np.testing.assert_allclose(one[:, :3], [info["lidar"] for info in infos], rtol=1e-6)
    np.testing.assert_allclose(one[:, 3:7], [info["lidar_beams"][1] for info in told], rtol=1e-6)


def test_a_late_lidar_tells_what_one_on_time_did():
    (soon, _), (late, _) = (
        _flown(
            FlapEnv(
                **SITE,
                task={"observe": "lidar_beams"},
                sensors={"lidar": {**CONE, "noise": 0.0, "delay": delay}},
            ),
            2,
            40,
        )
        for delay in (0.0, 0.35)  # ten actions
    )
    np.testing.assert_allclose(late[10:], soon[:-10], atol=1e-6)


@pytest.mark.parametrize("keywords", [{"duration": 2.0}, {**SITE, "backend": "numpy"}])
def test_an_episode_goes_on_from_its_state_as_json(keywords):
    env = FlapEnv(**keywords, task={"observe": SEES}, sensors={"lidar": CONE, "noise": 1e4})
    _flown(env, 6, 7)
    state = json.loads(json.dumps(env.get_state()))
    expected = [env.step(STILL)[0] for _ in range(5)]
    other = FlapEnv(**keywords, task={"observe": SEES}, sensors={"lidar": CONE, "noise": 1e4})
    other.set_state(state)
    np.testing.assert_array_equal([other.step(STILL)[0] for _ in range(5)], expected)


def test_unequal_blades_have_a_lidar_too(file):  # noqa: F811
    keywords = {"model": file, "wind": {"field": {"kind": "kaimal"}}, "duration": 1.5}
    seeing = FlapEnv(**keywords, task={"observe": SEES}, sensors={"lidar": CONE})
    observed, _ = _flown(seeing, 3, 5)
    expected, _ = _flown(FlapEnv(**keywords, task={"observe": SEES[2:]}), 3, 5)
    np.testing.assert_array_equal(observed[:, -4:], expected)
    assert np.ptp(observed[:, :7]) > 0.1


def test_a_shear_gust_is_seen_as_it_stands_over_the_disk():
    wind = {
        "turbulence_intensity": 0.0,
        "gust": {"kind": "extreme_wind_shear", "stronger": "right", "start": 0.0},
    }
    env = FlapEnv(
        model="nrel5mw-site",
        wind=wind,
        duration=2.0,
        full_info=True,
        sensors={"lidar": {**HUB, "radius": 40.0, "beams": 4}},
    )
    mean, cosine, sine = env.reset(seed=0)[1]["lidar"]
    # Stronger on the right of one who looks downwind, at azimuth 90 deg.
    assert sine > 1.0
    np.testing.assert_allclose([mean, cosine], 0.0, atol=1e-9)


def test_a_wave_in_a_box_is_seen_before_it_comes(tmp_path):
    moments = STEP * np.arange(200)
    wave = np.sin(2.0 * np.pi * 0.1 * moments)[:, None, None] * np.ones((1, len(PLACES), len(PLACES)))
    wind = {"field": {"kind": "box", "file": netcdf(tmp_path / "box.nc", MEAN + wave), "start": 5.0}}
    lidar = {**HUB, "range": 11.0 * 5.0, "radius": 40.0, "beams": 4, "sample_rate": 4.0}
    env = FlapEnv(model="nrel5mw-site", wind=wind, duration=3.5, full_info=True, sensors={"lidar": lidar})
    _, infos = _flown(env, 0, 99)
    told = np.array([info["lidar"] for info in infos])
    made = np.floor(0.035 * np.arange(100) / 0.25 + 1e-9) * 0.25
    np.testing.assert_allclose(told[:, 0], np.sin(2.0 * np.pi * 0.1 * (5.0 + made + 5.0)), atol=1e-6)
    np.testing.assert_allclose(told[:, 1:], 0.0, atol=1e-9)
    with pytest.raises(
        ValueError, match=r"^sensors.lidar.decay: expected 0 with a box, which is frozen, got 2$"
    ):
        FlapEnv(model="nrel5mw-site", wind=wind, duration=3.5, sensors={"lidar": CONE})


@pytest.mark.parametrize(
    ("keywords", "line"),
    [
        ({"sensors": {"lidar": {"range": 100.0}}}, "sensors.lidar.radius: missing"),
        ({"sensors": {"lidar": {**CONE, "reach": 1.0}}}, "sensors.lidar.reach"),
        ({"sensors": {"lidar": 100.0}}, "sensors.lidar: expected a mapping of range, radius"),
        ({"sensors": {"lidar": {**CONE, "range": 2.0}}}, "sensors.lidar.range: expected at least"),
        ({**SITE, "sensors": {"lidar": {**CONE, "range": 1000.0}}}, "sensors.lidar.range: expected at most"),
        ({"task": {"observe": "lidar"}}, "task.observe: lidar takes sensors.lidar"),
    ],
)
def test_what_cannot_be_seen_is_refused_in_one_line(keywords, line):
    with pytest.raises(ValueError) as refusal:
        FlapEnv(**keywords)
    assert str(refusal.value).startswith(line)
    assert "\n" not in str(refusal.value)
