"""Readers of wind boxes: TurbSim's full-field `.bts`, HAWC2's boxes of raw numbers, NetCDF."""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from flapgym.core.arrays import AnyArray
from flapgym.core.fields import Count, Quantity, TupleOf
from flapgym.core.files import MEGABYTE, read_bytes, regular_file
from flapgym.core.wording import number, one_line, shown
from flapgym.wind.box import STRONGEST, WindBox, along_the_wind

LARGEST = 1024 * MEGABYTE
"""Of a file [bytes]: an hour of ten planes a second of 32 by 32 points takes a fifth."""

# TurbSim User's Guide (version 2), Appendix "Full-field TurbSim binary": little-endian; id, points up and across,
# points down the tower, times; spacings up and across, time step, mean wind and height of the hub, height of the lowest
# point; slope and offset of each component; the length of a text, which follows.
_TURBSIM = struct.Struct("<h4i6f6fi")
_TURBSIM_IDS = (7, 8)  # the latter: periodic
_COMPONENTS = 3

NETCDF_NAMES = ("u", "x_wind", "eastward_wind")
"""Of a NetCDF variable or its `standard_name` (the latter two are of the CF conventions), in order of preference."""
UNITS = {
    "m/s": ("m s-1", "m/s", "m s^-1", "m s**-1", "m.s-1"),
    "m": ("m", "meter", "meters", "metre", "metres"),
    "s": ("s", "sec", "second", "seconds"),
}
MEAN_ABOUT = 0.3
"""By which a NetCDF file's mean may differ from the mean wind that one gives for it, over the latter: beyond it, the
file most likely holds perturbations, or another wind."""
EVEN = 1e-4
"""By which time steps of a NetCDF file may differ, over them: single precision and decimals written short."""
_CLASSIC, _HDF5 = b"CDF", b"\x89HDF\r\n\x1a\n"


def read_box(
    path: str | os.PathLike[str],
    mean_wind: float,
    hub_height: float,
    shape: tuple[int, int, int] | None = None,
    spacing: tuple[float, float, float] | None = None,
) -> WindBox:
    """Read a box of any kind: HAWC2's with a shape and a spacing, else TurbSim's or NetCDF by its content.

    Parameters
    ----------
    path : path
    mean_wind : float
        Of NetCDF and HAWC2 [m/s]; a TurbSim file tells its own.
    hub_height : float
        Of TurbSim and NetCDF [m]; HAWC2's hub is in the middle.
    shape, spacing : tuple of three, optional
        Of HAWC2, as `read_mann` takes them.

    Raises
    ------
    FileNotFoundError, ValueError, ImportError
        Of `read_turbsim`, `read_mann` and `read_netcdf`.
    """
    if shape is not None and spacing is not None:
        return read_mann(path, shape, spacing, mean_wind)
    try:
        with open(regular_file(path, LARGEST), "rb") as file:
            begins = file.read(len(_HDF5))
    except FileNotFoundError:
        raise
    except OSError as error:
        with _naming(path):
            raise ValueError(f"cannot be read ({error.strerror})") from None
    if begins.startswith((_CLASSIC, _HDF5)):
        return read_netcdf(path, mean_wind, hub_height)
    if int.from_bytes(begins[:2], "little") in _TURBSIM_IDS:
        return read_turbsim(path, hub_height)
    with _naming(path):
        raise ValueError(
            "expected TurbSim's .bts or NetCDF, got another kind; a HAWC2 file also needs its shape and spacing"
        )


def begins_a_box(content: bytes) -> bool:
    """Whether a file that begins so is NetCDF or TurbSim's; HAWC2's has nothing to tell it by."""
    return content.startswith((_CLASSIC, _HDF5)) or int.from_bytes(content[:2], "little") in _TURBSIM_IDS


