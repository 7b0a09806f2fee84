"""Loads of every channel at several slopes against closed forms, and the table that tells them."""

import json

import numpy as np
import pytest

from flapgym.control import OpenLoop, PDGains, pd_agent
from flapgym.evaluation import (
    SCORED_SEED,
    Record,
    as_text,
    channel_loads,
    compare,
    damage_equivalent_load,
    damage_equivalent_loads,
    simulate,
    split,
    steady_loads,
)
from flapgym.evaluation.channels import ChannelLoads, score_channel
from flapgym.evaluation.record import unit_of
from flapgym.model import load_model
from flapgym.turbine.case import BLADE_LOADS, SPEED_SIGNALS, TOWER_LOADS
from tests.synthetic import FURTHER, synthetic_model

TIME_STEP = 0.01
TIME = TIME_STEP * np.arange(40_000)
MODEL = synthetic_model(further=True)
PD = pd_agent("pd", MODEL, PDGains(5e-8, 0.1, 0.1, 9.0, 0.8))
SLOPES = (3.0, 4.0, 5.0, 8.0, 10.0, 12.0)


def _record(rbm, **further):
    blades = np.asarray(rbm)[None, :, None] * np.array([1.0, 2.0, 3.0])
    still, fixed = np.zeros(blades.shape), np.zeros(blades.shape[:2])
    return Record(blades, still, still, still, fixed, fixed, fixed, np.zeros(1), TIME_STEP, further=further)


def test_what_a_speed_loop_tells_has_units_and_of_it_the_torque_alone_is_a_load():
    assert [unit_of(name) for name in SPEED_SIGNALS] == ["rad/s", "rad", "N m", "m/s"]
    signals = {name: np.ones((1, 50)) for name in SPEED_SIGNALS}
    found = channel_loads(_record(np.zeros(50), **signals), SLOPES)
    assert [each.channel for each in found] == ["rbm", "generator_torque"]


@pytest.mark.parametrize("frequency", [0.2, 1.0, 4.0])
def test_a_sinusoid_does_the_damage_of_its_cycles_at_every_slope(frequency):
    loads = damage_equivalent_loads(3e6 * np.sin(2.0 * np.pi * frequency * TIME), TIME_STEP, SLOPES)
    # Range times (cycles over those of 1 Hz)^(1/m).
    np.testing.assert_allclose(loads, [6e6 * frequency ** (1.0 / m) for m in SLOPES], rtol=3e-3)


def test_a_slow_cycle_and_the_fast_ones_on_it_do_their_damage_together():
    """Fast cycles of amplitude 1 on slow ones of amplitude 5, 50 on each: in 400 s, 8 of range 12, the rest of 2.

    A fast crest stands on the slow trough, so that the lowest point lies half a fast cycle beside it, at -5.990. Fast
    cycles have less than their range where the slow one is steep, which shows at slope 3.
    """
    series = np.cos(2.0 * np.pi * TIME) + 5.0 * np.cos(2.0 * np.pi * 0.02 * TIME)
    loads = damage_equivalent_loads(series, TIME_STEP, SLOPES)
    expected = [((8.0 * 12.0**m + 392.0 * 2.0**m) / 400.0) ** (1.0 / m) for m in SLOPES]
    np.testing.assert_allclose(loads, expected, rtol=2e-2)


def test_each_slope_is_that_of_the_load_counted_for_it_alone():
    series = np.random.default_rng(1).standard_normal(5000)
    together = damage_equivalent_loads(series, TIME_STEP, SLOPES)
    assert together.tolist() == [damage_equivalent_load(series, TIME_STEP, slope) for slope in SLOPES]


