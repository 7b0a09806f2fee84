"""The page of bad input is what its program writes, and every line on it is one."""

from pathlib import Path

from benchmarks.errors.__main__ import page

ROOT = Path(__file__).parents[2]


def test_the_page_is_what_its_program_writes():
    assert (ROOT / "docs" / "errors.md").read_text(encoding="utf-8") == page(), (
        "write it anew: python -m benchmarks.errors docs/errors.md"
    )


def test_every_line_names_what_is_wrong_and_no_library_or_folder_of_this_machine():
    rows = [line for line in page().splitlines() if line.startswith("| ") and "`" in line]
    assert len(rows) > 60
    for row in rows:
        assert row.isprintable()
        assert len(row) < 600
        for stranger in ("Errno", "object at", "site-packages", "tmp", "Traceback", "__init__", str(ROOT)):
            assert stranger not in row, row
