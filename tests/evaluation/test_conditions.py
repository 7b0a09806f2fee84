"""Agents are compared in the wind that is asked for: another model of a set, turbulence, a recording, a box."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.io import netcdf_file

from flapgym.control import OpenLoop, PDGains, pd_agent
from flapgym.evaluation import as_text, compare, plan, simulate
from flapgym.evaluation.conditions import chosen_model, chosen_wind, lasts
from flapgym.evaluation.report import as_json
from flapgym.evaluation.simulate import longest_duration
from flapgym.model import ModelSet, load_model, save_model_set
from flapgym.model.nameplate import nameplate
from tests.synthetic import synthetic_model

MODEL = synthetic_model()
PD = pd_agent("pd", MODEL, PDGains(5e-8, 0.1, 0.1, 9.0, 0.8))
SITE, FIELD = "flapgym/NREL5MWSite-v0", "flapgym/NREL5MWField-v0"


@pytest.fixture
def recording(tmp_path):
    """Eight seconds of wind that rises by a quarter of a m/s each second, from the mean on."""
    path = tmp_path / "wind.csv"
    path.write_text(
        "time [s], wind [m/s]\n" + "".join(f"{t}, {MODEL.wind_speed + 0.25 * t}\n" for t in range(9))
    )
    return path


@pytest.fixture
def box(tmp_path):
    """Twenty seconds of a wind that is the same over the disk, a sine of 4 s about 11 m/s."""
    places, time = np.linspace(-65.0, 65.0, 14), 0.25 * np.arange(80)
    hub = nameplate(load_model("nrel5mw-site").case).hub_height
    axes = {"time": (time, "s"), "y": (places, "m"), "z": (hub + places, "m")}
    with netcdf_file(tmp_path / "box.nc", "w") as file:
        for name, (values, unit) in axes.items():
            file.createDimension(name, len(values))
            variable = file.createVariable(name, "f8", (name,))
            variable[:], variable.units = values, unit
        variable = file.createVariable("u", "f8", ("time", "y", "z"))
        variable[:] = 11.0 + 0.5 * np.sin(2.0 * np.pi * time / 4.0)[:, None, None] * np.ones((1, 14, 14))
        variable.units = "m/s"
    return tmp_path / "box.nc"


def test_a_set_gives_its_model_at_the_wind_speed(tmp_path):
    path = tmp_path / "set.safetensors"
    slow = replace(MODEL, wind_speed=7.0, name="at 7")
    save_model_set(ModelSet.of([MODEL, slow]), path)
    assert chosen_model(path, 7.0).name == "at 7"
    assert plan([], path, wind_speed=7.0).model.wind_speed == 7.0
    for given in (None, 8.0):
        with pytest.raises(
            ValueError, match=r"^wind_speed: expected one of 7, 11 m/s, for which .*set.safeten"
        ):
            chosen_model(path, given)


def test_a_single_model_is_for_its_wind_speed_alone():
    assert chosen_model(MODEL, 11.0) is MODEL
    with pytest.raises(
        ValueError, match="^wind_speed: expected 11 m/s, for which the model .* got 9 m/s; name a set"
    ):
        chosen_model(MODEL, 9.0)


def test_an_environment_is_flown_on_another_model_of_its_kind():
    planned = plan([], "nrel5mw-three-flaps", environment=SITE, duration=5.0)
    assert planned.model.name == "nrel5mw-three-flaps"
    assert planned.settings["gravity"]


def test_twice_the_turbulence_intensity_is_twice_the_load():
    """The turbine is linear: with flaps at rest every load goes with the wind."""
    weak, strong = (
        compare([], MODEL, realisations=1, duration=20.0, turbulence_intensity=intensity)
        for intensity in (0.05, 0.1)
    )
    ratio = strong.scores["open_loop"].rbm_rms / weak.scores["open_loop"].rbm_rms
    assert ratio == pytest.approx(2.0, rel=1e-9)
    assert "turbulence intensity 5 %" in as_text(weak)
    assert as_json(weak)["settings"] == {"wind": {"turbulence_intensity": 0.05}}


def test_longer_eddies_turn_over_slower():
    """By von Karman's spectrum the share of fast wind falls with the length; crossings of zero tell it."""

    def crossings(length):
        planned = plan([], MODEL, length_scale=length, realisations=3, duration=60.0)
        wind = simulate(OpenLoop(), planned.model, planned.seeds, 60.0, **planned.settings).wind
        return np.count_nonzero(np.diff(np.sign(wind), axis=1))

    assert crossings(20.0) > 2 * crossings(400.0)


