"""Boxes of wind: what the blades meet of a known field, and files of known values in each format."""

from __future__ import annotations

import importlib.util
import struct

import numpy as np
import pytest
from scipy.io import netcdf_file

from flapgym.core.multiblade import to_blades
from flapgym.wind.box import WindBox, along_the_wind, mann_box
from flapgym.wind.box_files import read_mann, read_netcdf, read_turbsim

RNG = np.random.default_rng(8)
MEAN = 11.0
SHAPE, SPACING = (6, 4, 5), (5.5, 20.0, 25.0)
FIELD = RNG.normal(0.0, 1.0, SHAPE)


def box(**changes):
    values = {
        "u": FIELD,
        "y": np.array([-30.0, -10.0, 10.0, 30.0]),
        "z": np.array([-50.0, -25.0, 0.0, 25.0, 50.0]),
        "time_step": 0.5,
        "mean_wind": MEAN,
    }
    return WindBox(**(values | changes))


def linear_box():
    """A field that is linear in time and place, which interpolation leaves alone."""
    places = np.linspace(-60.0, 60.0, 13)
    time = 0.5 * np.arange(41)
    u = 0.05 * time[:, None, None] + 0.01 * places[:, None] + 0.02 * places
    return WindBox(u, places, places, 0.5, MEAN)


def test_at_its_points_a_box_has_their_values():
    found = box()
    time = (0.5 * np.arange(6))[:, None, None]
    np.testing.assert_array_equal(found.at(time, found.y[:, None], found.z), FIELD)


def test_between_the_points_it_is_the_mean_of_the_eight_corners():
    found = box().at(np.array(0.25), np.array(0.0), np.array(12.5))
    assert found == pytest.approx(FIELD[:2, 1:3, 2:4].mean())


def test_the_blades_meet_a_linear_field_where_they_are():
    time, azimuth, radius = RNG.uniform(0.0, 20.0, 30), RNG.uniform(0.0, 6.3, 30), np.array([10.0, 60.0])
    components = linear_box().components(time, azimuth, radius)
    for b in range(3):
        angle = azimuth + 2.0 * np.pi * b / 3.0
        left, up = -np.outer(np.sin(angle), radius), np.outer(np.cos(angle), radius)
        found = to_blades(components, azimuth[:, None])[..., b]
        np.testing.assert_allclose(found, 0.05 * time[:, None] + 0.01 * left + 0.02 * up, atol=1e-12)


def test_a_linear_field_has_constant_components():
    time, azimuth = np.full(20, 4.0), np.linspace(0.0, 6.0, 20)
    found = linear_box().components(time, azimuth, np.array([30.0]))
    np.testing.assert_allclose(found[:, 0], np.tile([0.2, 0.6, -0.3], (20, 1)), atol=1e-12)


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"u": np.full(SHAPE, np.nan)}, "^box.u: expected a speed from -100 to 100 m/s, got nan m/s"),
        ({"u": FIELD[:, :3]}, r"^box.u: expected two or more times of 4 by 5 points, got \(6, 3, 5\)"),
        ({"y": np.array([1.0, 0.0, 2.0, 3.0])}, "^box.y: expected two or more places that increase"),
        ({"time_step": 0.0}, "^box.time_step: expected 0 s < time"),
        ({"mean_wind": -1.0}, "^box.mean_wind"),
    ],
)
def test_a_box_that_cannot_be_is_refused_by_its_field(changes, message):
    with pytest.raises(ValueError, match=message):
        box(**changes)


@pytest.mark.parametrize(
    "mean, radius, duration, message",
    [
        (11.2, 30.0, 2.0, "^box.mean_wind: expected the model's 11.2 m/s within 1%, got 11 m/s"),
        (11.0, 31.0, 2.0, "^box.y: expected a grid that covers the rotor, -31 to 31 m .* got -30 to 30 m"),
        (11.0, 30.0, 2.6, "^box.u: expected a box that lasts as long as the episode, 2.6 s, got 2.5 s"),
    ],
)
def test_a_box_that_does_not_suit_the_episode_is_refused(mean, radius, duration, message):
    with pytest.raises(ValueError, match=message):
        box().require(mean, radius, duration)


def test_a_box_that_suits_the_episode_passes():
    assert box().require(11.1, 30.0, 2.5) is None


