"""Gusts against their formulas and the standard's numbers; recordings against what their files say."""

from __future__ import annotations

import json
import os

import numpy as np
import pytest

from flapgym.wind import gust_of
from flapgym.wind.gusts import ExtremeOperatingGust
from flapgym.wind.recording import read_wind

MEAN = 11.0
SIZE = {"rotor_diameter": 126.0, "hub_height": 90.0}
TIME = np.linspace(-1.0, 20.0, 2101)


def _wind(spec, time=TIME):
    return gust_of(json.loads(json.dumps(spec))).wind(np.asarray(time, dtype=float), MEAN)


def test_a_step_is_nothing_before_its_start_and_its_size_from_then_on():
    wind = _wind({"kind": "step", "start": 2.0, "size": -1.5}, [-1.0, 0.0, 1.999, 2.0, 50.0])
    np.testing.assert_array_equal(wind, [0.0, 0.0, 0.0, -1.5, -1.5])


def test_a_ramp_has_one_slope_and_stays_at_its_size():
    wind = _wind({"kind": "ramp", "start": 3.0, "duration": 4.0, "size": 2.0})
    slope = np.gradient(wind, TIME)
    rising = (TIME > 3.02) & (TIME < 6.98)
    np.testing.assert_allclose(slope[rising], 0.5, rtol=1e-9)
    np.testing.assert_allclose(slope[(TIME < 2.98) | (TIME > 7.02)], 0.0, atol=1e-12)
    assert wind[-1] == 2.0


def test_a_sinusoid_has_its_frequency_and_begins_without_a_jump():
    wind = _wind(
        {"kind": "sinusoid", "start": 1.0, "amplitude": 0.7, "frequency": 0.25}, [0.5, 1.0, 2.0, 3.0, 4.0]
    )
    np.testing.assert_allclose(wind, [0.0, 0.0, 0.7, 0.0, -0.7], atol=1e-12)


@pytest.mark.parametrize("intensity, letter", [(0.16, "A"), (0.14, "B"), (0.12, "C")])
def test_the_extreme_gust_has_the_magnitude_of_the_standard_below_its_yearly_limit(intensity, letter):
    gust = ExtremeOperatingGust(turbulence_class=letter, **SIZE)
    sigma = intensity * (0.75 * MEAN + 5.6)
    assert gust.magnitude(MEAN) == pytest.approx(3.3 * sigma / (1.0 + 0.1 * 126.0 / 42.0))


def test_in_a_storm_the_yearly_extreme_bounds_the_extreme_gust():
    # V_e1 = 0.8 * 1.4 * 37.5 = 42 m/s: 1.35 (42 - 40).
    assert ExtremeOperatingGust(turbine_class="III", **SIZE).magnitude(40.0) == pytest.approx(2.7)


def test_a_low_hub_has_a_shorter_turbulence_scale():
    low = ExtremeOperatingGust(rotor_diameter=126.0, hub_height=40.0).magnitude(MEAN)
    sigma = 0.16 * (0.75 * MEAN + 5.6)
    assert low == pytest.approx(3.3 * sigma / (1.0 + 0.1 * 126.0 / 28.0))


def test_the_extreme_gust_dips_peaks_at_half_time_and_dips_again():
    wind = _wind({"kind": "extreme_operating_gust", "start": 2.0, **SIZE})
    magnitude = ExtremeOperatingGust(**SIZE).magnitude(MEAN)
    assert wind.max() == pytest.approx(0.74 * magnitude, rel=1e-6)
    assert TIME[wind.argmax()] == pytest.approx(2.0 + 5.25)
    np.testing.assert_allclose(
        _wind({"kind": "extreme_operating_gust", "start": 2.0, **SIZE}, [5.5, 9.0]), 0.0, atol=1e-12
    )
    dips = wind[(TIME > 2.0) & (TIME < 5.5)].min(), wind[(TIME > 9.0) & (TIME < 12.5)].min()
    # Largest of sin(3 pi x) (1 - cos(2 pi x)) before x = 1/3, from its derivative: 0.9233 at x = 0.2131.
    x = np.linspace(0.0, 1.0 / 3.0, 100001)
    depth = 0.37 * magnitude * (np.sin(3 * np.pi * x) * (1 - np.cos(2 * np.pi * x))).max()
    np.testing.assert_allclose(dips, -depth, rtol=1e-4)
    assert not wind[(TIME <= 2.0) | (TIME >= 12.5)].any()


