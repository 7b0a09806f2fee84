"""On a turbine nearly twice as large, with a flap and a wind of its own, no number of the NREL 5 MW is left."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from flapgym import cli
from flapgym.aeroelastic.build import build_model
from flapgym.envs import FlapEnv, FlapVectorEnv
from flapgym.envs.rendering import HUB, REACH, Screen
from flapgym.evaluation import compare
from flapgym.evaluation.report import as_json, as_markdown, as_text
from flapgym.model import load_model, save_model
from flapgym.structure.mode_plot import plot_modes
from flapgym.structure.modes import modes_table
from flapgym.structure.report import describe_modes
from flapgym.wrappers.servo import Servo
from tests.scaled import FACTOR, scaled_turbine, small_case

RADIUS, HUB_HEIGHT = 63.0 * FACTOR, 90.0 * FACTOR
STRAY = re.compile(
    r"nrel|\b5 ?MW|(?<![\d.])(?:63|126|90|87\.6|61\.5|147|11|11\.4|1\.267) ?(?:m\b|m/s|rad/s)", re.I
)
"""What the NREL 5 MW's own numbers look like in a text."""


@pytest.fixture(scope="module")
def model():
    return build_model(small_case(FACTOR, "large"))


@pytest.fixture(scope="module")
def silent(model):
    """The same, of a case that tells nothing of the machine."""
    return replace(model, case={"name": "large"})


@pytest.fixture
def drawn(monkeypatch):
    """Figures as they were when saved."""
    figures = []
    monkeypatch.setattr(Figure, "savefig", lambda self, *_, **__: figures.append(self))
    return figures


def told(capsys, *arguments):
    assert cli.main([str(argument) for argument in arguments]) == 0
    return capsys.readouterr().out


def test_a_model_grows_with_its_turbine_by_the_cubic_law(model):
    # Same wind and materials: moments go with the cube of the length, deflections and times with the length. What is
    # left, some 1e-3, is the reduction's, which weighs by frequencies of its own.
    small = build_model(small_case())
    assert model.rbm_rms == pytest.approx(FACTOR**3 * small.rbm_rms, rel=2e-3)
    assert model.rotor_speed == pytest.approx(small.rotor_speed / FACTOR)
    frequency = np.array([0.02, 0.1, 0.3, 0.6])
    ours = model.turbine.frequency_response(frequency / FACTOR)
    theirs = small.turbine.frequency_response(frequency)
    for output, power in (("rbm_0", 3), ("tip_deflection_0", 1), ("tower_fore_aft", 1)):
        row = model.turbine.outputs.index(output)
        for name in ("flap_angle_0", "wind"):
            column = model.turbine.inputs.index(name)
            np.testing.assert_allclose(
                np.abs(ours[:, row, column]), FACTOR**power * np.abs(theirs[:, row, column]), rtol=5e-3
            )


def test_info_names_turbine_radius_hub_height_airloads_and_where_the_flap_is(model, tmp_path, capsys):
    save_model(model, tmp_path / "large.safetensors")
    out = told(capsys, "info", tmp_path / "large.safetensors")
    assert "scaled15mw, rotor radius 120 m, hub height 171.4 m" in out
    assert "elastic axis published, lift slope sections, profile mean" in out
    inner, outer = flap_ends()
    assert f"from {inner:.1%} to {outer:.1%} of the rotor radius" in out
    assert f"length scale {105.0 * FACTOR:g} m" in out
    assert STRAY.search(out) is None