@pytest.mark.parametrize(
    "time, y, z, message",
    [
        (2.6, 0.0, 0.0, "^box.time: expected points from 0 to 2.5 s, got 2.6 s"),
        (0.0, -31.0, 0.0, "^box.y: expected points from -30 to 30 m, got -31 m"),
        (0.0, 0.0, np.nan, "^box.z: .*got nan m"),
    ],
)
def test_points_outside_the_box_are_refused(time, y, z, message):
    with pytest.raises(ValueError, match=message):
        box().at(np.array(time), np.array(y), np.array(z))


# TurbSim ------------------------------------------------------------------------------------------------------------

SLOPE, OFFSET = 1000.0, -11000.0
COUNTS = RNG.integers(-9000, 9000, (3, 4, 5, 3))  # times, heights, points from right to left, components
TOWER = RNG.integers(-9000, 9000, (3, 2, 3))


def bts(kind=7, up=4, across=5, times=3, step=0.05, slope=SLOPE):
    """A file of TurbSim's, number by number: 70 bytes, a text of 7, and 3 planes of 20 and 2 points of 6 bytes."""
    text = b"by hand"
    head = struct.pack("<h4l", kind, up, across, 2, times) + struct.pack(
        "<6f", 25.0, 20.0, step, 11.0, 90.0, 40.0
    )
    head += struct.pack("<6f", slope, OFFSET, 900.0, 5.0, 800.0, 7.0) + struct.pack("<l", len(text)) + text
    body = b""
    for plane, tower in zip(COUNTS, TOWER, strict=True):
        for row in (*plane, tower):
            for point in row:
                body += struct.pack("<3h", *point)
    return head + body