def test_every_channel_of_a_record_has_its_rms_and_its_loads_blade_by_blade():
    wave = np.sin(2.0 * np.pi * TIME)
    edge = 7.0 * wave[None, :, None] * np.ones(3)
    found = channel_loads(_record(2.0 * wave, rbm_edge=edge, tower_base_fore_aft=5.0 * wave[None]))
    assert [(each.channel, each.unit) for each in found] == [
        ("rbm", "N m"),
        ("rbm_edge", "N m"),
        ("tower_base_fore_aft", "N m"),
    ]
    for loads, amplitude in zip(found, ([[2.0, 4.0, 6.0]], [[7.0] * 3], [[5.0]]), strict=True):
        np.testing.assert_allclose(loads.rms, np.array(amplitude) / np.sqrt(2.0), rtol=1e-9)
        np.testing.assert_allclose(
            loads.equivalent, np.broadcast_to(2.0 * np.array(amplitude), loads.equivalent.shape), rtol=3e-3
        )
        assert loads.equivalent.shape == (len(SLOPES), 1, len(amplitude[0]))


def test_loads_scale_with_the_record():
    series = np.random.default_rng(2).standard_normal(4000)
    (one,), (seven,) = (channel_loads(_record(scale * series)) for scale in (1.0, 7.0))
    np.testing.assert_allclose(seven.equivalent, 7.0 * one.equivalent, rtol=1e-12)


def test_every_load_a_model_may_tell_has_a_unit():
    assert {unit_of(name) for name in ("rbm", *BLADE_LOADS, *TOWER_LOADS, "flapwise_moment_25")} == {"N m"}
    assert {unit_of(name) for name in ("deflection_50", "tip_deflection")} == {"m"}
    assert unit_of("brightness") == ""


def test_damage_summed_over_blades_and_realisations_is_not_the_mean_of_ratios():
    ours = ChannelLoads("rbm", "N m", np.ones((2, 1)), (2.0,), np.array([[[1.0], [3.0]]]))
    reference = ChannelLoads("rbm", "N m", np.ones((2, 1)), (2.0,), np.array([[[2.0], [3.0]]]))
    (at,) = score_channel(ours, reference).slopes
    assert at.summed_change.mean == pytest.approx(np.sqrt((1.0 + 9.0) / (4.0 + 9.0)) - 1.0)
    assert at.change.mean == pytest.approx(-0.25)
    assert at.equivalent_load == pytest.approx(np.sqrt((1.0 + 9.0) / 2.0))
    assert at.summed_change.low == pytest.approx(-0.5)
    assert at.summed_change.high == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("further", "slopes", "text"),
    [
        ({"yaw": np.zeros((1, 7))}, SLOPES, r"record.further\['yaw'\]: expected shape"),
        ({"yaw": np.full((1, 4), np.nan)}, SLOPES, r"record.further\['yaw'\]: expected a finite number"),
        ({}, (3.0, -1.0), r"slopes\[1\]: expected 0 < number, got -1"),
        ({}, (), "slopes: expected a list of one or more"),
    ],
)
def test_channels_without_loads_are_refused(further, slopes, text):
    with pytest.raises(ValueError, match=text):
        channel_loads(_record(np.arange(4.0), **further), slopes)


def test_a_record_has_the_model_s_further_outputs_as_its_matrices_give_them():
    """The tilt of this model is a combination of the moments' cosine component and the tower's displacement."""
    record = simulate(OpenLoop(), MODEL, [4], 3.0)
    assert list(record.further) == [name for name, of_blades in FURTHER if of_blades] + ["tilt", "yaw"]
    azimuth = record.azimuth[0] + MODEL.rotor_speed * MODEL.time_step * (1 + np.arange(record.rbm.shape[1]))
    angle = azimuth[:, None] + 2.0 * np.pi / 3.0 * np.arange(3)
    cosine = 2.0 / 3.0 * (record.rbm[0] * np.cos(angle)).sum(axis=1)
    tilt = cosine + 1e6 * record.tower_fore_aft[0]
    np.testing.assert_allclose(record.further["tilt"][0], tilt, atol=1e-9 * np.abs(tilt).max())