def read_turbsim(path: str | os.PathLike[str], hub_height: float | None = None) -> WindBox:
    """Read a full-field file of TurbSim, `.bts`.

    The perturbation is about the file's mean wind at its hub, so the file's shear is part of it. Of the three
    components the one along the wind is taken; points down the tower are left out. The first plane is time zero.

    Parameters
    ----------
    path : path
    hub_height : float or None
        Height of the turbine's hub in the file's grid [m]; the file's own by default.

    Raises
    ------
    FileNotFoundError, ValueError
        If there is no such file, or it is none of TurbSim's, or cut off; the message names it.
    """
    content = read_bytes(path, LARGEST)
    with _naming(path):
        if len(content) < _TURBSIM.size or int.from_bytes(content[:2], "little") not in _TURBSIM_IDS:
            raise ValueError("expected a full-field file of TurbSim, which begins with the number 7 or 8")
        header = _TURBSIM.unpack_from(content)
        _, up, across, tower, times = header[:5]
        # Steps are decimals that single precision has spoilt: a thousand of 0.05 s shall be 50 s.
        dz, dy, time_step, mean_wind, file_hub, lowest = (float(str(np.float32(x))) for x in header[5:11])
        slope, offset, text = header[11], header[12], header[17]
        for name, value, least in (
            ("points up", up, 2),
            ("points across", across, 2),
            ("points down the tower", tower, 0),
            ("times", times, 2),
            ("characters of its text", text, 0),
        ):
            if value < least:
                raise ValueError(f"expected a header with at least {least} {name}, got {value}")
        Quantity("number", above=0.0).check(slope, "slope of the wind along the shaft")
        for name, length in (("spacing up", dz), ("spacing across", dy)):
            Quantity("length", above=0.0).check(length, name)
        plane = _COMPONENTS * (up * across + tower)
        _check_size(len(content), _TURBSIM.size + text + 2 * plane * times, f"{times} planes")
        raw = np.frombuffer(content, "<i2", plane * times, _TURBSIM.size + text).reshape(times, plane)
        # Heights from the lowest, at each the points from right to left, at each the three components.
        grid = raw[:, : _COMPONENTS * up * across].reshape(times, up, across, _COMPONENTS)[..., 0]
        wind = (grid.astype(np.float64) - offset) / slope
        hub = file_hub if hub_height is None else hub_height
        return WindBox(
            u=wind.transpose(0, 2, 1) - mean_wind,
            y=dy * (np.arange(across) - 0.5 * (across - 1)),
            z=lowest - hub + dz * np.arange(up),
            time_step=time_step,
            mean_wind=mean_wind,
        )


def read_mann(
    path: str | os.PathLike[str],
    shape: tuple[int, int, int],
    spacing: tuple[float, float, float],
    mean_wind: float,
) -> WindBox:
    """Read one component of a turbulence box as HAWC2 takes it: numbers of 32 bits, x slowest and z fastest.

    x points downwind, so the file's last plane arrives first, at time zero; y points to the left of one who looks
    downwind, z up; the hub is in the middle. The file tells nothing of its size.

    Parameters
    ----------
    path : path
        Of the component along the wind.
    shape : tuple of three int
        Points along x, y and z.
    spacing : tuple of three float
        Their distances [m].
    mean_wind : float
        With which the box is carried along [m/s].

    Raises
    ------
    FileNotFoundError, ValueError
        If there is no such file, or it holds another number of points, or numbers that are no wind.
    """
    TupleOf(Count(at_least=2), length=3).check(shape, "mann.shape")
    TupleOf(Quantity("length", above=0.0), length=3).check(spacing, "mann.spacing")
    Quantity("speed", above=0.0, at_most=STRONGEST).check(mean_wind, "mann.mean_wind")
    content = read_bytes(path, LARGEST)
    with _naming(path):
        points = " by ".join(map(str, shape))
        _check_size(len(content), 4 * int(np.prod(shape, dtype=object)), f"{points} numbers of 32 bits")
        wind = np.frombuffer(content, "<f4").reshape(shape).astype(float)
        _require_whole("box.u", wind)
        return along_the_wind(wind, spacing, mean_wind)


def read_netcdf(path: str | os.PathLike[str], mean_wind: float, hub_height: float) -> WindBox:
    """Read the wind (not its perturbation) from a NetCDF file, classic or NetCDF-4.

    The variable is called `u`, `x_wind` or `eastward_wind`, or has one of the latter as its `standard_name`. Its
    dimensions are `time`, `y` and `z` in any order, each with its coordinate: time in s, evenly spaced; y in m from
    the hub, to the left of one who looks downwind; z in m above the ground.

    Parameters
    ----------
    path : path
    mean_wind : float
        Of the perturbation and of the transport [m/s].
    hub_height : float
        [m]

    Raises
    ------
    FileNotFoundError, ValueError
        If there is no such file, or it is not as above; the message names it.
    ImportError
        If it is NetCDF-4 and xarray and h5netcdf are not installed.
    """
    Quantity("speed", above=0.0, at_most=STRONGEST).check(mean_wind, "netcdf.mean_wind")
    Quantity("length", at_least=0.0).check(hub_height, "netcdf.hub_height")
    content = read_bytes(path, LARGEST)
    with _naming(path):
        if content.startswith(_HDF5):
            variables = _netcdf_4(path)
        elif content.startswith(_CLASSIC):
            variables = _netcdf_classic(path)
        else:
            raise ValueError("expected a NetCDF file, got another kind")
        name = _wind_variable(variables)
        dimensions, values, units = variables[name]
        if sorted(dimensions) != ["time", "y", "z"]:
            raise ValueError(
                f"variable {name}: expected the dimensions time, y, z, got {', '.join(dimensions)}"
            )
        _check_unit(name, units, "m/s")
        axes = []
        for axis, unit in (("time", "s"), ("y", "m"), ("z", "m")):
            if axis not in variables or len(variables[axis][0]) != 1:
                raise ValueError(f"variable {axis}: missing; expected the coordinate of the dimension {axis}")
            _check_unit(axis, variables[axis][2], unit)
            axes.append(variables[axis][1])
        time, y, z = axes
        wind = values.transpose([dimensions.index(axis) for axis in ("time", "y", "z")])
        _require_whole(f"variable {name}", wind)
        average = float(wind.mean())
        if abs(average - mean_wind) > MEAN_ABOUT * mean_wind:
            raise ValueError(
                f"variable {name}: expected the wind itself, about {number(mean_wind)} m/s, got a mean of "
                f"{average:.3g} m/s; add the mean wind, or take a model that was built for that of the file"
            )
        return WindBox(wind - mean_wind, y, z - hub_height, _even_step(time), mean_wind)


