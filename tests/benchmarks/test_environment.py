"""The benchmark runs, says what it counted, and puts its tables where the page wants them."""

from __future__ import annotations

import json

import pytest

from benchmarks.environment import kernels, limits, peers, report, timing
from benchmarks.environment.__main__ import main
from benchmarks.environment.peers import FLAPGYM, PENDULUM, Subject
from benchmarks.page import fill
from flapgym.model import load_model
from tests.synthetic import synthetic_model


@pytest.fixture(autouse=True)
def _alone(monkeypatch):
    """pytest-benchmark refuses to time anything beside other workers; what is counted here does not depend on them."""
    monkeypatch.delenv("PYTEST_XDIST_WORKER", raising=False)


def quiet(text):
    """Say nothing."""


def test_rates_count_every_environment_and_stand_beside_the_pendulum():
    subjects = [Subject(FLAPGYM, 3, "native", 5, "numpy", "float64"), Subject(PENDULUM, 3, "sync")]
    rates = peers.rates(subjects, seconds=0.01, rounds=1, tell=quiet)
    assert all(rate > 0 for rate in rates.values())
    lines = report.peers_table(rates).splitlines()
    assert len(lines) == 4
    cells = [cell.strip() for cell in lines[2].split("|")[1:-1]]
    assert int(cells[5].replace(",", "")) == pytest.approx(5 * int(cells[4].replace(",", "")), abs=5)
    assert lines[3].split("|")[-2].strip() == "1.00"


def test_a_peer_that_is_missing_is_left_out_with_a_word(monkeypatch):
    monkeypatch.setattr(peers, "missing", lambda subject: "envpool")
    said = []
    assert peers.rates([Subject(PENDULUM, 64, "envpool")], 0.01, 1, said.append) == {}
    assert "envpool is not installed" in said[0]


def test_forms_of_the_plant_are_timed_by_steps_of_each_turbine():
    call = kernels.by_plant(synthetic_model(), 2, 5, "numpy", "float64", 20)
    call()
    assert kernels.by_modes(synthetic_model(), 3)() is None


def test_the_plants_work_is_counted_from_its_modes():
    model = load_model("nrel5mw-rated")
    # 15 rows of root moments; angle, rate and command of three components.
    assert limits.work_per_step(model, 5) == (15 * 2 * 137 + 15 * 9 + 2 * 137 * 9 + 4 * 137) / 5
    assert limits.memory_per_turbine(model, 572, 5, "float32") < limits.memory_per_turbine(
        model, 572, 5, "float64"
    )


def test_the_program_writes_machine_and_tables(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(peers, "all_subjects", lambda: [Subject(PENDULUM, 1, "single")])
    page = tmp_path / "page.md"
    page.write_text("before\n<!-- peers -->\nold\n<!-- end -->\nafter\n")
    output = tmp_path / "folder" / "bench.json"
    given = ["peers", "--seconds", "0.01", "--rounds", "1", "--output", str(output), "--docs", str(page)]
    assert main(given) == 0
    assert json.loads(output.read_text())["peers"][0]["name"] == PENDULUM
    assert PENDULUM in capsys.readouterr().out
    text = page.read_text()
    assert PENDULUM in text
    assert "old" not in text
    assert text.startswith("before\n")
    assert text.endswith("after\n")


def test_a_table_without_a_place_is_left_out():
    assert fill("plain\n", {"peers": "| a |"}) == "plain\n"


def test_a_call_that_fails_is_not_timed():
    with pytest.raises(RuntimeError, match="run the call that failed"):
        timing.best_of({"bad": lambda: 1 / 0}, 0.01, 1, quiet)


def test_rounds_take_turns_and_the_best_counts():
    turns = []
    calls = {name: lambda name=name: turns.append(name) for name in "ab"}
    best = timing.best_of(calls, 0.001, 2, quiet)
    assert set(best) == set("ab")
    assert all(0.0 < time < 1e-3 for time in best.values())
    assert "".join(dict.fromkeys("".join(turns))) == "ab"
    changes = "".join(name for before, name in zip(["", *turns], turns, strict=False) if name != before)
    assert changes == "abab"
