"""The comparison as a whole: what it writes, that it follows the model, and what it refuses."""

import csv
import json
import os
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from flapgym.control import OpenLoop, PDGains, Policy, Weights, lqg_agent, pd_agent, save_agent
from flapgym.control.closed_loop import closed_loop, with_effectiveness
from flapgym.evaluation import SCORED_SEED, as_markdown, as_text, compare, measure, plan, simulate
from flapgym.evaluation.figure import draw_figure
from flapgym.evaluation.report import as_csv, write_report
from flapgym.model.turbine_model import load_model, save_model
from tests.synthetic import synthetic_model

MODEL = synthetic_model()
CHANGES = ("rbm_rms_change", "tip_rms_change", "rbm_del_change", "rbm_del_summed_change", "tower_rms_change")
FIGURES = (
    "rbm_rms_Nm",
    "rbm_del_Nm",
    "flap_angle_max_rad",
    "flap_rate_max_rad_per_s",
    "flap_travel_rad_per_s",
)


def _policy():
    """Proportional, with damping, held for seven steps: an agent of another interval and another observation."""
    return Policy(
        name="policy",
        observe=("flap_angle", "rbm", "flap_rate"),
        steps_per_action=7,
        per_blade=True,
        offset=np.zeros(3),
        scale=np.ones(3),
        weights=(np.array([[-2.0, -0.1, -1.0]]),),
        biases=(np.zeros(1),),
        activation="tanh",
        squash="clip",
        model_hash="f" * 64,
    )


AGENTS = (
    pd_agent("pd", MODEL, PDGains(5e-8, 0.1, 0.1, 9.0, 0.8)),
    lqg_agent("lqg", MODEL, Weights(0.5)),
    _policy(),
)


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("results")
    return compare(AGENTS, MODEL, realisations=3, duration=20.0, output=folder), folder


def test_the_json_has_every_agent_and_number(results):
    agents = json.loads((results[1] / "compare.json").read_text())["agents"]
    assert list(agents) == ["open_loop", "pd", "lqg", "policy"]
    for agent in agents.values():
        for change in CHANGES:
            assert agent[change]["low"] <= agent[change]["mean"] <= agent[change]["high"]
        assert all(np.isfinite(agent[name]) for name in FIGURES)


def test_open_loop_changes_nothing(results):
    agents = json.loads((results[1] / "compare.json").read_text())["agents"]
    assert all(agents["open_loop"][change] == {"mean": 0.0, "low": 0.0, "high": 0.0} for change in CHANGES)
    assert all(agents["open_loop"][name] == 0.0 for name in FIGURES[2:])


def test_controllers_reduce_the_load(results):
    for name in ("pd", "lqg", "policy"):
        assert results[0].scores[name].rbm_rms_change.high < -0.02


def test_table_spreadsheet_and_figure_say_the_same(results):
    comparison, folder = results
    rows = list(csv.DictReader((folder / "compare.csv").read_text().splitlines()))
    assert [row["agent"] for row in rows] == list(comparison.scores)
    change = comparison.scores["lqg"].rbm_rms_change
    assert float(rows[2]["rbm_rms_change_mean"]) == change.mean
    cell = f"{100 * change.mean:+.1f} [{100 * change.low:+.1f}, {100 * change.high:+.1f}]"
    assert cell in (folder / "compare.md").read_text()
    assert cell in as_text(comparison)
    assert (folder / "compare.png").read_bytes().startswith(b"\x89PNG")