def test_the_mean_of_the_extreme_gust_is_its_integral():
    time = np.linspace(0.0, 10.5, 10001)
    wind = _wind({"kind": "extreme_operating_gust", **SIZE}, time)
    magnitude = ExtremeOperatingGust(**SIZE).magnitude(MEAN)
    assert np.trapezoid(wind, time) / 10.5 == pytest.approx(0.37 * 8.0 / (15.0 * np.pi) * magnitude, rel=1e-6)


@pytest.mark.parametrize(
    "text, expected",
    [
        ("time [s], wind [m/s]\n0, 11\n1, 12\n3, 10\n", [0.0, 0.5, 0.0, -1.0]),
        ("time [min], wind [km/h]\n0, 39.6\n0.05, 39.6\n", [0.0, 0.0, 0.0, 0.0]),
        (
            "time [h], wind_perturbation [kn]\n0, 0\n1, 4200\n",
            [1852 / 3600 * 4200 / 3600 * t for t in (0.0, 0.5, 2.0, 3.0)],
        ),
        ("wind_perturbation [m/s], time [ms]\n0, 0\n1, 1000\n# a gap\n\n-1, 3000\n", [0.0, 0.5, 0.0, -1.0]),
    ],
)
def test_a_recording_is_linear_between_its_samples_in_its_own_units(tmp_path, text, expected):
    path = tmp_path / "wind.csv"
    path.write_text(text)
    wind = _wind({"kind": "recorded", "file": str(path)}, [0.0, 0.5, 2.0, 3.0])
    np.testing.assert_allclose(wind, expected, atol=1e-12)


def test_a_recording_may_start_later_and_holds_what_blew_before(tmp_path):
    path = tmp_path / "wind.csv"
    path.write_text("time [s], wind_perturbation [m/s]\n10, 0\n20, 5\n")
    wind = _wind({"kind": "recorded", "file": str(path), "start": 12.0}, [-1.0, 0.0, 8.0])
    np.testing.assert_allclose(wind, [1.0, 1.0, 5.0])
    for start, message in (
        (9.0, "holds 10 to 20 s.* got 9 s"),
        (13.0, "until 20 s.* duration of at most 7 s"),
    ):
        with pytest.raises(ValueError, match=message):
            _wind({"kind": "recorded", "file": str(path), "start": start}, [0.0, 8.0])


@pytest.mark.parametrize(
    "text, message",
    [
        ("", "header"),
        ("time [s], wind [m/s]\n0, 1\n", "at least two samples, got 1"),
        ("0, 1\n1, 2\n", "line 1: expected a header of two columns with units"),
        ("time [s], wind\n0, 1\n", "line 1: .*got 'wind'"),
        ("time [s], speed [m/s]\n0, 1\n", "line 1: .*got 'speed"),
        ("time [s], wind [mph]\n0, 1\n", "line 1: column wind: .*'m/s' or .*, got the unit 'mph'"),
        ("time [s], time [s]\n0, 1\n", "line 1: expected two columns"),
        ("time [s], wind [m/s], wind_perturbation [m/s]\n0, 1, 2\n", "line 1: expected two columns"),
        ("time [s], wind [m/s]\n0, 1\n1; 2\n", "line 3: expected two numbers"),
        ("# site\ntime [s], wind [m/s]\n0, 1\n\n1, calm\n", "line 5: expected two numbers"),
        ("time [s], wind [m/s]\n0, 1\n1, nan\n", "line 3: expected finite"),
        ("time [s], wind [m/s]\n0, 1\n0, 2\n", "line 3: expected times that increase"),
    ],
)
def test_a_recording_that_cannot_be_read_is_refused_by_file_and_line(tmp_path, text, message):
    path = tmp_path / "wind.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match="wind.csv.*" + message):
        _wind({"kind": "recorded", "file": str(path)})


