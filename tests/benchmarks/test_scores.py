"""The page of scores says what the comparison says, and other pages take its short tables where they have a place."""

from __future__ import annotations

import pytest

from benchmarks.page import fill
from benchmarks.scores import REPORTED, agents_for, main, page, short_table
from flapgym.control import AGENT_NAMES, FIELD_AGENT_NAMES, PDGains, pd_agent
from flapgym.envs.registration import ENVIRONMENTS
from flapgym.evaluation import as_markdown, compare
from tests.synthetic import synthetic_model

MODEL = synthetic_model()
ID = "flapgym/NREL5MW-v1"


@pytest.fixture(scope="module")
def comparison():
    return compare(
        [pd_agent("pd", MODEL, PDGains(5e-8, 0.1, 0.1, 9.0, 0.8))], MODEL, realisations=2, duration=5.0
    )


def test_the_page_has_a_section_of_each_environment_and_names_the_seeds(comparison):
    text = page({ID: comparison})
    assert f"## {ID}\n\nThe turbine of three blades in homogeneous turbulence.\n" in text
    assert as_markdown(comparison).strip() in text
    assert "seeds 1,000,000 to 1,000,001" in text


def test_a_short_table_has_the_changes_with_their_intervals_and_goes_to_its_place(comparison):
    lines = short_table(comparison).splitlines()
    assert len(lines) == 3
    change = comparison.scores["pd"].rbm_rms_change
    assert lines[2].startswith(
        f"| `pd` | {100 * change.mean:+.1f} [{100 * change.low:+.1f}, {100 * change.high:+.1f}] |"
    )
    assert "disk margin" not in lines[0]
    filled = fill(f"before\n<!-- scores {ID} -->\nold\n<!-- end -->\nafter\n", {f"scores {ID}": "new"})
    assert filled == f"before\n<!-- scores {ID} -->\nnew\n<!-- end -->\nafter\n"


def test_where_blades_pitch_every_agent_stands_beside_individual_pitch_control():
    known = {entry.id: entry for entry in ENVIRONMENTS}
    assert set(REPORTED) <= known.keys()
    assert agents_for(known[ID]) == AGENT_NAMES
    pitching = agents_for(known["flapgym/NREL5MWPitch-v0"])
    assert pitching[:3] == ("individual_pitch", "individual_pitch_2p", "individual_pitch+pd")
    # Beside each agent of flaps but open loop, and the second one beside the last of those for a field.
    assert len(pitching) == 2 + len(AGENT_NAMES) - 1 + len(FIELD_AGENT_NAMES) + 1


def test_a_page_that_is_not_there_or_an_unknown_id_is_refused_in_one_line(capsys, tmp_path):
    for arguments, part in (
        ([str(tmp_path / "no" / "scores.md")], "make it first"),
        ([str(tmp_path / "scores.md"), str(tmp_path / "README.md")], "README.md"),
        ([str(tmp_path / "scores.md"), "--environments", "flapgym/NREL5MWBlade-v1"], "--environments"),
    ):
        assert main(arguments) == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1
        assert part in error
    assert not list(tmp_path.iterdir())
