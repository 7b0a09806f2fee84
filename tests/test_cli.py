"""The command line: what it writes can be read back, and what it refuses costs one line and no file."""

import json
import os
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.io import netcdf_file

from flapgym import cli
from flapgym.aeroelastic import cache
from flapgym.aeroelastic.cache import COMPLETE_STAGES
from flapgym.control import AGENT_NAMES
from flapgym.core.state_space import delayed
from flapgym.model import load_model, save_model
from flapgym.turbine import load_case


@pytest.fixture
def run(capsys, monkeypatch, tmp_path, tmp_path_factory):
    """Run the command line in an empty folder with an empty cache; return its exit code, output and error output."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("FLAPGYM_CACHE_DIR", str(tmp_path_factory.mktemp("cache")))

    def call(*arguments):
        try:
            code = cli.main([str(argument) for argument in arguments])
        except SystemExit as exit_:
            code = exit_.code
        printed = capsys.readouterr()
        return code, printed.out, printed.err

    return call


def refused(result, *parts):
    """Whether it was refused: exit code 2, nothing on standard output, one line with these parts."""
    code, out, err = result
    assert (code, out) == (2, "")
    assert err.endswith("\n")
    assert err.count("\n") == 1, err
    for part in parts:
        assert part in err
    return True


SMALL_CASE = """
base = "nrel5mw-rated"
name = "small"
[discretisation]
chordwise_panels = 2
wake_length = "0.05 rotor diameters"
time_step = "30 ms"
[reduction]
blade_modes = 3
tower_modes = 3
aerodynamic_states = 6
"""


def test_build_writes_the_model_of_a_case_file(run, tmp_path):
    (tmp_path / "small.toml").write_text(SMALL_CASE)
    code, out, err = run("build", "small.toml", "--output", "small.safetensors")
    assert code == 0
    assert "wrote small.safetensors" in out
    stages = len(COMPLETE_STAGES)
    assert f"{stages}/{stages}" in err  # the progress bar reached its end
    model = load_model("small.safetensors")
    assert model.name == "small"
    assert model.time_step == 0.03
    assert model.inputs_hash == load_case("small.toml").hash()
    assert sorted(os.listdir()) == ["small.safetensors", "small.toml"]
    assert model.record.flutter.describe() in out


def test_the_same_case_is_built_once_and_copied_with_a_word(run, tmp_path, monkeypatch):
    (tmp_path / "small.toml").write_text(SMALL_CASE)
    _, first, building = run("build", "small.toml", "--output", "first.safetensors")
    monkeypatch.setattr(cache, "build_model", None)
    code, second, copying = run("build", "small.toml", "--output", "second.safetensors")
    assert code == 0
    assert second == first.replace("wrote first", "wrote second")
    assert (tmp_path / "second.safetensors").read_bytes() == (tmp_path / "first.safetensors").read_bytes()
    assert "built before, copied from the cache: " in copying
    assert "copied" not in building


def test_unequal_blades_build_their_periodic_form_and_say_so(run, tmp_path):
    (tmp_path / "heavy.toml").write_text(SMALL_CASE + "[blades]\nmass_factor = [1.0, 1.0, 1.02]\n")
    code, out, err = run("build", "heavy.toml", "--output", "heavy.safetensors")
    assert code == 0
    assert "blades.mass_factor: blades differ, the model takes its periodic form" in err
    assert "periodic, since blades differ (mass_factor 1, 1, 1.02)" in out
    assert run("info", "heavy.safetensors")[1] in out
    assert refused(run("aero", "heavy.toml"), "blades.mass_factor: expected equal blades here")


def test_info_says_what_the_shipped_model_holds(run):
    code, out, _ = run("info")
    model = load_model()
    assert code == 0
    assert model.hash[:12] in out
    assert f"{model.turbine.order} states" in out
    assert re.search(r"0\.3\d\d Hz", out), "the first tower mode of the paper's Table 1, 0.32 Hz"


def test_info_lists_the_modes_of_a_model_whose_inputs_act_late_as_those_of_one_whose_do_not():
    turbine = load_model().turbine
    ours, theirs = cli.lightly_damped(delayed(turbine)), cli.lightly_damped(turbine)
    np.testing.assert_allclose(ours, theirs, rtol=1e-6)


@pytest.mark.parametrize(
    "arguments, parts",
    [
        ([], ["COMMAND"]),
        (["fly"], ["fly"]),
        (["build", "nrel5mw-rated"], ["--output"]),
        (["build", "nrel5mw-rates", "--output", "m"], ["nrel5mw-rates", "nrel5mw-rated"]),
        (["build", "nrel5mw-rated", "--output", "no/such/m"], ["--output", "no/such"]),
        (["build", "nrel5mw-rated", "--output", "."], ["--output", "folder"]),
        (["info", "missing.safetensors"], ["missing.safetensors"]),
        (["aero", "nrel5mw-rates"], ["nrel5mw-rates", "nrel5mw-rated"]),
        (["compare", "--agents", "lgq"], ["lgq", "lqg"]),
        (["compare", "--agents", "pd", "pd"], ["pd"]),
        (["compare", "--agents"], ["--agents"]),
        (["compare", "--model", "missing.safetensors"], ["missing.safetensors"]),
        (["compare", "--agents", "open_loop", "--realisations", "0"], ["realisations", "0"]),
        (["compare", "--agents", "open_loop", "--realisations", "few"], ["--realisations", "few"]),
        (["compare", "--agents", "open_loop", "--duration", "nan"], ["duration", "nan"]),
        (["compare", "--agents", "open_loop", "--seed", "-1"], ["seed", "-1"]),
        (["compare", "--realisation", "5", "--ouptut", "here"], ["--ouptut"]),
    ],
)
def test_bad_input_costs_one_line_and_leaves_no_file(run, arguments, parts):
    assert refused(run(*arguments), *parts)
    assert os.listdir() == []


@pytest.mark.parametrize(
    "text, parts",
    [
        ('name = "mine"\n', ["turbine", "missing"]),
        (
            'base = "nrel5mw-rated"\nname = "mine"\n[flap]\nangle_limit = "10 m"\n',
            ["flap.angle_limit", "'m'"],
        ),
        ('base = "nrel5mw-rated"\nname = "mine"\n[flap]\nangel_limit = "10 deg"\n', ["flap.angel_limit"]),
        ('base = "nrel5mw-rated"\nname = "mine"\n[flap\n', ["mine.toml", "TOML"]),
    ],
)
def test_a_faulty_case_file_costs_one_line_and_leaves_no_model(run, tmp_path, text, parts):
    (tmp_path / "mine.toml").write_text(text)
    assert refused(run("build", "mine.toml", "--output", "mine.safetensors"), "mine.toml", *parts)
    assert os.listdir() == ["mine.toml"]


@pytest.mark.parametrize("command", [["info"], ["compare", "--model"]])
def test_a_damaged_model_file_is_refused(run, tmp_path, command):
    path = tmp_path / "damaged.safetensors"
    save_model(load_model(), path)
    content = bytearray(path.read_bytes())
    content[-100] ^= 0xFF
    path.write_bytes(content)
    assert refused(run(*command, path.name), "damaged.safetensors", "damaged")
    path.write_bytes(content[:5000])
    assert refused(run(*command, path.name), "damaged.safetensors")
    path.write_text("not a model")
    assert refused(run(*command, path.name), "damaged.safetensors")
    assert os.listdir() == ["damaged.safetensors"]


def test_an_output_folder_that_is_a_file_is_refused_and_kept(run, tmp_path):
    (tmp_path / "results").write_text("mine")
    assert refused(run("compare", "--agents", "open_loop"), "results")
    assert (tmp_path / "results").read_text() == "mine"


def test_compare_writes_its_table_in_every_form(run):
    code, out, _ = run("compare", "--agents", "open_loop", "pd", "--realisations", "2", "--duration", "20")
    assert code == 0
    assert "pd" in out
    scores = json.loads(Path("results/compare.json").read_text())["agents"]
    assert list(scores) == ["open_loop", "pd"]
    assert scores["open_loop"]["rbm_rms_change"] == {"mean": 0.0, "low": 0.0, "high": 0.0}
    change = scores["pd"]["rbm_rms_change"]
    assert change["low"] <= change["mean"] <= change["high"]
    assert f"{scores['pd']['rbm_rms_Nm'] / 1e6:.3f}" in out
    assert sorted(os.listdir("results")) == ["compare.csv", "compare.json", "compare.md", "compare.png"]


def test_results_stay_when_a_later_comparison_is_refused(run):
    assert run("compare", "--agents", "open_loop", "--realisations", "1", "--duration", "5")[0] == 0
    before = Path("results/compare.json").read_text()
    assert refused(run("compare", "--agents", "nobody"), "nobody")
    assert Path("results/compare.json").read_text() == before


def test_an_interrupt_ends_with_a_line_and_the_shell_s_exit_code(run, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(cli, "run", interrupted)
    code, _, err = run("compare", "--agents", "open_loop")
    assert code == 130
    assert err == "flapgym compare: interrupted; what was written before stays\n"


def test_help_names_every_shipped_agent(run):
    code, out, _ = run("compare", "--help")
    assert code == 0
    assert all(name in out for name in AGENT_NAMES)


@pytest.mark.parametrize("command", [["build", "nrel5mw-rated", "--output"], ["modes", "--plot"]])
def test_a_device_pipe_or_folder_is_no_output_and_stays(run, tmp_path, command):
    os.mkfifo("pipe.png")
    os.symlink("pipe.png", "link.png")
    os.symlink("/dev/null", "device.png")
    os.mkdir("folder.png")
    for name, kind in (
        ("pipe", "a pipe"),
        ("link", "a pipe"),
        ("device", "a device"),
        ("folder", "a folder"),
    ):
        told = f"{name}.png: expected a regular file or none there, got {kind}"
        assert refused(run(*command, f"{name}.png"), command[-1], told)
    assert Path("pipe.png").is_fifo()
    assert Path("device.png").resolve() == Path("/dev/null")
    assert sorted(os.listdir()) == ["device.png", "folder.png", "link.png", "pipe.png"]


def test_compare_takes_its_wind_slope_and_series_by_flags(run, tmp_path):
    pytest.importorskip("xarray")
    (tmp_path / "wind.csv").write_text("time [s], wind [m/s]\n0, 11\n5, 12\n10, 10.5\n")
    code, out, _ = run(
        "compare", "--agents", "pd", "--realisations", "1", "--duration", "8", "--wind", "wind.csv", "--slope", "4",
        "--wind-speed", "11", "--turbulence-intensity", "5%", "--length-scale", "80", "--save-series", "series.nc",
        "--env", "flapgym/NREL5MW-v0",
    )  # fmt: skip
    assert code == 0
    assert "S-N slope 4," in out
    assert "and series.nc" in out
    found = json.loads(Path("results/compare.json").read_text())
    assert found["environment"] == "flapgym/NREL5MW-v0"
    assert found["settings"]["wind"] == {
        "gust": {"kind": "recorded", "file": "wind.csv"},
        "turbulence_intensity": pytest.approx(0.05),
        "length_scale": 80.0,
    }
    assert (found["slope"], found["duration_s"], found["wind_speed_m_per_s"]) == (4.0, 8.0, 11.0)
    with netcdf_file("series.nc", "r", mmap=False) as file:
        assert file.variables["rbm"].shape == (2, 1, round(8.0 / 0.007), 3)


def test_the_table_fits_into_the_terminal(run, monkeypatch):
    for columns in (80, 120):
        monkeypatch.setenv("COLUMNS", str(columns))
        _, out, _ = run("compare", "--agents", "pd", "--realisations", "2", "--duration", "2", "--channels")
        assert max(map(len, out.splitlines())) <= columns


@pytest.mark.parametrize(
    "arguments, parts",
    [
        (["--env", "flapgym/NREL5MW"], ["environment: expected one of 'flapgym/NREL5MW-v1'"]),
        (["--environment", "flapgym/NREL5MW-v1"], ["--environment"]),
        (["--wind-speed", "9"], ["wind_speed: expected 11 m/s", "got 9 m/s", "flapgym build"]),
        (["--wind-speed", "fast"], ["--wind-speed: expected a number from 1 to 100 m/s, got fast"]),
        (
            ["--turbulence-intensity", "14"],
            ["--turbulence-intensity: expected a fraction from 0 to 0.99, such as 0.14 or 14%, got 14"],
        ),
        (["--turbulence-intensity", "x%"], ["--turbulence-intensity", "x%"]),
        (["--length-scale", "0"], ["--length-scale: expected a number from 1 to 10000 m, got 0"]),
        (
            ["--env", "flapgym/NREL5MWSite-v0", "--length-scale", "50"],
            ["length_scale: expected none with a field of kind kaimal", "got 50 m"],
        ),
        (["--wind", "nowhere.csv"], ["wind nowhere.csv: no such file"]),
        (["--wind", "."], ["wind .: expected a regular file, got a folder"]),
        (["--box-shape", "2", "2", "2"], ["box_shape: expected none without a file of wind"]),
        (["--box-shape", "2", "2"], ["--box-shape"]),
        (["--slope", "0"], ["--slope: expected a number from 1 to 30, got 0"]),
        (
            ["--save-series", "series.csv"],
            ["save_series: expected a file that ends in .nc, got 'series.csv'"],
        ),
        (["--save-series", "no/series.nc"], ["no/series.nc: no folder no; make it first"]),
    ],
)
def test_a_flag_without_meaning_costs_one_line_that_names_it(run, arguments, parts):
    assert refused(run("compare", "--agents", "open_loop", "--duration", "5", *arguments), *parts)
    assert os.listdir() == []