def test_intensity_and_length_go_to_the_field_of_an_environment():
    assert plan(
        [], environment=FIELD, duration=5.0, turbulence_intensity=0.2, length_scale=60.0
    ).settings == {
        "wind": {"field": {"kind": "von_karman", "turbulence_intensity": 0.2, "length_scale": 60.0}}
    }
    given = {"field": {"kind": "kaimal"}, "inflow": {"shear_exponent": 0.2}}
    assert chosen_wind(given, turbulence_intensity=0.2) == {
        "field": {"kind": "kaimal", "turbulence_intensity": 0.2},
        "inflow": {"shear_exponent": 0.2},
    }


def test_a_recording_is_the_wind_that_every_agent_meets(recording):
    planned = plan([PD], MODEL, wind=recording, realisations=2, series=True)
    # By default as long as the file lasts, less one action.
    assert 7.8 < planned.duration < 8.0
    comparison = compare([PD], MODEL, wind=recording, realisations=1, duration=7.0)
    wind = comparison.records["pd"].wind[0]
    time = MODEL.time_step * np.arange(1, wind.size + 1)
    np.testing.assert_allclose(wind, 0.25 * time, atol=1e-9)
    assert f"file {recording}" in as_text(comparison, 1000)


def test_turbulence_is_added_to_a_recording_where_it_is_asked_for(recording):
    alone, both = (
        simulate(OpenLoop(), MODEL, [1], 5.0, wind=chosen_wind({}, wind=recording, **asked)).wind
        for asked in ({}, {"turbulence_intensity": 0.1})
    )
    assert np.std(both - alone) > 0.2


def test_a_recording_takes_the_place_of_a_field_and_leaves_what_is_steady(recording):
    planned = plan([], environment=SITE, wind=recording)
    assert planned.settings["wind"] == {
        "inflow": {"shear_exponent": 0.2, "tower_shadow": True},
        "gust": {"kind": "recorded", "file": str(recording)},
        "turbulence_intensity": 0.0,
    }
    assert planned.settings["gravity"]


def test_a_box_is_told_by_its_content_and_flown_through(box):
    unnamed = box.rename(box.with_suffix(""))
    planned = plan([], "nrel5mw-site", wind=unnamed, realisations=1)
    assert planned.settings["wind"] == {"field": {"kind": "box", "file": str(unnamed)}}
    # 19.75 s between the first and the last plane, less what an episode is longer.
    assert 19.0 < planned.duration < 19.75
    record = simulate(OpenLoop(), planned.model, [3], 8.0, **planned.settings)
    amplitude = np.sqrt(2.0) * np.std(record.wind[0])
    assert amplitude == pytest.approx(0.5, rel=0.05)


def test_what_varies_in_a_box_is_scaled_to_the_intensity(box):
    given = chosen_wind({}, wind=box, turbulence_intensity=0.1)
    model = load_model("nrel5mw-site")
    record = simulate(OpenLoop(), model, [3], 8.0, wind=given)
    assert np.std(record.wind[0]) == pytest.approx(0.1 * 11.0, rel=0.05)


def test_a_hawc2_box_is_read_by_its_shape_and_spacing(tmp_path):
    shape, spacing = (64, 14, 14), (4.0, 10.0, 10.0)
    np.ones(shape, "<f4").tofile(tmp_path / "u.bin")
    planned = plan([], "nrel5mw-site", wind=tmp_path / "u.bin", box_shape=shape, box_spacing=spacing)
    model = planned.model
    # Planes 4 m apart pass at the mean wind.
    assert lasts(planned.settings["wind"], model) == pytest.approx(63 * 4.0 / 11.0)


