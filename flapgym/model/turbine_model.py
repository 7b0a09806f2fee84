"""The built turbine model: what everybody downstream of the physics uses, and the file it lives in.

A model file is a safetensors file: matrices as tensors, everything else as one JSON text in the header.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from functools import cached_property
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import safetensors
import safetensors.numpy

from flapgym.core.arrays import Array
from flapgym.core.atomic import write_atomically
from flapgym.core.fields import from_plain
from flapgym.core.files import MEGABYTE, parse_json, regular_file
from flapgym.core.state_space import StateSpace, require_time_step
from flapgym.core.wording import number, one_line, shown
from flapgym.model.check import ONE_FLAP, check_header, check_model, check_tensors
from flapgym.model.harmonics import PeriodicPart, shaken_at
from flapgym.model.record import Flutter, Record
from flapgym.model.signals import BLADE_OUTPUTS as BLADE_OUTPUTS
from flapgym.model.signals import (
    blade_inputs,
    flap_names,
    grouped,
    pitch_inputs,
    turbine_inputs,
    turbine_outputs,
)
from flapgym.turbine import Pitch

FORMAT_VERSION = 2
DEFAULT_MODEL = "nrel5mw-corrected"
"""The shipped model meant where none is named."""
LARGEST = 128 * MEGABYTE
"""Of a model file [bytes]: unequal blades take two."""
_LIMITS = ("angle_limit", "rate_limit", "acceleration_limit")
_SYSTEMS = ("turbine", "blade")
_MATRICES = ("A", "B", "C", "D")
_REAL, _COMPLEX = ("left", "right"), ("core", "forcing")  # of the periodic part
_HASH_SETTINGS = ("wind_speed", "rotor_speed", "time_step", "turbulence_intensity", "length_scale")
_HASH_FREQUENCIES = (0.0, 0.3, 1.0, 3.0)  # Hz
_HASH_AZIMUTHS = (0.0, 1.0, 2.5)  # rad, where unequal blades are looked at

TURBINE_INPUTS = turbine_inputs(1)
TURBINE_OUTPUTS = turbine_outputs()
BLADE_INPUTS = blade_inputs(1)
"""Of a model with one flap a blade, homogeneous wind and no further outputs."""


@dataclass(frozen=True)
class ModelFlap:
    """The stops of a flap, the same on every blade.

    Attributes
    ----------
    name : str
        With which its inputs begin: "flap", or "flap1" to "flapF" from root to tip.
    angle_limit, rate_limit, acceleration_limit : float
        Stops [rad, rad/s] and the acceleration an action of one stands for [rad/s^2], to either side.
    """

    name: str
    angle_limit: float
    rate_limit: float
    acceleration_limit: float


@dataclass(frozen=True, eq=False)
class TurbineModel:
    """The coupled turbine and the clamped single blade, reduced, discrete and time-invariant.

    Attributes
    ----------
    turbine : StateSpace
        Whole turbine in multi-blade coordinates u_b = u_0 + u_c cos(theta_b) + u_s sin(theta_b),
        theta_b = theta + 2 pi b / 3 (b = 0, 1, 2). Inputs ``flap_inputs``, the flaps' angles [rad] and
        rates [rad/s] in multi-blade coordinates, then the homogeneous wind perturbation along the shaft [m/s], then,
        where the case asks for them, that in each of a blade's strips and ``pitch_inputs`` in multi-blade
        coordinates, and ``gravity`` [m/s^2].
        Outputs ``TURBINE_OUTPUTS``: flapwise root bending moment [N m] and tip deflection [m] in
        multi-blade coordinates, tower-top displacement [m] downwind and sideways (positive to the left of one
        who looks downwind); then those the case asks for. All are perturbations about a trim without gravity.
    blade : StateSpace
        One blade clamped at its root, rotating alone in its own wake but bent as in the rotor's trim (the
        paper's design model): inputs
        ``blade_flap_inputs`` and the wind, outputs ``BLADE_OUTPUTS``, same units.
    name : str
        Name of the case.
    wind_speed, rotor_speed, time_step : float
        Operating point [m/s, rad/s] and sampling time [s].
    turbulence_intensity, length_scale : float
        The case's reference turbulence [-, m].
    flaps : tuple of ModelFlap
        Of each blade, from root to tip.
    rbm_rms : float
        Open-loop rms of the root bending moment under the reference turbulence, mean over blades [N m].
    inputs_hash : str
        SHA-256 of the inputs (case and turbine data) the model was built from.
    case : mapping
        Those inputs, as plain JSON values.
    periodic : PeriodicPart, optional
        With unequal blades, what the azimuth adds to ``turbine``, which is then the mean over the revolution:
        ``flapgym.model.harmonics`` evaluates and simulates it. None for equal blades, whose form is constant.
    record : Record
        How the model was made: tools, readings, errors of the conversions, flutter.
    format_version : int
        Version of the file format.
    """

    turbine: StateSpace
    blade: StateSpace
    name: str
    wind_speed: float
    rotor_speed: float
    time_step: float
    turbulence_intensity: float
    length_scale: float
    flaps: tuple[ModelFlap, ...]
    rbm_rms: float
    inputs_hash: str
    case: Mapping[str, Any]
    periodic: PeriodicPart | None = None
    record: Record = field(default_factory=Record)
    format_version: int = FORMAT_VERSION

    def __post_init__(self) -> None:
        for name in _SYSTEMS:
            found = getattr(self, name).time_step
            require_time_step(f"model.{name}.time_step", found, self.time_step, "the model's own time_step")

    @cached_property
    def hash(self) -> str:
        """SHA-256 of how the model answers: what an agent names to say which model it was made for.

        Steady and dynamic responses of the outputs that every model has to flaps and homogeneous wind, to a thousandth
        of each output's largest, with operating point, turbulence and limits: what a model has beside does not change
        what an agent meets; with unequal blades also at a few azimuths, their imbalance as one more input. It knows no
        coordinates, so a rebuild of the same case on another machine, equal but for rounding, almost surely has
        the same hash.
        """
        settings = [getattr(self, name) for name in _HASH_SETTINGS]
        settings += [getattr(flap, name) for flap in self.flaps for name in _LIMITS]
        digest = hashlib.sha256(repr(settings).encode())
        alike = self.turbine.select(turbine_inputs(len(self.flaps)), TURBINE_OUTPUTS)
        systems = [alike, self.blade]
        if self.periodic is not None:
            systems += [shaken_at(self.turbine, self.periodic, azimuth) for azimuth in _HASH_AZIMUTHS]
        for system in systems:
            response = system.frequency_response(_HASH_FREQUENCIES)
            largest = np.abs(response).max(axis=(0, 2), keepdims=True)
            largest[largest == 0.0] = 1.0  # of an output that never answers
            digest.update(" ".join(f"{value:.3e}" for value in largest.ravel()).encode())
            # Adding zero makes one zero of the two that rounding leaves.
            parts = np.stack([response.real, response.imag]) / largest
            digest.update((np.round(parts, 3) + 0.0).astype("<f8").tobytes())
        return digest.hexdigest()

    @cached_property
    def pitch_actuator(self) -> Pitch | None:
        """The actuator of the blades' pitch, where that is an input; as the case tells it."""
        if pitch_inputs()[0] not in self.turbine.inputs:
            return None
        return from_plain(Pitch, self.case.get("pitch"), "case.pitch")

    @property
    def strips(self) -> int:
        """Strips of a blade whose wind is an input of its own; zero where the wind is homogeneous alone."""
        return sum(re.fullmatch(r"wind\d+_0", name) is not None for name in self.turbine.inputs)

    @cached_property
    def blade_outputs(self) -> tuple[str, ...]:
        """Outputs of the turbine that each blade has, without the ends of their multi-blade coordinates."""
        return tuple(name for name, of_blades in grouped(self.turbine.outputs) if of_blades)

    @cached_property
    def fixed_outputs(self) -> tuple[str, ...]:
        """Outputs of the turbine that are not the blades'."""
        return tuple(name for name, of_blades in grouped(self.turbine.outputs) if not of_blades)

    @property
    def form(self) -> str:
        """In one line, whether the multi-blade form is constant, and if not why."""
        if self.periodic is None:
            return "time-invariant, blades alike"
        degree = np.pi / 180.0
        differ = "; ".join(
            f"{name} {', '.join(f'{number(value)}' for value in values)}"
            if name != "pitch_offset"
            else f"{name} {', '.join(f'{number(value / degree)}' for value in values)} deg"
            for name, values in self.case["blades"].items()
            if len(set(values)) > 1
        )
        return (
            f"periodic, since blades differ ({differ}): the mean over azimuth and "
            f"{self.periodic.harmonics} harmonics of rank {self.periodic.rank}"
        )