def test_both_ways_to_join_the_realisations_damage_are_named_and_follow_from_each_load(results):
    comparison, folder = results
    loads = {
        agent.name: measure(simulate(agent, MODEL, range(SCORED_SEED, SCORED_SEED + 3), 20.0)).rbm_del
        for agent in (OpenLoop(), AGENTS[0])
    }
    ours, still = loads["pd"], loads["open_loop"]
    score = comparison.scores["pd"]
    assert score.rbm_del_change.mean == pytest.approx(float(np.mean(ours / still)) - 1.0)
    # Histories of one length: damage adds, and at slope 10 it goes as the tenth power.
    summed = {name: np.mean(load**10.0) ** 0.1 for name, load in loads.items()}
    assert score.rbm_del_summed_change.mean == pytest.approx(summed["pd"] / summed["open_loop"] - 1.0)
    assert score.rbm_del == pytest.approx(summed["pd"])
    header = (folder / "compare.md").read_text().splitlines()[2]
    for name in ("| RBM DEL [%] |", "| RBM DEL, damage summed [%] |", "| RBM DEL [MN m] |"):
        assert name in header
    assert f"{score.rbm_del / 1e6:.3f}" in as_text(comparison)
    assert "mean of the ratios" in as_text(comparison)


def test_an_agent_of_another_model_is_marked(results):
    assert results[0].scores["lqg"].made_for_this_model
    assert not results[0].scores["policy"].made_for_this_model
    assert "policy *" in as_text(results[0])
    assert "* made for another model" in (results[1] / "compare.md").read_text()


def test_an_agent_whose_linear_loop_grows_is_marked_with_frequency_and_doubling_time(tmp_path):
    """Doubling by the eigenvalue itself: n steps of it make a factor of two."""
    strong = replace(MODEL, turbine=with_effectiveness(MODEL.turbine, 10.0))
    wild = lqg_agent("wild", MODEL, Weights(30.0))
    held = pd_agent("held", MODEL, PDGains(1e-12, 0.1, 0.1, 9.0, 0.8))
    comparison = compare([wild, held, _policy()], strong, realisations=1, duration=5.0, output=tmp_path)
    values = np.linalg.eigvals(closed_loop(strong, wild.system).A)
    fastest = values[np.abs(values).argmax()]
    assert abs(fastest) > 1.0
    frequency = abs(np.angle(fastest)) / (2.0 * np.pi * MODEL.time_step)
    agents = json.loads((tmp_path / "compare.json").read_text())["agents"]
    assert agents["wild"]["growth_frequency_Hz"] == pytest.approx(frequency)
    assert abs(fastest) ** (agents["wild"]["doubling_time_s"] / MODEL.time_step) == pytest.approx(2.0)
    for name in ("open_loop", "held", "policy"):
        assert agents[name]["growth_frequency_Hz"] is agents[name]["doubling_time_s"] is None
    rows = {row["agent"]: row for row in csv.DictReader((tmp_path / "compare.csv").read_text().splitlines())}
    assert float(rows["wild"]["doubling_time_s"]) == agents["wild"]["doubling_time_s"]
    assert rows["held"]["doubling_time_s"] == ""
    line = f"wild: its linear loop grows at {frequency:.2f} Hz, doubling in {agents['wild']['doubling_time_s']:.3g} s"
    for text in (as_text(comparison), (tmp_path / "compare.md").read_text()):
        assert line in text
        assert "held: its linear loop" not in text


def test_agents_of_different_intervals_meet_the_same_wind():
    held, stepped = (simulate(agent, MODEL, [3, 4], 5.0) for agent in (_policy(), OpenLoop()))
    assert held.wind.shape == stepped.wind.shape == (2, round(5.0 / MODEL.time_step))
    np.testing.assert_allclose(held.wind, stepped.wind, atol=1e-9)
    assert np.abs(held.rbm - stepped.rbm).max() > 1e4


def test_a_weaker_flap_in_the_model_file_shows_in_the_table(results, tmp_path):
    weak = replace(MODEL, turbine=with_effectiveness(MODEL.turbine, 0.5))
    save_model(weak, tmp_path / "weak.safetensors")
    comparison = compare(AGENTS, tmp_path / "weak.safetensors", realisations=3, duration=20.0)
    for name in ("pd", "lqg", "policy"):
        full = results[0].scores[name].rbm_rms_change.mean
        assert 0.3 * full > comparison.scores[name].rbm_rms_change.mean > 0.75 * full
    assert not comparison.scores["lqg"].made_for_this_model


