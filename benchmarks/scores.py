"""What the shipped agents reach on the scored realisations of the environments that are reported on: one page.

    python -m benchmarks.scores docs/scores.md README.md

writes the first page whole, and into the others, between `<!-- scores ID -->` and `<!-- end -->`, a short table of the
environment of that id. `make tables` does so in some minutes.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from benchmarks.page import fill, table
from flapgym.control import AGENT_NAMES, FIELD_AGENT_NAMES, INDIVIDUAL_PITCH, INDIVIDUAL_PITCH_2P, OpenLoop
from flapgym.core.atomic import check_target, write_together
from flapgym.core.program import Parser, Work, run, whole
from flapgym.envs.registration import ENVIRONMENTS, Registered
from flapgym.evaluation import SCORED_SEED, Comparison, as_markdown, plan
from flapgym.evaluation import run as compared
from flapgym.evaluation.comparison import MOST_REALISATIONS, PAPER_REALISATIONS
from flapgym.evaluation.report import SHORT, cells

REPORTED = tuple(
    f"flapgym/{name}"
    for name in (
        "NREL5MW-v1",
        "NREL5MW-v0",
        "NREL5MWField-v0",
        "NREL5MWSite-v0",
        "NREL5MWThreeFlaps-v0",
        "NREL5MWPitch-v0",
    )
)
_MADE = "<!-- Made by `make tables`. -->"


def agents_for(entry: Registered) -> tuple[str, ...]:
    """The shipped agents that are scored in an environment; where blades pitch, beside individual pitch control."""
    flaps = AGENT_NAMES if entry.agents else (OpenLoop.name,)
    if entry.keywords.get("wind", {}).get("field"):
        flaps = (*flaps, *FIELD_AGENT_NAMES)
    if not entry.keywords.get("pitch"):
        return flaps
    beside = (f"{INDIVIDUAL_PITCH}+{name}" for name in flaps if name != OpenLoop.name)
    return (INDIVIDUAL_PITCH, INDIVIDUAL_PITCH_2P, *beside, f"{INDIVIDUAL_PITCH_2P}+{FIELD_AGENT_NAMES[-1]}")


def page(comparisons: Mapping[str, Comparison]) -> str:
    """The page of all comparisons by id."""
    first = next(iter(comparisons.values()))
    seeds = f"{first.seed:,} to {first.seed + first.realisations - 1:,}"
    text = [
        _MADE,
        "",
        "# What the shipped agents reach",
        "",
        f"Each on the same realisations, seeds {seeds}, on which nothing was tuned or trained. Brackets hold 95 %",
        "intervals.",
        "[evaluation.md](evaluation.md) explains each column. `flapgym compare --env ID` makes a table anew.",
    ]
    for entry in (each for each in ENVIRONMENTS if each.id in comparisons):
        summary = entry.summary.split(". ")[0].rstrip(".")
        text += ["", f"## {entry.id}", "", f"{summary}.", "", as_markdown(comparisons[entry.id]).rstrip()]
    return "\n".join(text) + "\n"


def short_table(comparison: Comparison) -> str:
    """The columns that a first look needs, but for blank ones, and all agents but open loop, whose changes are zero."""
    header, rows = cells(comparison)
    shown = [row for name, row in zip(comparison.scores, rows, strict=True) if name != OpenLoop.name]
    kept = [place for place, name in enumerate(header) if name in SHORT and any(row[place] for row in shown)]
    return table(
        [header[place] for place in (0, *kept)],
        [[f"`{row[0]}`", *(row[place] for place in kept)] for row in shown],
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns the exit code."""
    return run(_parser(), arguments)


def _door(options: argparse.Namespace) -> Work:
    target = check_target(options.page)
    others = {path: path.read_text(encoding="utf-8") for path in map(check_target, options.others)}
    known = {entry.id: entry for entry in ENVIRONMENTS}
    plans = {
        name: plan(agents_for(known[name]), realisations=options.realisations, environment=name)
        for name in options.environments
    }

    def work() -> int:
        found = dict[str, Comparison]()
        for name, planned in plans.items():
            print(name, file=sys.stderr)
            found[name] = compared(planned, progress=True)
        tables = {f"scores {name}": short_table(comparison) for name, comparison in found.items()}
        pages = {target: page(found)} | {path: fill(text, tables) for path, text in others.items()}
        write_together({path: text.encode() for path, text in pages.items()})
        return 0

    return work


def _parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="python -m benchmarks.scores",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.set_defaults(door=_door, program="benchmarks.scores")
    parser.add_argument("page", type=Path, help="written whole, as docs/scores.md")
    parser.add_argument(
        "others", type=Path, nargs="*", help="pages with places for short tables, as README.md"
    )
    parser.add_argument(
        "--environments",
        nargs="+",
        default=list(REPORTED),
        choices=REPORTED,
        metavar="ID",
        help="default: all",
    )
    parser.add_argument(
        "--realisations",
        type=whole(1, MOST_REALISATIONS),
        default=PAPER_REALISATIONS,
        help=f"from seed {SCORED_SEED} on; default: %(default)s",
    )
    return parser


if __name__ == "__main__":
    sys.exit(main())
