"""The shipped turbine with a heavy blade: made from its case, stable, and shaken once a revolution."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from flapgym.model import load_model
from flapgym.turbine import load_case
from tests.plant.plants import flown, plant_of, rest

BALANCED = {"nrel5mw-heavy-blade": "nrel5mw-rated", "nrel5mw-corrected-heavy-blade": "nrel5mw-corrected"}


@pytest.fixture(scope="module", params=BALANCED)
def heavy(request):
    return load_model(request.param)


def test_the_model_is_the_one_of_its_case(heavy):
    case = load_case(heavy.name)
    assert heavy.inputs_hash == case.hash()
    assert case.blades.mass_factor == (1.05, 1.0, 1.0)


def test_its_mean_is_nearly_the_balanced_turbine(heavy):
    gain, balanced = (model.turbine.dc_gain() for model in (heavy, load_model(BALANCED[heavy.name])))
    np.testing.assert_allclose(gain[0, [0, 6]], balanced[0, [0, 6]], rtol=0.02)


def test_in_still_air_the_imbalance_shakes_the_tower_sideways_once_a_revolution(heavy):
    plant = plant_of(16, 10, 2, heavy, record=False)
    azimuth = 2.0 * np.pi / 16 * np.arange(16)
    last = plant.reset(np.arange(16), rest(plant, azimuth=azimuth)).last
    sideways = last[:, plant.quantities.last["tower_side_side"].start]
    once, twice = (2.0 / 16 * np.abs(np.exp(-1j * n * azimuth) @ sideways) for n in (1, 2))
    assert 0.02 < once < 0.04  # m
    assert twice < 0.02 * once
    assert np.abs(last[:, plant.quantities.last["rbm"]]).max() < 0.02 * heavy.rbm_rms


def test_no_reset_waits_for_an_import():
    code = """
import sys
import gymnasium
import flapgym
env = gymnasium.make("flapgym/NREL5MWHeavyBlade-v1")
known = set(sys.modules)
env.reset(seed=0)
print(set(sys.modules) - known)
"""
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert run.stdout.strip() == "set()", run.stderr


def test_the_steady_motion_goes_on(heavy):
    steps = 10
    turn = heavy.rotor_speed * heavy.time_step * steps
    plant = plant_of(2, steps, 60, heavy, record=False)
    # The second turbine starts where the first will be after 50 actions.
    start = rest(plant, azimuth=np.array([0.3, 0.3 + 50 * turn]))
    first = plant.reset(np.arange(2), start).last
    later = flown(plant, start, np.zeros((50, 2, 3))).loads.last[-1]
    for names in (("rbm",), ("tower_fore_aft", "tower_side_side")):
        place = np.r_[*(plant.quantities.last[name] for name in names)]
        size = np.abs(first[:, place]).max()
        np.testing.assert_allclose(later[0, place], first[1, place], atol=1e-6 * size)