@pytest.mark.parametrize("kind", [7, 8])
def test_a_file_of_turbsim_is_its_header_and_scaled_numbers(tmp_path, kind):
    path = tmp_path / "wind.bts"
    path.write_bytes(bts(kind))
    found = read_turbsim(path)
    wind = (COUNTS[..., 0] - OFFSET) / SLOPE
    np.testing.assert_allclose(found.u, wind.transpose(0, 2, 1) - 11.0, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(found.y, [-40.0, -20.0, 0.0, 20.0, 40.0])
    np.testing.assert_allclose(found.z, [-50.0, -25.0, 0.0, 25.0])
    assert (found.time_step, found.mean_wind) == (0.05, 11.0)


def test_another_hub_moves_turbsim_s_grid(tmp_path):
    path = tmp_path / "wind.bts"
    path.write_bytes(bts())
    np.testing.assert_allclose(read_turbsim(path, hub_height=80.0).z, [-40.0, -15.0, 10.0, 35.0])


@pytest.mark.parametrize(
    "content, message",
    [
        (b"", "expected a full-field file of TurbSim"),
        (
            b"time [s], wind [m/s]\n" * 9,
            "expected a full-field file of TurbSim, which begins with the number 7 or 8",
        ),
        (bts(kind=4), "which begins with the number 7 or 8"),
        (bts()[:-1], "expected 473 bytes for 3 planes, got a file that is cut off, 472 bytes"),
        (bts() + b"x", "expected 473 bytes for 3 planes, got more, 474 bytes"),
        (bts(up=-4), "expected a header with at least 2 points up, got -4"),
        (bts(step=0.0), "box.time_step: expected 0 s < time"),
        (bts(step=float("nan")), "box.time_step"),
        (bts(slope=0.0), "slope of the wind along the shaft: expected 0 < number, got 0"),
        (bts(slope=1.0), "box.u: expected a speed from -100 to 100 m/s"),
    ],
)
def test_what_is_no_whole_file_of_turbsim_is_refused_by_name(tmp_path, content, message):
    path = tmp_path / "wind.bts"
    path.write_bytes(content)
    with pytest.raises(ValueError, match="^.*wind.bts: .*" + message):
        read_turbsim(path)


# HAWC2 --------------------------------------------------------------------------------------------------------------


def test_the_last_plane_of_a_mann_box_arrives_first(tmp_path):
    path = tmp_path / "u.bin"
    # x slowest, z fastest: written with three loops.
    path.write_bytes(
        b"".join(struct.pack("<f", FIELD[i, j, k]) for i in range(6) for j in range(4) for k in range(5))
    )
    found = read_mann(path, SHAPE, SPACING, MEAN)
    np.testing.assert_allclose(found.u[0], FIELD[5], rtol=1e-6)
    np.testing.assert_allclose(found.u[5], FIELD[0], rtol=1e-6)
    np.testing.assert_allclose(found.y, [-30.0, -10.0, 10.0, 30.0])
    np.testing.assert_allclose(found.z, [-50.0, -25.0, 0.0, 25.0, 50.0])
    assert found.time_step == pytest.approx(0.5)


@pytest.mark.parametrize(
    "count, shape, message",
    [
        (
            119,
            SHAPE,
            "u.bin: expected 480 bytes for 6 by 4 by 5 numbers of 32 bits, got a file that is cut off, 476",
        ),
        (120, (6, 5, 5), "u.bin: expected 600 bytes"),
        (120, (5, 4, 5), "u.bin: expected 400 bytes .*got more, 480"),
        (120, (120, 1, 1), r"^mann.shape\[1\]: expected a whole number of at least 2, got 1"),
    ],
)
def test_a_mann_box_of_another_size_is_refused(tmp_path, count, shape, message):
    path = tmp_path / "u.bin"
    path.write_bytes(FIELD.astype("<f4").tobytes()[: 4 * count])
    with pytest.raises(ValueError, match=message):
        read_mann(path, shape, SPACING, MEAN)


def test_a_mann_box_with_a_hole_is_refused(tmp_path):
    path = tmp_path / "u.bin"
    path.write_bytes(np.where(FIELD.max() == FIELD, np.nan, FIELD).astype("<f4").tobytes())
    with pytest.raises(ValueError, match="u.bin: box.u: .*got nan m/s"):
        read_mann(path, SHAPE, SPACING, MEAN)


def test_a_file_that_is_not_there_is_said_to_be_missing(tmp_path):
    for read in (
        read_turbsim,
        lambda p: read_mann(p, SHAPE, SPACING, MEAN),
        lambda p: read_netcdf(p, MEAN, 90.0),
    ):
        with pytest.raises(FileNotFoundError, match="nowhere: no such file"):
            read(tmp_path / "nowhere")


# NetCDF -------------------------------------------------------------------------------------------------------------


def netcdf(path, name="u", standard_name="", order=("time", "y", "z"), units=None, time=None, values=None):
    """A classic file of FIELD (time, y, z) as wind about MEAN; its dimensions in any order."""
    units = {"time": "s", "y": "m", "z": "m", "wind": "m s-1"} | (units or {})
    places = {
        "time": 0.5 * np.arange(6) if time is None else np.array(time),
        "y": np.array([-30.0, -10.0, 10.0, 30.0]),
        "z": np.array([40.0, 65.0, 90.0, 115.0, 140.0]),
    }
    with netcdf_file(path, "w") as file:
        for axis, place in places.items():
            file.createDimension(axis, len(place))
            variable = file.createVariable(axis, "f8", (axis,))
            variable[:] = place
            variable.units = units[axis]
        variable = file.createVariable(name, "f8", order)
        wind = FIELD + MEAN if values is None else values
        variable[:] = wind.transpose([("time", "y", "z").index(axis) for axis in order])
        variable.units = units["wind"]
        if standard_name:
            variable.standard_name = standard_name
    return path


@pytest.mark.parametrize(
    "given",
    [
        {},
        {"name": "x_wind", "order": ("z", "y", "time")},
        {"name": "speed", "standard_name": "eastward_wind"},
        {"units": {"time": "seconds since 2024-01-01", "wind": "m/s", "y": "metres"}},
    ],
)
def test_a_netcdf_file_is_read_by_its_names_dimensions_and_units(tmp_path, given):
    found = read_netcdf(netcdf(tmp_path / "wind.nc", **given), MEAN, hub_height=90.0)
    np.testing.assert_allclose(found.u, FIELD, atol=1e-13)
    np.testing.assert_allclose(found.z, [-50.0, -25.0, 0.0, 25.0, 50.0])
    np.testing.assert_allclose(found.y, [-30.0, -10.0, 10.0, 30.0])
    assert (found.time_step, found.mean_wind) == (0.5, MEAN)


@pytest.mark.parametrize(
    "given, message",
    [
        ({"name": "speed"}, "expected a variable u, x_wind, eastward_wind, got .*speed"),
        ({"units": {"time": "min"}}, "variable time: expected the units s, got 'min'"),
        ({"units": {"y": "km"}}, "variable y: expected the units m, got 'km'"),
        ({"units": {"wind": "knots"}}, "variable u: expected the units m/s, got 'knots'"),
        ({"time": [0.0, 0.5, 1.0, 1.5, 2.0, 3.0]}, "variable time: expected two or more times .* even steps"),
        ({"time": 5.0 - np.arange(6.0)}, "variable time: expected two or more times that increase"),
        ({"values": FIELD}, "variable u: expected the wind itself, about 11 m/s, got a mean of"),
        ({"values": FIELD + np.where(FIELD.max() == FIELD, np.nan, MEAN)}, "got nan m/s|mean of nan"),
    ],
)
def test_another_netcdf_file_is_refused_by_name(tmp_path, given, message):
    with pytest.raises(ValueError, match="wind.nc: .*(" + message + ")"):
        read_netcdf(netcdf(tmp_path / "wind.nc", **given), MEAN, hub_height=90.0)


@pytest.mark.parametrize("kept", [6, 40, 200, -8])
def test_a_netcdf_file_that_is_cut_off_is_refused(tmp_path, kept):
    path = netcdf(tmp_path / "wind.nc")
    path.write_bytes(path.read_bytes()[:kept])
    with pytest.raises(ValueError, match="wind.nc: a NetCDF file that is cut off or broken"):
        read_netcdf(path, MEAN, 90.0)


def test_what_is_no_netcdf_file_is_refused(tmp_path):
    path = tmp_path / "wind.nc"
    path.write_bytes(bts())
    with pytest.raises(ValueError, match="wind.nc: expected a NetCDF file, got another kind"):
        read_netcdf(path, MEAN, 90.0)


@pytest.mark.skipif(importlib.util.find_spec("h5netcdf") is not None, reason="h5netcdf is there")
def test_a_netcdf_4_file_says_what_to_install(tmp_path):
    path = tmp_path / "wind.nc"
    path.write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(100))
    with pytest.raises(ImportError, match=r'wind.nc: a NetCDF-4 file: pip install "flapgym\[wind\]"'):
        read_netcdf(path, MEAN, 90.0)