def test_agents_come_from_files(tmp_path):
    save_agent(tmp_path / "mine.json", replace(_policy(), name="mine"), MODEL, "A test.", {})
    comparison = compare([tmp_path / "mine.json"], MODEL, realisations=1, duration=5.0)
    assert list(comparison.scores) == ["open_loop", "mine"]
    assert comparison.scores["mine"].rbm_rms_change.low is None
    assert comparison.scores["mine"].made_for_this_model


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"agents": ["lqr"]}, "agent lqr: unknown"),
        ({"agents": [_policy(), _policy()]}, "two are called policy"),
        ({"realisations": 0}, "realisations"),
        ({"duration": -1.0}, "duration"),
        ({"duration": float("nan")}, "duration"),
        ({"seed": -1}, "seed"),
    ],
)
def test_bad_input_is_refused_before_any_work_and_results_stay(tmp_path, arguments, text):
    (tmp_path / "compare.json").write_text("before")
    with pytest.raises(ValueError, match=text):
        compare(**({"agents": [OpenLoop()], "model": MODEL, "output": tmp_path} | arguments))
    assert (tmp_path / "compare.json").read_text() == "before"


def test_a_missing_model_and_an_impossible_folder_are_refused_by_name(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"nowhere\.safetensors"):
        plan([], tmp_path / "nowhere.safetensors")
    (tmp_path / "taken").write_text("")
    with pytest.raises(ValueError, match="taken"):
        compare([], MODEL, output=tmp_path / "taken")


def test_the_comparison_needs_neither_torch_nor_matplotlib_to_import():
    code = (
        "import sys, flapgym.evaluation; assert not {'torch', 'matplotlib'} & set(sys.modules), sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_saved_model_is_the_one_compared(tmp_path):
    save_model(MODEL, tmp_path / "model.safetensors")
    assert (
        plan([], tmp_path / "model.safetensors").model.hash == load_model(tmp_path / "model.safetensors").hash
    )


def test_the_four_files_appear_together_or_not_at_all(results, tmp_path, monkeypatch):
    names = ["compare.csv", "compare.json", "compare.md", "compare.png"]
    for name in names[:3]:
        (tmp_path / name).write_text("before")

    def full(source, target, replace=os.replace):
        if str(target).endswith(".md"):
            raise OSError(28, "No space left on device")
        replace(source, target)

    monkeypatch.setattr("flapgym.core.atomic.os.replace", full)
    with pytest.raises(OSError, match="No space left"):
        write_report(results[0], tmp_path)
    assert {name: (tmp_path / name).read_text() for name in sorted(os.listdir(tmp_path))} == dict.fromkeys(
        names[:3], "before"
    )
    monkeypatch.undo()
    write_report(results[0], tmp_path)
    assert sorted(os.listdir(tmp_path)) == names


@pytest.mark.parametrize("name", ["compare.json", "compare.png"])
def test_an_output_that_cannot_be_replaced_is_refused_before_any_work(tmp_path, name):
    (tmp_path / name).mkdir()
    with pytest.raises(FileExistsError, match=f"{name}: expected a regular file or none there, got a folder"):
        compare([OpenLoop()], MODEL, output=tmp_path)
    assert os.listdir(tmp_path) == [name]


def test_names_are_escaped_where_they_are_printed(results):
    comparison = results[0]
    scores = {
        "a|b": comparison.scores["pd"],
        "=cmd()": comparison.scores["lqg"],
        "<b>": comparison.scores["policy"],
    }
    hostile = replace(comparison, scores=scores)
    rows = [line for line in as_markdown(hostile).splitlines() if line.startswith("| ")]
    assert {len(re.findall(r"(?<!\\)\|", row)) for row in rows} == {len(rows[0].split("|")) - 1}
    assert "&lt;b&gt;" in as_markdown(hostile)
    cells = [row["agent"] for row in csv.DictReader(as_csv(hostile).splitlines())]
    assert cells == ["a|b", "'=cmd()", "<b>"]


def test_a_model_s_name_is_no_formula_in_the_figure(results):
    assert draw_figure(replace(results[0], model_name="$\\frac$")).startswith(b"\x89PNG")
