"""Environments of a turbine with a heavy blade at a site: made from a model file, seeded, stepped, saved."""

from __future__ import annotations

import json

import gymnasium
import numpy as np
import pytest

from flapgym.envs import FlapEnv, FlapVectorEnv
from flapgym.model import save_model
from flapgym.plant import Surroundings
from tests.envs.test_site import flown
from tests.plant.plants import plant_of
from tests.plant.test_unequal_surroundings import heavy_model

SITE = {
    "wind": {"field": {"kind": "kaimal"}, "inflow": {"shear_exponent": 0.2, "tower_shadow": True}},
    "gravity": True,
    "duration": 1.5,
}


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("models") / "heavy-site.safetensors"
    save_model(heavy_model(), path)
    return str(path)


def test_the_heavy_blade_s_environment_takes_a_field_inflow_and_gravity(file):
    env = gymnasium.make("flapgym/NREL5MWHeavyBlade-v1", model=file, **SITE)
    expected = flown(env, 5)
    assert np.isfinite(expected).all()
    np.testing.assert_array_equal(flown(env, 5), expected)
    assert not np.allclose(flown(env, 6)[0], expected[0])


def test_gravity_adds_the_steady_response_of_its_plant(file):
    still = {"model": file, "wind": {"turbulence_intensity": 0.0}, "record_samples": True, "duration": 1.5}
    rbm = []
    for gravity in (True, False):
        env = FlapEnv(**still, gravity=gravity)
        env.reset(seed=0, options={"azimuth": 0.4})
        rbm.append(env.step(np.zeros(3))[4]["samples"]["rbm"])
    plant = plant_of(1, 5, 4, heavy_model(), surroundings=Surroundings(gravity=True))
    turn = heavy_model().rotor_speed * heavy_model().time_step
    expected = plant.steady(0.4 + turn * np.arange(1, 6))["rbm"]
    np.testing.assert_allclose(rbm[0] - rbm[1], expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def test_one_turbine_of_several_is_the_one_alone(file):
    several = flown(FlapVectorEnv(2, model=file, **SITE), [7, 8])
    for turbine, seed in enumerate([7, 8]):
        alone = flown(FlapEnv(model=file, **SITE), seed)
        np.testing.assert_allclose(several[:, turbine], alone, rtol=1e-5, atol=1e-6)


def test_an_episode_goes_on_from_its_state_as_json(file):
    env, twin = (FlapEnv(model=file, **SITE) for _ in range(2))
    flown(env, 5)
    twin.reset(seed=1)
    twin.set_state(json.loads(json.dumps(env.get_state())))
    for _ in range(3):
        np.testing.assert_array_equal(twin.step(np.ones(3))[0], env.step(np.ones(3))[0])


def test_the_extreme_wind_shear_strikes_its_strips(file):
    shear = {"turbulence_intensity": 0.0, "gust": {"kind": "extreme_wind_shear", "start": -3.0}}
    told = {"model": file, "record_samples": True, "duration": 1.5}
    rbm = []
    for wind in (shear, {"turbulence_intensity": 0.0}):
        env = FlapEnv(wind=wind, **told)
        env.reset(seed=0, options={"azimuth": 0.0})
        rbm.append(env.step(np.zeros(3))[4]["samples"]["rbm"][-1])
    up, *down = rbm[0] - rbm[1]
    assert up > 0.0 > max(down)  # more wind above the hub, less below
