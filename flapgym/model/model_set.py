"""Models of one turbine over wind speed, in memory or in one file from which each is read when it is asked for.

A file is a safetensors file like that of a single model. Its tensors' names begin with the place of their model.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from importlib import resources
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import safetensors
import safetensors.numpy

from flapgym.core.arrays import Array
from flapgym.core.atomic import write_atomically
from flapgym.core.fields import Quantity
from flapgym.core.files import parse_json, regular_file
from flapgym.core.wording import number, shown
from flapgym.model.check import check_header
from flapgym.model.turbine_model import LARGEST, TurbineModel, packed, unpacked

SETS, SUFFIX = "sets", ".safetensors"
"""Folder of the shipped sets in the package, and how files end."""
METADATA = "flapgym_models"
"""Under which a file's metadata hold the headers of its models."""


@dataclass(frozen=True, eq=False)
class ModelSet:
    """Models of one turbine at several wind speeds; made by `of` or `load_model_set`.

    Attributes
    ----------
    wind_speeds : tuple of float
        What the models were built for, ascending [m/s].
    members : tuple of callables
        Each gives the model at its wind speed.
    """

    wind_speeds: tuple[float, ...]
    members: tuple[Callable[[], TurbineModel], ...]

    @classmethod
    def of(cls, models: Iterable[TurbineModel]) -> ModelSet:
        """The set of some models, in any order.

        Raises
        ------
        ValueError
            If there is none, two are of one wind speed, or they are not of the same turbine with the same flaps, inputs
            and outputs.
        """
        ordered = sorted(models, key=lambda model: model.wind_speed)
        _check_alike([_identity(packed(model)[0]) for model in ordered])
        return cls(
            tuple(model.wind_speed for model in ordered), tuple(partial(_itself, model) for model in ordered)
        )

    def __len__(self) -> int:
        """Number of models."""
        return len(self.members)

    def __iter__(self) -> Iterator[TurbineModel]:
        """The models by rising wind speed, each read as its turn comes."""
        return (member() for member in self.members)

    def at(self, wind_speed: float) -> TurbineModel:
        """The model built for a wind speed [m/s].

        Raises
        ------
        ValueError
            If there is none; the message says which there are.
        """
        place = self._nearest(wind_speed)
        if not np.isclose(self.wind_speeds[place], wind_speed, rtol=1e-9, atol=0.0):
            there = ", ".join(number(speed) for speed in self.wind_speeds)
            raise ValueError(
                f"model_set.at: expected one of the wind speeds {there} m/s, got {number(wind_speed)} m/s; "
                "or take the nearest"
            )
        return self.members[place]()

    def nearest(self, wind_speed: float) -> TurbineModel:
        """The model built for the wind speed nearest to one [m/s]; of two as near, the lower."""
        return self.members[self._nearest(wind_speed)]()

    def _nearest(self, wind_speed: float) -> int:
        asked = Quantity("speed").check(wind_speed, "model_set.wind_speed")
        return int(np.abs(np.array(self.wind_speeds) - asked).argmin())


def save_model_set(models: ModelSet, path: str | os.PathLike[str]) -> None:
    """Write a set to one file, atomically as `save_model` does; raises ValueError as that does."""
    headers: list[dict[str, Any]] = []
    tensors: dict[str, Array] = {}
    for place, model in enumerate(models):
        header, own = packed(model)
        headers.append(header)
        tensors |= {f"{place}.{name}": tensor for name, tensor in own.items()}
    metadata = {METADATA: json.dumps(headers, sort_keys=True)}
    write_atomically(path, safetensors.numpy.save(tensors, metadata))


def builtin_model_sets() -> list[str]:
    """Names of the sets shipped in the package."""
    folder = resources.files("flapgym.model") / SETS
    return sorted(item.name.removesuffix(SUFFIX) for item in folder.iterdir() if item.name.endswith(SUFFIX))


def is_model_set(name: str | os.PathLike[str]) -> bool:
    """Whether a name is that of a shipped set, or a path that of a file with one."""
    if str(name) in builtin_model_sets():
        return True
    try:
        with safetensors.safe_open(regular_file(Path(name), LARGEST), framework="numpy") as file:
            return METADATA in (file.metadata() or {})
    except (safetensors.SafetensorError, OSError, ValueError):
        return False


