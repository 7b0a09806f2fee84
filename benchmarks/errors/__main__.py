"""Write the page: `python -m benchmarks.errors docs/errors.md`; without a file it is printed."""

from __future__ import annotations

import argparse
import contextlib
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from benchmarks.errors.entry import Section, line_of
from benchmarks.errors.files import FILES
from flapgym.core.atomic import check_target, write_atomically
from flapgym.core.program import Parser, Work, run

SECTIONS: tuple[Section, ...] = (*FILES,)
"""Of the page, in this order."""
HEAD = """# Bad input and the line it gets

Whatever a person or a file gives is checked before any work. What is refused costs one line: the field or the file,
what is expected there, and what was given. In Python it is the text of a `ValueError` or `FileNotFoundError`; `flapgym`
prints it and ends with exit code 2.

This page is made by `python -m benchmarks.errors docs/errors.md`, which gives each of these and writes what comes back.
"""


def page() -> str:
    """The page as Markdown; every entry is tried in an empty folder."""
    parts = [HEAD]
    for section in SECTIONS:
        parts.append(f"## {section.title}\n\n| given | told |\n|---|---|")
        for entry in section.entries:
            with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
                told = line_of(entry)
            # A vertical line would end the cell, a backtick the code.
            shown = told.replace("|", "\\|").replace("`", "'")
            parts.append(f"| {entry.what} | `{shown}` |")
        parts.append("")
    return "\n".join(parts)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; return its exit code."""
    return run(_parser(), arguments)


def _door(options: argparse.Namespace) -> Work:
    if options.file is not None:
        check_target(options.file)

    def work() -> int:
        if options.file is None:
            print(page())
        else:
            write_atomically(options.file.absolute(), page().encode())
        return 0

    return work


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="python -m benchmarks.errors", description=(__doc__ or "").splitlines()[0])
    parser.set_defaults(door=_door, program="benchmarks.errors")
    parser.add_argument(
        "file",
        nargs="?",
        type=Path,
        metavar="FILE",
        help="the page, such as docs/errors.md; default: printed",
    )
    return parser


if __name__ == "__main__":
    sys.exit(main())
