"""The single blade has what the model tells of its clamped blade, and nothing of the turbine."""

from __future__ import annotations

import numpy as np
import pytest

from flapgym.envs.settings import Settings
from flapgym.envs.turbines import Turbines
from tests.synthetic import synthetic_model

MODEL = synthetic_model(flaps=2, further=True)


@pytest.mark.parametrize("name", ["tower_top", "azimuth", "tower_fore_aft", "tilt", "hinge"])
def test_what_it_does_not_have_cannot_be_observed(name):
    with pytest.raises(ValueError, match=f"task.observe: a single blade has no {name}; leave it out"):
        Turbines(Settings(model=MODEL, single_blade=True, task={"observe": name}), 1)


def test_what_it_tells_is_of_the_blade_alone():
    turbines = Turbines(Settings(model=MODEL, single_blade=True, full_info=True), 2)
    every = np.arange(2)
    generators = [np.random.default_rng(turbine) for turbine in every]
    info = turbines.begin(every, generators, turbines.chosen(every))[1]
    assert set(MODEL.blade.outputs) <= set(info)
    assert not {*MODEL.fixed_outputs, "tower_top", "hinge", "tip_speed"} & set(info)


@pytest.mark.parametrize(
    "actuators, said",
    [
        ({"effectiveness": (1.0,) * 4}, "actuators.effectiveness: expected 3 entries"),
        ({"stuck": (None,) * 4}, "actuators.stuck: expected 3 entries"),
    ],
)
def test_entries_for_neither_blades_nor_flaps_are_refused_by_the_keyword(actuators, said):
    with pytest.raises(ValueError, match=said):
        Turbines(Settings(model=MODEL, actuators=actuators), 1)
