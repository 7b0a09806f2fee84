"""What agents did at a wind speed, kept on disk under all that it depends on: an interrupted study goes on from there.

A file holds the loads of one agent in one bin, and is written whole or not at all.
"""

from __future__ import annotations

import dataclasses
import hashlib
import inspect
import json
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from flapgym.control import Agent
from flapgym.core.arrays import Array
from flapgym.core.atomic import write_atomically
from flapgym.core.files import MEGABYTE, read_json
from flapgym.core.wording import number
from flapgym.evaluation.channels import ChannelLoads, joined

FORMAT = 1
"""Of the files, and of what the numbers in them mean: a change of either makes this one more."""
FOLDER = "lifetime-bins"
LARGEST = 16 * MEGABYTE
OF_SIMULATION = ("core", "wind", "model", "plant", "control", "envs")
OF_EVALUATION = ("bank", "channels", "cycles", "lifetime_study", "metrics", "record", "simulate")
"""Folders and files with code that decides what loads are found."""
OWN = ("flapgym", "numpy", "builtins")
"""Packages whose classes are known by their names."""


@dataclass(frozen=True, eq=False)
class Duty:
    """What actuators of N realisations had to do.

    Attributes
    ----------
    flap_travel, pitch_travel : (N,) float
        Path of a flap, and of a blade's pitch with the collective one, per unit of time [rad/s].
    flap_cycles, pitch_cycles : (N,) float
        The same in paths from stop to stop and back [1/s].
    flap_rate_max, pitch_rate_max : (N,) float
        Largest modulus [rad/s].
    flap_power : (N,) float
        Mean power that speeds a flap up, over its moment of inertia about the hinge [W/(kg m^2)]: what brakes it again
        is not given back.
    wind_max : (N,) float
        Largest departure of the mean over the rotor from the mean wind [m/s]; the same under every agent.
    """

    flap_travel: Array
    flap_cycles: Array
    flap_rate_max: Array
    flap_power: Array
    pitch_travel: Array
    pitch_cycles: Array
    pitch_rate_max: Array
    wind_max: Array


@dataclass(frozen=True, eq=False)
class BinLoads:
    """One agent at one wind speed: loads of every channel, and the actuators' duty."""

    channels: tuple[ChannelLoads, ...]
    duty: Duty


def joined_bins(parts: list[BinLoads]) -> BinLoads:
    """Of realisations that were simulated in parts."""
    channels = zip(*(part.channels for part in parts), strict=True)
    duty = {
        each.name: np.concatenate([getattr(part.duty, each.name) for part in parts]) for each in fields(Duty)
    }
    return BinLoads(tuple(joined(same) for same in channels), Duty(**duty))


def key_of(agent: Agent, conditions: Mapping[str, Any]) -> str | None:
    """Hash of an agent and of all that it meets, plain values; None if the agent cannot be told from others."""
    digest = hashlib.sha256(json.dumps([FORMAT, code_checksum(), conditions], sort_keys=True).encode())
    try:
        _digest(agent, digest, 0)
    except TypeError:
        return None
    return digest.hexdigest()


@cache
def code_checksum() -> str:
    """Of the code between a model and its loads: what was found by other code is found again."""
    package, digest = Path(__file__).parents[1], hashlib.sha256()
    files = [package / "evaluation" / f"{name}.py" for name in OF_EVALUATION]
    for folder in OF_SIMULATION:
        files += sorted((package / folder).rglob("*.py"))
    for file in files:
        digest.update(file.read_bytes())
    return digest.hexdigest()


def _digest(value: Any, digest: Any, depth: int) -> None:
    """Take in a value with everything in it; a TypeError if that cannot be seen from outside, as of compiled code."""
    if depth > 20:
        raise TypeError(f"{type(value).__name__}: nested too deep")
    kind = type(value)
    digest.update(f"({kind.__module__}.{kind.__qualname__}".encode())
    if kind.__module__.partition(".")[0] not in OWN:
        try:
            digest.update(inspect.getsource(kind).encode())  # somebody's own agent may be another tomorrow
        except OSError:
            raise TypeError(f"{kind.__name__}: its code is not to be seen") from None
    if isinstance(value, np.ndarray):
        if value.dtype.hasobject:
            raise TypeError("an array of objects")
        digest.update(f"{value.dtype.str}{value.shape}".encode() + np.ascontiguousarray(value).tobytes())
    elif value is None or isinstance(value, str | bytes | bool | int | float | complex | np.generic):
        digest.update(repr(value).encode())
    elif isinstance(value, Mapping):
        for key in sorted(value, key=repr):
            digest.update(repr(key).encode())
            _digest(value[key], digest, depth + 1)
    elif isinstance(value, list | tuple):
        for entry in value:
            _digest(entry, digest, depth + 1)
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        _digest({each.name: getattr(value, each.name) for each in fields(value)}, digest, depth + 1)
    elif hasattr(value, "__dict__") and not callable(value) and type(value).__module__ != "builtins":
        _digest(vars(value), digest, depth + 1)
    else:
        raise TypeError(f"{type(value).__name__}: nothing to be seen of it")
    digest.update(b")")


class Store:
    """Results in a folder; without one nothing is kept.

    Parameters
    ----------
    folder : path or None
        Made when the first result is written.
    """

    def __init__(self, folder: Path | None) -> None:
        self.folder = folder

    def read(self, key: str | None, agent: str, wind_speed: float) -> BinLoads | None:
        """What was kept under a key; None if there is nothing, or a file that cannot be read."""
        if key is None or self.folder is None:
            return None
        try:
            return _from_json(read_json(self._path(key, agent, wind_speed), LARGEST), key)
        except (OSError, ValueError, KeyError, TypeError):
            return None  # it is found again, and written anew

    def write(self, key: str | None, agent: str, wind_speed: float, loads: BinLoads) -> None:
        """Keep what was found."""
        if key is None or self.folder is None:
            return
        self.folder.mkdir(exist_ok=True)
        document = json.dumps(_to_json(loads, key, agent, wind_speed), allow_nan=False)
        write_atomically(self._path(key, agent, wind_speed), document.encode())

    def _path(self, key: str, agent: str, wind_speed: float) -> Path:
        assert self.folder is not None
        return self.folder / f"{number(wind_speed)}mps-{agent}-{key[:16]}.json"


def _to_json(loads: BinLoads, key: str, agent: str, wind_speed: float) -> dict[str, Any]:
    return {
        "key": key,
        "agent": agent,
        "wind_speed": wind_speed,
        "channels": [
            {
                "channel": each.channel,
                "unit": each.unit,
                "rms": each.rms.tolist(),
                "slopes": list(each.slopes),
                "equivalent": each.equivalent.tolist(),
            }
            for each in loads.channels
        ],
        "duty": {each.name: getattr(loads.duty, each.name).tolist() for each in fields(Duty)},
    }


def _from_json(content: Mapping[str, Any], key: str) -> BinLoads:
    if content["key"] != key:
        raise ValueError("of another study")
    channels = tuple(
        ChannelLoads(
            each["channel"],
            each["unit"],
            np.array(each["rms"]),
            tuple(each["slopes"]),
            np.array(each["equivalent"]),
        )
        for each in content["channels"]
    )
    return BinLoads(
        channels, Duty(**{each.name: np.array(content["duty"][each.name]) for each in fields(Duty)})
    )
