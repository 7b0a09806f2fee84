"""What a turbine model must hold to before anything is computed with it, in files and on its way into one.

A sealed file says only that it is what somebody wrote, not that this is a turbine.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from flapgym.core.arrays import Array
from flapgym.core.files import check_plain
from flapgym.core.wording import shown
from flapgym.model.record import Flutter, Record
from flapgym.model.signals import (
    BLADE_OUTPUTS,
    GRAVITY,
    blade_inputs,
    flap_names,
    pitch_inputs,
    turbine_inputs,
    turbine_outputs,
)

RANGES = {
    "wind_speed": (0.1, 200.0, "m/s"),
    "rotor_speed": (1e-3, 100.0, "rad/s"),
    "time_step": (1e-5, 1.0, "s"),
    "turbulence_intensity": (1e-9, 1.0, ""),
    "length_scale": (0.1, 1e6, "m"),
    "rbm_rms": (1e-3, 1e12, "N m"),
}
"""Numbers that every model has, from where to where, and unit: beyond lies no turbine, and what overflows."""
FLAP_RANGES = {
    "angle_limit": (1e-9, math.pi, "rad"),
    "rate_limit": (1e-9, 1e3, "rad/s"),
    "acceleration_limit": (1e-9, 1e6, "rad/s^2"),
}
"""The same of every flap."""
ONE_FLAP = ("flap_angle_limit", "flap_rate_limit", "acceleration_limit")
"""What a file calls the limits of a turbine's only flap."""
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
    _check_flap_entries(header)
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


def check_model(model: Any) -> None:
    """Refuse a model that no plant could step, or whose loads grow by themselves; raises as `check_header`."""
    for name, (low, high, unit) in RANGES.items():
        _check_number(getattr(model, name), name, low, high, unit)
    _check_flaps(model)
    check_plain(dict(model.case), "case")
    model.pitch_actuator  # noqa: B018 (refuses what the case says of an actuator that is none)
    signals = {
        "turbine": (_asked(model), _told(model)),
        "blade": (blade_inputs(len(model.flaps)), BLADE_OUTPUTS),
    }
    for system in ("turbine", "blade"):
        part = getattr(model, system)
        for kind, expected in zip(("inputs", "outputs"), signals[system], strict=True):
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


def _asked(model: Any) -> tuple[str, ...]:
    """The turbine's inputs as they must be: those of every model, then any further ones."""
    names = model.turbine.inputs
    pitch, gravity = (name in names for name in (pitch_inputs()[0], GRAVITY))
    return turbine_inputs(len(model.flaps), model.strips, pitch=pitch, gravity=gravity)


def _told(model: Any) -> tuple[str, ...]:
    """The turbine's outputs as they must be: those of every model, then any further ones."""
    own = turbine_outputs()
    return own + model.turbine.outputs[len(own) :]


def _check_flaps(model: Any) -> None:
    """Refuse flaps that are not named in order, or whose limits lie out of range."""
    if not model.flaps:
        raise ValueError("flaps: expected one or more flaps, got none")
    names = tuple(flap.name for flap in model.flaps)
    if names != flap_names(len(names)):
        raise ValueError(
            f"flaps: expected the names {', '.join(flap_names(len(names)))}, got {shown(list(names))}"
        )
    for place, flap in enumerate(model.flaps):
        limits = {name: getattr(flap, name) for name in FLAP_RANGES}
        _check_limits(limits, ONE_FLAP if len(names) == 1 else [f"flaps[{place}].{name}" for name in limits])


def _check_flap_entries(header: Mapping[str, Any]) -> None:
    """Refuse what a file says of its flaps: three numbers of a single one, or a list of several."""
    if "flaps" not in header:
        _check_limits(
            {name: header[entry] for name, entry in zip(FLAP_RANGES, ONE_FLAP, strict=True)}, ONE_FLAP
        )
        return
    _check_list(header["flaps"], "flaps", lambda flap, name: _check_keys(flap, name, ("name", *FLAP_RANGES)))
    if len(header["flaps"]) < 2:
        raise ValueError(
            f"flaps: expected two or more, or {', '.join(ONE_FLAP)}, got {shown(header['flaps'])}"
        )
    for place, flap in enumerate(header["flaps"]):
        _check_text(flap["name"], f"flaps[{place}].name")
        _check_limits(flap, [f"flaps[{place}].{name}" for name in FLAP_RANGES])


def _check_limits(limits: Mapping[str, Any], names: Collection[str]) -> None:
    for (limit, (low, high, unit)), name in zip(FLAP_RANGES.items(), names, strict=True):
        _check_number(limits[limit], name, low, high, unit)


def _check_periodic(model: Any) -> None:
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