def builtin_models() -> list[str]:
    """Names of the models shipped in the package."""
    folder = resources.files("flapgym.model") / "data"
    return sorted(
        item.name.removesuffix(".safetensors")
        for item in folder.iterdir()
        if item.name.endswith(".safetensors")
    )


def save_model(model: TurbineModel, path: str | os.PathLike[str]) -> None:
    """Write the model file atomically: readers see the old file or the new one, never half of one.

    Raises
    ------
    ValueError
        If it is a model that `load_model` would refuse.
    """
    header, tensors = packed(model)
    # The header is one JSON text under a key of our own: safetensors metadata holds strings only.
    metadata = {"flapgym": json.dumps(header, sort_keys=True)}
    write_atomically(path, safetensors.numpy.save(tensors, metadata))


def packed(model: TurbineModel) -> tuple[dict[str, Any], dict[str, Array]]:
    """Header, sealed with its checksum, and tensors of a model's file; raises as `save_model`."""
    try:
        check_model(model)
    except ValueError as error:
        raise ValueError(f"model {one_line(model.name)}: {error}") from None
    tensors = _tensors(model)
    header = {
        f.name: getattr(model, f.name)
        for f in fields(model)
        if f.name not in (*_SYSTEMS, "case", "flaps", "periodic", "record")
    }
    header |= _flap_entries(model.flaps)
    record = model.record
    header["case"] = dict(model.case)
    header["record"] = {
        "tools": dict(record.tools),
        "readings": record.readings,
        "errors": dict(record.errors),
        "flutter": record.flutter and asdict(record.flutter),
    }
    for system in _SYSTEMS:
        part = getattr(model, system)
        header[system] = {"inputs": part.inputs, "outputs": part.outputs}
    header["checksum"] = _checksum(tensors, header)
    return header, tensors


