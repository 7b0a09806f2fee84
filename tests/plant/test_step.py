"""The step is a pure function over named arrays, and whoever writes another one hands it to the plant."""

from __future__ import annotations

import copy

import numpy as np
import pytest

from flapgym.envs.settings import Settings
from flapgym.envs.turbines import Turbines
from flapgym.plant import Faults, LinearPlant
from flapgym.plant.backends import numpy as in_numpy
from tests.plant.plants import BACKENDS, actions_of, assert_near, fly, model_of, plant_of, start_of

FAULTS = Faults(effectiveness=(0.7, 1.0, 1.2), stuck=(None, 0.04, None), lag=0.05)


def _bits(values):
    """Of every array and number, for comparison to the last bit."""
    return [np.asarray(value).tobytes() for value in values]


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("count", [1, 7])
@pytest.mark.parametrize("backend", BACKENDS)
def test_a_step_changes_nothing_it_is_given_and_says_the_same_again(backend, count, precision):
    plant = plant_of(count, 5, 20, model_of(2), backend, faults=FAULTS, precision=precision)
    plant.reset(np.arange(count), start_of(plant))
    actions = actions_of(plant, 8, size=1.5)
    fly(plant, actions[:7])
    given = (*plant.parameters, *plant.episode, *plant.state, actions[7])
    before = _bits(given)
    first = plant._step(plant.parameters, plant.episode, plant.state, actions[7])
    assert first[1].last[:, plant.quantities.last["flap_stopped"]].any(), "the stops must take part"
    again = plant._step(plant.parameters, plant.episode, plant.state, actions[7])
    assert _bits(given) == before
    for one, other in zip(first, again, strict=True):
        assert type(one) is type(other)
        assert _bits(one) == _bits(other)
    # Nothing that is handed out is a window on what was given.
    for part in (*first[0], *first[1]):
        assert not any(np.shares_memory(part, array) for array in given if isinstance(array, np.ndarray))


@pytest.mark.parametrize("backend", BACKENDS)
def test_loads_and_states_handed_out_stay_as_they_were(backend):
    plant = plant_of(3, 5, 20, backend=backend)
    plant.reset(np.arange(3), start_of(plant))
    actions = actions_of(plant, 4)
    loads = plant.step(actions[0])
    kept, state = copy.deepcopy(loads), plant.state
    bits = _bits(state)
    fly(plant, actions[1:])
    plant.reset(np.arange(2), start_of(plant_of(2, 5, 20)))
    assert _bits(loads) == _bits(kept)
    assert _bits(state) == bits


class Counting:
    """A backend of someone else's: here that of numpy, counted, and written for one turbine at a time."""

    def __init__(self):
        self.calls = 0

    def __call__(self, parameters, episode, state, actions):
        self.calls += 1
        alone = []
        for turbine in range(len(state.elapsed)):
            own = slice(turbine, turbine + 1)
            one = episode._replace(
                azimuth=episode.azimuth[own], place=episode.place[own], level=episode.level[own]
            )
            part = [np.take(array, [turbine], axis=_axis(array, state)) for array in state]
            alone.append(in_numpy.step(parameters, one, type(state)(*part), actions[own]))
        states, loads = zip(*alone, strict=True)
        joined = [
            np.concatenate(parts, axis=_axis(array, state))
            for parts, array in zip(zip(*states, strict=True), state, strict=True)
        ]
        told = [np.concatenate(parts) for parts in zip(*loads, strict=True)]
        return type(state)(*joined), type(loads[0])(*told)


def _axis(array, state):
    """Along which the turbines of a state stand: as many as no other axis is long."""
    return array.shape.index(len(state.elapsed))


def test_a_backend_of_ones_own_steps_an_environments_turbines():
    settings = Settings(model=model_of(), record_samples=True, actuators={"lag": 0.02})
    ours, theirs = Turbines(settings, 13), Turbines(settings, 13)
    step = Counting()
    theirs.plant = LinearPlant(theirs.model, 13, theirs.stepping, step)
    assert theirs.plant.fingerprint == ours.plant.fingerprint
    none = [dict.fromkeys(("realisation_seed", "azimuth")) | each for each in ours.chosen(np.arange(13))]
    for each in (ours, theirs):
        each.begin(np.arange(13), [np.random.default_rng(seed) for seed in range(13)], none)
    for action in np.random.default_rng(2).uniform(-1, 1, (30, 13, 3)):
        expected, got = ours.step(action), theirs.step(action)
        assert_near(got[1], expected[1], 1e-12, "reward")
        for name, values in expected[4]["samples"].items():
            # Of all samples so far the largest is not known; the loads are far from zero.
            assert_near(got[4]["samples"][name], values, 1e-10, name)
        np.testing.assert_allclose(got[0], expected[0], rtol=1e-6, atol=1e-6)
    assert step.calls == 30