def test_the_second_table_tells_every_channel_and_the_first_stays_as_it_is(tmp_path):
    plain = compare([PD], MODEL, realisations=2, duration=10.0)
    scored = compare([PD], MODEL, realisations=2, duration=10.0, output=tmp_path, channels=True)
    assert not plain.channels
    assert as_text(scored).startswith(as_text(plain))
    assert scored.scores == plain.scores
    agents = json.loads((tmp_path / "compare.json").read_text())["agents"]
    names = ["rbm", "tip_speed", "hinge", "tilt", "yaw"]
    assert [each["channel"] for each in agents["pd"]["channels"]] == names
    moment = agents["pd"]["channels"][0]
    (at,) = [each for each in moment["slopes"] if each["slope"] == 10.0]
    # The same loads as in the table above.
    assert at["change"] == agents["pd"]["rbm_del_change"]
    assert at["summed_change"] == agents["pd"]["rbm_del_summed_change"]
    assert at["equivalent_load"] == agents["pd"]["rbm_del_Nm"]
    assert f"{at['equivalent_load'] / 1e6:.3f} MN m" in as_text(scored)
    assert "| tilt | 12 | pd |" in (tmp_path / "compare.md").read_text()


def test_channels_scored_in_parts_are_those_of_all_realisations(monkeypatch):
    whole = compare([PD], MODEL, realisations=2, duration=5.0, seed=SCORED_SEED, channels=True)
    monkeypatch.setattr("flapgym.evaluation.comparison.TOGETHER", 1.0)
    parts = compare([PD], MODEL, realisations=2, duration=5.0, seed=SCORED_SEED, channels=True)
    for ours, theirs in zip(whole.channels["pd"], parts.channels["pd"], strict=True):
        assert ours.rms == pytest.approx(theirs.rms)
        for one, other in zip(ours.slopes, theirs.slopes, strict=True):
            assert one.summed_change.mean == pytest.approx(other.summed_change.mean)


def test_all_loads_and_turbulence_alone_are_those_of_their_series():
    gravity, gust = 4.0 * np.sin(2.0 * np.pi * 0.2 * TIME), 0.5 * np.sin(2.0 * np.pi * TIME)
    parts = split(gravity + gust, gravity, TIME_STEP, [3.0, 10.0])
    assert parts.turbulence_rms == pytest.approx(0.5 / np.sqrt(2.0))
    assert parts.all_rms == pytest.approx(np.hypot(4.0, 0.5) / np.sqrt(2.0))
    np.testing.assert_allclose(parts.turbulence_equivalent, [1.0, 1.0], rtol=3e-3)
    assert (parts.all_equivalent > 4.0).all()


def test_a_flap_that_cancels_gravity_is_given_no_credit_in_turbulence():
    gravity, gust = 4.0 * np.sin(2.0 * np.pi * 0.2 * TIME), 0.5 * np.sin(2.0 * np.pi * 1.1 * TIME)
    still = split(gravity + gust, gravity, TIME_STEP)
    flapping = split(0.5 * gravity + gust, gravity, TIME_STEP)
    assert flapping.all_rms < 0.6 * still.all_rms
    assert flapping.turbulence_rms > still.turbulence_rms
    assert (flapping.turbulence_equivalent > still.turbulence_equivalent).all()


SITE = "flapgym/NREL5MWSite-v0"
FIELD = {"kind": "kaimal", "turbulence_class": "B"}
INFLOW = {"shear_exponent": 0.2, "tower_shadow": True}


@pytest.fixture(scope="module")
def site_model():
    return load_model("nrel5mw-site")


def test_steady_loads_are_those_of_a_turbine_in_steady_wind(site_model):
    settings = {"wind": {"inflow": INFLOW, "turbulence_intensity": 0.0}, "gravity": True}
    record = simulate(OpenLoop(), site_model, [3, 4], 2.0, **settings)
    found = steady_loads(site_model, record.azimuth, record.rbm.shape[1], **settings)
    for name, series in {"rbm": record.rbm, **record.further}.items():
        np.testing.assert_allclose(found[name], series, atol=1e-9 * np.abs(series).max())


def test_nothing_is_steady_where_turbulence_alone_loads_the_turbine(site_model):
    assert steady_loads(site_model, np.zeros(1), 5, wind={"field": FIELD}) == {}


