"""What a turbine model must hold to before anything is computed with it, in files and on its way into one.

A sealed file says only that it is what somebody wrote, not that this is a turbine.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from flapgym.files import check_plain
from flapgym.state_space import Array
from flapgym.wording import shown

if TYPE_CHECKING:
    from flapgym.aeroelastic.model import TurbineModel

POSITIVE = (
    "wind_speed",
    "rotor_speed",
    "time_step",
    "turbulence_intensity",
    "length_scale",
    "flap_angle_limit",
    "flap_rate_limit",
    "acceleration_limit",
    "rbm_rms",
)
"""Numbers that every model has."""


def check_header(header: Mapping[str, Any]) -> None:
    """Refuse texts where numbers are meant, and the other way round, in what a file says beside its matrices.

    Raises
    ------
    ValueError
        That begins with the entry.
    """
    for name in POSITIVE:
        _check_number(header[name], name)
    for name in ("name", "inputs_hash"):
        _check_text(header[name], name)
    for system in ("turbine", "blade"):
        for kind in ("inputs", "outputs"):
            _check_list(header[system][kind], f"{system}.{kind}", _check_text)
    for name in ("case", "record"):
        _check_mapping(header[name], name)
    record = header["record"]
    _check_mapping(record["tools"], "record.tools", _check_text)
    _check_list(record["readings"], "record.readings", _check_text)
    _check_mapping(
        record["errors"], "record.errors", lambda value, name: _check_number(value, name, zero=True)
    )
    if record["flutter"] is not None:
        _check_mapping(record["flutter"], "record.flutter")
        for name, value in record["flutter"].items():
            if value is not None or name == "searched":
                _check_number(value, f"record.flutter.{name}")


def check_tensors(tensors: Mapping[str, Array]) -> None:
    """Refuse what is no finite number in double precision; raises as `check_header`."""
    for name, tensor in tensors.items():
        if tensor.dtype != np.float64:
            raise ValueError(f"{shown(name)}: expected numbers in double precision, got {tensor.dtype}")
        if not np.isfinite(tensor).all():
            raise ValueError(f"{shown(name)}: expected finite numbers, got NaN or infinity")


def check_model(model: TurbineModel, inputs: Mapping[str, tuple[str, ...]]) -> None:
    """Refuse a model that no plant could step, or whose loads grow by themselves; raises as `check_header`.

    Parameters
    ----------
    model : TurbineModel
    inputs : mapping
        Names of inputs and outputs that the model's systems have, as "turbine.inputs".
    """
    for name in POSITIVE:
        _check_number(getattr(model, name), name)
    check_plain(dict(model.case), "case")
    for system in ("turbine", "blade"):
        part = getattr(model, system)
        for kind in ("inputs", "outputs"):
            expected = inputs[f"{system}.{kind}"]
            if getattr(part, kind) != expected:
                raise ValueError(
                    f"{system}.{kind}: expected {', '.join(expected)}, got {shown(list(getattr(part, kind)))}"
                )
        if part.time_step != model.time_step:
            raise ValueError(f"{system}: expected a time step of {model.time_step} s, got {part.time_step} s")
        radius = part.spectral_radius()
        if part.order == 0 or not radius < 1.0:
            raise ValueError(
                f"{system}.A: expected a stable system, of a spectral radius below 1, got {radius:.6f} and "
                f"{part.order} states"
            )
    _check_periodic(model)


def _check_periodic(model: TurbineModel) -> None:
    """Refuse a periodic part that does not fit the turbine it belongs to."""
    part = model.periodic
    if part is None:
        return
    turbine = model.turbine
    _check_mapping(model.case.get("blades"), "case.blades", _check_list)
    rows, columns = turbine.order + len(turbine.outputs), turbine.order + len(turbine.inputs)
    if part.core.ndim != 3 or part.left.ndim != 2 or part.right.ndim != 2 or part.forcing.ndim != 2:
        raise ValueError("periodic: expected matrices left, right and forcing, and core of three axes")
    harmonics, r, s = part.core.shape
    for name, shape in {
        "left": (rows, r),
        "right": (s, columns),
        "forcing": (harmonics + 1, rows),
    }.items():
        if getattr(part, name).shape != shape:
            raise ValueError(f"periodic.{name}: expected shape {shape}, got {getattr(part, name).shape}")


def _check_number(value: object, name: str, zero: bool = False) -> None:
    good = isinstance(value, int | float | np.floating) and not isinstance(value, bool)
    if not good or not (math.isfinite(value) and (value >= 0.0 if zero else value > 0.0)):  # type: ignore[arg-type,operator]
        raise ValueError(
            f"{name}: expected a finite number {'of at least' if zero else 'above'} 0, got {shown(value)}"
        )


def _check_text(value: object, name: str) -> None:
    if not isinstance(value, str) or not value.strip() or not value.isprintable() or len(value) > 1000:
        raise ValueError(f"{name}: expected a text of one line, got {shown(value)}")


def _check_list(value: object, name: str, check: Callable[[object, str], None] = check_plain) -> None:
    if not isinstance(value, list | tuple):
        raise ValueError(f"{name}: expected a list, got {shown(value)}")
    for index, entry in enumerate(value):
        check(entry, f"{name}[{index}]")


def _check_mapping(value: object, name: str, check: Callable[[object, str], None] = lambda *_: None) -> None:
    if not isinstance(value, Mapping):
        raise ValueError(f"{name}: expected a mapping, got {shown(value)}")
    for key, entry in value.items():
        _check_text(key, name)
        check(entry, f"{name}.{key}")
