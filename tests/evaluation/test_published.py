"""Scores between open loop and the bound, worked out by hand, and blank where no bound is published."""

from __future__ import annotations

import json
from dataclasses import asdict, replace

import pytest

from flapgym.control import PDGains, pd_agent
from flapgym.evaluation import Bound, as_text, compare, plan, published
from flapgym.evaluation.published import bounds_for, read_bounds, score
from flapgym.evaluation.report import as_csv, as_json
from flapgym.model import load_model
from tests.synthetic import synthetic_model

ID = "flapgym/NREL5MW-v1"
MODEL = load_model()
RMS = Bound(ID, MODEL.name, MODEL.hash, 7, 2, 10.0, "rbm_rms", -0.5, 0.01)
DEL = replace(RMS, metric="rbm_del", value=-0.4, gap=None, kind="feasible")


def test_a_score_is_the_share_of_the_way_to_the_bound():
    assert score(0.0, RMS) == 0.0
    assert score(-0.5, RMS) == 1.0
    assert score(-0.2, RMS) == pytest.approx(0.4)
    assert score(+0.1, DEL) == pytest.approx(-0.25)


@pytest.fixture
def shipped(monkeypatch):
    monkeypatch.setattr(published, "_shipped", lambda: (RMS, DEL))


def test_the_table_and_the_files_tell_the_score_and_what_it_is_measured_by(shipped):
    comparison = compare(["pd"], realisations=2, seed=7, duration=10.0)
    found = as_json(comparison)
    pd = found["agents"]["pd"]
    assert pd["score_rbm_rms"] == pytest.approx(pd["rbm_rms_change"]["mean"] / -0.5)
    assert pd["score_rbm_del"] == pytest.approx(pd["rbm_del_change"]["mean"] / -0.4)
    assert found["agents"]["open_loop"]["score_rbm_rms"] == 0.0
    assert found["bounds"]["rbm_del"] == {"value": -0.4, "gap": None, "kind": "feasible"}
    text = as_text(comparison, 1000)
    row = next(line for line in text.splitlines() if line.startswith("pd "))
    assert f"{pd['score_rbm_rms']:.2f}" in row
    assert "score rms -50.0 % (the best sequence found stays 1.0 points behind)" in text
    assert "score DEL -40.0 %, the best sequence found, which is no bound" in text
    assert f",{pd['score_rbm_rms']}," in as_csv(comparison)


@pytest.mark.parametrize(
    "asked",
    [
        {"seed": 8},
        {"realisations": 1},
        {"duration": 11.0},
        {"turbulence_intensity": 0.1},
        {"model": "nrel5mw-rated"},
        {"model": replace(MODEL, rbm_rms=1.0, wind_speed=11.5)},
        {"model": synthetic_model()},
        {"environment": "flapgym/NREL5MWActuatorLag-v1"},
    ],
)
def test_other_realisations_wind_or_model_have_no_bound(shipped, asked):
    given = {"realisations": 2, "seed": 7, "duration": 10.0}
    assert plan([], **given).bounds == {"rbm_rms": RMS, "rbm_del": DEL}
    assert plan([], **(given | asked)).bounds == {}


def test_the_bound_of_the_id_is_that_of_its_own_model_and_wind(shipped):
    given = {"realisations": 2, "seed": 7, "duration": 10.0}
    assert plan([], environment=ID, **given).bounds == {"rbm_rms": RMS, "rbm_del": DEL}
    assert plan([], slope=4.0, **given).bounds == {"rbm_rms": RMS}


def test_without_a_bound_the_column_is_blank(tmp_path):
    agent = pd_agent("pd", synthetic_model(), PDGains(5e-8, 0.1, 0.1, 9.0, 0.8))
    comparison = compare([agent], synthetic_model(), realisations=1, duration=5.0)
    assert as_json(comparison)["agents"]["pd"]["score_rbm_rms"] is None
    header, _, *rows = as_text(comparison, 1000).split("\n\n")[1].splitlines()
    place = header.index("score rms")
    assert not any(row[place : place + 20].strip() for row in rows)


def test_bounds_are_read_from_a_file(tmp_path):
    path = tmp_path / "bounds.json"
    assert read_bounds(path) == ()
    path.write_text(json.dumps([asdict(RMS) | {"value_of_each": [-0.4, -0.6]}]))
    assert read_bounds(path) == (RMS,)
    assert bounds_for(ID, MODEL, range(7, 9), 10.0, read_bounds(path)) == {"rbm_rms": RMS}
    assert bounds_for(None, MODEL, range(7, 9), 10.0, read_bounds(path)) == {}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({}, "bounds .*bounds.json: expected a list of objects, got {}"),
        ([3], "bounds .*bounds.json: expected a list of objects"),
        ([{"model": "m"}], r"bounds\[0\]"),
        ([asdict(RMS) | {"value": 0.5}], r"bounds\[0\].value: expected -1 <= fraction < 0, got 0.5"),
    ],
)
def test_a_file_of_anything_else_is_refused(tmp_path, content, message):
    path = tmp_path / "bounds.json"
    path.write_text(json.dumps(content))
    with pytest.raises(ValueError, match=message):
        read_bounds(path)


def test_what_the_package_ships_is_read():
    assert all(bound.value < 0.0 for bound in published._shipped())
