"""The paper's Section IV beside ours, in one report: `python -m baselines.paper [PART ...]`.

Writes paper.md and paper.html, and the figures into the folder `paper` beside them. Finished parts lie in its folder
`parts` and are not computed again; an interrupted run goes on where it was. The report of some parts alone is
paper-part.md and .html; `--quick` is a trial run of a minute, which says so and writes paper-trial.md, .html and a
folder of its own.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from baselines.paper.groundwork import stages, worked
from baselines.paper.study import LONG, PARTS, REALISATIONS, Study
from flapgym.core.atomic import write_together
from flapgym.core.program import Parser, Work, run, whole
from flapgym.core.progress import ProgressBar
from flapgym.evaluation import writable_folder
from flapgym.evaluation.comparison import MOST_REALISATIONS, PAPER_LENGTH
from flapgym.model.nameplate import nameplate
from flapgym.model.turbine_model import TurbineModel, load_model
from studies.document import Section, Table, summary
from studies.render import as_html, as_markdown

PROCESSES = 2
"""Side by side, if no other number is given."""
TITLE = "Load alleviation on the NREL 5 MW turbine: Section IV of the paper beside ours"
ANGLES = {"pitch": "deg", "angle_limit": "deg", "rate_limit": "deg/s", "acceleration_limit": "deg/s^2"}


def parameters(model: TurbineModel, parts: Sequence[str]) -> Section:
    """What was computed, in the case's own words."""
    rows = []
    for group in ("operating_point", "discretisation", "airloads", "flap", "reduction", "turbulence"):
        for name, value in model.case[group].items():
            angle = isinstance(value, float) and name in ANGLES
            shown = np.rad2deg(value) if angle else value
            number = f"{shown:.6g}" if isinstance(value, float) else str(value)
            rows.append((f"{group}.{name}", f"{number} {ANGLES[name]}" if angle else number))
    return Section(
        "Case",
        (
            f"Model {model.name}, hash {model.hash[:16]}; {nameplate(model.case).size}; SI units where none is given.",
            f"Parts of the report: {', '.join(parts)}; {len(parts)} of {len(PARTS)}.",
            Table(("parameter", "value"), tuple(rows)),
        ),
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns the exit code."""
    return run(_parser(), arguments)


def _door(options: argparse.Namespace) -> Work:
    names = options.parts or [name for name in PARTS if not (options.quick and name in LONG)]
    unknown = [name for name in names if name not in PARTS]
    if unknown:
        raise ValueError(f"{unknown[0]}: unknown part; expected some of {', '.join(PARTS)}")
    stem = "paper-trial" if options.quick else "paper" if set(names) == set(PARTS) else "paper-part"
    model, output = load_model(options.model), writable_folder(options.output, (f"{stem}.md", f"{stem}.html"))
    # A trial's numbers, figures and finished parts stay apart from those of the full report.
    folder = writable_folder(output / ("paper-trial" if options.quick else "paper"))

    def work() -> int:
        with ProgressBar(unit=" jobs") as bar:
            study = Study(model, folder, options.realisations, options.quick, bar.set_postfix_str)
            plan = stages(study, names) if options.processes > 1 else []
            bar.total = sum(map(len, plan)) + len(names)
            for jobs in plan:
                for job in worked(
                    jobs, options.processes, model, folder, options.realisations, options.quick
                ):
                    bar.set_postfix_str(f"{job} done")
                    bar.update()
            sections = []
            for name in names:
                bar.set_description(name)
                sections.append(PARTS[name](study))
                bar.update()
        notice, title = "", TITLE
        if options.quick:
            notice, title = trial_notice(study), f"Trial run: {TITLE}"
            sections = [section.on_trial(notice) for section in (parameters(model, names), *sections)]
        else:
            glance = [summary(sections)] if any(section.verdict for section in sections) else []
            sections = [*glance, parameters(model, names), *sections]
        write_together(
            {
                output / f"{stem}.md": as_markdown(title, sections, output).encode(),
                output / f"{stem}.html": as_html(title, sections, notice).encode(),
            }
        )
        print(f"wrote {output / stem}.md and .html{'; ' + notice if notice else ''}")
        return 0

    return work


def trial_notice(study: Study) -> str:
    """What a trial run says on every page."""
    full = PAPER_LENGTH * study.model.length_scale / study.model.wind_speed
    return (
        f"Trial run: {study.realisations} realisations of {study.duration:.3g} s in place of {REALISATIONS} of "
        f"{full:.0f} s, and few controllers; a test of the program, no result."
    )


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="python -m baselines.paper", description=(__doc__ or "").splitlines()[0])
    parser.set_defaults(
        door=_door, program="baselines.paper", kept="what is finished is kept, run it again to go on"
    )
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)} (default: all)")
    parser.add_argument("--model", default="nrel5mw-rated", help="a model's name or file")
    parser.add_argument(
        "--realisations",
        type=whole(2, MOST_REALISATIONS),
        default=REALISATIONS,
        help="scored realisations (default: %(default)s; paper: 5)",
    )
    parser.add_argument(
        "--processes",
        type=whole(1, 64),
        default=PROCESSES,
        help="that work side by side, each with up to 2 GB (default: %(default)s)",
    )
    parser.add_argument("--quick", action="store_true", help="a trial run of a minute: paper-trial.*")
    parser.add_argument(
        "--output", type=Path, default=Path("results"), help="folder for the report (default: %(default)s)"
    )
    return parser


if __name__ == "__main__":
    sys.exit(main())
