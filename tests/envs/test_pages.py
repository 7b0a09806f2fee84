"""The manual pages committed are those the code makes."""

from __future__ import annotations

from pathlib import Path

import benchmarks.manual as page

DOCS = Path(__file__).parents[2] / "docs"


def test_the_committed_pages_are_up_to_date():
    made = page.pages(DOCS)
    assert {f"environments/{path.name}" for path in (DOCS / "environments").glob("*.md")} | {
        "environment.md"
    } == set(made)
    for name, text in made.items():
        assert (DOCS / name).read_text(encoding="utf-8") == text, (
            f"{name}: run python -m benchmarks.manual docs"
        )


def test_writing_removes_the_pages_of_environments_that_are_gone(tmp_path):
    (tmp_path / "environments").mkdir()
    (tmp_path / "environments" / "Gone-v0.md").write_text("old")
    page.main([str(tmp_path)])
    assert not (tmp_path / "environments" / "Gone-v0.md").exists()
    assert (tmp_path / "environments" / "NREL5MW-v0.md").exists()
