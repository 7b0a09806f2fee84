"""Quantities as people write them ("10 deg", "867.637e6 N m/rad") and as the code uses them (SI, radians)."""

from __future__ import annotations

import math
import re

from flapgym.core.wording import number, shown

DEGREE = math.pi / 180.0

# dimension: accepted unit and its size in SI; messages show the first one
UNITS: dict[str, dict[str, float]] = {
    "number": {"": 1.0, "%": 0.01},
    "fraction": {"": 1.0, "%": 0.01},
    "length": {"m": 1.0, "mm": 1e-3, "km": 1e3},
    "length in rotor diameters": {"rotor diameters": 1.0},
    "time": {"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0},
    "frequency": {"Hz": 1.0},
    "speed": {"m/s": 1.0, "km/h": 1.0 / 3.6, "kn": 1852.0 / 3600.0},
    "acceleration": {"m/s^2": 1.0},
    "angle": {"deg": DEGREE, "rad": 1.0},
    "angular rate": {"deg/s": DEGREE, "rad/s": 1.0, "rpm": math.pi / 30.0},
    "angular acceleration": {"deg/s^2": DEGREE, "rad/s^2": 1.0},
    "slope": {"1/rad": 1.0, "1/deg": 1.0 / DEGREE},
    "density": {"kg/m^3": 1.0},
    "mass": {"kg": 1.0, "t": 1e3},
    "mass per length": {"kg/m": 1.0},
    "inertia": {"kg m^2": 1.0},
    "inertia per length": {"kg m": 1.0},
    "force": {"N": 1.0, "kN": 1e3, "MN": 1e6},
    "moment": {"N m": 1.0, "kN m": 1e3, "MN m": 1e6},
    "power": {"W": 1.0, "kW": 1e3, "MW": 1e6},
    "torque per speed squared": {"N m s^2/rad^2": 1.0},
    "bending stiffness": {"N m^2": 1.0},
    "torsion spring": {"N m/rad": 1.0},
    "torsion damper": {"N m s/rad": 1.0},
}

_QUANTITY = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*")


def article(dimension: str) -> str:
    """Return the dimension with its article, for messages: "an angle"."""
    return f"{'an' if dimension[0] in 'aeiou' else 'a'} {dimension}"


def si_unit(dimension: str) -> str:
    """Return the unit that a plain number of the dimension is in: "rad"; empty for a number without one."""
    return next(unit for unit, size in UNITS[dimension].items() if size == 1.0)


def unit_size(dimension: str, unit: str, name: str) -> float:
    """Size in SI of a unit; `name` is the field the message shall name."""
    known = UNITS[dimension]
    unit = " ".join(unit.split())
    if unit not in known:
        units = f"in {' or '.join(repr(key) for key in known if key)}"
        expected = f"without a unit or {units}" if "" in known else units
        raise ValueError(f"{name}: expected {article(dimension)} {expected}, got the unit {shown(unit)}")
    return known[unit]


def parse_quantity(value: object, dimension: str, name: str) -> float:
    """Read a number with its unit into SI.

    Parameters
    ----------
    value : str, int or float
        "10 deg", or a plain number where the dimension has none of its own.
    dimension : str
        A key of `UNITS`.
    name : str
        Dotted name of the field, for messages.

    Returns
    -------
    float
        The value in SI units and radians; finite.
    """
    unitless = "" in UNITS[dimension]
    if isinstance(value, int | float) and not isinstance(value, bool) and unitless:
        try:
            found, size = float(value), 1.0
        except OverflowError:
            found, size = math.inf, 1.0
    else:
        # The expression's time grows faster than the text.
        match = _QUANTITY.fullmatch(value) if isinstance(value, str) and len(value) < 100 else None
        if match is None or not (match[2] or unitless):
            unit = next(iter(UNITS[dimension]))
            example = " such as 0.5" if unitless else f', a text such as "1.5 {unit}"'
            raise ValueError(f"{name}: expected {article(dimension)}{example}, got {shown(value)}")
        found, size = float(match[1]), unit_size(dimension, match[2], name)
    if not math.isfinite(found):
        raise ValueError(f"{name}: expected a finite {dimension}, got {shown(value)}")
    return found * size


def show(value: float, dimension: str) -> str:
    """Write an SI value in the first unit of its dimension, for messages."""
    unit, size = next(iter(UNITS[dimension].items()))
    return f"{number(value / size)} {unit}".strip()
