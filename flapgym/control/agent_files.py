"""Agents on disk: one JSON file that says what an agent is, which model it was made for, and holds its numbers.

A checksum covers all of it. The shipped agents lie in the package's `agents` folder.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from flapgym.control.agent import Agent, OpenLoop, check_fit, check_flaps
from flapgym.control.agent_checks import check_numbers, named_errors
from flapgym.control.blade_controller import BladeController, acceleration_limits
from flapgym.control.by_rule import RULED, agent_by_rule
from flapgym.control.channels import BLADE, MULTIBLADE, ROTOR
from flapgym.control.individual_pitch import (
    CROSSOVER,
    INDIVIDUAL_PITCH,
    INDIVIDUAL_PITCH_2P,
    SECOND_CROSSOVER,
    individual_pitch_agent,
)
from flapgym.control.policy import Policy
from flapgym.control.rotor_controller import RotorController
from flapgym.core.arrays import Array
from flapgym.core.atomic import write_atomically
from flapgym.core.files import MEGABYTE, check_plain, read_json
from flapgym.core.state_space import StateSpace
from flapgym.core.wording import one_line, shown
from flapgym.model.turbine_model import DEFAULT_MODEL, TurbineModel

FORMAT_VERSION = 2
LARGEST = 16 * MEGABYTE
"""Of a file [bytes]: some seven hundred thousand numbers."""
AGENT_NAMES = (
    "open_loop",
    "pd",
    "pid",
    "individual_flap",
    "lqg",
    "lqg_saturating",
    "lqg_multiblade_saturating",
    "ppo",
    "sac",
)
"""The agents of the comparison, in the order of its table."""
AGENT_SETS = (DEFAULT_MODEL, "nrel5mw-rated")
"""The shipped models that have agents of their own, tuned and trained on them by the same rules."""
FIELD_AGENT_NAMES = ("lqg_field", "lqg_field_multiblade")
"""Further agents, made for a field over the disk with shear, for models with winds by strip."""
FIELD_AGENT_SETS = (DEFAULT_MODEL, "nrel5mw-three-flaps")
"""The sets that have them: nrel5mw-site is the first's model with more inputs, and its hash is the same."""

_TELLS: dict[tuple[str, ...], str] = {AGENT_SETS: "pd", FIELD_AGENT_SETS: "lqg_field"}
"""Of each kind of set a small agent, which tells whose it is."""
_COMMON = ("format_version", "kind", "name", "description", "model", "model_hash", "design", "checksum")
_CONTROLLER = ("time_step", "A", "B", "C", "D", "start")
_NETWORK = ("observe", "steps_per_action", "per_blade", "activation", "squash")
_KINDS = {
    "blade_controller": _CONTROLLER,
    "rotor_controller": ("multiblade", *_CONTROLLER),
    "policy": (*_NETWORK, "offset", "scale", "weights", "biases"),
}


def made_for(agent: Agent, model: TurbineModel) -> bool:
    """Whether the agent fits any model or was designed on this one."""
    return agent.model_hash is None or agent.model_hash == model.hash


def load_agent(name: str | os.PathLike[str], model: TurbineModel) -> Agent:
    """A shipped agent by its name, or one from its .json file, ready for `model`.

    A plain name means the agent of the set made for the model, or of the first set where none is; "nrel5mw-rated/lqg"
    names one of a set whatever the model. Where no set was made for a model with winds by strip, PD, PID and LQGs are
    made for it by the rule of `flapgym.control.by_rule`. "individual_pitch" is made for the model by its rule, and
    moves the blades' pitch alone; "individual_pitch+lqg" does so beside what moves the flaps. An agent made for another
    model is returned all the same; `made_for` tells.

    "individual_pitch_2p" goes as "individual_pitch" does, and takes off what comes twice a turn, too.

    Raises
    ------
    ValueError
        If there is no such agent, its file is damaged or says what no agent can be, or its step or its number of flaps
        is not the model's.
    """
    if str(name) == OpenLoop.name:
        return OpenLoop()
    pitch, plus, beside = str(name).partition("+")
    if pitch in (INDIVIDUAL_PITCH, INDIVIDUAL_PITCH_2P):
        if plus and (not beside or beside.startswith(INDIVIDUAL_PITCH)):
            raise ValueError(f"agent {one_line(name)}: expected an agent of the flaps behind the +")
        flaps = load_agent(beside, model) if beside else None
        return individual_pitch_agent(
            # By the name of what moves the flaps: a path would be none that tables can show.
            pitch if flaps is None else f"{pitch}+{flaps.name}",
            model,
            CROSSOVER,
            flaps,
            second=SECOND_CROSSOVER if pitch == INDIVIDUAL_PITCH_2P else 0.0,
        )
    path = _find(name, model)
    content = _read(path)
    if str(name) in RULED and model.strips and content["model_hash"] != model.hash:
        # The winds of a site blow at any speed, and no set was made for this one.
        return agent_by_rule(str(name), model, content["design"])
    try:
        with named_errors(content["name"]):
            agent = _policy(content) if content["kind"] == "policy" else _controller(content, model)
            check_fit(agent, model)
            return agent
    except ValueError as error:
        raise ValueError(f"{error} (in {path})") from None