def load_model_set(name: str | os.PathLike[str]) -> ModelSet:
    """Read which models a shipped set or a file holds; each is read and checked when first asked for, and then kept.

    Raises
    ------
    FileNotFoundError
        If there is no such file and no shipped set of that name.
    ValueError
        If it is no file of a set, or its models do not go together. A damaged member is found when it is asked for.
    """
    shipped = str(name) in builtin_model_sets()
    path = Path(str(resources.files("flapgym.model") / SETS / f"{name}{SUFFIX}")) if shipped else Path(name)
    try:
        source = regular_file(path, LARGEST)
        with safetensors.safe_open(source, framework="numpy") as file:
            metadata = file.metadata() or {}
    except (safetensors.SafetensorError, OSError) as error:
        if isinstance(error, FileNotFoundError):
            raise FileNotFoundError(
                f"model set {path}: no such file, and no shipped set of that name "
                f"(shipped: {', '.join(builtin_model_sets())})"
            ) from None
        raise ValueError(f"model set {path}: damaged or not a file of models; save it again") from None
    if METADATA not in metadata:
        raise ValueError(f"model set {path}: not a file of several models; one model is for load_model")
    try:
        headers = _headers(metadata[METADATA])
        _check_alike([_identity(header) for header in headers])
    except KeyError as error:
        raise ValueError(f"model set {path}: {error}: missing; save it again") from None
    except ValueError as error:
        raise ValueError(f"model set {path}: {error}") from None
    speeds = tuple(header["wind_speed"] for header in headers)
    return ModelSet(speeds, tuple(_Stored(source, place, header) for place, header in enumerate(headers)))


def _headers(text: str) -> list[dict[str, Any]]:
    headers = parse_json(f'{{"models": {text}}}', "header")["models"]
    if not isinstance(headers, list) or not all(isinstance(header, dict) for header in headers):
        raise ValueError(f"header: expected a list of models, got {shown(headers)}")
    for header in headers:
        check_header(header)
    return headers


class _Stored:
    """Reads a model of a file once. No function within one: pickle, which takes sets to other processes, refuses it."""

    def __init__(self, path: Path, place: int, header: Mapping[str, Any]) -> None:
        self._path, self._place, self._header = path, place, header

    def __call__(self) -> TurbineModel:
        return self._model

    @cached_property
    def _model(self) -> TurbineModel:
        prefix = f"{self._place}."
        with safetensors.safe_open(self._path, framework="numpy") as file:
            names = [key for key in file.keys() if key.startswith(prefix)]  # noqa: SIM118 (not a dict)
            tensors = {name.removeprefix(prefix): file.get_tensor(name) for name in names}
        return unpacked(dict(self._header), tensors, self._path)


def _itself(model: TurbineModel) -> TurbineModel:
    return model


def _identity(header: Mapping[str, Any]) -> tuple[float, dict[str, Any]]:
    """Wind speed of a model, and what those of one set have in common, by name."""
    flaps = {key: value for key, value in header.items() if "flap" in key or key == "acceleration_limit"}
    signals = {kind: list(header["turbine"][kind]) for kind in ("inputs", "outputs")}
    return header["wind_speed"], {"turbine": header["case"].get("turbine"), "flaps": flaps, **signals}


def _check_alike(models: list[tuple[float, dict[str, Any]]]) -> None:
    """Refuse models that are not those of one turbine, each at a wind speed of its own, ascending."""
    if not models:
        raise ValueError("model_set: expected one or more models, got none")
    for (slower, one), (faster, other) in pairwise(models):
        if not slower < faster:
            raise ValueError(
                f"model_set.wind_speed: expected one model a wind speed, ascending, got {number(slower)} m/s then "
                f"{number(faster)} m/s"
            )
        for name, value in one.items():
            if value != other[name]:
                raise ValueError(
                    f"model_set.{name}: expected the same in all models, got others at {number(slower)} and "
                    f"{number(faster)} m/s; build them from one case but for the operating point"
                )
