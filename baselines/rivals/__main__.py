"""Rivals of the LQG and the bound of all, as a report: `python -m baselines.rivals`.

Writes rivals.md and rivals.html. Finished batches lie in the folder `parts` beside them and are not computed again; an
interrupted run goes on where it was. Fifty realisations take sixteen minutes of one core's time.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from baselines.cache import Cache
from baselines.rivals.section import rivals_section
from baselines.rivals.study import Study
from flapgym.core.atomic import write_together
from flapgym.core.program import Parser, Work, real, run, whole
from flapgym.core.progress import ProgressBar
from flapgym.evaluation import writable_folder
from flapgym.evaluation.comparison import LONGEST, MOST_REALISATIONS, PAPER_LENGTH
from flapgym.model.nameplate import nameplate
from flapgym.model.turbine_model import load_model
from studies.render import as_html, as_markdown


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns the exit code."""
    return run(_parser(), arguments)


def _door(options: argparse.Namespace) -> Work:
    model, folder = load_model(options.model), writable_folder(options.output, ("rivals.md", "rivals.html"))
    duration = options.duration or PAPER_LENGTH * model.length_scale / model.wind_speed

    def work() -> int:
        with ProgressBar(
            unit=" batches", bar_format="{desc:<16} {n_fmt}/{total_fmt}{unit}, {elapsed}"
        ) as bar:

            def tell(name: str) -> None:
                bar.set_description_str(name, refresh=False)
                bar.update()

            study = Study(model, options.realisations, duration, Cache(folder / "parts", model.hash), tell)
            bar.total = study.rounds
            sections = [rivals_section(study.findings())]
        title = f"Rivals of the LQG on model {model.name} ({nameplate(model.case).size})"
        write_together(
            {
                folder / "rivals.md": as_markdown(title, sections, folder).encode(),
                folder / "rivals.html": as_html(title, sections).encode(),
            }
        )
        print(f"wrote {folder / 'rivals.md'} and {folder / 'rivals.html'}")
        return 0

    return work


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="python -m baselines.rivals", description=(__doc__ or "").splitlines()[0])
    parser.set_defaults(
        door=_door, program="baselines.rivals", kept="finished batches are kept, run it again to go on"
    )
    parser.add_argument("--model", default="nrel5mw-rated", help="a model's name or file")
    parser.add_argument(
        "--realisations",
        type=whole(2, MOST_REALISATIONS),
        default=50,
        help="scored realisations (default: %(default)s)",
    )
    parser.add_argument("--duration", type=real(10.0, LONGEST, "s"), help="of each [s] (default: 20 L/U)")
    parser.add_argument("--output", type=Path, default=Path("results/rivals"), help="folder for the report")
    return parser


if __name__ == "__main__":
    sys.exit(main())
