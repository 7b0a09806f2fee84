"""Files of agents: whole or not at all, and refused by field and file where they say what no agent can be."""

import hashlib
import json
import os
from dataclasses import replace

import numpy as np
import pytest

from flapgym import cli
from flapgym.control import (
    AGENT_NAMES,
    PDGains,
    Policy,
    Weights,
    load_agent,
    lqg_agent,
    pd_agent,
    save_agent,
)
from flapgym.control.agent_checks import BLADE_QUANTITIES
from flapgym.envs.task import LIDAR, OBSERVABLES, PITCH, SPEED, TURBINE_ONLY
from flapgym.evaluation import compare
from flapgym.model import save_model
from flapgym.model.turbine_model import load_model
from tests.synthetic import synthetic_model

MODEL = synthetic_model()
LQG = lqg_agent("mine", MODEL, Weights(rbm=3.0))
POLICY = Policy(
    name="mine",
    observe=("rbm", "flap_angle"),
    steps_per_action=5,
    per_blade=True,
    offset=np.zeros(2),
    scale=np.ones(2),
    weights=(np.ones((4, 2)), np.ones((1, 4))),
    biases=(np.zeros(4), np.zeros(1)),
    activation="tanh",
    squash="clip",
    model_hash=MODEL.hash,
)


@pytest.fixture
def saved(tmp_path):
    """Files of a controller and a policy."""
    for name, agent in (("lqg", LQG), ("policy", POLICY)):
        save_agent(tmp_path / f"{name}.json", agent, MODEL, "A test.", {"weight": 3.0})
    return tmp_path


def edit(path, sealed=True, **changes):
    """Change entries of a file and seal it anew, as one who knows the format would."""
    content = {
        key: value for key, value in (json.loads(path.read_text()) | changes).items() if value is not ...
    }
    if sealed:
        rest = {key: value for key, value in content.items() if key != "checksum"}
        content["checksum"] = hashlib.sha256(json.dumps(rest, sort_keys=True).encode()).hexdigest()
    path.write_text(json.dumps(content))


def refusal(path):
    with pytest.raises(ValueError) as caught:
        load_agent(path, MODEL)
    message = str(caught.value)
    assert message.startswith("agent")
    assert path.name in message
    assert message.isprintable()
    assert len(message) < 700
    return message


@pytest.mark.parametrize(
    "design", [{"x": object()}, {"x": float("nan")}, {1: 2}, {"x": {1, 2}}, {"x": 10**400}]
)
def test_what_cannot_be_saved_leaves_the_agent_that_was_there(saved, design):
    before = {path.name: path.read_bytes() for path in saved.iterdir()}
    with pytest.raises(ValueError, match="design"):
        save_agent(
            saved / "lqg.json", pd_agent("mine", MODEL, PDGains(1e-8, 5.0, 0.05, 3.0, 0.8)), MODEL, "", design
        )
    assert {path.name: path.read_bytes() for path in saved.iterdir()} == before
    assert load_agent(saved / "lqg.json", MODEL).system.order == LQG.system.order