@pytest.mark.parametrize("settings", [{}, {"wind": {"field": {"kind": "von_karman"}}}], ids=["gust", "field"])
def test_the_longest_duration_is_the_longest_that_fits(settings):
    """Whole actions of each agent, and one more: what is longer by an action needs more wind than there is."""
    agents, lasting = [PD, OpenLoop(), replace(PD, name="other")], 8.0
    found = longest_duration(agents, MODEL, lasting, settings)
    step = MODEL.time_step * PD.steps_per_action
    assert lasting - 2.0 * step < found <= lasting - step + 1e-9


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"turbulence_intensity": 1.0}, "turbulence_intensity: expected 0 <= fraction < 1, got 1"),
        ({"turbulence_intensity": "strong"}, "turbulence_intensity: expected a fraction"),
        ({"length_scale": 0.1}, "wind.length_scale: expected a length from 1 to 100000 m, got 0.1 m"),
        ({"wind": "nowhere.csv"}, "wind nowhere.csv: no such file"),
        ({"box_shape": (2, 2, 2)}, "box_shape: expected none without a file of wind, got"),
        ({"slope": 0.5}, "slope: expected a number from 1 to 30, got 0.5"),
        (
            {"environment": SITE, "length_scale": 50.0},
            "length_scale: expected none with a field of kind kaimal",
        ),
    ],
)
def test_what_has_no_meaning_in_a_wind_is_refused_by_name(asked, message):
    with pytest.raises((ValueError, FileNotFoundError), match=message):
        plan([], **({"duration": 5.0} | ({} if "environment" in asked else {"model": MODEL}) | asked))


def test_a_wind_that_is_too_short_or_of_no_kind_is_refused_in_one_line(tmp_path, recording, box):
    with pytest.raises(
        ValueError, match=r"^duration: expected from 1 to 7\.\d+ s, as .* lasts 8 s .*, got 9 s$"
    ):
        plan([PD], MODEL, wind=recording, duration=9.0)
    short = tmp_path / "short.csv"
    short.write_text("time [s], wind [m/s]\n0, 11\n0.5, 12\n")
    with pytest.raises(
        ValueError, match=r"^duration: expected another file, as .* lasts 0.5 s .*, got none$"
    ):
        plan([PD], MODEL, wind=short)
    (tmp_path / "raw").write_bytes(bytes(range(256)))
    with pytest.raises(
        ValueError, match="expected a recording in text, TurbSim's .bts or NetCDF, got another kind"
    ):
        plan([], MODEL, wind=tmp_path / "raw")
    with pytest.raises(ValueError, match="field.spacing: missing beside field.shape"):
        plan([], "nrel5mw-site", wind=box, box_shape=(64, 14, 14))
    with pytest.raises(ValueError, match="wind.field: expected a model with winds by strip"):
        plan([], wind=box)
    (tmp_path / "table.csv").write_text("brightness [cd]\n1\n")
    with pytest.raises(ValueError, match=r"table.csv, line 1: expected a header of two columns"):
        plan([], MODEL, wind=tmp_path / "table.csv")
    with pytest.raises(ValueError, match="length_scale: expected none without turbulence"):
        plan([], MODEL, wind=recording, length_scale=50.0)


def test_the_slope_is_that_of_every_scored_damage(tmp_path):
    steep, flat = (compare([PD], MODEL, realisations=2, duration=10.0, slope=slope) for slope in (10.0, 4.0))
    channels = compare([PD], MODEL, realisations=2, duration=10.0, channels=True, output=tmp_path)
    by_slope = {each.slope: each for each in channels.channels["pd"][0].slopes}
    for found, slope in ((steep, 10.0), (flat, 4.0)):
        assert found.scores["pd"].rbm_del == pytest.approx(by_slope[slope].equivalent_load)
        assert found.scores["pd"].rbm_del_change == by_slope[slope].change
        assert found.scores["pd"].rbm_del_summed_change == by_slope[slope].summed_change
    assert "S-N slope 4," in as_text(flat, 1000)
    assert json.loads((tmp_path / "compare.json").read_text())["slope"] == 10.0
