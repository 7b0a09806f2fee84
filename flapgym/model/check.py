"""What a turbine model must hold to before anything is computed with it, in files and on its way into one.

A sealed file says only that it is what somebody wrote, not that this is a turbine.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

from flapgym.core.arrays import Array
from flapgym.core.files import check_plain
from flapgym.core.wording import shown
from flapgym.model.record import Flutter, Record

if TYPE_CHECKING:
    from flapgym.model.turbine_model import TurbineModel

RANGES = {
    "wind_speed": (0.1, 200.0, "m/s"),
    "rotor_speed": (1e-3, 100.0, "rad/s"),
    "time_step": (1e-5, 1.0, "s"),
    "turbulence_intensity": (1e-9, 1.0, ""),
    "length_scale": (0.1, 1e6, "m"),
    "flap_angle_limit": (1e-9, math.pi, "rad"),
    "flap_rate_limit": (1e-9, 1e3, "rad/s"),
    "acceleration_limit": (1e-9, 1e6, "rad/s^2"),
    "rbm_rms": (1e-3, 1e12, "N m"),
}
"""Numbers that every model has, from where to where, and unit: beyond lies no turbine, and what overflows."""
LARGEST_ENTRY = 1e30
"""Of any matrix: products of a few stay finite."""


def check_header(header: Mapping[str, Any]) -> None:
    """Refuse texts where numbers are meant, and the other way round, in what a file says beside its matrices.

    Raises
    ------
    ValueError
        That begins with the entry.
    """
    for name, (low, high, unit) in RANGES.items():
        _check_number(header[name], name, low, high, unit)
    for name in ("name", "inputs_hash"):
        _check_text(header[name], name)
    for system in ("turbine", "blade"):
        _check_keys(header[system], system, ("inputs", "outputs"))
        for kind in ("inputs", "outputs"):
            _check_list(header[system][kind], f"{system}.{kind}", _check_text)
    _check_mapping(header["case"], "case")
    record = header["record"]
    _check_keys(record, "record", [f.name for f in fields(Record)])
    _check_mapping(record["tools"], "record.tools", _check_text)
    _check_list(record["readings"], "record.readings", _check_text)
    _check_mapping(record["errors"], "record.errors", lambda value, name: _check_number(value, name, 0.0))
    if record["flutter"] is not None:
        _check_flutter(record["flutter"])


def check_tensors(tensors: Mapping[str, Array]) -> None:
    """Refuse what is no finite number in double precision; raises as `check_header`."""
    for name, tensor in tensors.items():
        if tensor.dtype != np.float64:
            raise ValueError(f"{shown(name)}: expected numbers in double precision, got {tensor.dtype}")
        if not (np.abs(tensor) < LARGEST_ENTRY).all():
            raise ValueError(f"{shown(name)}: expected finite numbers below {LARGEST_ENTRY:g}, got others")


def check_model(model: TurbineModel, inputs: Mapping[str, tuple[str, ...]]) -> None:
    """Refuse a model that no plant could step, or whose loads grow by themselves; raises as `check_header`.

    Parameters
    ----------
    model : TurbineModel
    inputs : mapping
        Names of inputs and outputs that the model's systems have, as "turbine.inputs".
    """
    for name, (low, high, unit) in RANGES.items():
        _check_number(getattr(model, name), name, low, high, unit)
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
    _check_mapping(
        model.case.get("blades"), "case.blades", lambda value, name: _check_list(value, name, _check_number)
    )
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


def _check_flutter(flutter: object) -> None:
    """Refuse a speed without its frequency."""
    _check_keys(flutter, "record.flutter", [f.name for f in fields(Flutter)])
    assert isinstance(flutter, Mapping)
    _check_number(flutter["searched"], "record.flutter.searched", 0.0)
    for name in ("speed", "frequency"):
        if flutter["speed"] is not None or flutter["frequency"] is not None:
            _check_number(flutter[name], f"record.flutter.{name}", 0.0)


def _check_number(
    value: object, name: str, low: float = -LARGEST_ENTRY, high: float = LARGEST_ENTRY, unit: str = ""
) -> None:
    good = isinstance(value, int | float | np.floating) and not isinstance(value, bool)
    if not good or not low <= value <= high:  # type: ignore[operator]
        raise ValueError(
            f"{name}: expected a number from {low:.6g} to {f'{high:.6g} {unit}'.strip()}, got {shown(value)}"
        )


def _check_text(value: object, name: str) -> None:
    if not isinstance(value, str) or not value.strip() or not value.isprintable() or len(value) > 1000:
        raise ValueError(f"{name}: expected a text of one line, got {shown(value)}")


def _check_list(value: object, name: str, check: Callable[[object, str], None]) -> None:
    if not isinstance(value, list | tuple):
        raise ValueError(f"{name}: expected a list, got {shown(value)}")
    for index, entry in enumerate(value):
        check(entry, f"{name}[{index}]")


def _check_keys(value: object, name: str, keys: Collection[str]) -> None:
    _check_mapping(value, name)
    assert isinstance(value, Mapping)
    if set(value) != set(keys):
        raise ValueError(f"{name}: expected the entries {', '.join(keys)}, got {shown(list(value))}")


def _check_mapping(value: object, name: str, check: Callable[[object, str], None] = lambda *_: None) -> None:
    if not isinstance(value, Mapping):
        raise ValueError(f"{name}: expected a mapping, got {shown(value)}")
    for key, entry in value.items():
        _check_text(key, name)
        check(entry, f"{name}.{key}")