def test_a_full_disk_leaves_the_agent_that_was_there(saved, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("flapgym.core.atomic.os.fsync", full)
    with pytest.raises(OSError, match="No space left"):
        save_agent(saved / "lqg.json", replace(LQG, name="other"), MODEL, "", {})
    assert load_agent(saved / "lqg.json", MODEL).name == "mine"
    assert sorted(os.listdir(saved)) == ["lqg.json", "policy.json"]


def test_a_design_may_hold_what_numpy_has(tmp_path):
    design = {"a": np.int64(3), "b": np.float32(0.5), "c": np.arange(3), "d": np.bool_(True), "e": (1, None)}
    save_agent(tmp_path / "a.json", LQG, MODEL, "A test.", design)
    assert json.loads((tmp_path / "a.json").read_text())["design"] == {
        "a": 3,
        "b": 0.5,
        "c": [0, 1, 2],
        "d": True,
        "e": [1, None],
    }


def test_an_agent_beside_a_model_of_the_same_stem_leaves_the_model(tmp_path):
    save_model(MODEL, tmp_path / "mine.safetensors")
    save_agent(tmp_path / "mine.json", LQG, MODEL, "A test.", {})
    assert load_model(tmp_path / "mine.safetensors").hash == MODEL.hash
    assert load_agent(tmp_path / "mine.json", MODEL).name == "mine"


def test_a_controller_without_states_survives_its_file(tmp_path):
    system = replace(LQG.system, A=np.empty((0, 0)), B=np.empty((0, 3)), C=np.empty((1, 0)))
    agent = replace(LQG, system=system, start=np.empty((0, 3)))
    save_agent(tmp_path / "gain.json", agent, MODEL, "A test.", {})
    loaded = load_agent(tmp_path / "gain.json", MODEL)
    assert [getattr(loaded.system, key).shape for key in "ABCD"] == [(0, 0), (0, 3), (1, 0), (1, 3)]
    np.testing.assert_array_equal(loaded.system.D, system.D)


@pytest.mark.parametrize("key", ["name", "description", "design", "time_step", "A", "model_hash"])
def test_a_changed_entry_of_any_kind_is_seen_by_the_checksum(saved, key):
    content = json.loads((saved / "lqg.json").read_text())
    other = {"design": {"weight": 4.0}, "time_step": 0.0070000001, "A": (0.5 * LQG.system.A).tolist()}
    edit(saved / "lqg.json", sealed=False, **{key: other.get(key, f"{content[key]} or not")})
    assert "checksum" in refusal(saved / "lqg.json")


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"steps_per_action": 101}, "steps_per_action: expected a whole number from 1 to 100, got 101"),
        ({"steps_per_action": 10**9}, "steps_per_action: expected a whole number"),
        ({"steps_per_action": 2.0}, "steps_per_action: expected a whole number from 1 to 100, got 2.0"),
        ({"steps_per_action": True}, "steps_per_action: expected a whole number from 1 to 100, got True"),
        ({"steps_per_action": 0}, "steps_per_action: expected a whole number"),
        ({"observe": ["rbm", "wind_speed"]}, "observe: expected some of rbm, flap_angle"),
        ({"observe": ["rbm", "rbm"]}, "observe: expected each name once"),
        ({"observe": ["rbm", "azimuth"]}, "observe: expected some of"),
        ({"observe": "rbm"}, "observe: expected a list"),
        ({"observe": []}, "observe: expected a list"),
        ({"observe": [["rbm"], 1]}, "observe: expected some of"),
        ({"per_blade": 1}, "per_blade: expected true or false, got 1"),
        ({"activation": "elu"}, "activation: expected one of tanh, relu"),
        ({"activation": ["tanh"]}, "activation: expected one of tanh, relu"),
        ({"squash": None}, "squash: expected one of"),
        ({"offset": [0.0, "0"]}, "offset: expected a row of numbers"),
        ({"offset": [0.0, True]}, "offset: expected numbers"),
        ({"offset": [0.0]}, "offset and scale: expected 2 entries each, got 1 and 2"),
        ({"scale": {}}, "scale: expected numbers, got {}"),
        ({"scale": 1}, "scale: expected numbers, got 1"),
        ({"weights": []}, "weights: expected as many layers as biases"),
        ({"weights": 3}, "weights: expected a list of layers"),
        ({"weights": [[[1.0, 1.0]], [[1.0, 2.0], [1.0]]]}, "weights[1]: expected rows of numbers"),
        ({"weights": [[[1.0, 1.0]], [[1.0, 2.0]]], "biases": [[1.0], [1.0]]}, "weights: expected a layer of"),
        ({"biases": [[0.0], None]}, "biases[1]: expected numbers"),
        ({"activation": ...}, "activation: missing"),
        ({"A": [[1.0]]}, "'A': unknown key of a policy"),
        ({"kind": "oracle"}, "kind: expected one of blade_controller"),
        ({"kind": ["policy"]}, "kind: expected one of"),
        ({"format_version": 1}, "format_version: expected 2, got 1; save it again"),
        ({"format_version": True}, "format_version: expected 2, got True"),
    ],
)
def test_a_policy_s_file_that_says_what_no_policy_can_be_is_refused_by_its_field(saved, changes, message):
    edit(saved / "policy.json", **changes)
    assert message in refusal(saved / "policy.json")


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"time_step": 0.01}, "time_step: designed for 0.01 s"),
        ({"time_step": "0.007"}, "time_step: designed for '0.007' s"),
        ({"time_step": ...}, "time_step: missing"),
        ({"A": [[1.0, 0.0]]}, "state_space.A: expected shape"),
        ({"A": []}, "state_space.B: expected shape"),
        ({"A": [[]]}, "state_space.A: expected shape"),
        ({"D": [[1.0, True, 0.0]]}, "D: expected numbers"),
        ({"D": [["x", 1.0, 0.0]]}, "D: expected rows of numbers"),
        ({"start": [[1.0]]}, "start: expected shape"),
        ({"multiblade": True}, "'multiblade': unknown key"),
        ({"kind": "rotor_controller", "multiblade": 1}, "multiblade: expected true or false"),
        ({"kind": "rotor_controller", "multiblade": True}, "state_space.B: expected shape"),
        ({"model_hash": 5}, "model_hash: expected a text"),
        ({"description": "a\nb"}, "description: expected a text of one line"),
        ({"design": []}, "design: expected a mapping, got []"),
    ],
)
def test_a_controller_s_file_that_says_what_none_can_be_is_refused_by_its_field(saved, changes, message):
    edit(saved / "lqg.json", **changes)
    assert message in refusal(saved / "lqg.json")


