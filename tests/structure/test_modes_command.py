"""The command `flapgym modes`: what it prints, and what it refuses in one line."""

import json

import pytest

from flapgym import cli
from flapgym.structure.modes import TABLE_1


def test_json_holds_table_1_and_the_published_columns(capsys) -> None:
    assert cli.main(["modes", "--blade-elements", "48", "--json"]) == 0
    table = json.loads(capsys.readouterr().out)
    assert [row["mode"] for row in table] == [row.mode for row in TABLE_1]
    for row, published in zip(table, TABLE_1, strict=True):
        assert set(row) == {"mode", "frequency", "paper", "fast", "adams"}
        assert (row["paper"], row["fast"], row["adams"]) == (
            published.paper_48,
            published.fast,
            published.adams,
        )


def test_text_shows_every_mode_and_its_error(capsys) -> None:
    assert cli.main(["modes"]) == 0
    printed = capsys.readouterr().out
    for row in TABLE_1:
        line = next(line for line in printed.splitlines() if line.startswith(row.mode))
        assert f"{row.paper_12:.3f}" in line
    assert "2.316" in printed


def test_turning_rotor_has_whirls_and_no_published_values(capsys) -> None:
    assert cli.main(["modes", "--rotating", "--json"]) == 0
    table = json.loads(capsys.readouterr().out)
    assert "1st blade edgewise backward whirl" in [row["mode"] for row in table]
    assert all(row["paper"] is None for row in table)


@pytest.mark.parametrize(
    "arguments, part",
    [
        (["--blade-elements", "13"], "expected 12 or 48, got 13"),
        (["--blade-elements", "0"], "expected 12 or 48, got 0"),
        (["--rotating", "--plot"], "leave out --rotating"),
        (["--plot", "no-such-folder/modes.png"], "no folder no-such-folder"),
        (["no-such-case"], "no-such-case"),
    ],
)
def test_bad_input_costs_one_line(capsys, monkeypatch, tmp_path, arguments, part) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.main(["modes", *arguments]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert part in printed.err
    assert list(tmp_path.iterdir()) == []