def load_model(name: str | os.PathLike[str] = DEFAULT_MODEL) -> TurbineModel:
    """Read a model shipped with the package by its name, or a model file by its path.

    Raises
    ------
    FileNotFoundError
        If there is neither a shipped model nor a file of that name.
    ValueError
        If the file is no model file, is damaged, or has another format version.
    """
    path = _find(name)
    if path.suffix == ".toml":
        raise ValueError(
            f"model {path}: a case, not a model file; make one by `flapgym build {path} --output FILE`"
        )
    return unpacked(*_read(path), path)


def unpacked(header: dict[str, Any], tensors: dict[str, Array], path: Path) -> TurbineModel:
    """The model of a header and tensors that `packed` made; the path is for messages. Raises ValueError."""
    if (version := header.get("format_version")) != FORMAT_VERSION:
        raise ValueError(
            f"model {path}: format version {shown(version)}, this flapgym reads {FORMAT_VERSION}; build it again"
        )
    if header.pop("checksum", None) != _checksum(tensors, header):
        raise ValueError(f"model {path}: damaged, its content does not match its checksum; build it again")
    try:
        check_tensors(tensors)
        model = _model(header, tensors)
        check_model(model)
    except KeyError as error:
        raise ValueError(f"model {path}: {error}: missing; build it again") from None
    except ValueError as error:
        raise ValueError(f"model {path}: {one_line(error)}; build it again") from None
    return model


def _read(path: Path) -> tuple[dict[str, Any], dict[str, Array]]:
    """Header and tensors of a model file, of whatever content."""
    try:
        with safetensors.safe_open(regular_file(path, LARGEST), framework="numpy") as file:
            metadata = file.metadata() or {}
            tensors = {key: file.get_tensor(key) for key in file.keys()}  # noqa: SIM118 (not a dict)
    except FileNotFoundError:
        raise
    except ValueError as error:
        raise ValueError(f"model {error}") from None
    # Types that numpy has not raise what they like.
    except (safetensors.SafetensorError, OSError, TypeError, AttributeError, KeyError):
        raise ValueError(f"model {path}: damaged or not a model file; build it again") from None
    if "flapgym" not in metadata:
        raise ValueError(f"model {path}: not a flapgym model file; make one with `flapgym build`")
    try:
        return parse_json(metadata["flapgym"], "header"), tensors
    except ValueError as error:
        raise ValueError(f"model {path}: damaged {error}; build it again") from None


