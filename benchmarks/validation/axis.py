"""Which axis the paper's blade had, by Figures 10, 13 and 15: `python -m benchmarks.validation.axis`.

The paper's case with the beam through the quarter chords and with the published axis, all else alike. Prints the table
and writes `results/axis.md`; `--docs docs/validation.md` puts it into the page. Designs that are tuned lie in
`results/axis` and are not tuned again. Some five minutes of one core the first time.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from baselines.cache import Cache
from baselines.models import unscaled_flap
from baselines.paper.readings import FEW, Reading, reading
from baselines.scores import Trial
from baselines.settings import load_tuning
from baselines.tune import CONFIG
from benchmarks.page import fill, table
from flapgym.aeroelastic.cache import cached_model
from flapgym.aeroelastic.coupling import multiblade_aerodynamics
from flapgym.control import OpenLoop
from flapgym.core.atomic import write_atomically
from flapgym.core.program import Parser, Work, run
from flapgym.evaluation import SCORED_SEED, simulate, writable_folder
from flapgym.evaluation.comparison import PAPER_LENGTH
from flapgym.model import TurbineModel
from flapgym.turbine import Case, load_case
from studies.bode import FEW_MODES, OWN, SOFT, Curves, decibel, on_towers, tip, tower_marks
from studies.design import frozen_turbine
from studies.parts import Study, reduce_rotor, with_modes
from studies.tables import mark_cells, peak_cell

PAPER = "nrel5mw-rated"
AXES: dict[str, float | Literal["published"]] = {"25 % of the chord": 0.25, "as published": "published"}
Rows = dict[str, tuple[str, str]]
"""Ours by quantity, and the paper's."""


def axis_cases(paper: Case) -> dict[str, Case]:
    """The paper's case with each axis, by its name in the table."""
    return {
        name: replace(
            paper, name=f"{paper.name}-axis-{axis}", airloads=replace(paper.airloads, elastic_axis=axis)
        )
        for name, axis in AXES.items()
    }


def bode_rows(case: Case) -> Rows:
    """Marks and levels of Figures 10 and 13."""
    study = Study(case)
    curves = on_towers(study)
    few = with_modes(study.parts, study.rotor, *FEW_MODES)
    components = reduce_rotor(few, study.rotor, case.reduction.aerodynamic_states)
    lattice = multiblade_aerodynamics(*components, 0.0, study.time_step)
    few_modes = "5 + 20 modes"
    shown = Curves.of(curves | {few_modes: tip(frozen_turbine(few, lattice, 0.0))})
    marks = {mark.name: mark_cells(mark) for mark in tower_marks(shown)}
    level = decibel(shown[OWN])
    return {
        "Figure 10: tower's first mode [dB]": (marks[OWN][0], "around 0.3 Hz"),
        "three times softer": (marks[SOFT][0], "lower"),
        "blade's flapwise mode [dB]": (marks[OWN][1], "around 0.6 Hz"),
        "on the softer tower": (marks[SOFT][1], "to the left"),
        "tower's second mode [dB]": (marks[OWN][3], "2.9 Hz"),
        "level at 0.1 Hz less that at 10 Hz [dB]": (f"{level[0] - level[-1]:.0f}", "axis of 80"),
        "Figure 13: first peak, 15 + 40 modes": (peak_cell(shown, OWN), "axis of 40 dB"),
        few_modes: (peak_cell(shown, few_modes), "a slight shift"),
    }


def series_rows(model: TurbineModel, duration: float) -> Rows:
    """Sizes of Figure 15 without a controller: largest of each of a few realisations, in the mean."""
    record = simulate(OpenLoop(), model, range(SCORED_SEED, SCORED_SEED + FEW), duration)
    largest = [
        float(np.abs(load.reshape(FEW, -1)).max(axis=1).mean())
        for load in (record.rbm / 1e6, record.tip_deflection, record.tower_fore_aft)
    ]
    ratio = record.tip_deflection.std() / (record.rbm.std() / 1e6)
    return {
        "Figure 15: largest RBM [MN m]": (f"{largest[0]:.2f}", "axis to 2"),
        "largest tip [m]": (f"{largest[1]:.2f}", "axis to 1"),
        "largest tower top [m]": (f"{largest[2]:.3f}", "axis to 0.1 or more"),
        "tip over RBM, rms [m per MN m]": (f"{ratio:.3f}", "0.5, of the axes"),
    }


def control_rows(readings: Sequence[Reading]) -> Rows:
    """Changes of RBM rms, tip rms and DEL that the base case of Section IV.C makes."""
    rows = {}
    for one in readings:
        changes = [100.0 * each.mean for each in one.few]
        flap = "scaled flap" if one.flap == "scaled" else "the lattice's own flap"
        shown = " / ".join(f"{change:+.1f}" for change in changes)
        rows[f"LQG, {flap}: RBM rms, tip rms, DEL [%]"] = (shown, "-22 / -23 / -17")
        ratios = f"{changes[1] / changes[0]:.2f}, {changes[2] / changes[0]:.2f}"
        rows[f"{flap}: tip, DEL over RBM"] = (ratios, "1.05, 0.77")
    return rows


def control_readings(case: Case, model: TurbineModel, folder: Path, duration: float) -> list[Reading]:
    """The base case with either flap, tuned on what it is scored on: twenty others take four times as long."""
    tuning, cache = load_tuning(CONFIG), Cache(folder, model.hash)
    trial = Trial("axis", 2 * FEW, duration)
    bare = unscaled_flap(case)
    flaps = {"scaled": model, "unscaled": cached_model(replace(bare, name=f"{bare.name}-bare-flap"))}
    return [reading(flap, True, of, tuning, trial, cache, lambda name: None) for flap, of in flaps.items()]


def axis_table(found: dict[str, Rows]) -> str:
    """Quantities by axis beside the paper's."""
    first = next(iter(found.values()))
    lines = [
        [quantity, *(rows[quantity][0] for rows in found.values()), paper]
        for quantity, (_, paper) in first.items()
    ]
    return table(["", *(f"axis {name}" for name in found), "the paper"], lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the study; return the exit code."""
    parser = Parser(prog="python -m benchmarks.validation.axis", description=(__doc__ or "").splitlines()[0])
    parser.set_defaults(door=_door, program="benchmarks.validation.axis")
    parser.add_argument("--output", type=Path, default=Path("results"), help="folder (default: %(default)s)")
    parser.add_argument("--docs", type=Path, metavar="PAGE", help="page whose table is replaced")
    return run(parser, arguments)


def _door(options: argparse.Namespace) -> Work:
    folder = writable_folder(options.output, ("axis.md",))
    if options.docs is not None:
        options.docs.read_text(encoding="utf-8")

    def work() -> int:
        rows = {}
        for axis, case in axis_cases(load_case(PAPER)).items():
            model = cached_model(case)
            duration = PAPER_LENGTH * model.length_scale / model.wind_speed
            rows[axis] = (
                bode_rows(case)
                | series_rows(model, duration)
                | control_rows(control_readings(case, model, folder / "axis", duration))
            )
            print(f"done: axis {axis}", file=sys.stderr, flush=True)
        found = axis_table(rows)
        print(found)
        write_atomically(folder / "axis.md", f"{found}\n".encode())
        if options.docs is not None:
            # Read only now: the page may have been edited during the work.
            page = fill(options.docs.read_text(encoding="utf-8"), {"axis": found})
            write_atomically(options.docs, page.encode())
        return 0

    return work


if __name__ == "__main__":
    sys.exit(main())
