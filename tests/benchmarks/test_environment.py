"""The benchmark runs, and says what it counted."""

from __future__ import annotations

import json

from benchmarks.environment import FLAPGYM, PENDULUM, Subject, main, measure, table


def test_figures_count_every_turbine_and_stand_beside_the_pendulum():
    subjects = (Subject(FLAPGYM, 3, "native", 5), Subject(PENDULUM, 3, "sync", 1))
    figures = measure(subjects, seconds=0.02, rounds=1)
    turbine, pendulum = figures
    assert turbine.plant_steps_per_second == 5 * turbine.steps_per_second > 0
    assert pendulum.plant_steps_per_second == pendulum.steps_per_second > 0
    lines = table(figures).splitlines()
    assert len(lines) == 3
    assert lines[2].split()[-2] == "1.00"


def test_the_program_writes_machine_and_figures(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("benchmarks.environment.SUBJECTS", (Subject(PENDULUM, 1, "single", 1),))
    assert (
        main(["--seconds", "0.01", "--rounds", "1", "--output", str(tmp_path / "folder" / "bench.json")]) == 0
    )
    report = json.loads((tmp_path / "folder" / "bench.json").read_text())
    assert report["machine"]["processors"] >= 1
    assert report["figures"][0]["subject"]["name"] == PENDULUM
    assert PENDULUM in capsys.readouterr().out