def agent_design(name: str | os.PathLike[str], model: TurbineModel) -> dict[str, Any]:
    """How an agent, named as for `load_agent`, was made: its weights or gains and what was found about it."""
    return dict(_read(_find(name, model))["design"])


def save_agent(
    path: str | os.PathLike[str],
    agent: BladeController | RotorController | Policy,
    model: TurbineModel,
    description: str,
    design: Mapping[str, Any],
) -> None:
    """Write an agent to a file; what was there before stays until the new one is whole.

    Parameters
    ----------
    path : path
        Ends in .json.
    agent : BladeController, RotorController or Policy
        What to save.
    model : TurbineModel
        What it was made for.
    description : str
        One line on what it is.
    design : mapping
        How it was made (weights, hyperparameters, what was measured): JSON values, also as numpy has them.

    Raises
    ------
    ValueError, TypeError
        If it cannot be saved; nothing is written then.
    """
    if not isinstance(agent, BladeController | RotorController | Policy):
        raise TypeError(
            f"agent: expected a BladeController, RotorController or Policy, got {type(agent).__name__}; "
            "any other agent is handed to flapgym.evaluation.compare as it is"
        )
    check_fit(agent, model)
    target = Path(path)
    if target.suffix != ".json":
        raise ValueError(f"agent {target}: expected a path that ends in .json")
    kind, settings, numbers = _parts(agent)
    header = {
        "format_version": FORMAT_VERSION,
        "kind": kind,
        "name": agent.name,
        "description": description,
        "model": model.name,
        "model_hash": model.hash,
        "design": _plain(design),
        **settings,
    }
    _check_common(header)
    check_plain(header["design"], "agent: design")
    lists = {key: _lists(value) for key, value in numbers.items()}
    header["checksum"] = _checksum(header | lists)
    write_atomically(target, _document(header, lists).encode())


def _parts(
    agent: BladeController | RotorController | Policy,
) -> tuple[str, dict[str, Any], dict[str, Array | tuple[Array, ...]]]:
    """Kind, settings and numbers of an agent, under the keys of its file."""
    if isinstance(agent, Policy):
        numbers = {key: getattr(agent, key) for key in ("offset", "scale", "weights", "biases")}
        return "policy", {key: getattr(agent, key) for key in _NETWORK}, numbers
    system = agent.system
    matrices = {key: getattr(system, key) for key in "ABCD"} | {"start": agent.start}
    settings: dict[str, Any] = {"time_step": system.time_step}
    if isinstance(agent, BladeController):
        return "blade_controller", settings, matrices
    return "rotor_controller", settings | {"multiblade": agent.channels.multiblade}, matrices


def _document(header: Mapping[str, Any], numbers: Mapping[str, Any]) -> str:
    """JSON with a line for every setting and for every row of numbers."""
    parts = [json.dumps(header, indent=2, allow_nan=False).removesuffix("\n}")]
    for key, value in numbers.items():
        rows = ",\n    ".join(json.dumps(row, allow_nan=False) for row in value)
        parts.append(f'  "{key}": [\n    {rows}\n  ]')
    return ",\n".join(parts) + "\n}\n"


def _lists(value: Array | tuple[Array, ...]) -> list[Any]:
    return [part.tolist() for part in value] if isinstance(value, tuple) else value.tolist()


def _plain(value: Any) -> Any:
    """What JSON has for a value that numpy or a mapping of another class holds."""
    if isinstance(value, Mapping):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    return value.tolist() if isinstance(value, np.generic | np.ndarray) else value


def _checksum(content: Mapping[str, Any]) -> str:
    """Of everything but the checksum itself."""
    rest = {key: value for key, value in content.items() if key != "checksum"}
    return hashlib.sha256(json.dumps(rest, sort_keys=True, allow_nan=False).encode()).hexdigest()


def _find(name: str | os.PathLike[str], model: TurbineModel) -> Path:
    chosen, _, plain = str(name).rpartition("/")
    sets = _sets(plain)
    if sets and chosen in ("", *sets):
        return _folder(chosen or _set_for(sets, model)) / f"{plain}.json"
    path = Path(name)
    if path.suffix != ".json":
        raise ValueError(
            f"agent {one_line(name)}: unknown; expected one of {', '.join((*AGENT_NAMES, *FIELD_AGENT_NAMES))}, "
            f"{INDIVIDUAL_PITCH}, {INDIVIDUAL_PITCH_2P}, or the path of an agent's .json file"
        )
    return path


def _folder(chosen: str) -> Path:
    return Path(str(resources.files("flapgym.control") / "agents" / chosen))


def _sets(name: str) -> tuple[str, ...]:
    """The sets that have a shipped agent of this name; none for any other name, and for open loop, which is no file."""
    if name in FIELD_AGENT_NAMES:
        return FIELD_AGENT_SETS
    return AGENT_SETS if name in AGENT_NAMES and name != OpenLoop.name else ()