def test_a_recording_in_a_wrong_unit_is_refused(tmp_path):
    path = tmp_path / "wind.csv"
    path.write_text("time [s], wind [m/s]\n0, 1e6\n9, 1e6\n")
    with pytest.raises(ValueError, match="gust.file: .*wind.csv: expected perturbations within .*100 m/s"):
        _wind({"kind": "recorded", "file": str(path)}, [0.0, 1.0])


def test_what_is_no_table_is_refused_by_file_and_line(tmp_path):
    path = tmp_path / "wind.csv"
    path.write_text('time [s], wind [m/s]\n0, "1\n' + 200000 * "x")
    with pytest.raises(ValueError, match="wind.csv, line .*: not a table .*expected CSV"):
        _wind({"kind": "recorded", "file": str(path)})


@pytest.mark.parametrize("number", [np.float32(1.0), np.float64(1.0), np.int64(1), 1])
def test_numbers_of_numpy_are_numbers(number):
    wind = gust_of({"kind": "step", "size": number}).wind(np.array([-1.0, 1.0]), MEAN)
    np.testing.assert_array_equal(wind, [0.0, 1.0])


def test_a_missing_recording_is_refused():
    with pytest.raises(ValueError, match="nowhere.csv: no such file; give the path"):
        _wind({"kind": "recorded", "file": "nowhere.csv"})


@pytest.mark.parametrize(
    "spec, message",
    [
        ("step", "gust: expected a mapping"),
        ({}, "gust.kind: expected one of 'step'"),
        ({"kind": "hurricane"}, "gust.kind"),
        ({"kind": "step"}, "gust.size: missing; give it a value"),
        ({"kind": "step", "size": 1.0, "end": 2.0}, "gust.end: unknown key; known keys: size, start"),
        ({"kind": "step", "size": 1.0, "strat": 2.0}, "gust.strat: unknown key; did you mean 'start'"),
        ({"kind": "step", "size": "1 m/s"}, "gust.size: expected a speed as a number in m/s, got '1 m/s'"),
        ({"kind": "step", "size": float("nan")}, "gust.size"),
        ({"kind": "ramp", "size": 1.0, "duration": 0.0}, "gust.duration: expected a time from 0.001"),
        (
            {"kind": "sinusoid", "amplitude": 1.0, "frequency": -1.0},
            "gust.frequency: .* to 50 Hz",
        ),
        (
            {"kind": "extreme_operating_gust", "turbulence_class": "D"},
            "gust.turbulence_class: expected one of 'A', 'B', 'C'",
        ),
        ({"kind": "extreme_operating_gust", "turbine_class": 1}, "gust.turbine_class"),
        ({"kind": "recorded", "file": 3}, "gust.file"),
        ({"kind": "extreme_operating_gust", "turbulence_class": ["A"]}, "gust.turbulence_class"),
        ({"kind": "step", "size": 1e308}, "gust.size: expected a speed from -100 to 100 m/s"),
        ({"kind": "step", "size": 10**400}, "gust.size"),
        ({"kind": "step", "size": np.complex64(1)}, "gust.size"),
        ({"kind": "sinusoid", "amplitude": -1e9, "frequency": 1.0}, "gust.amplitude"),
        ({"kind": "sinusoid", "amplitude": 1.0, "frequency": 1e308}, "gust.frequency"),
        ({"kind": "ramp", "size": 1.0, "duration": 1e-308}, "gust.duration"),
    ],
)
def test_an_impossible_gust_is_refused_by_name(spec, message):
    with pytest.raises(ValueError, match=message):
        gust_of(spec)


