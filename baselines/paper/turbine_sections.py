"""Figures 10, 11 and 13 to 15, the turbine's responses beside the paper's, as sections of the report."""

from __future__ import annotations

import contextlib
import io
import re
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from baselines.paper.cache import Cache
from baselines.paper.document import Section, Table, from_markdown
from baselines.paper.drawing import kept
from baselines.paper.models import JUDGED, was_judged
from benchmarks.turbine.bode import figure10, figure13, figure14
from benchmarks.turbine.study import Study
from benchmarks.turbine.tips import figure11
from flapgym.core.arrays import Array
from flapgym.evaluation import plan, run
from flapgym.evaluation.figure import draw_figure
from flapgym.model.turbine_model import TurbineModel
from flapgym.turbine import Case

TURBINE = {
    "figure10": (
        figure10,
        "Bode diagram, gust to tip deflection, rigid, NREL and three times softer tower",
        "Agrees: the tower's first fore-aft mode marks the blade's answer near 0.3 Hz, and lower on the softer tower. "
        "Disagrees: of the second, at 2.9 Hz, hardly anything shows. Our air damps the flapwise modes of the turning "
        "blade so much that they make no peak of their own.",
    ),
    "figure11": (
        figure11,
        "tips of the three turning blades in one homogeneous gust",
        "Agrees: the tips differ slightly, by azimuth; the tower makes the difference. Disagrees: ours swing down "
        "nearly as far as up, which a gust without a mean makes them do; the paper shows a realisation of its own.",
    ),
    "figure13": (
        figure13,
        "5 + 20 and 15 + 40 structural modes against all",
        "Agrees: 15 tower and 40 blade modes do (ours are 13 a blade), 5 and 20 get the first modes only.",
    ),
    "figure14": (
        figure14,
        "20, 50 and 150 aerodynamic states against all",
        "Agrees: 150 states do, 50 hardly. Disagrees: 20 states do not smooth the curve as the paper's do, because "
        "structure and lattice are joined after the reduction; they misplace its level.",
    ),
}
"""Program, subject and judgement of the figures of the whole turbine (docs/turbine.md says more)."""


def towers_marks(printed: Sequence[str | Table], model: TurbineModel) -> Table:
    """Figure 10: where the tower and the blades mark the answer, and the paper's words."""
    table = next(part for part in printed if isinstance(part, Table))
    own, softer = (next(row for row in table.rows if row[0] == name) for name in TOWERS)
    rows = []
    for mode, cells, column, paper in MARKS:
        found = float(re.findall(r"at ([0-9.]+) Hz", (own, softer)[cells][column])[0])
        error = "" if paper is None else f"{100.0 * (found / paper - 1.0):+.0f}"
        rows.append((mode, f"{found:.2f}", "lower" if paper is None else f"around {paper:g}", error))
    return Table(("mark [Hz]", "ours", "paper", "error [%]"), tuple(rows))


def tips_range(printed: Sequence[str | Table], model: TurbineModel) -> Table:
    """Figure 11: range of the tips, and the axis of the paper's figure."""
    table = next(part for part in printed if isinstance(part, Table))
    low, high = (float(value) for value in table.rows[0][2].split(" to "))
    return Table(
        ("tips over nine turns [m]", "ours", "paper's axis", "difference [m]"),
        (
            ("lowest", f"{low:+.2f}", "-0.2", f"{low + 0.2:+.2f}"),
            ("highest", f"{high:+.2f}", "+1", f"{high - 1.0:+.2f}"),
        ),
    )


def sizes(printed: Sequence[str | Table], model: TurbineModel) -> Table:
    """Figure 13: states of the full and the reduced system."""
    grid, keep, turbine = (model.case[name] for name in ("discretisation", "reduction", "turbine"))
    step = model.wind_speed * grid["time_step"] / (1.0 - grid["induction"])
    wake = round(grid["wake_length"] * 2.0 * turbine["rotor"]["radius"] / step)
    strips = grid["blade_elements"] - grid["first_lattice_node"]
    structure = 2 * (3 * keep["blade_modes"] + keep["tower_modes"])
    full = 3 * strips * (grid["chordwise_panels"] + wake) + structure
    reduced = 3 * keep["aerodynamic_states"] + structure
    counted = (
        ("bound and wake rings, and structure in its modes", full, 9500),
        ("reduced, with turbulence filter and double integrators", reduced + 5 + 6, 300),
        ("blade modes", 3 * keep["blade_modes"], 40),
        ("tower modes", keep["tower_modes"], 15),
        ("aerodynamic states", 3 * keep["aerodynamic_states"], 150),
    )
    return Table(
        ("states", "ours", "paper", "difference [%]"),
        tuple(
            (name, f"{ours:,}", f"{paper:,}", f"{100.0 * (ours / paper - 1.0):+.0f}")
            for name, ours, paper in counted
        ),
    )


