"""The tuning rules on a small turbine: the flap meets its stop, margins hold, bad files are refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from baselines import tune, tuning
from baselines.settings import FieldCandidate, LQGCandidate, PDCandidate, PIDCandidate, Tuning, load_tuning
from baselines.tuning import (
    Bench,
    largest_weight,
    meet_the_stops,
    tune_individual,
    tune_lqg,
    tune_pd,
    tune_pid,
    tune_saturating,
)
from flapgym.control import Weights, closed_loop, load_agent, lqg_agent, made_for
from flapgym.control.margins import disk_margin
from flapgym.model import save_model
from tests.synthetic import synthetic_model

MODEL = synthetic_model()
CONFIG = Path(__file__).parents[2] / "configs" / "tuning.toml"
LQG = (LQGCandidate(1.0, 0.0036, 0.01),)
FIELD = (FieldCandidate(1.0, 360.0, 2.0, 100.0),)
PD = (PDCandidate(0.1, 0.1, 12.0, 0.8),)
PID = (PIDCandidate(0.1, 0.1, 12.0, 0.8, 1.0, 2.0),)
BENCH = Bench(MODEL, Tuning(5, 2, 0.54, LQG, LQG, FIELD, PD, PID, PID), 30.0, lambda name: None)


def test_the_rule_brings_the_flap_just_to_its_stop():
    for tuned in (tune_lqg(BENCH), tune_pd(BENCH), tune_pid(BENCH)):
        assert tuned.design["tuning_flap_angle_max"] == pytest.approx(MODEL.flaps[0].angle_limit, rel=0.01)
        assert BENCH.stroke(tuned.agent) == pytest.approx(1.0, abs=0.006)


def test_a_rule_without_an_answer_says_so():
    """No weight drives the flap to its stop: the controller's own states grow first."""

    def growing(weight):
        agent = lqg_agent("lqg", MODEL, Weights(weight))
        return replace(agent, system=replace(agent.system, A=(1.0 + weight) * agent.system.A))

    stable = [closed_loop(MODEL, growing(weight).system).spectral_radius() < 1.0 for weight in (1e-5, 0.1)]
    assert stable == [True, False]
    assert meet_the_stops(BENCH, growing, 1e-5) is None


def test_the_saturating_design_is_as_heavy_as_the_disk_margin_allows():
    weak = LQGCandidate(1.0, 1e-5, 0.002)
    bench = Bench(MODEL, Tuning(5, 2, 1.2, LQG, (weak,), FIELD, PD, PID, PID), 30.0, lambda name: None)

    def design(weight):
        return lqg_agent("lqg", MODEL, Weights(weight, 1.0, 1e-5, 0.002))

    weight = largest_weight(bench, design, highest=1e6)
    assert disk_margin(MODEL, design(weight).system).alpha >= 1.2
    assert disk_margin(MODEL, design(1.1 * weight).system).alpha < 1.2


def test_the_limit_respecting_lqg_is_the_first_candidate_with_the_disk_margin(monkeypatch):
    """On this turbine an observer that expects less noise has more of it: 1.8 at 1 %, 1.5 at 30 %."""
    monkeypatch.setattr(tuning, "meet_the_stops", lambda bench, design, start: 0.9)
    candidates = (LQGCandidate(1.0, 0.0036, 0.3), LQGCandidate(1.0, 0.0036, 0.01))
    for asked, noise in ((1.0, 0.3), (1.6, 0.01)):
        bench = replace(BENCH, tuning=replace(BENCH.tuning, disk_margin=asked, lqg=candidates))
        design = tune_lqg(bench).design
        assert design["measurement_noise"] == noise
        assert design["disk_margin"] >= asked


def test_no_candidate_with_the_disk_margin_is_said_with_those_found(monkeypatch):
    monkeypatch.setattr(tuning, "meet_the_stops", lambda bench, design, start: 0.9)
    bench = replace(BENCH, tuning=replace(BENCH.tuning, disk_margin=1.9))
    with pytest.raises(ValueError, match=r"disk margin of 1.9 \(found: 1.8"):
        tune_lqg(bench)


def test_the_saturating_design_reduces_more_than_the_limit_respecting_one():
    gentle, fierce = tune_lqg(BENCH), tune_saturating(BENCH)
    assert fierce.design["tuning_rbm_rms"] < 0.9 * gentle.design["tuning_rbm_rms"]
    assert fierce.design["tuning_flap_angle_max"] <= MODEL.flaps[0].angle_limit


def test_tilt_and_yaw_get_as_much_gain_as_the_disk_margin_allows():
    tuned = tune_individual(BENCH)
    assert tuned.design["disk_margin"] == pytest.approx(0.54, rel=0.05)
    assert tuned.design["collective_proportional"] == tune_pid(BENCH).design["proportional"]


def test_the_program_saves_agents_of_the_model_given(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(tune, "PAPER_LENGTH", 2.0)
    save_model(MODEL, tmp_path / "model.safetensors")
    config = tmp_path / "tuning.toml"
    config.write_text(CONFIG.read_text().replace("realisations = 20", "realisations = 2"))
    arguments = ["pd", "--model", str(tmp_path / "model.safetensors"), "--config", str(config)]
    assert tune.main([*arguments, "--output", str(tmp_path / "agents")]) == 0
    agent = load_agent(tmp_path / "agents" / "pd.json", MODEL)
    assert made_for(agent, MODEL)
    assert "stable up to" in capsys.readouterr().out


def test_the_shipped_tuning_file_is_read():
    shipped = load_tuning(CONFIG)
    assert shipped.disk_margin == 0.54
    assert shipped.lqg[0].measurement_noise == pytest.approx(0.01)


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("disk_margin = ", "disc_margin = ", "disc_margin: unknown key; did you mean 'disk_margin'"),
        ('"12 rad/s"', '"12 m"', "pd.*servo_frequency"),
        ("realisations = 20", "realisations = 0", "realisations"),
        ("seed = 2000000", "seed = 1000003", "must not be scored ones"),
        ("acceleration = 36.0", "acceleration = 0", "acceleration"),
    ],
)
def test_a_faulty_tuning_file_is_refused_by_the_fields_name(tmp_path, old, new, text):
    path = tmp_path / "tuning.toml"
    path.write_text(CONFIG.read_text().replace(old, new))
    with pytest.raises(ValueError, match=text):
        load_tuning(path)


@pytest.mark.parametrize("arguments", [["lqr"], ["--model", "nowhere"], ["--config", "nowhere.toml"]])
def test_bad_input_costs_one_line_and_exit_code_two(arguments, capsys, tmp_path):
    assert tune.main([*arguments, "--output", str(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert arguments[-1] in error
    assert np.size(list(tmp_path.iterdir())) == 0
