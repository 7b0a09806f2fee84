"""What each term moves: the cases lead from one turbine to the other, figures those that others found."""

from dataclasses import fields, replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from baselines.paper.readings import Reading
from benchmarks.validation import terms
from benchmarks.validation.axis import axis_cases, axis_table, control_rows, series_rows
from benchmarks.validation.axis import main as axis_main
from benchmarks.validation.steady import Means
from benchmarks.validation.terms import Effect, added, cells, effect, left_out, terms_table
from flapgym.evaluation import Estimate
from flapgym.model import load_model
from flapgym.turbine import load_case

PAPER, CORRECTED = (load_case(name) for name in ("nrel5mw-rated", "nrel5mw-corrected"))


def differing(one, other):
    return {
        f.name
        for f in fields(one.airloads)
        if getattr(one.airloads, f.name) != getattr(other.airloads, f.name)
    }


def test_all_in_which_the_two_turbines_differ_is_a_term():
    assert differing(PAPER, CORRECTED) == set(terms.TERMS)
    assert replace(CORRECTED, airloads=PAPER.airloads).hash() == PAPER.hash()


def test_terms_added_lead_from_the_paper_to_the_corrected_turbine_one_at_a_time():
    cases = [case for _, case in added(PAPER, CORRECTED)]
    assert cases[0].hash() == PAPER.hash()
    assert cases[-1].hash() == CORRECTED.hash()
    changed = [differing(one, other) for one, other in pairwise(cases)]
    assert changed == [{name} for name in terms.TERMS]


def test_each_term_is_left_out_alone():
    cases = [case for _, case in left_out(PAPER, CORRECTED)]
    assert cases[0].hash() == CORRECTED.hash()
    assert [differing(case, CORRECTED) for case in cases[1:]] == [{name} for name in terms.TERMS]


def test_a_case_met_on_both_ways_is_worked_out_once():
    """Added last and left out last are one, and so are the ends."""
    asked = []

    def of(case):
        asked.append(case.hash())
        return invented(len(asked))

    lines = terms_table(PAPER, CORRECTED, of).splitlines()
    assert len(asked) == len(set(asked)) == 12
    assert len(lines) == 2 + 2 + 14  # head and rule, two headings, cases
    without_last = next(line for line in lines if line.startswith("| without slow-wake states"))
    up_to_it = next(line for line in lines if line.startswith("| + full linearisation"))
    assert without_last.split("|")[2:] == up_to_it.split("|")[2:]


def invented(scale):
    mean = Means(1e3, 1e6, 1e6, 700e3 * scale, 4e6, 9e6, 5.0, np.radians(0.5))
    sizes = {"BeamDyn": (0.9, 0.8), "ElastoDyn": (1.1, 1.2)}
    return Effect(mean, (0.9e6, 0.5), (5e6, 3.0), (0.8e6, 0.9e6), sizes, (0.1, 0.2, 0.3, 0.4, 0.5))


def test_a_line_holds_degrees_and_mega_units():
    assert cells("one", invented(1)) == [
        "one",
        "700, 4.00",
        "5.00, 0.5",
        "0.900, 0.500",
        "0.0873, 0.0524",
        "0.800, 0.900",
        "0.900, 0.800",
        "1.100, 1.200",
        "0.10, 0.20, 0.30, 0.40, 0.50",
    ]


def test_effect_of_the_papers_turbine_is_that_of_another_program():
    """To the digits that it printed: three, or a unit of the second."""
    found = effect(PAPER)
    assert found.mean.bent_thrust == pytest.approx(762e3, rel=2e-3)
    assert found.mean.bent_torque == pytest.approx(5.73e6, rel=2e-3)
    assert found.wind == pytest.approx((0.798e6, 0.404), rel=2e-3)
    assert np.radians(found.flap) == pytest.approx((0.0693e6, 0.0452), rel=2e-3)
    assert found.rigid == pytest.approx((0.874e6, 0.61e6), rel=8e-3)
    assert found.sizes["BeamDyn"] == pytest.approx((0.777, 0.826), abs=6e-4)
    assert found.sizes["ElastoDyn"] == pytest.approx((0.841, 0.893), abs=6e-4)
    assert found.bands == pytest.approx((0.77, 0.90, 0.89, 0.74, 0.48), abs=6e-3)


def test_program_of_terms_fills_the_page(monkeypatch, tmp_path, capsys):
    page = tmp_path / "page.md"
    page.write_text("<!-- terms -->\n<!-- end -->\n")
    monkeypatch.setattr(terms, "effect", lambda case: invented(1))
    assert terms.main(["--output", str(tmp_path), "--docs", str(page)]) == 0
    table = capsys.readouterr().out.strip()
    assert page.read_text() == f"<!-- terms -->\n{table}\n<!-- end -->\n"
    assert (tmp_path / "terms.md").read_text() == f"{table}\n"


@pytest.mark.parametrize("program", [terms.main, axis_main])
def test_a_page_that_is_missing_is_one_line_before_any_work(program, tmp_path, capsys):
    assert program(["--output", str(tmp_path), "--docs", str(tmp_path / "nowhere.md")]) == 2
    line = capsys.readouterr().err
    assert "nowhere.md" in line
    assert line.count("\n") == 1


def test_the_two_axes_differ_in_nothing_else():
    quarter, published = axis_cases(PAPER).values()
    assert quarter.hash() == PAPER.hash()
    assert differing(quarter, published) == {"elastic_axis"}
    assert replace(published, airloads=PAPER.airloads).hash() == PAPER.hash()


def test_readings_of_an_axis_stand_beside_the_papers_percentages():
    few = tuple(Estimate(mean, mean, mean) for mean in (-0.2, -0.25, -0.15))
    rows = control_rows([Reading("scaled", True, 0.5, 2.0, few, few)])
    text = axis_table({"one": rows, "other": rows})
    percentages, ratios = text.splitlines()[2:]
    assert percentages.endswith("| -20.0 / -25.0 / -15.0 | -20.0 / -25.0 / -15.0 | -22 / -23 / -17 |")
    assert ratios.endswith("| 1.25, 0.75 | 1.25, 0.75 | 1.05, 0.77 |")


def test_largest_loads_of_a_series_are_means_over_the_realisations(monkeypatch):
    size = np.arange(1.0, 6.0)[:, None, None] * np.array([1.0, -2.0])[None, :, None] * np.ones((5, 2, 3))
    record = SimpleNamespace(rbm=1e6 * size, tip_deflection=0.5 * size, tower_fore_aft=0.1 * size[..., 0])
    monkeypatch.setattr("benchmarks.validation.axis.simulate", lambda *given: record)
    rows = [ours for ours, _ in series_rows(load_model("nrel5mw-rated"), 10.0).values()]
    assert rows == ["6.00", "3.00", "0.600", "0.500"]