@pytest.mark.parametrize(
    "text",
    [
        "time [s]; wind [m/s]\n0,0; 11,5\n0,5; 12\n2,0; 9,25\n",
        "time [s]\twind [m/s]\n0\t11.5\n0.5\t12\n2\t9.25\n",
        "time [s]\twind [m/s]\r\n0\t11,5\r\n0,5\t12,0\r\n2\t9,25\r\n",
        "time; wind [m/s]\n2024-01-31 23:59:59,5; 11,5\n2024-02-01 00:00:00,0; 12\n2024-02-01 00:00:01,5; 9,25\n",
        "time [UTC], wind [m/s]\n2024-01-31T23:59:59.5Z, 11.5\n2024-02-01T00:00:00Z, 12\n"
        "2024-02-01T00:00:01.5Z, 9.25\n",
        "# mast 3\ntime [s];wind [m/s]\n2024-01-31T13:00:00+01:00;11.5\n"
        "2024-01-31T13:00:00.5+01:00;12\n2024-01-31T13:00:02+01:00;9.25\n",
        '"time [s]";"wind [km/h]"\n"0";"41,4"\n"0,5";"43,2"\n"2";"33,3"\n',
        "\ufefftime [s]; wind [m/s]\n0; 11.5\n0.5; 12.0\n2; 9.25\n",
    ],
)
def test_what_met_masts_give_is_read(tmp_path, text):
    path = tmp_path / "mast.csv"
    path.write_bytes(text.encode())
    series = read_wind(path)
    np.testing.assert_allclose(series.time, [0.0, 0.5, 2.0], atol=1e-12)
    np.testing.assert_allclose(series.wind, [11.5, 12.0, 9.25], rtol=1e-12)


@pytest.mark.parametrize(
    "text, message",
    [
        (
            "time [s]; wind [m/s]\n0; 1\n1.5; 1,5\n",
            "line 3: expected decimal points or decimal commas, not both",
        ),
        ("time [s]; wind [m/s]\n0; 1\n1; 1.234,5\n", "line 3: expected two numbers"),
        ("time [s]; wind [m/s]\n0; 1\n1; 1_0\n", "line 3: expected two numbers"),
        ("time [s]; wind [m/s]\n0; 1; 2\n", "line 2: expected two numbers separated by a semicolon"),
        ("time [s], wind [m/s]\n0, 1\n0,5, 1\n", "line 3: expected two numbers separated by a comma"),
        (
            "time, wind [m/s]\n0, 1\n1, 2\n",
            "line 2: expected a time in ISO 8601 such as 2024-01-31T13:00:00.5",
        ),
        ("time, wind [m/s]\n31.01.2024 13:00, 1\n", "line 2: expected a time in ISO 8601"),
        (
            "time, wind [m/s]\n2024-01-31T13:00, 1\n2024-01-31T13:01Z, 1\n",
            "line 3: .*of one time zone or none",
        ),
        (
            "time, wind [m/s]\n2024-01-31T13:00, 1\n2024-01-31T13:00, 1\n",
            "line 3: expected times that increase",
        ),
        (
            "time [s], wind [m/s]\n1704070000.25, 1\n1704070000.125, 1\n",
            "got 1704070000.125 s after 1704070000.25 s",
        ),
        ("time [h], wind [m/s]\n0, 1\n1e306, 1\n", "line 3: expected finite numbers"),
        ("time [s], wind [m/s]\n0, 1\n1, \x1b[31m\n", "line 3: .*x1b"),
    ],
)
def test_a_recording_that_could_mean_two_things_is_refused_by_line(tmp_path, text, message):
    path = tmp_path / "mast.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match="mast.csv, " + message if message.startswith("line") else message):
        read_wind(path)


@pytest.mark.parametrize("path, kind", [("/dev/zero", "a device"), ("pipe", "a pipe")])
def test_a_recording_is_a_regular_file(tmp_path, path, kind):
    if path == "pipe":
        path = tmp_path / "pipe"
        os.mkfifo(path)
    with pytest.raises(ValueError, match=f"expected a regular file, got {kind}"):
        read_wind(path)


def test_a_recording_in_another_encoding_is_refused_by_its_name(tmp_path):
    path = tmp_path / "mast.csv"
    path.write_bytes("# Höhe 90 m\ntime [s], wind [m/s]\n0, 1\n1, 2\n".encode("latin-1"))
    with pytest.raises(ValueError, match="Latin-1.*line 1.*save it as UTF-8"):
        read_wind(path)