@pytest.mark.parametrize("text", ["", "{", "[]", "1", "null", '{"a": NaN}', "\ufeff{}", '{"a": "\\ud800"}'])
def test_json_of_any_shape_is_refused_by_the_file(saved, text):
    (saved / "lqg.json").write_text(text, encoding="utf-8")
    refusal(saved / "lqg.json")


NAMES: list[object] = [
    *("", " ", "a\nb", "a|b", "=cmd()", "-a", "@a", "\x1b[31ma", "a/b", "../a", "<b>", "a" * 61, "open_loop"),
    *(1, None, []),
]


@pytest.mark.parametrize("name", NAMES)
def test_a_name_that_a_table_would_not_take_is_refused_in_files_and_in_code(saved, name):
    for file in ("lqg.json", "policy.json"):
        edit(saved / file, name=name)
        assert "name: expected" in refusal(saved / file)
    for agent in (LQG, POLICY):
        with pytest.raises(ValueError, match="agent: name: expected"):
            replace(agent, name=name)


class Own:
    """The protocol, and nothing of this package."""

    def __init__(self, **attributes):
        standard = {"name": "own", "observe": ("rbm",), "steps_per_action": 10, "model_hash": None}
        self.__dict__.update(standard | attributes)

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        return np.full((*observation.shape[:-1], 3), self.__dict__.get("action", 0.0), dtype=np.float32), None


@pytest.mark.parametrize(
    "attributes, message",
    [
        *(({"name": name}, "agent: name: expected") for name in NAMES),
        ({"steps_per_action": 101}, "agent own: steps_per_action: expected a whole number from 1 to 100"),
        ({"steps_per_action": 2.0}, "agent own: steps_per_action"),
        ({"observe": ("wind", "wind")}, "agent own: observe: expected each name once"),
        ({"observe": ("weather",)}, "agent own: observe: expected some of"),
        ({"action": np.nan}, "agent own: gave an action that is not finite after 0.00 s"),
    ],
)
def test_agents_of_other_classes_pass_the_same_door(attributes, message):
    with pytest.raises(ValueError, match=message):
        compare([Own(**attributes)], MODEL, realisations=1, duration=1.0)


def test_numbers_that_are_not_finite_are_refused_in_code():
    with pytest.raises(ValueError, match=r"agent mine: weights\[0\]: expected finite numbers"):
        replace(POLICY, weights=(np.full((4, 2), np.nan), POLICY.weights[1]))
    with pytest.raises(ValueError, match="agent mine: start: expected finite numbers"):
        replace(LQG, start=np.full_like(LQG.start, np.inf))


def test_a_controller_that_grows_without_end_costs_one_line(saved, monkeypatch, capsys):
    save_model(MODEL, saved / "model.safetensors")
    system = replace(LQG.system, A=1e9 * np.eye(LQG.system.order))
    save_agent(saved / "lqg.json", replace(LQG, system=system), MODEL, "It grows.", {})
    monkeypatch.chdir(saved)
    code = cli.main(
        [
            "compare",
            "--model",
            "model.safetensors",
            "--agents",
            "lqg.json",
            "--realisations",
            "1",
            "--duration",
            "2",
        ]
    )
    error = capsys.readouterr().err
    assert code == 2
    assert "flapgym compare: agent mine: gave an action that is not finite after" in error
    assert "Traceback" not in error
    assert "Warning" not in error


def test_the_quantities_of_a_policy_are_those_of_which_each_blade_has_one():
    assert set(BLADE_QUANTITIES) == set(OBSERVABLES) - TURBINE_ONLY - PITCH - LIDAR - SPEED - {"wind"}


def test_every_shipped_agent_passes_the_door():
    model = load_model()
    assert [load_agent(name, model).name for name in AGENT_NAMES] == list(AGENT_NAMES)