def test_build_tells_the_same_of_what_it_has_built(model, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(cli, "load_case", lambda _: small_case(FACTOR, "large"))
    monkeypatch.setattr(cli, "cached_model", lambda case, progress: model)
    monkeypatch.setattr(cli, "cached_path", lambda case: tmp_path)
    out = told(capsys, "build", "large.toml", "--output", tmp_path / "large.safetensors")
    assert told(capsys, "info", tmp_path / "large.safetensors") in out
    assert "scaled15mw" in out


def test_aero_names_turbine_and_radius(capsys, monkeypatch):
    monkeypatch.setattr(cli, "load_case", lambda _: small_case(FACTOR, "large"))
    out = told(capsys, "aero", "large.toml")
    assert "scaled15mw, rotor radius 120 m" in out
    assert STRAY.search(out) is None


def test_the_record_tells_this_turbine_s_readings(model):
    readings = " ".join(model.record.readings)
    assert f"EI {1e13 * FACTOR**4:g} N m^2" in readings
    assert f"roll axis {2.608e6 * FACTOR**5:g} kg m^2" in readings
    assert STRAY.search(readings) is None


def test_the_comparison_names_the_turbine_and_its_figure_ends_at_the_flap_s_stop(model, drawn):
    comparison = compare(["open_loop"], model, realisations=1, duration=4.0)
    for text in (as_text(comparison), as_markdown(comparison)):
        assert "scaled15mw, rotor radius 120 m" in " ".join(text.split())
        assert STRAY.search(text) is None
    about = as_json(comparison)["model"]
    assert (about["turbine"], about["rotor_radius_m"]) == ("scaled15mw", pytest.approx(RADIUS))
    assert about["hub_height_m"] == pytest.approx(HUB_HEIGHT, abs=1e-3)
    draw(comparison)
    (figure,) = drawn
    stop = np.rad2deg(model.flaps[0].angle_limit)
    (axis,) = (axis for axis in figure.axes if axis.get_ylabel() == "flap angle [deg]")
    assert axis.get_ylim() == pytest.approx((-1.1 * stop, 1.1 * stop))
    assert "scaled15mw" in figure.axes[0].get_title(loc="left")


def draw(comparison):
    from flapgym.evaluation.figure import draw_figure

    draw_figure(comparison)


def test_the_hint_for_another_wind_speed_starts_from_this_model_s_case(model):
    with pytest.raises(ValueError, match="wind_speed: model large was built for 9.5 m/s") as error:
        FlapEnv(model=model, wind_speed=8.0)
    assert 'base = "the case file that large was built from"' in str(error.value)
    assert STRAY.search(str(error.value)) is None


def test_the_hint_for_a_shipped_model_names_its_case():
    with pytest.raises(ValueError, match='with base = "nrel5mw-rated", name = "nrel5mw-rated-8mps"'):
        FlapEnv(model="nrel5mw-rated", wind_speed=8.0)


def test_a_model_that_only_has_a_shipped_name_is_no_shipped_case(model):
    with pytest.raises(ValueError, match='base = "the case file that nrel5mw-rated was built from"'):
        FlapEnv(model=replace(model, name="nrel5mw-rated"), wind_speed=8.0)


def gust_peak(model, **gust):
    """Largest perturbation an environment meets in an extreme operating gust."""
    env = FlapEnv(
        model=model,
        wind={"gust": {"kind": "extreme_operating_gust", **gust}, "turbulence_intensity": 0.0},
        duration=12.0,
        record_samples=True,
    )
    env.reset(seed=0)
    peak, ended = 0.0, False
    while not ended:
        _, _, _, ended, info = env.step(np.zeros(3))
        peak = max(peak, float(info["samples"]["wind"].max()))
    return peak


def standard_peak(diameter, height, mean):
    """0.74 V_gust of IEC 61400-1:2005, 6.3.2.2, classes I and A, below its yearly limit."""
    scale = 0.7 * min(60.0, height)
    return 0.74 * 3.3 * 0.16 * (0.75 * mean + 5.6) / (1.0 + 0.1 * diameter / scale)


def test_the_extreme_gust_is_that_of_this_rotor(model):
    assert gust_peak(model) == pytest.approx(standard_peak(2.0 * RADIUS, HUB_HEIGHT, 9.5), rel=1e-4)
    assert gust_peak(model, rotor_diameter=100.0) == pytest.approx(
        standard_peak(100.0, HUB_HEIGHT, 9.5), rel=1e-4
    )


def test_the_extreme_gust_on_a_low_turbine_has_its_shorter_scale():
    # The hub height counts below 60 m.
    low = load_model("nrel5mw-rated")
    tower = {**low.case["turbine"]["tower"]}
    tower["height"] = [0.5 * height for height in tower["height"]]
    low = replace(low, case={**low.case, "turbine": {**low.case["turbine"], "tower": tower}})
    hub = 0.5 * 87.6 + 90.0 - 87.6
    assert gust_peak(low) == pytest.approx(standard_peak(126.0, hub, 11.0), rel=1e-4)


def test_an_extreme_gust_on_a_turbine_of_unknown_size_is_refused(silent):
    with pytest.raises(
        ValueError, match=r"gust.rotor_diameter: the model's case does not tell it; give it in m"
    ):
        gust_peak(silent)
    assert gust_peak(silent, rotor_diameter=240.0, hub_height=170.0) == pytest.approx(
        standard_peak(240.0, 170.0, 9.5), rel=1e-4
    )


def flap_ends(first=11.75, start=0.4, end=0.65):
    """Ends of the flap over the rotor radius; the lattice begins at 11.75 m of the NREL 5 MW's 63 m."""
    return tuple((first + share * (63.0 - first)) / 63.0 for share in (start, end))


def flap_rows(model):
    """Radii over the rotor radius between which the flap of blade 1, upright and at its stop, is painted."""
    pytest.importorskip("pygame")
    screen = Screen(model, "rgb_array", 0.1, lambda: None)
    angle = np.array([model.flaps[0].angle_limit, 0.0, 0.0])
    screen.resume({"flap_angle": angle, "azimuth": 0.0}, 0)
    red = (screen.picture() == (200, 40, 40)).all(axis=2)[: int(HUB[1]), :310]
    rows = np.flatnonzero(red.any(axis=1))
    return (HUB[1] - rows.max()) / REACH, (HUB[1] - rows.min()) / REACH


def test_the_picture_has_the_flap_where_the_case_has_it(model):
    assert flap_rows(model) == pytest.approx(flap_ends(), abs=2.0 / REACH)
    assert flap_rows(load_model("nrel5mw-rated")) == pytest.approx(
        flap_ends(11.75, 0.7, 0.9), abs=2.0 / REACH
    )


def test_a_flap_of_unknown_place_is_shown_along_the_whole_blade(silent):
    assert flap_rows(silent) == pytest.approx((0.02, 1.0), abs=6.0 / REACH)  # the hub covers the root


def test_mode_plots_hold_the_whole_turbine(tmp_path, drawn):
    plot_modes(scaled_turbine(), tmp_path / "modes.png", 12)
    (figure,) = drawn
    for axes in figure.axes:
        points = np.hstack([np.asarray(line.get_data_3d()) for line in axes.lines])
        for reach, limits in zip(points, (axes.get_xlim(), axes.get_ylim(), axes.get_zlim()), strict=True):
            assert limits[0] <= reach.min()
            assert reach.max() <= limits[1]
        assert axes.get_zlim()[1] > HUB_HEIGHT + RADIUS
    assert "scaled15mw" in figure.get_suptitle()


def test_published_frequencies_stand_beside_no_other_turbine():
    text = describe_modes(scaled_turbine(), 12)
    assert STRAY.search(text) is None
    assert not any(word in text for word in ("FAST", "ADAMS", "paper", "Table 1", "Figure 9"))
    rows = modes_table(scaled_turbine(), 12)
    known = modes_table(scaled_turbine(1.0), 12)
    for ours, theirs in zip(rows, known, strict=True):
        assert (ours["paper"], ours["fast"], ours["adams"]) == (None, None, None)
        assert theirs["paper"] is not None, "by its numbers it is the NREL 5 MW, whatever its name"
        assert ours["frequency"] == pytest.approx(theirs["frequency"] / FACTOR, rel=1e-5)
        assert f"{ours['frequency']:.4f}" in text


def test_an_environment_has_the_case_s_turbulence_by_default(model):
    def winds(**settings):
        env = FlapVectorEnv(2, model=model, duration=3.0, record_samples=True, **settings)
        env.reset(seed=3)
        return env.step(np.zeros((2, 3)))[4]["samples"]["wind"]

    own = winds()
    np.testing.assert_array_equal(
        own, winds(wind={"turbulence_intensity": 0.14, "length_scale": 105.0 * FACTOR})
    )
    assert (own != winds(wind={"turbulence_intensity": 0.10})).any()
    assert (own != winds(wind={"length_scale": 147.0})).any()


def test_the_loads_of_a_large_turbine_are_observed_unclipped(model):
    env = FlapEnv(
        model=model,
        wind={"gust": {"kind": "step", "size": 30.0}, "turbulence_intensity": 0.0},
        task={"observe": ("rbm",)},
        record_samples=True,
    )
    env.reset(seed=0)
    for _ in range(20):
        observation, *_, info = env.step(np.zeros(3))
    last = info["samples"]["rbm"][-1] / 1e6
    assert (last > 60.0).all()
    np.testing.assert_allclose(observation, last, rtol=1e-5)


def test_a_model_whose_case_tells_nothing_says_so(silent, tmp_path, capsys):
    save_model(silent, tmp_path / "silent.safetensors")
    out = told(capsys, "info", tmp_path / "silent.safetensors")
    assert "turbine          not told by the model's case" in out
    assert "airloads         not told by the model's case" in out
    about = as_json(compare(["open_loop"], silent, realisations=1, duration=2.0))["model"]
    assert (about["turbine"], about["rotor_radius_m"], about["hub_height_m"]) == (None, None, None)


def test_a_case_of_before_there_were_airloads_still_tells_turbine_and_size(model, tmp_path, capsys):
    older = {key: value for key, value in model.case.items() if key != "airloads"}
    save_model(replace(model, case=older), tmp_path / "older.safetensors")
    out = told(capsys, "info", tmp_path / "older.safetensors")
    assert "scaled15mw, rotor radius 120 m, hub height 171.4 m" in out
    assert "airloads         not told by the model's case" in out


def test_a_sinusoid_the_model_s_samples_cannot_show_is_refused(model):
    # 0.03 s times the factor: half the sampling frequency is 8.75 Hz, where the shipped model has 71 Hz.
    with pytest.raises(ValueError, match=r"gust.frequency: expected at most 8.75 Hz.*, got 10 Hz"):
        FlapEnv(model=model, wind={"gust": {"kind": "sinusoid", "amplitude": 1.0, "frequency": 10.0}})
    FlapEnv(model=model, wind={"gust": {"kind": "sinusoid", "amplitude": 1.0, "frequency": 8.7}})


@pytest.mark.parametrize("lag", [0.05, 0.2])
def test_a_slow_flap_s_servo_crosses_both_stops_within_its_own_limits(lag):
    # A way of 40 deg at 100 deg/s^2: poles of the shipped flap's servo would ask for ten times as much.
    degree = np.pi / 180.0
    servo = Servo(100.0 * degree, 30.0 * degree, 20.0 * degree, 0.03, lag)
    angle, rate, acting = np.array([-20.0 * degree]), np.zeros(1), np.zeros(1)
    target, angles, rates = -angle, [], []
    for _ in range(600):
        command = servo(angle, rate, acting, target)
        for _ in range(30):  # finely: no sampling of the servo's own
            acting = acting + (command - acting) * (1.0 - np.exp(-0.001 / lag))
            rate = rate + 0.001 * acting
            angle = angle + 0.001 * rate
        angles.append(angle[0])
        rates.append(rate[0])
    assert angles[-1] == pytest.approx(target[0], abs=1e-3)
    assert max(angles) < target[0] * 1.01
    assert max(rates) < servo.rate_limit


def test_a_learner_s_tip_is_scaled_by_its_own_size(model):
    pytest.importorskip("stable_baselines3")
    from train.scaling import observation_scale

    small = build_model(small_case())
    ours, theirs = (observation_scale(("rbm", "tip_deflection"), each) for each in (model, small))
    np.testing.assert_allclose(ours, theirs / np.array([FACTOR**3, FACTOR]), rtol=5e-3)
    wind = model.turbulence_intensity * model.wind_speed
    assert 0.1 < ours[1] * wind * model.blade.dc_gain()[1, 2] < 10.0  # of order one
