"""Agents on disk: a JSON description beside its matrices in safetensors; nothing is unpickled.

`name.json` says what the agent is and which model it was made for, `name.safetensors` holds its numbers; a checksum
ties the two together. The shipped agents lie in the package's `agents` folder.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import safetensors
import safetensors.numpy

from flapgym.aeroelastic.model import DEFAULT_MODEL, TurbineModel
from flapgym.atomic import write_atomically
from flapgym.control.agent import Agent, OpenLoop
from flapgym.control.blade_controller import CONTROLLER_INPUTS, CONTROLLER_OUTPUTS, BladeController
from flapgym.control.channels import MULTIBLADE, ROTOR
from flapgym.control.policy import Policy
from flapgym.control.rotor_controller import RotorController
from flapgym.state_space import Array, StateSpace

FORMAT_VERSION = 1
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


def made_for(agent: Agent, model: TurbineModel) -> bool:
    """Whether the agent fits any model or was designed on this one."""
    return agent.model_hash is None or agent.model_hash == model.hash


def load_agent(name: str | os.PathLike[str], model: TurbineModel) -> Agent:
    """A shipped agent by its name, or one from its .json file, ready for `model`.

    A plain name means the agent of the set made for the model, or of the first of `AGENT_SETS` where none is;
    "nrel5mw-rated/lqg" names one of a set whatever the model. An agent made for another model is returned all the same;
    `made_for` tells.

    Raises
    ------
    ValueError
        If there is no such agent, its file is damaged, or its step is not the model's.
    """
    if str(name) == OpenLoop.name:
        return OpenLoop()
    path = _find(name, model)
    header, tensors = _read(path)
    try:
        if header["kind"] == "blade_controller":
            return _blade_controller(header, tensors, model)
        if header["kind"] == "rotor_controller":
            return _rotor_controller(header, tensors, model)
        if header["kind"] == "policy":
            return _policy(header, tensors)
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"agent {path}: missing or wrong entry {error}") from None
    raise ValueError(
        f"agent {path}: kind: expected blade_controller, rotor_controller or policy, got {header['kind']!r}"
    )


def agent_design(name: str | os.PathLike[str], model: TurbineModel) -> dict[str, Any]:
    """How an agent, named as for `load_agent`, was made: its weights or gains and what was found about it."""
    return dict(_read(_find(name, model))[0]["design"])


def save_agent(
    path: str | os.PathLike[str],
    agent: BladeController | RotorController | Policy,
    model: TurbineModel,
    description: str,
    design: Mapping[str, Any],
) -> None:
    """Write `path` (.json) and its .safetensors neighbour.

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
        Plain JSON values: how it was made (weights, hyperparameters, what was measured).
    """
    if not isinstance(agent, BladeController | RotorController | Policy):
        raise TypeError(
            f"agent: expected a BladeController, RotorController or Policy, got {type(agent).__name__}; "
            "any other agent is handed to flapgym.evaluation.compare as it is"
        )
    target = Path(path)
    if target.suffix != ".json":
        raise ValueError(f"agent {target}: expected a path that ends in .json")
    header: dict[str, Any] = {
        "format_version": FORMAT_VERSION,
        "name": agent.name,
        "description": description,
        "model": model.name,
        "model_hash": model.hash,
        "design": dict(design),
    }
    if isinstance(agent, BladeController | RotorController):
        kind = "blade_controller" if isinstance(agent, BladeController) else "rotor_controller"
        header |= {"kind": kind, "time_step": agent.system.time_step}
        if isinstance(agent, RotorController):
            header["multiblade"] = agent.channels == MULTIBLADE
        tensors = {key: getattr(agent.system, key) for key in "ABCD"} | {"start": agent.start}
    else:
        header |= {
            "kind": "policy",
            "observe": list(agent.observe),
            "steps_per_action": agent.steps_per_action,
            "per_blade": agent.per_blade,
            "layers": [list(weight.shape) for weight in agent.weights],
            "activation": agent.activation,
            "squash": agent.squash,
        }
        tensors = {"offset": agent.offset, "scale": agent.scale}
        for index, (weight, bias) in enumerate(zip(agent.weights, agent.biases, strict=True)):
            tensors |= {f"layer_{index}.weight": weight, f"layer_{index}.bias": bias}
    content = safetensors.numpy.save({key: np.ascontiguousarray(value) for key, value in tensors.items()})
    header["checksum"] = hashlib.sha256(content).hexdigest()
    write_atomically(target.with_suffix(".safetensors"), content)
    write_atomically(target, (json.dumps(header, indent=2) + "\n").encode())


def _find(name: str | os.PathLike[str], model: TurbineModel) -> Path:
    chosen, _, plain = str(name).rpartition("/")
    if plain in AGENT_NAMES and plain != OpenLoop.name and chosen in ("", *AGENT_SETS):
        return _folder(chosen or _set_for(model)) / f"{plain}.json"
    path = Path(name)
    if path.suffix != ".json":
        raise ValueError(
            f"agent {name}: unknown; expected one of {', '.join(AGENT_NAMES)} or the path of an agent's .json file"
        )
    if not path.is_file():
        raise ValueError(
            f"agent {name}: no such file; give the path of an agent's .json file, or one of {', '.join(AGENT_NAMES)}"
        )
    return path


def _folder(chosen: str) -> Path:
    return Path(str(resources.files("flapgym.control") / "agents" / chosen))


def _set_for(model: TurbineModel) -> str:
    """The set of agents made for a model; the first where none is."""
    own = (each for each in AGENT_SETS if _read(_folder(each) / "pd.json")[0]["model_hash"] == model.hash)
    return next(own, AGENT_SETS[0])


def _read(path: Path) -> tuple[dict[str, Any], dict[str, Array]]:
    try:
        header = json.loads(path.read_text(encoding="utf-8"))
        content = path.with_suffix(".safetensors").read_bytes()
    except (OSError, ValueError) as error:
        raise ValueError(f"agent {path}: missing or damaged ({error})") from None
    if not isinstance(header, dict) or header.get("format_version") != FORMAT_VERSION:
        found = header.get("format_version") if isinstance(header, dict) else None
        raise ValueError(f"agent {path}: format_version: expected {FORMAT_VERSION}, got {found}")
    if hashlib.sha256(content).hexdigest() != header.get("checksum"):
        raise ValueError(
            f"agent {path}: {path.with_suffix('.safetensors').name} is damaged, its checksum differs"
        )
    try:
        tensors = safetensors.numpy.load(content)
    except safetensors.SafetensorError as error:
        raise ValueError(f"agent {path}: damaged matrices ({error})") from None
    return header, {key: np.asarray(value, dtype=float) for key, value in tensors.items()}


def _blade_controller(
    header: Mapping[str, Any], tensors: Mapping[str, Array], model: TurbineModel
) -> BladeController:
    system = _system(header, tensors, model, CONTROLLER_INPUTS, CONTROLLER_OUTPUTS)
    return BladeController(
        header["name"], system, tensors["start"], model.acceleration_limit, header["model_hash"]
    )


def _rotor_controller(
    header: Mapping[str, Any], tensors: Mapping[str, Array], model: TurbineModel
) -> RotorController:
    channels = MULTIBLADE if header["multiblade"] else ROTOR
    system = _system(header, tensors, model, channels.inputs, channels.outputs)
    return RotorController(
        header["name"], system, tensors["start"], model.acceleration_limit, header["model_hash"]
    )


def _system(
    header: Mapping[str, Any],
    tensors: Mapping[str, Array],
    model: TurbineModel,
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
) -> StateSpace:
    if header["time_step"] != model.time_step:
        raise ValueError(
            f"agent {header['name']}: time_step: designed for {header['time_step']} s, "
            f"the model {model.name} steps {model.time_step} s; tune it again for this model"
        )
    matrices = {key: tensors[key] for key in "ABCD"}
    return StateSpace(**matrices, time_step=header["time_step"], inputs=inputs, outputs=outputs)


def _policy(header: Mapping[str, Any], tensors: Mapping[str, Array]) -> Policy:
    layers = range(len(header["layers"]))
    return Policy(
        name=header["name"],
        observe=tuple(header["observe"]),
        steps_per_action=header["steps_per_action"],
        per_blade=header["per_blade"],
        offset=tensors["offset"],
        scale=tensors["scale"],
        weights=tuple(tensors[f"layer_{index}.weight"] for index in layers),
        biases=tuple(tensors[f"layer_{index}.bias"] for index in layers),
        activation=header["activation"],
        squash=header["squash"],
        model_hash=header["model_hash"],
    )