VERDICT = (
    "agree: tower's mark at 0.3 Hz, slight differences between blades, 150 states and 15 + 40 modes suffice; disagree: "
    "hardly a mark at 2.9 Hz, 20 states do not smooth the curve"
)
TOWERS = ("NREL tower", "tower three times softer")
MARKS = (
    ("1st tower fore-aft", 0, 1, 0.3),
    ("the same, tower three times softer", 1, 1, None),
    ("blade flapwise", 0, 2, 0.6),
    ("the same, tower three times softer", 1, 2, None),
    ("2nd tower fore-aft", 0, 4, 2.9),
)
"""Name, tower, column of the printed table, the paper's frequency [Hz] if it gives one."""
AXES = ("2", "1", "0.1")
"""Of Figure 15: moment [MN m], tip deflection and tower top [m]."""
COMPARED = {"figure10": towers_marks, "figure11": tips_range, "figure13": sizes}


def turbine_figures(
    case: Case, model: TurbineModel, folder: Path, cache: Cache, tell: Callable[[str], None]
) -> Section:
    """Figures 10, 11, 13 and 14."""
    study, judged = Study(case, "svg"), was_judged(case.hash())
    judgements: list[str] = []
    content: list[str | Table | Path] = [
        "Reading: 'stationary' is a joint frozen with blade 1 up while inflow and wake turn; magnitudes in dB of 1 m "
        "per m/s, the paper's in dB of a gust input whose scale it does not give, so shapes are compared, not levels."
    ]
    for name, (program, subject, judgement) in TURBINE.items():

        def make(name: str = name, program: Callable[..., None] = program) -> dict[str, Array]:
            printed = io.StringIO()
            with tempfile.TemporaryDirectory() as drawn, contextlib.redirect_stdout(printed):
                program(study, Path(drawn), tell)
                drawing = np.frombuffer((Path(drawn) / f"{name}.svg").read_bytes(), dtype=np.uint8)
            return {"drawing": drawing, "printed": np.asarray(printed.getvalue())}

        found = cache.arrays(name, {"case": case.hash()}, make)
        printed = from_markdown(str(found["printed"]))
        content += [
            f"Figure {name.removeprefix('figure')}: {subject}.",
            kept(folder / f"{name}.svg", found["drawing"]),
            *printed,
            *([COMPARED[name](printed, model)] if name in COMPARED else []),
        ]
        judgements.append(f"Figure {name.removeprefix('figure')}. {judgement}")
    if not judged:
        judgements = [f"Not judged: only the figures of {JUDGED} were looked at beside the paper's."]
    return Section(
        "Figures 10, 11, 13 and 14: responses of the turbine",
        tuple(content),
        VERDICT if judged else "",
        tuple(judgements),
    )


def figure_15(model: TurbineModel, folder: Path, cache: Cache, duration: float) -> Section:
    """One realisation, open and closed loop."""

    def make() -> dict[str, Array]:
        comparison = run(plan(["lqg"], model, realisations=1, duration=duration))
        open_loop, closed = (comparison.records[name] for name in ("open_loop", "lqg"))
        peaks = [
            [
                np.abs(record.rbm).max() / 1e6,
                np.abs(record.tip_deflection).max(),
                np.abs(record.tower_fore_aft).max(),
            ]
            for record in (open_loop, closed)
        ]
        return {
            "peaks": np.array(peaks),
            "flap": np.asarray(np.rad2deg(np.abs(closed.flap_angle).max())),
            "lag": np.asarray(_lag(closed.wind[0], -closed.flap_angle[0, :, 0], model.time_step)),
            "drawing": np.frombuffer(draw_figure(comparison, "svg"), dtype=np.uint8),
        }

    found = cache.arrays("figure15", {"duration": duration}, make)
    lag = float(found["lag"])
    rows = tuple(
        (
            name,
            f"{a:.2f}",
            f"{b:.2f}",
            f"{100 * (b / a - 1):+.0f}",
            axis,
            f"{100 * (a / float(axis) - 1):+.0f}",
        )
        for name, a, b, axis in zip(
            ("RBM [MN m]", "tip deflection [m]", "tower-top fore-aft [m]"), *found["peaks"], AXES, strict=True
        )
    )
    return Section(
        "Figure 15: time series, open and closed loop",
        (
            f"Realisation {plan(['lqg'], model, 1).seeds[0]}, {duration:.0f} s, "
            f"{duration * model.rotor_speed / (2 * np.pi):.0f} revolutions; the paper shows 50 of a realisation of "
            "its own, so only the sizes compare. Largest values below; the paper's are the axes of its figure.",
            kept(folder / "figure15.svg", found["drawing"]),
            Table(
                (
                    "largest",
                    "open loop",
                    "LQG",
                    "change [%]",
                    "paper's axis, open loop",
                    "open loop against it [%]",
                ),
                rows,
            ),
        ),
        f"open loop reaches {rows[0][1]} MN m, {rows[1][1]} m and {rows[2][1]} m; the paper's axes are {AXES[0]}, "
        f"{AXES[1]} and {AXES[2]}",
        (
            f"The flap reaches {float(found['flap']):.1f} deg and answers the inflow {abs(lag):.2f} s "
            f"{'late, as in the paper' if lag > 0 else 'early, where the paper has it late'} (greatest correlation).",
        ),
    )


def _lag(cause: Array, effect: Array, time_step: float, longest: float = 3.0) -> float:
    """Delay of the effect at which the two correlate most [s]."""
    reach = min(round(longest / time_step), cause.size // 4)
    inner = cause[reach:-reach]
    shifts = range(-reach, reach + 1)
    products = [inner @ effect[reach + shift : reach + shift + inner.size] for shift in shifts]
    return time_step * shifts[int(np.argmax(products))]