@pytest.mark.parametrize(
    ("azimuth", "samples", "settings", "message"),
    [
        ([[0.0]], 5, {}, "steady_loads.azimuth: expected"),
        ([np.nan], 5, {}, "steady_loads.azimuth: expected"),
        ([0.0], 0, {}, "steady_loads.samples: expected"),
        ([0.0], 5, {"gravity": True}, "gravity: expected a model with gravity as an input"),
    ],
)
def test_steady_loads_of_nothing_sensible_are_refused(azimuth, samples, settings, message):
    with pytest.raises(ValueError, match=message):
        steady_loads(MODEL, azimuth, samples, **settings)


def test_turbulence_alone_at_a_site_is_what_its_field_does_without_shear_tower_and_weight(site_model):
    record = simulate(OpenLoop(), site_model, [7], 10.0, wind={"field": FIELD})
    (alone,) = [each for each in channel_loads(record) if each.channel == "rbm_edge"]
    scored = compare([], environment=SITE, realisations=1, seed=7, duration=10.0, channels=True)
    (site,) = [each for each in scored.channels["open_loop"] if each.channel == "rbm_edge"]
    assert site.turbulence.rms == pytest.approx(alone.rms.mean(), rel=1e-9)
    told = [at.equivalent_load for at in site.turbulence.slopes]
    counted = [
        np.mean(loads**slope) ** (1 / slope) for slope, loads in zip(SLOPES, alone.equivalent, strict=True)
    ]
    np.testing.assert_allclose(told, counted, rtol=1e-9)
    # Weight is most of the edgewise moment.
    assert site.rms > 2.0 * site.turbulence.rms


def test_the_table_and_the_file_tell_turbulence_alone_beside_all_loads(tmp_path):
    scored = compare([], environment=SITE, realisations=1, duration=2.0, output=tmp_path, channels=True)
    header = next(line for line in as_text(scored, 1000).splitlines() if line.startswith("channel"))
    for column in ("DEL", "DEL [%]", "DEL, damage summed [%]"):
        assert f"all loads: {column}" in header
        assert f"turbulence alone: {column}" in header
    entry = json.loads((tmp_path / "compare.json").read_text())["agents"]["open_loop"]["channels"][0]
    assert entry["turbulence_alone"]["unit"] == entry["unit"] == "N m"
    assert entry["turbulence_alone"]["rms"] == scored.channels["open_loop"][0].turbulence.rms
    assert [at.keys() for at in entry["turbulence_alone"]["slopes"]] == [at.keys() for at in entry["slopes"]]


def test_without_anything_steady_nothing_is_told_apart(tmp_path):
    scored = compare([], MODEL, realisations=1, duration=2.0, output=tmp_path, channels=True)
    assert "turbulence alone" not in as_text(scored).lower()
    assert "turbulence_alone" not in (tmp_path / "compare.json").read_text()


def test_a_channel_without_its_steady_part_is_refused():
    with pytest.raises(ValueError, match="steady: expected an entry for rbm, got tilt"):
        channel_loads(_record(np.arange(4.0)), SLOPES, {"tilt": np.zeros((1, 4))})


def test_each_series_of_many_is_split_by_itself():
    rng = np.random.default_rng(5)
    total, periodic = rng.standard_normal((2, 2, 3, 500))
    parts = split(total, periodic, TIME_STEP, [4.0])
    assert parts.all_equivalent.shape == (1, 2, 3)
    alone = split(total[1, 2], periodic[1, 2], TIME_STEP, [4.0])
    assert parts.turbulence_equivalent[0, 1, 2] == alone.turbulence_equivalent[0]


@pytest.mark.parametrize(
    ("slopes", "text"),
    [
        ((3.0, 0.0), r"slopes\[1\]: expected 0 < number, got 0"),
        ((), "slopes: expected a list of one or more"),
    ],
)
def test_slopes_that_are_none_are_refused(slopes, text):
    with pytest.raises(ValueError, match=text):
        damage_equivalent_loads([0.0, 1.0, 0.0], TIME_STEP, slopes)


def test_a_deterministic_part_of_another_length_is_refused():
    with pytest.raises(
        ValueError, match=r"split.deterministic: expected shape \(5,\), as of the total, got \(4,\)"
    ):
        split(np.zeros(5), np.zeros(4), TIME_STEP)
