"""The model beside OpenFAST: `python -m benchmarks.validation`, or `make validate`.

Prints one table of the models and writes it and the picture, `results/validation.json`, `.md` and `.png`; `--docs
docs/validation.md` puts them into the page. Some ten seconds a model.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.page import fill
from benchmarks.validation.comparison import Comparison, compare
from benchmarks.validation.picture import draw
from benchmarks.validation.report import comparison_table, verdict
from flapgym.aeroelastic import load_model
from flapgym.atomic import write_atomically
from flapgym.evaluation import writable_folder

PICTURE = Path("figures") / "validation.png"
"""Seen from the page."""
MODELS = ["nrel5mw-corrected", "nrel5mw-rated"]
"""The turbine as published, and as the paper reads it."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare the models asked for; return the exit code: 0, or 2 for bad input."""
    options = _parser().parse_args(arguments)
    try:
        models = [load_model(name) for name in options.model]
        folder = writable_folder(options.output)
        page = None if options.docs is None else options.docs.read_text(encoding="utf-8")
        comparisons = [compare(model) for model in models]
    except (OSError, ValueError) as error:
        print(f"benchmarks.validation: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    table, picture = comparison_table(comparisons), draw(comparisons)
    print(f"{table}\n", *map(verdict, comparisons), "", sep="\n")
    data = json.dumps([as_data(comparison) for comparison in comparisons], indent=2, allow_nan=False) + "\n"
    title = ", ".join(comparison.model for comparison in comparisons)
    written = {
        folder / "validation.json": data.encode(),
        folder / "validation.md": f"![{title}](validation.png)\n\n{table}\n".encode(),
        folder / "validation.png": picture,
    }
    if page is not None:
        written |= {
            options.docs: fill(page, {"comparison": table}).encode(),
            options.docs.parent / PICTURE: picture,
        }
    for path, content in written.items():
        path.parent.mkdir(exist_ok=True)
        write_atomically(path, content)
        print(f"written: {path}")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.validation", description=(__doc__ or "").splitlines()[0]
    )
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
