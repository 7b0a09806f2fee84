"""In which conditions agents are compared: which model of a set, and what blows in place of an environment's wind."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from flapgym.core.fields import Quantity
from flapgym.core.files import regular_file
from flapgym.core.wording import number, one_line, shown
from flapgym.model.model_set import is_model_set, load_model_set
from flapgym.model.nameplate import nameplate
from flapgym.model.turbine_model import TurbineModel, load_model
from flapgym.wind import BoxFile, VonKarman, turbulence_of
from flapgym.wind.box_files import LARGEST, begins_a_box
from flapgym.wind.gusts import Recorded


def chosen_model(
    model: TurbineModel | str | os.PathLike[str], wind_speed: float | None = None
) -> TurbineModel:
    """The model meant: itself, by its name or file, or of a set the one at a wind speed [m/s].

    Raises
    ------
    FileNotFoundError, ValueError
        If there is no such model, or none at that wind speed.
    """
    if wind_speed is not None:
        Quantity("speed", at_least=1.0, at_most=100.0).check(wind_speed, "wind_speed")
    if not isinstance(model, TurbineModel):
        if not isinstance(model, str | os.PathLike):
            raise ValueError(f"model: expected a model, its name or its file, got {shown(model)}")
        if is_model_set(model):
            models = load_model_set(model)
            if wind_speed is None or not np.isclose(models.wind_speeds, wind_speed, rtol=1e-9).any():
                there = ", ".join(map(number, models.wind_speeds))
                raise ValueError(
                    f"wind_speed: expected one of {there} m/s, for which {one_line(model)} holds models, got "
                    f"{'none' if wind_speed is None else f'{number(wind_speed)} m/s'}"
                )
            return models.at(wind_speed)
        model = load_model(model)
    if wind_speed is not None and not math.isclose(wind_speed, model.wind_speed, rel_tol=1e-9):
        raise ValueError(
            f"wind_speed: expected {number(model.wind_speed)} m/s, for which the model {model.name} was built, got "
            f"{number(wind_speed)} m/s; name a set of models, or build one for that speed (flapgym build)"
        )
    return model


def chosen_wind(
    given: Mapping[str, Any],
    *,
    turbulence_intensity: float | None = None,
    length_scale: float | None = None,
    wind: str | os.PathLike[str] | None = None,
    box_shape: Sequence[int] | None = None,
    box_spacing: Sequence[float] | None = None,
) -> dict[str, Any]:
    """The environment's keyword `wind` with what is asked for in the place of its own.

    Parameters
    ----------
    given : mapping
        The environment's own, as plain values.
    turbulence_intensity : float, optional
        Of its turbulence, homogeneous or over the disk, a fraction; a box's is scaled to it.
    length_scale : float, optional
        Of von Karman's turbulence [m].
    wind : path, optional
        A file: a recording of homogeneous wind in a table, or a box. It replaces turbulence and gust; what is steady
        stays. Turbulence is added to a recording if its intensity is given.
    box_shape, box_spacing : sequence of three, optional
        Points of a HAWC2 box along the wind, to the left and up, and their distances [m].

    Raises
    ------
    FileNotFoundError, ValueError
        If the file is missing or of no kind of wind, or something asked for has no meaning in this wind.
    """
    found = dict(given)
    for name, value in (("box_shape", box_shape), ("box_spacing", box_spacing)):
        if value is not None and wind is None:
            raise ValueError(f"{name}: expected none without a file of wind, got {shown(value)}")
    if wind is not None:
        for name in ("gust", "field", "turbulence_intensity", "length_scale"):
            found.pop(name, None)
        found |= _from_file(os.fspath(wind), box_shape, box_spacing)
    if turbulence_intensity is None and length_scale is None:
        return found
    if turbulence_intensity is not None:
        Quantity("fraction", at_least=0.0, below=1.0).check(turbulence_intensity, "turbulence_intensity")
    asked = {"turbulence_intensity": turbulence_intensity, "length_scale": length_scale}
    asked = {name: value for name, value in asked.items() if value is not None}
    field = found.get("field")
    if field is None:
        if length_scale is not None and {**found, **asked}.get("turbulence_intensity") == 0.0:
            raise ValueError(
                f"length_scale: expected none without turbulence, got {number(length_scale)} m; give its intensity, too"
            )
        return {**found, **asked}
    if length_scale is not None and field["kind"] != VonKarman.kind:
        raise ValueError(
            f"length_scale: expected none with a field of kind {field['kind']}, which has its own, got "
            f"{number(length_scale)} m"
        )
    return {**found, "field": {**field, **asked}}


def _from_file(path: str, shape: Sequence[int] | None, spacing: Sequence[float] | None) -> dict[str, Any]:
    """Entries of the keyword `wind` for a file, told apart by its content."""
    try:
        with open(regular_file(Path(path), LARGEST), "rb") as file:
            begins = file.read(1024)
    except FileNotFoundError:
        raise FileNotFoundError(f"wind {one_line(path)}: no such file") from None
    except ValueError as error:
        raise ValueError(f"wind {one_line(error)}") from None
    except OSError as error:
        raise ValueError(f"wind {one_line(path)}: cannot be read ({error.strerror})") from None
    if shape is not None or spacing is not None:
        field = {"kind": BoxFile.kind, "file": path, "shape": shape, "spacing": spacing}
        field = {name: tuple(each) if isinstance(each, list) else each for name, each in field.items()}
    elif begins_a_box(begins):
        field = {"kind": BoxFile.kind, "file": path}
    elif _is_text(begins):
        # The wind is all in the recording, unless turbulence is asked for beside it.
        return {"gust": {"kind": Recorded.kind, "file": path}, "turbulence_intensity": 0.0}
    else:
        raise ValueError(
            f"wind {one_line(path)}: expected a recording in text, TurbSim's .bts or NetCDF, got another kind; a HAWC2 "
            "box also needs its shape and spacing"
        )
    turbulence_of(field)  # refuses a shape without a spacing
    return {"field": field}


def _is_text(begins: bytes) -> bool:
    """Whether a file that begins so may be a table in text, of whatever encoding; `read_wind` says what is wrong."""
    return begins.startswith((b"\xff\xfe", b"\xfe\xff")) or not any(byte < 9 for byte in begins)


def lasts(wind: Mapping[str, Any], model: TurbineModel) -> float:
    """How long the wind of a file lasts [s]; infinite where none comes from a file."""
    gust, field = wind.get("gust"), wind.get("field")
    if isinstance(gust, Mapping) and gust["kind"] == Recorded.kind:
        return Recorded(gust["file"]).lasts()
    if isinstance(field, Mapping) and field["kind"] == BoxFile.kind:
        plate = nameplate(model.case)
        if plate.hub_height is None or not len(plate.strip_radii):
            return math.inf  # a model that takes no box, which the environment refuses
        box = turbulence_of(field)
        assert isinstance(box, BoxFile)
        found = box.on_turbine(
            model.wind_speed,
            plate.hub_height,
            float(plate.strip_radii[-1]),
            model.rotor_speed,
            model.time_step,
        )
        return found.box.duration
    return math.inf
