"""The studies of the turbine model on a coarse case: that they run, and that what they print is what they say."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks import conventions
from benchmarks.turbine import __main__ as program
from benchmarks.turbine.__main__ import main
from benchmarks.turbine.accuracy import errors, reduced_against_full, signals
from benchmarks.turbine.building import builds, newmark_gap, sway
from benchmarks.turbine.campbell import modes_at
from benchmarks.turbine.speed import Subject, assembled, seconds_per_step
from flapgym.aeroelastic.build import build_model
from flapgym.aeroelastic.equations import periodic_equations
from flapgym.aeroelastic.periodic import periodic_model
from flapgym.model import load_model
from flapgym.turbine import load_case
from flapgym.wind import von_karman_spectrum
from studies import bode
from studies.parts import Study, with_modes, with_tower
from studies.tables import deviation_table, towers_table
from studies.tips import TIPS, exact_rms, simulate_tips


@pytest.fixture(scope="module")
def study():
    case = load_case("nrel5mw-rated")
    grid = replace(case.discretisation, chordwise_panels=3, wake_length=0.05)
    reduction = replace(case.reduction, blade_modes=4, tower_modes=6, aerodynamic_states=15)
    return Study(replace(case, discretisation=grid, reduction=reduction))


def rows_of(printed):
    """Cells of the Markdown rows, without the heads."""
    lines = [line for line in printed.splitlines() if line.startswith("|") and "---" not in line]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def test_softer_tower_moves_its_frequencies_by_the_root_of_three(study):
    own, softer = (
        np.sqrt(np.linalg.eigvalsh(parts.modal_support[0][2])[:2])
        for parts in (study.parts, with_tower(study.parts, 1.0 / 3.0))
    )
    np.testing.assert_allclose(softer / own, 1.0 / np.sqrt(3.0), rtol=0.01)


def test_other_modes_leave_the_first_ones_as_they_are(study):
    more = with_modes(study.parts, study.rotor, 6, 8)
    np.testing.assert_allclose(more.frequency[:4], study.parts.frequency, rtol=1e-9)
    assert more.lattice.modes == 6


@pytest.fixture
def coarse(monkeypatch):
    monkeypatch.setattr(bode, "FREQUENCY", np.geomspace(0.1, 10.0, 60))
    monkeypatch.setattr(bode, "TOTALS", (30, 45))
    monkeypatch.setattr(bode, "FEW_MODES", (3, 5))
    monkeypatch.setattr(bode, "ALL_MODES", (6, 8))


@pytest.mark.parametrize(("figure", "curves"), [("figure10", 4), ("figure13", 3), ("figure14", 3)])
def test_frequency_responses_are_tabled_and_drawn(study, coarse, figure, curves, tmp_path, capsys):
    program.PROGRAMS[figure](study, tmp_path, lambda stage: None)
    assert (tmp_path / f"{figure}.png").stat().st_size > 10_000
    assert len(rows_of(capsys.readouterr().out)) == 1 + curves


def test_tables_say_what_the_curves_hold(study, coarse):
    curves = bode.towers(study, lambda stage: None)
    change = bode.decibel(curves[bode.SOFT]) - bode.decibel(curves[bode.RIGID])
    low, high = bode.TOWER_BANDS[0]
    inside = (curves.frequency >= low) & (curves.frequency <= high)
    mark = next(mark for mark in bode.tower_marks(curves) if mark.name == bode.SOFT)
    assert abs(mark.change[0]) == np.abs(change[inside]).max()
    assert change[curves.frequency == mark.frequency[0]] == mark.change[0]
    row = next(row for row in towers_table(curves).rows if row[0] == bode.SOFT)
    assert row[1] == f"{mark.change[0]:+.1f} at {mark.frequency[0]:.2f} Hz"
    *_, full = deviation_table(curves).rows
    assert full[0] == curves.names[0]


def test_parked_structure_rings_at_its_natural_frequencies(study, monkeypatch):
    """Table 1: first tower fore-aft at 0.321 Hz, first collective flap at 0.726 Hz."""
    monkeypatch.setattr(bode, "FREQUENCY", np.arange(0.25, 0.9, 0.002))
    response = bode.parked_tip(study)
    peaks = bode.FREQUENCY[bode.resonances(response)]
    assert np.abs(peaks - 0.321).min() < 0.005
    assert np.abs(peaks - 0.726).min() < 0.01


def test_input_signals_start_from_rest_and_rates_are_those_of_the_angles(study):
    made = signals(study, 400)
    flaps, step = made["flaps"], study.time_step
    assert not made["gust"][:, :6].any()
    assert not flaps[0, :3].any()
    moved = np.cumsum(0.5 * step * (flaps[1:, 3:6] + flaps[:-1, 3:6]), axis=0)
    np.testing.assert_allclose(moved, flaps[1:, :3], atol=2e-3 * np.abs(flaps[:, :3]).max())


def test_errors_are_relative_and_of_the_worst_blade():
    full = np.random.default_rng(0).standard_normal((50, 8))
    ours = full.copy()
    ours[:, 4] *= 1.1
    assert errors(full, full) == [0.0] * 4
    np.testing.assert_allclose(errors(ours, full), [0.0, 0.1, 0.0, 0.0], atol=1e-12)


def test_reduced_forms_follow_the_march_and_table_and_assembly_are_one(study, capsys):
    equations, lattice = periodic_equations(study.parts), study.seen(0.0)
    azimuths = periodic_model(equations, lattice, study.time_step, 734)
    reduced_against_full(study, azimuths, lambda stage: None, steps=150)
    rows = rows_of(capsys.readouterr().out)[1:]
    assert len(rows) == 6
    assert all(float(row[2]) < 3.0 for row in rows)  # 45 states of a coarse lattice
    u = signals(study, 60)["flaps"]
    table, anew = azimuths.simulate(u, 0.3), assembled(study, u, 1)
    np.testing.assert_allclose(table, anew, atol=2e-2 * np.abs(anew[:, :3]).max())


def test_time_of_a_step_is_the_difference_of_long_and_short_run():
    subject = Subject("sleeper", 1, lambda n: None, steps=10, turbines=2)
    assert seconds_per_step(subject, [(1.0, 9.0), (2.0, 7.0)]) == pytest.approx(6.0 / 60.0)


def test_tips_rms_is_the_integral_of_the_spectrum_over_frequency():
    model = load_model("nrel5mw-rated")
    frequency = np.geomspace(1e-4, 20.0, 700)
    response = model.turbine.select(inputs=["wind"], outputs=TIPS).frequency_response(frequency)[:, :, 0]
    power = np.abs(response) ** 2 * von_karman_spectrum(frequency, 11.0, 0.10, 147.0)[:, None]
    mean, cosine, sine = np.trapezoid(power, frequency, axis=0) + power[0] * frequency[0]
    blade, apart = exact_rms(model)
    assert blade == pytest.approx(np.sqrt(mean + 0.5 * (cosine + sine)), rel=5e-3)
    assert apart == pytest.approx(np.sqrt(0.5 * (cosine + sine)), rel=2e-2)


def test_blades_part_in_turbulence_by_a_few_percent():
    """Figure 11: "altered slightly from one another"."""
    turns, wind, tips = simulate_tips(load_model("nrel5mw-rated"), 3, seed=2)
    assert turns[-1] == pytest.approx(3.0, abs=0.01)
    apart = np.abs(tips - tips.mean(axis=1, keepdims=True)).max()
    assert 0.01 < apart / np.abs(tips).max() < 0.3
    assert len(wind) == len(tips)


def test_modes_at_another_speed_are_trimmed_and_named_there(study):
    speed, modes, radius = modes_at(study, 6.0)
    assert speed == pytest.approx(6.0 / 7.0 * study.case.rotor_speed)
    assert radius < 1.0
    assert {"flap 1 backward", "edge 1 forward", "tower fore-aft 1"} <= {mode.name for mode in modes}


def test_unknown_part_is_named_before_any_work(capsys):
    assert main(["figure12"]) == 2
    assert "figure12" in capsys.readouterr().err


def test_a_heavy_blade_built_in_a_process_of_its_own_is_the_same_model_and_throws_the_tower_sideways(study):
    case = study.case
    blades = replace(case.blades, mass_factor=(1.0, 1.0, 1.02))
    grid = replace(case.discretisation, chordwise_panels=2, time_step=0.02)
    reduction = replace(case.reduction, blade_modes=3, tower_modes=4, aerodynamic_states=6)
    case = replace(case, blades=blades, discretisation=grid, reduction=reduction)
    (of,) = builds([case])
    assert of.model.hash == build_model(case).hash
    assert of.model.record.flutter is not None
    assert of.seconds > 0.0
    assert 0.05 < of.memory < 2.0
    downwind, sideways = sway(of.model)
    assert 0.0 < downwind < sideways


def test_gap_of_newmark_s_rule_in_two_coordinates_is_small_but_there(study):
    for gap in newmark_gap(study, 150).values():
        assert 0.0 < max(gap) < 0.01


def test_the_picture_of_the_conventions_is_drawn(tmp_path):
    assert conventions.main([str(tmp_path)]) == 0
    assert (tmp_path / "conventions.png").read_bytes().startswith(b"\x89PNG")