_Variables = dict[str, tuple[tuple[str, ...], AnyArray, str]]
"""Dimensions, values and unit of each variable by its name; the standard name's as well."""


def _netcdf_classic(path: str | os.PathLike[str]) -> _Variables:
    from scipy.io import netcdf_file  # long to import

    try:
        with netcdf_file(os.fspath(path), "r", mmap=False, maskandscale=True) as file:
            return _by_name(
                (name, each.dimensions, each[:], each._attributes) for name, each in file.variables.items()
            )
    # A broken header leads SciPy to any place and size.
    except (
        OSError,
        TypeError,
        ValueError,
        IndexError,
        KeyError,
        OverflowError,
        MemoryError,
        EOFError,
    ) as error:
        raise ValueError(f"a NetCDF file that is cut off or broken ({one_line(error, 100)})") from None


def _netcdf_4(path: str | os.PathLike[str]) -> _Variables:
    try:
        import h5netcdf  # noqa: F401  what xarray reads the file with
        import xarray
    except ImportError as error:
        raise ImportError(
            f'{one_line(os.fsdecode(path), 300)}: a NetCDF-4 file: pip install "flapgym[wind]" ({error})'
        ) from error
    try:
        with xarray.open_dataset(os.fspath(path), engine="h5netcdf", decode_times=False) as file:
            return _by_name(
                (str(k), each.dims, each.values, each.attrs) for k, each in file.variables.items()
            )
    except (OSError, ValueError, KeyError, RuntimeError) as error:
        raise ValueError(f"a NetCDF file that is cut off or broken ({one_line(error, 100)})") from None


def _by_name(variables: Iterator[tuple[str, Any, Any, Any]]) -> _Variables:
    found: _Variables = {}
    for name, dimensions, values, attributes in variables:
        told = {key: _text(attributes.get(key, "")) for key in ("units", "standard_name")}
        if np.asarray(values).dtype.kind not in "iuf":
            continue  # texts and the like
        # What is masked as missing becomes NaN, which the box refuses.
        numbers = np.ma.filled(np.ma.asarray(values).astype(np.float64), np.nan)
        entry = (tuple(map(str, dimensions)), numbers, told["units"])
        found[name] = entry
        if told["standard_name"] in NETCDF_NAMES:
            found.setdefault(told["standard_name"], entry)
    return found


def _text(value: object) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def _wind_variable(variables: _Variables) -> str:
    for name in NETCDF_NAMES:
        if name in variables:
            return name
    given = ", ".join(variables) or "none"
    raise ValueError(f"expected a variable {', '.join(NETCDF_NAMES)}, got {one_line(given, 100)}")


def _check_unit(name: str, given: str, unit: str) -> None:
    if " ".join(given.split()).partition(" since ")[0] not in UNITS[unit]:
        raise ValueError(f"variable {name}: expected the units {unit}, got {shown(given)}")


def _even_step(time: AnyArray) -> float:
    """The time step [s] of times that are evenly spaced."""
    steps = np.diff(time)
    if not len(steps) or not steps.mean() > 0.0 or not (np.abs(steps / steps.mean() - 1.0) < EVEN).all():
        raise ValueError("variable time: expected two or more times that increase by even steps")
    return float(steps.mean())


def _require_whole(name: str, wind: AnyArray) -> None:
    missing = int(np.isnan(wind).sum())
    if missing:
        raise ValueError(
            f"{name}: expected a number at each point, got nan m/s at {missing} of {wind.size}; fill those"
        )


def _check_size(given: int, expected: int, what: str) -> None:
    if given != expected:
        cut = given < expected
        short, fix = ("a file that is cut off", "copy it again") if cut else ("more", "check its sizes")
        raise ValueError(f"expected {expected} bytes for {what}, got {short}, {given} bytes; {fix}")


@contextmanager
def _naming(path: str | os.PathLike[str]) -> Iterator[None]:
    """Begin what a ValueError says with the file's name."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"{one_line(os.fsdecode(path), 300)}: {error}") from None