def test_a_netcdf_4_file_is_read_as_the_classic_one(tmp_path):
    pytest.importorskip("h5netcdf")
    xarray = pytest.importorskip("xarray")
    with xarray.open_dataset(netcdf(tmp_path / "classic.nc"), engine="scipy", decode_times=False) as classic:
        classic.to_netcdf(tmp_path / "wind.nc", engine="h5netcdf")
    np.testing.assert_allclose(read_netcdf(tmp_path / "wind.nc", MEAN, 90.0).u, FIELD, atol=1e-13)


# hipersim -----------------------------------------------------------------------------------------------------------


@pytest.mark.skipif(importlib.util.find_spec("hipersim") is not None, reason="hipersim is there")
def test_a_mann_box_says_what_to_install():
    with pytest.raises(ImportError, match=r'mann_box: hipersim makes it: pip install "flapgym\[wind\]"'):
        mann_box(MEAN, 1.1, (16, 8, 8), (4.0, 9.0, 9.0), seed=1)


@pytest.mark.parametrize(
    "changes, message",
    [
        (
            {"standard_deviation": 0.0},
            "^mann_box.standard_deviation: expected 0 m/s < speed <= 100 m/s, got 0 m/s",
        ),
        ({"shape": (16, 8)}, "^mann_box.shape: expected a list of 3 values"),
        ({"spacing": (4.0, -9.0, 9.0)}, r"^mann_box.spacing\[1\]"),
        ({"seed": -1}, "^mann_box.seed"),
    ],
)
def test_an_impossible_mann_box_is_refused_by_name(changes, message):
    values = {"standard_deviation": 1.1, "shape": (16, 8, 8), "spacing": (4.0, 9.0, 9.0), "seed": 1}
    with pytest.raises(ValueError, match=message):
        mann_box(MEAN, **(values | changes))


def test_hipersim_s_box_is_the_file_that_it_writes_for_hawc2(tmp_path):
    hipersim = pytest.importorskip("hipersim")
    shape, spacing = (32, 8, 8), (4.0, 9.0, 9.0)
    field = hipersim.MannTurbulenceField.generate(L=33.6, Gamma=3.9, Nxyz=shape, dxyz=spacing, seed=3)
    field.to_hawc2(str(tmp_path), "box_")
    read = read_mann(tmp_path / "box_u.turb", shape, spacing, MEAN)
    made = mann_box(MEAN, 1.1, shape, spacing, seed=3)
    np.testing.assert_array_equal(read.u[::-1], field.uvw[0])
    np.testing.assert_allclose(made.u, read.u * (1.1 / read.u.std()), rtol=1e-6)
    assert made.u.std() == pytest.approx(1.1)


def test_the_grid_of_a_box_along_the_wind_is_about_the_hub():
    found = along_the_wind(FIELD, SPACING, MEAN)
    assert found.y.sum() == found.z.sum() == 0.0
    assert found.time_step == pytest.approx(SPACING[0] / MEAN)