def _model(header: dict[str, Any], tensors: Mapping[str, Array]) -> TurbineModel:
    """The model that a file's content describes."""
    check_header(header)
    known = {f.name for f in fields(TurbineModel)} - {"periodic", "flaps"} | _flap_keys(header)
    names = {f"{system}.{matrix}" for system in _SYSTEMS for matrix in _MATRICES}
    names |= {f"periodic.{name}" for name in (*_REAL, *_COMPLEX)}
    for kind, given, expected in (("entry", header, known), ("matrix", tensors, names)):
        if unknown := sorted(given.keys() - expected):
            raise ValueError(f"{shown(unknown[0])}: unknown {kind}")
    turbine, blade = (_system(system, header, tensors) for system in _SYSTEMS)
    apart = {*_SYSTEMS, "record", *_flap_keys(header)}
    rest = {name: value for name, value in header.items() if name not in apart}
    return TurbineModel(
        turbine,
        blade,
        flaps=_flaps(header),
        periodic=_periodic(tensors),
        record=_record(header["record"]),
        **rest,
    )


def _system(name: str, header: Mapping[str, Any], tensors: Mapping[str, Array]) -> StateSpace:
    matrices = {matrix: tensors[f"{name}.{matrix}"] for matrix in _MATRICES}
    inputs, outputs = (tuple(header[name][kind]) for kind in ("inputs", "outputs"))
    try:
        return StateSpace(**matrices, time_step=header["time_step"], inputs=inputs, outputs=outputs)
    except ValueError as error:
        raise ValueError(str(error).replace("state_space", name)) from None


def _find(name: str | os.PathLike[str]) -> Path:
    shipped = Path(str(resources.files("flapgym.model") / "data" / f"{name}.safetensors"))
    path = shipped if str(name) in builtin_models() else Path(name)
    try:
        return regular_file(path, LARGEST)
    except FileNotFoundError:
        raise FileNotFoundError(
            f"model {one_line(name)}: no such file, and no shipped model of that name "
            f"(shipped: {', '.join(builtin_models()) or 'none'})"
        ) from None
    except ValueError as error:
        raise ValueError(f"model {error}") from None


def _tensors(model: TurbineModel) -> dict[str, Array]:
    tensors = {
        f"{system}.{matrix}": np.ascontiguousarray(getattr(getattr(model, system), matrix))
        for system in _SYSTEMS
        for matrix in _MATRICES
    }
    if model.periodic is not None:
        for name in _REAL:
            tensors[f"periodic.{name}"] = np.ascontiguousarray(getattr(model.periodic, name))
        for name in _COMPLEX:  # as real and imaginary parts
            value = getattr(model.periodic, name)
            tensors[f"periodic.{name}"] = np.stack([value.real, value.imag])
    return tensors


def _flap_entries(flaps: tuple[ModelFlap, ...]) -> dict[str, Any]:
    """What a file's header says of the flaps: of one alone its three limits, as every model once had."""
    if len(flaps) == 1:
        return {entry: getattr(flaps[0], name) for entry, name in zip(ONE_FLAP, _LIMITS, strict=True)}
    return {"flaps": [asdict(flap) for flap in flaps]}


def _flap_keys(header: Mapping[str, Any]) -> set[str]:
    return {"flaps"} if "flaps" in header else set(ONE_FLAP)


def _flaps(header: Mapping[str, Any]) -> tuple[ModelFlap, ...]:
    if "flaps" in header:
        return tuple(ModelFlap(**flap) for flap in header["flaps"])
    return (ModelFlap(flap_names(1)[0], *(header[entry] for entry in ONE_FLAP)),)


def _record(content: Mapping[str, Any]) -> Record:
    flutter = content["flutter"]
    return Record(
        tools=content["tools"],
        readings=tuple(content["readings"]),
        errors=content["errors"],
        flutter=None if flutter is None else Flutter(**flutter),
    )


def _periodic(tensors: Mapping[str, Array]) -> PeriodicPart | None:
    if not any(name.startswith("periodic.") for name in tensors):
        return None
    left, right = (tensors[f"periodic.{name}"] for name in _REAL)
    for name in _COMPLEX:
        if tensors[f"periodic.{name}"].shape[:1] != (2,):
            raise ValueError(f"periodic.{name}: expected real and imaginary parts")
    core, forcing = (v[0] + 1j * v[1] for v in (tensors[f"periodic.{name}"] for name in _COMPLEX))
    return PeriodicPart(left=left, core=core, right=right, forcing=forcing)


def _checksum(tensors: Mapping[str, Array], header: Mapping[str, Any]) -> str:
    digest = hashlib.sha256(json.dumps(header, sort_keys=True).encode())
    for key in sorted(tensors):
        digest.update(key.encode())
        digest.update(str(tensors[key].shape).encode())
        digest.update(np.ascontiguousarray(tensors[key], dtype="<f8").tobytes())
    return digest.hexdigest()
