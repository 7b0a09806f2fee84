"""Mutated files of every kind: refused in one line, or finite and shaped; the long run is benchmarks.fuzz."""

import pytest

from benchmarks.fuzz.kinds import kinds
from benchmarks.fuzz.run import fuzz, mutation


@pytest.fixture(scope="module")
def all_kinds(tmp_path_factory):
    return {kind.name: kind for kind in kinds(tmp_path_factory.mktemp("examples"))}


@pytest.mark.parametrize("name", ["model", "agent", "case", "recording"])
def test_examples_are_sound(all_kinds, tmp_path, name):
    kind = all_kinds[name]
    for content in kind.examples:
        path = tmp_path / f"example{kind.suffix}"
        path.write_bytes(content)
        kind.check(kind.load(path))


@pytest.mark.parametrize("name", ["model", "agent", "case", "recording"])
def test_mutations_are_refused_in_one_line_or_sound(all_kinds, tmp_path, name):
    outcome = fuzz(all_kinds[name], 300, tmp_path, seed=1)
    assert outcome.faults == []
    assert outcome.refused > 150
    assert outcome.taken > 3  # or the mutations would spoil too much to find anything


@pytest.mark.parametrize("name", ["model", "agent", "case", "recording"])
def test_a_mutation_can_be_made_again(all_kinds, name):
    kind = all_kinds[name]
    assert mutation(kind, 5, 17) == mutation(kind, 5, 17)
    assert len({mutation(kind, 5, index) for index in range(20)}) > 10
