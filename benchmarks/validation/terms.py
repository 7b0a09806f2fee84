"""What each term of the corrected turbine's loads moves: `python -m benchmarks.validation.terms`.

From the paper's reading to the corrected turbine one term after the other, and the corrected turbine without one at a
time. Prints the table and writes `results/terms.md`; `--docs docs/validation.md` puts it into the page. Every model is
built once, 20 to 40 s, and kept in the cache folder.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.page import fill, table
from benchmarks.validation.comparison import PROGRAMS, turbulence
from benchmarks.validation.measures import statistics
from benchmarks.validation.steady import Means, means, rigid_answer
from flapgym.aeroelastic.cache import cached_model
from flapgym.core.atomic import write_atomically
from flapgym.core.program import Parser, Work, run
from flapgym.core.progress import ProgressBar
from flapgym.core.units import DEGREE
from flapgym.evaluation import writable_folder
from flapgym.model import TurbineModel, load_model
from flapgym.turbine import Case, load_case

FIRST, LAST = "nrel5mw-rated", "nrel5mw-corrected"
TERMS = {
    "elastic_axis": "axis as published",
    "profile": "section drag and moment in the mean",
    "mean_wake": "a wake of its own for the mean",
    "lift_slope": "listed lift slopes",
    "linearisation": "full linearisation",
    "slow_wake": "slow-wake states",
}
"""Fields of the airloads in the order in which they are changed, and what tables call them."""
HEAD = (
    "",
    "thrust [kN], torque [MN m]",
    "tip [m], twist [deg]",
    "RBM [MN m], tip [m] per m/s",
    "RBM [MN m], tip [m] per deg of flap",
    "rigid: RBM end, torque per m/s [MN m]",
    *(f"std, DEL over {name}" for name in PROGRAMS),
    f"bands over {PROGRAMS[0]}",
)
MEGA = 1e6


@dataclass(frozen=True)
class Effect:
    """What a case's loads are like.

    Attributes
    ----------
    mean : Means
        Of its trim.
    wind, flap : tuple of float
        Steady root moment and tip per m/s [N m, m], and per angle of all flaps [N m per rad, m per rad].
    rigid : tuple of float
        Root moment and torque of the rigid rotor per m/s, steady [N m].
    sizes : mapping
        Standard deviation and damage equivalent load of the root moment in turbulence over each program's.
    bands : tuple of float
        Its rms by band over that of the first program.
    """

    mean: Means
    wind: tuple[float, float]
    flap: tuple[float, float]
    rigid: tuple[float, float]
    sizes: Mapping[str, tuple[float, float]]
    bands: tuple[float, ...]


def added(first: Case, last: Case) -> Iterator[tuple[str, Case]]:
    """The first case, then with the last one's terms, one after the other, by what was added."""
    yield first.name, first
    case = first
    for field, words in TERMS.items():
        case = with_term(case, field, last)
        yield f"+ {words}", case


def left_out(first: Case, last: Case) -> Iterator[tuple[str, Case]]:
    """The last case, then with one term of the first one's at a time, by what is left out."""
    yield last.name, last
    for field, words in TERMS.items():
        yield f"without {words}", with_term(last, field, first)


def with_term(case: Case, field: str, of: Case) -> Case:
    """The case with one field of another one's airloads."""
    changed = replace(case, airloads=replace(case.airloads, **{field: getattr(of.airloads, field)}))
    # Named after what it holds: reached by another way, it is the same model in the cache.
    return replace(changed, name=f"terms-{changed.hash()[:12]}")


def built(case: Case) -> TurbineModel:
    """The model of a case: shipped, from the cache, or built now."""
    shipped = {load_case(name).hash(): name for name in (FIRST, LAST)}
    name = shipped.get(case.hash())
    return cached_model(case) if name is None else load_model(name)


def effect(case: Case) -> Effect:
    """Of a case and its model."""
    model = built(case)
    outputs = ("rbm_0", "tip_deflection_0")
    gains = model.turbine.select(inputs=["wind", "flap_angle_0"], outputs=outputs).dc_gain()
    rigid = rigid_answer(case)
    compared = {name: tuple(map(statistics, pair)) for name, pair in turbulence(model).items()}
    first_ours, first_theirs = compared[PROGRAMS[0]]
    return Effect(
        mean=means(case),
        wind=(float(gains[0, 0]), float(gains[1, 0])),
        flap=(float(gains[0, 1]), float(gains[1, 1])),
        rigid=(rigid.end, rigid.torque),
        sizes={
            name: (ours.rbm_std / theirs.rbm_std, ours.rbm_del / theirs.rbm_del)
            for name, (ours, theirs) in compared.items()
        },
        bands=tuple(np.divide(first_ours.bands, first_theirs.bands).tolist()),
    )


def cells(name: str, found: Effect) -> list[str]:
    """One line of the table."""
    mean, (wind, tip), (flap, lift) = found.mean, found.wind, found.flap
    return [
        name,
        f"{mean.bent_thrust / 1e3:.0f}, {mean.bent_torque / MEGA:.2f}",
        f"{mean.tip:.2f}, {mean.twist / DEGREE:.1f}",
        f"{wind / MEGA:.3f}, {tip:.3f}",
        f"{flap * DEGREE / MEGA:.4f}, {lift * DEGREE:.4f}",
        ", ".join(f"{value / MEGA:.3f}" for value in found.rigid),
        *(", ".join(f"{ratio:.3f}" for ratio in ratios) for ratios in found.sizes.values()),
        ", ".join(f"{ratio:.2f}" for ratio in found.bands),
    ]


def terms_table(first: Case, last: Case, of: Callable[[Case], Effect]) -> str:
    """All rows: terms added to the first case, then left out of the last one."""
    lines: list[list[str]] = []
    known: dict[str, Effect] = {}
    for heading, cases in (
        ("One term after the other", added(first, last)),
        ("One term left out", left_out(first, last)),
    ):
        lines.append([f"**{heading}**", *[""] * (len(HEAD) - 1)])
        for name, case in ProgressBar(list(cases), desc=heading, unit=" models"):
            # Two of the cases are met on both ways.
            known[case.hash()] = known.get(case.hash()) or of(case)
            lines.append(cells(name, known[case.hash()]))
    return table(HEAD, lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the study; return the exit code."""
    parser = Parser(prog="python -m benchmarks.validation.terms", description=(__doc__ or "").splitlines()[0])
    parser.set_defaults(door=_door, program="benchmarks.validation.terms")
    parser.add_argument("--output", type=Path, default=Path("results"), help="folder (default: %(default)s)")
    parser.add_argument("--docs", type=Path, metavar="PAGE", help="page whose table is replaced")
    return run(parser, arguments)


def _door(options: argparse.Namespace) -> Work:
    folder = writable_folder(options.output, ("terms.md",))
    if options.docs is not None:
        options.docs.read_text(encoding="utf-8")

    def work() -> int:
        found = terms_table(load_case(FIRST), load_case(LAST), effect)
        print(found)
        write_atomically(folder / "terms.md", f"{found}\n".encode())
        if options.docs is not None:
            # Read only now: the page may have been edited during the work.
            page = fill(options.docs.read_text(encoding="utf-8"), {"terms": found})
            write_atomically(options.docs, page.encode())
        return 0

    return work


if __name__ == "__main__":
    sys.exit(main())
