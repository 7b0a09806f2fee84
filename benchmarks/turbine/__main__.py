"""Studies of the turbine model: `python -m benchmarks.turbine [PART ...] [--output DIR]`.

Prints the tables of docs/turbine.md in Markdown and writes figure10.png, figure11.png, figure13.png, figure14.png and
campbell.png. All parts take some two minutes on an idle core, and 1 GB.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.aerodynamics import table
from benchmarks.turbine.accuracy import reduced_against_full, table_of_azimuths
from benchmarks.turbine.campbell import TIP_SPEED_RATIOS, campbell
from benchmarks.turbine.speed import ROUNDS, speed
from flapgym.core.program import Parser, Work, run
from flapgym.core.progress import ProgressBar
from flapgym.evaluation import writable_folder
from flapgym.model import load_model
from flapgym.turbine import load_case
from studies import bode
from studies.figures import draw_aerodynamic_states, draw_structural_modes, draw_tips, draw_towers
from studies.parts import Study, Tell
from studies.tables import TITLES, deviation_table, parked_peaks, tips_table, towers_table
from studies.tips import tips_in_turbulence

STAGES = {
    "figure10": 2,
    "figure11": 1,
    "figure13": 2,
    "figure14": 4,
    "full": 3 + ROUNDS,
    "campbell": len(TIP_SPEED_RATIOS),
}


def figure10(study: Study, output: Path, tell: Tell) -> None:
    """Towers."""
    curves = bode.towers(study, tell)
    found = towers_table(curves)
    table(TITLES["figure10"], found.head, found.rows)
    print(f"\n{parked_peaks(curves)}")
    draw_towers(curves, output / "figure10.png")


def figure11(study: Study, output: Path, tell: Tell) -> None:
    """Tips."""
    tell("Figure 11: tips under turbulence")
    tips = tips_in_turbulence(load_model(study.case.name))
    found = tips_table(tips)
    table(TITLES["figure11"], found.head, found.rows)
    draw_tips(tips, output / "figure11.png")


def figure13(study: Study, output: Path, tell: Tell) -> None:
    """Structural modes."""
    curves = bode.structural_modes(study, tell)
    found = deviation_table(curves)
    table(TITLES["figure13"], found.head, found.rows)
    draw_structural_modes(curves, output / "figure13.png")


def figure14(study: Study, output: Path, tell: Tell) -> None:
    """Aerodynamic states."""
    curves = bode.aerodynamic_states(study, tell)
    found = deviation_table(curves)
    table(TITLES["figure14"], found.head, found.rows)
    draw_aerodynamic_states(curves, output / "figure14.png")


def against_full(study: Study, output: Path, tell: Tell) -> None:
    """Accuracy and speed, which share the table of A(theta)."""
    tell("A(theta) over a revolution")
    azimuths = table_of_azimuths(study)
    reduced_against_full(study, azimuths, tell)
    speed(study, azimuths, tell)


PROGRAMS = {
    "figure10": figure10,
    "figure11": figure11,
    "figure13": figure13,
    "figure14": figure14,
    "full": against_full,
    "campbell": campbell,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns the exit code."""
    return run(_parser(), arguments)


def _door(options: argparse.Namespace) -> Work:
    parts = options.parts or list(STAGES)
    unknown = [part for part in parts if part not in STAGES]
    if unknown:
        raise ValueError(f"{unknown[0]}: unknown part; expected some of {', '.join(STAGES)}")
    folder = writable_folder(options.output)

    def work() -> int:
        study = Study(load_case("nrel5mw-rated"))
        with ProgressBar(total=sum(STAGES[part] for part in parts), unit="stage") as bar:
            begun = False

            def tell(stage: str) -> None:
                nonlocal begun
                bar.update(int(begun))
                bar.set_description(stage)
                begun = True

            for part in parts:
                PROGRAMS[part](study, folder, tell)
            bar.update()
        return 0

    return work


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="python -m benchmarks.turbine", description=(__doc__ or "").splitlines()[0])
    parser.set_defaults(door=_door, program="benchmarks.turbine")
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(STAGES)} (default: all)")
    parser.add_argument("--output", type=Path, default=Path("results"), help="folder for the figures")
    return parser


if __name__ == "__main__":
    sys.exit(main())
