"""The model beside OpenFAST: `python -m benchmarks.validation`, or `make validate`.

Prints one table of the models and writes it and the picture, `results/validation.json`, `.md` and `.png`; `--docs
docs/validation.md` puts them into the page. Some ten seconds a model.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.page import fill
from benchmarks.validation.comparison import Comparison, compare
from benchmarks.validation.picture import draw
from benchmarks.validation.report import comparison_table, verdict
from flapgym.core.atomic import write_together
from flapgym.core.program import Parser, Work, run
from flapgym.evaluation import writable_folder
from flapgym.model import load_model

WRITTEN = ("validation.json", "validation.md", "validation.png")
"""Data, table and picture."""
PICTURE = Path("figures") / "validation.png"
"""Seen from the page."""
MODELS = ["nrel5mw-corrected", "nrel5mw-rated"]
"""The turbine as published, and as the paper reads it."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare the models asked for; return the exit code."""
    return run(_parser(), arguments)


def _door(options: argparse.Namespace) -> Work:
    models = [load_model(name) for name in options.model]
    folder = writable_folder(options.output, WRITTEN)
    if options.docs is not None:
        options.docs.read_text(encoding="utf-8")

    def work() -> int:
        comparisons = [compare(model) for model in models]
        table, picture = comparison_table(comparisons), draw(comparisons)
        print(f"{table}\n", *map(verdict, comparisons), "", sep="\n")
        data = [as_data(comparison) for comparison in comparisons]
        title = ", ".join(comparison.model for comparison in comparisons)
        contents = (
            (json.dumps(data, indent=2, allow_nan=False) + "\n").encode(),
            f"![{title}](validation.png)\n\n{table}\n".encode(),
            picture,
        )
        written: dict[str | os.PathLike[str], bytes] = {
            folder / name: content for name, content in zip(WRITTEN, contents, strict=True)
        }
        if options.docs is not None:
            # Read only now: the page may have been edited during the work.
            page = fill(options.docs.read_text(encoding="utf-8"), {"comparison": table})
            (options.docs.parent / PICTURE).parent.mkdir(exist_ok=True)
            written |= {options.docs: page.encode(), options.docs.parent / PICTURE: picture}
        write_together(written)
        print(*(f"written: {path}" for path in written), sep="\n")
        return 0

    return work


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="python -m benchmarks.validation", description=(__doc__ or "").splitlines()[0])
    parser.set_defaults(door=_door, program="benchmarks.validation")
    parser.add_argument(
        "--model", nargs="+", default=MODELS, help=f"models' names or files (default: {' '.join(MODELS)})"
    )
    parser.add_argument(
        "--output", type=Path, default=Path("results"), help="folder for the files (default: %(default)s)"
    )
    parser.add_argument("--docs", type=Path, metavar="PAGE", help="page whose table and picture are replaced")
    return parser


def as_data(comparison: Comparison) -> dict[str, object]:
    """Every row of a model in SI, as plain JSON values."""
    return {
        "model": comparison.model,
        "rows": [
            {
                "group": heading,
                "quantity": row.quantity,
                "ours": row.ours,
                "independent": dict(row.independent),
                "held_to": str(row.limit) if row.limit else None,
                "met": row.met,
                "beyond": row.beyond,
            }
            for heading, rows in comparison.tables.items()
            for row in rows
        ],
    }


if __name__ == "__main__":
    sys.exit(main())
