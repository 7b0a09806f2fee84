"""A turbine's state, as JSON holds it, goes on bit for bit in another plant."""

from __future__ import annotations

import json

import numpy as np
import pytest

from flapgym.plant import Faults
from tests.plant.plants import BACKENDS, actions_of, flown, fly, model_of, plant_of, start_of


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("count", [1, 9])
@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("single_blade", [False, True])
def test_a_state_given_back_goes_on_bit_for_bit(backend, count, precision, single_blade):
    given = {"precision": precision, "single_blade": single_blade, "faults": Faults(lag=0.03)}
    plant, twin = (plant_of(count, 5, 30, model_of(2), backend, **given) for _ in range(2))
    start, actions = start_of(plant), actions_of(plant, 20)
    assert flown(plant, start, actions[:10]).last("flap_stopped").any()
    twin.reset(np.arange(count), start)
    for turbine in range(count):
        state = plant.get_state(turbine)
        twin.set_state(turbine, json.loads(json.dumps(state)))
        assert twin.get_state(turbine) == state
    assert twin.elapsed.tolist() == [10] * count
    for one, other in zip(twin.flap_motion(), plant.flap_motion(), strict=True):
        np.testing.assert_array_equal(one, other)
    expected, got = fly(plant, actions[10:]), fly(twin, actions[10:])
    for one, other in zip(got.loads, expected.loads, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_state_moves_one_turbine_alone():
    plant, other = (plant_of(5, 5, 30, model_of(2), "numpy") for _ in range(2))
    for each, seed in ((plant, 0), (other, 1)):
        flown(each, start_of(each, seed), actions_of(each, 7, seed))
    before = [plant.get_state(turbine) for turbine in range(5)]
    plant.set_state(2, other.get_state(4))
    after = [plant.get_state(turbine) for turbine in range(5)]
    assert after[2] == other.get_state(4)
    assert [*after[:2], *after[3:]] == [*before[:2], *before[3:]]