def _set_for(sets: tuple[str, ...], model: TurbineModel) -> str:
    """The set of agents made for a model; the first where none is."""
    told = _TELLS[sets]
    own = (each for each in sets if _read(_folder(each) / f"{told}.json")["model_hash"] == model.hash)
    return next(own, sets[0])


def _read(path: Path) -> dict[str, Any]:
    """The content of an agent's file: whole, of a known kind, and with all its keys."""
    try:
        content = read_json(path, LARGEST)
    except FileNotFoundError as error:
        raise ValueError(
            f"agent {error}; give the path of an agent's .json file, which flapgym.control.save_agent writes, "
            f"or one of {', '.join((*AGENT_NAMES, *FIELD_AGENT_NAMES))}"
        ) from None
    except ValueError as error:
        raise ValueError(f"agent {error}") from None
    if content.get("format_version") != FORMAT_VERSION:
        raise ValueError(
            f"agent {path}: format_version: expected {FORMAT_VERSION}, got {shown(content.get('format_version'))}; "
            "save it again with this version of flapgym"
        )
    kind = content.get("kind")
    if not isinstance(kind, str) or kind not in _KINDS:
        raise ValueError(f"agent {path}: kind: expected one of {', '.join(_KINDS)}, got {shown(kind)}")
    known = (*_COMMON, *_KINDS[kind])
    for key in (*known, *content):
        if key not in content:
            raise ValueError(f"agent {path}: {key}: missing; save the agent again")
        if key not in known:
            raise ValueError(
                f"agent {path}: {shown(key)}: unknown key of a {kind}; known: {', '.join(known)}"
            )
    if content["checksum"] != _checksum(content):
        raise ValueError(f"agent {path}: damaged, its content does not match its checksum; save it again")
    try:
        _check_common(content)
    except ValueError as error:
        raise ValueError(f"{error} (in {path})") from None
    return content


def _check_common(content: Mapping[str, Any]) -> None:
    """Refuse what a file says of any kind of agent, but for its name, which the agent itself checks."""
    for key in ("description", "model", "model_hash"):
        if not isinstance(content[key], str) or not content[key].isprintable():
            raise ValueError(f"agent: {key}: expected a text of one line, got {shown(content[key])}")
    if not isinstance(content["design"], Mapping):
        raise ValueError(f"agent: design: expected a mapping, got {shown(content['design'])}")


def _controller(content: Mapping[str, Any], model: TurbineModel) -> BladeController | RotorController:
    step = content["time_step"]
    if isinstance(step, bool) or not isinstance(step, int | float) or step != model.time_step:
        raise ValueError(
            f"time_step: designed for {shown(step)} s, the model {model.name} steps "
            f"{model.time_step} s; tune it again for this model"
        )
    frame = BLADE
    if content["kind"] == "rotor_controller":
        if not isinstance(content["multiblade"], bool):
            raise ValueError(f"multiblade: expected true or false, got {shown(content['multiblade'])}")
        frame = MULTIBLADE if content["multiblade"] else ROTOR
    numbers = {key: _numbers(content[key], key, 2) for key in (*"ABCD", "start")}
    # A file names no signals: its accelerations tell how many flaps it was made for.
    flaps = max(1, len(numbers["D"]) // frame.count)
    check_flaps(content["name"], flaps, model)
    channels = frame.with_flaps(flaps)
    # Of a controller without states, B and start have no row that could tell how long it is.
    numbers |= {key: np.empty((0, len(channels.inputs))) for key in ("B", "start") if not len(numbers[key])}
    start = numbers.pop("start")
    system = StateSpace(
        **numbers, time_step=model.time_step, inputs=channels.inputs, outputs=channels.outputs
    )
    cls = BladeController if content["kind"] == "blade_controller" else RotorController
    return cls(content["name"], system, start, acceleration_limits(model), content["model_hash"])


def _policy(content: Mapping[str, Any]) -> Policy:
    weights, biases = content["weights"], content["biases"]
    for field in ("weights", "biases"):
        if not isinstance(content[field], list):
            raise ValueError(f"{field}: expected a list of layers, got {shown(content[field])}")
    return Policy(
        **{key: content[key] for key in ("name", *_NETWORK, "model_hash")},
        offset=_numbers(content["offset"], "offset", 1),
        scale=_numbers(content["scale"], "scale", 1),
        weights=tuple(_numbers(layer, f"weights[{i}]", 2) for i, layer in enumerate(weights)),
        biases=tuple(_numbers(layer, f"biases[{i}]", 1) for i, layer in enumerate(biases)),
    )


def _numbers(value: Any, field: str, dimensions: int) -> Array:
    """Numbers of a file: lists of lists, no truth values among them."""
    rows: Sequence[Any] = value if isinstance(value, list) else []
    within = [entry for row in rows for entry in (row if isinstance(row, list) else [row])]
    if not isinstance(value, list) or any(isinstance(entry, bool) for entry in within):
        raise ValueError(f"{field}: expected numbers, got {shown(value)}")
    if dimensions == 2 and not within:
        return np.empty((len(rows), 0))
    return check_numbers(value, field, dimensions)
