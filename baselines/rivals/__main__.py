"""Rivals of the LQG and the bound of all, as a report: `python -m baselines.rivals`.

Writes rivals.md and rivals.html. Finished batches lie in the folder `parts` beside them and are not computed again; an
interrupted run goes on where it was. Fifty realisations take sixteen minutes of one core's time.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from tqdm import tqdm

from baselines.paper.cache import Cache
from baselines.paper.document import as_html, as_markdown
from baselines.rivals.section import rivals_section
from baselines.rivals.study import Study
from flapgym.aeroelastic.model import load_model
from flapgym.atomic import write_together
from flapgym.evaluation import writable_folder
from flapgym.evaluation.compare import LONGEST, MOST_REALISATIONS, PAPER_LENGTH

TITLE = "Rivals of the LQG on the NREL 5 MW turbine"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; return the exit code: 0, or 2 for bad input."""
    options = _parser().parse_args(arguments)
    try:
        if not 2 <= options.realisations <= MOST_REALISATIONS:
            raise ValueError(f"realisations: expected 2 to {MOST_REALISATIONS}, got {options.realisations}")
        if options.duration is not None and not 10.0 <= options.duration <= LONGEST:
            raise ValueError(f"duration: expected 10 to {LONGEST:.0f} s, got {options.duration}")
        model, folder = (
            load_model(options.model),
            writable_folder(options.output, ("rivals.md", "rivals.html")),
        )
        duration = options.duration or PAPER_LENGTH * model.length_scale / model.wind_speed
        with tqdm(unit=" batches", bar_format="{desc:<16} {n_fmt}/{total_fmt}{unit}, {elapsed}") as bar:

            def tell(name: str) -> None:
                bar.set_description_str(name, refresh=False)
                bar.update()

            study = Study(model, options.realisations, duration, Cache(folder / "parts", model.hash), tell)
            bar.total = study.rounds
            sections = [rivals_section(study)]
    except (ValueError, OSError, ImportError) as error:
        print(f"baselines.rivals: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    write_together(
        {
            folder / "rivals.md": as_markdown(TITLE, sections, folder).encode(),
            folder / "rivals.html": as_html(TITLE, sections).encode(),
        }
    )
    print(f"wrote {folder / 'rivals.md'} and {folder / 'rivals.html'}")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m baselines.rivals", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument("--model", default="nrel5mw-rated", help="a model's name or file")
    parser.add_argument(
        "--realisations", type=int, default=50, help="scored realisations (default: %(default)s)"
    )
    parser.add_argument("--duration", type=float, help="of each [s] (default: 20 L/U)")
    parser.add_argument("--output", type=Path, default=Path("results/rivals"), help="folder for the report")
    return parser


if __name__ == "__main__":
    sys.exit(main())
