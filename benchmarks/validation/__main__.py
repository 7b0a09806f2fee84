"""The model beside OpenFAST: `python -m benchmarks.validation`, or `make validate`.

Prints one table for each model and writes `results/validation.json` and `.png`, both of the first one; `--docs
docs/validation.md` puts table and picture into the page. Some ten seconds a model.
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

PICTURE = Path("figures") / "validation.png"
"""From the page."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare the models asked for; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="benchmarks.validation", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument("--model", nargs="+", default=["nrel5mw-rated"], help="models' names or files")
    parser.add_argument("--output", type=Path, default=Path("results"), help="folder (default: results)")
    parser.add_argument("--docs", type=Path, help="page whose table and picture are replaced")
    options = parser.parse_args(arguments)
    try:
        models = [load_model(name) for name in options.model]
        comparisons = [compare(model) for model in models]
    except (OSError, ValueError) as error:
        parser.error(str(error))
    for comparison in comparisons:
        print(f"\n{comparison_table(comparison)}\n\n{verdict(comparison)}")
    first = comparisons[0]
    options.output.mkdir(parents=True, exist_ok=True)
    content = json.dumps(as_data(first), indent=2) + "\n"
    written = {
        options.output / "validation.json": content.encode(),
        options.output / "validation.png": draw(first),
    }
    if options.docs is not None:
        filled = fill(options.docs.read_text(encoding="utf-8"), {"comparison": comparison_table(first)})
        written |= {options.docs: filled.encode(), options.docs.parent / PICTURE: draw(first)}
    for path, data in written.items():
        write_atomically(path, data)
        print(f"written: {path}")
    return 0


def as_data(comparison: Comparison) -> dict[str, object]:
    """Every row in SI, as plain JSON values."""
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
