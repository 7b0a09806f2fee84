"""A step's info is a dict like any other, though its arrays are made when it is first looked at."""

from __future__ import annotations

import copy
import json
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flapgym.envs.step_info import FullInfo, StepInfo
from flapgym.plant import layout

NAMES = {
    "wind_perturbation",
    "azimuth",
    "rbm",
    "flap_angle",
    "flap_rate",
    "flap_travel",
    "flap_stopped",
    "rbm_mean_square",
    "reward_rbm",
    "reward_flap_angle",
    "reward_tower",
}
DEFLECTIONS = {"tip_deflection", "tower_top"}
KEYS = st.sampled_from(["rbm", "azimuth", "reward_rbm", "flap_stopped", "episode"])


def _info(kind=StepInfo):
    info = kind()
    info["wind_perturbation"] = 1.5
    info.row = np.arange(float(layout.ROW))
    return info


def _plain(kind=StepInfo):
    """The dict it stands for, written down."""
    row = np.arange(float(layout.ROW))
    plain = {
        "wind_perturbation": 1.5,
        "azimuth": 24.0,
        "rbm": row[0:3],
        "flap_angle": row[6:9],
        "flap_rate": row[9:12],
        "flap_travel": row[12:15],
        "rbm_mean_square": row[15:18],
        "flap_stopped": np.array([True, True, True]),
        "reward_rbm": 26.0,
        "reward_flap_angle": 27.0,
        "reward_tower": 28.0,
    }
    return plain | ({"tip_deflection": row[3:6], "tower_top": row[21:23]} if kind is FullInfo else {})


def _same(one, other):
    """Entries alike, arrays by what they hold."""
    return {name: np.asarray(value).tolist() for name, value in one.items()} == {
        name: np.asarray(value).tolist() for name, value in other.items()
    }


@pytest.mark.parametrize(
    "see",
    [
        dict,
        lambda info: {**info},
        lambda info: (lambda **entries: entries)(**info),
        lambda info: info | {},
        lambda info: {} | info,
        lambda info: dict(info.items()),
        lambda info: {name: info[name] for name in info},
        lambda info: {name: info.get(name) for name in _plain()},
        lambda info: dict(zip(info.keys(), info.values(), strict=True)),
        lambda info: info.copy(),
        copy.copy,
        copy.deepcopy,
        lambda info: pickle.loads(pickle.dumps(info)),
        lambda info: json.loads(json.dumps(info, default=lambda value: np.asarray(value).tolist())),
        lambda info: dict(reversed(info.items())),
    ],
)
def test_whoever_looks_sees_everything(see):
    assert _same(see(_info()), _plain())


def test_the_wind_is_there_at_once_and_the_rest_when_it_is_wanted():
    info = _info()
    assert dict.__len__(info) == 1
    assert isinstance(info["wind_perturbation"], float)
    assert dict.__len__(info) == 1
    assert info["rbm"].tolist() == [0.0, 1.0, 2.0]
    assert info["rbm"] is info["rbm"]
    assert set(info) == NAMES
    assert len(_info()) == len(NAMES)
    assert "flap_rate" in _info()
    assert set(_info(FullInfo)) == NAMES | DEFLECTIONS
    assert _same(_info(FullInfo), _plain(FullInfo))
    with pytest.raises(KeyError, match="tip_deflection"):
        _info()["tip_deflection"]


def test_what_somebody_put_in_stays():
    info = _info()
    info["rbm"], info["episode"] = "mine", {"r": 1.0}
    assert info.pop("flap_rate").tolist() == [9.0, 10.0, 11.0]
    assert info["rbm"] == "mine"
    assert set(info) == NAMES - {"flap_rate"} | {"episode"}
    assert info != _info()
    later = copy.deepcopy(info)
    assert type(later) is StepInfo
    assert set(later) == set(info)
    assert set(StepInfo(rbm=1.0)) == {"rbm"}


_OPERATIONS = st.one_of(
    st.tuples(st.just("__setitem__"), KEYS, st.integers()),
    st.tuples(st.sampled_from(["__delitem__", "__getitem__", "pop"]), KEYS),
    st.tuples(st.sampled_from(["get", "__contains__"]), KEYS),
    st.tuples(st.just("setdefault"), KEYS, st.integers()),
    st.tuples(st.just("update"), st.dictionaries(KEYS, st.integers())),
    st.tuples(st.sampled_from(["__len__", "clear", "copy", "__repr__"])),
)


@given(st.lists(_OPERATIONS, max_size=8))
def test_any_sequence_of_operations_is_that_on_a_plain_dict(operations):
    info, plain = _info(), _plain()
    for name, *arguments in operations:
        results = []
        for each in (info, plain):
            try:
                result = getattr(each, name)(*arguments)
            except KeyError as error:
                result = f"KeyError {error}"
            results.append(result if name in ("__len__", "__contains__") else None)
            if isinstance(result, str) and result.startswith("KeyError"):
                results[-1] = result
        assert results[0] == results[1]
    assert _same(info, plain)
