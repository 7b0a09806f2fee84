"""What is told beside observation and reward: exactly a dict, with these entries, in arrays that are the caller's."""

from __future__ import annotations

import json

import numpy as np
import pytest

from flapgym.envs import FlapEnv, FlapVectorEnv
from tests.synthetic import synthetic_model

NUMBERS = {"wind_perturbation", "azimuth"}
TERMS = {"reward_rbm", "reward_flap_angle", "reward_tower"}
OF_BLADES = {"rbm", "tip_deflection", "flap_angle", "flap_rate", "flap_travel", "flap_stopped"}
ARRAYS = OF_BLADES | {"tower_top"}
BACKENDS = ["numba", "numpy"]


def _told(env, steps=3):
    """What the reset tells, and the last of some steps."""
    _, first = env.reset(seed=1)
    for _ in range(steps):
        *_, last = env.step(np.full(env.action_space.shape, 0.2, dtype=np.float32))
    return first, last


@pytest.mark.parametrize("single_blade", [False, True])
@pytest.mark.parametrize("backend", BACKENDS)
def test_one_environment_tells_numbers(backend, single_blade):
    env = FlapEnv(model=synthetic_model(), backend=backend, single_blade=single_blade)
    numbers = NUMBERS - ({"azimuth"} if single_blade else set())
    for info, names in zip(_told(env), (numbers, numbers | TERMS), strict=True):
        assert type(info) is dict
        assert set(info) == names
        assert {type(value) for value in info.values()} == {float}
        assert json.loads(json.dumps(info)) == info


@pytest.mark.parametrize("single_blade", [False, True])
@pytest.mark.parametrize("backend", BACKENDS)
def test_full_info_adds_arrays(backend, single_blade):
    env = FlapEnv(model=synthetic_model(), backend=backend, single_blade=single_blade, full_info=True)
    numbers = NUMBERS - ({"azimuth"} if single_blade else set())
    arrays = ARRAYS - ({"tower_top"} if single_blade else set())
    first, last = _told(env)
    assert set(first) == numbers | arrays
    assert set(last) == numbers | arrays | TERMS | {"rbm_mean_square"}
    for name in arrays | {"rbm_mean_square"}:
        assert last[name].shape == ((2,) if name == "tower_top" else (1,) if single_blade else (3,))
        assert last[name].dtype == (bool if name == "flap_stopped" else float)
        # A view of more would keep all the plant's numbers alive.
        assert last[name].base is None or last[name].base.size == last[name].size
    assert {type(last[name]) for name in numbers | TERMS} == {float}


def test_what_is_told_with_arrays_is_what_is_told_without():
    brief, full = (FlapEnv(model=synthetic_model(), full_info=full) for full in (False, True))
    for one, other in zip(_told(brief), _told(full), strict=True):
        assert one == {name: other[name] for name in one}


@pytest.mark.parametrize("backend", BACKENDS)
def test_many_tell_arrays_of_their_own_with_masks(backend):
    env = FlapVectorEnv(2, model=synthetic_model(), backend=backend)
    for info, names in zip(
        _told(env), (NUMBERS | ARRAYS, NUMBERS | ARRAYS | TERMS | {"rbm_mean_square"}), strict=True
    ):
        assert type(info) is dict
        assert set(info) == names | {f"_{name}" for name in names}
        for name in names:
            assert info[name].shape[0] == 2
            assert not any(np.shares_memory(info[name], info[other]) for other in names - {name})
            assert info[f"_{name}"].tolist() == [True, True]


@pytest.mark.parametrize("backend", BACKENDS)
def test_recorded_samples_are_told_also_without_arrays(backend):
    env = FlapEnv(model=synthetic_model(), backend=backend, record_samples=True)
    first, last = _told(env)
    assert set(first) == NUMBERS
    assert set(last) == NUMBERS | TERMS | {"samples"}
    shapes = dict.fromkeys(("rbm", "tip_deflection", "flap_angle", "flap_rate"), (5, 3))
    shapes |= dict.fromkeys(("tower_fore_aft", "tower_side_side", "wind"), (5,))
    assert {name: part.shape for name, part in last["samples"].items()} == shapes
