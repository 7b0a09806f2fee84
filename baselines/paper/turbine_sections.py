"""Figures 10, 11 and 13 to 15, the turbine's responses beside the paper's, as sections of the report."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from baselines.cache import Cache
from baselines.models import JUDGED, was_judged
from baselines.paper.drawing import kept
from flapgym.core.arrays import Array
from flapgym.evaluation import plan, run
from flapgym.evaluation.figure import draw_figure
from flapgym.model.turbine_model import TurbineModel
from flapgym.turbine import Case
from studies.bode import OWN, SOFT, Curves, aerodynamic_states, structural_modes, tower_marks, towers
from studies.document import Section, Table
from studies.figures import draw_aerodynamic_states, draw_structural_modes, draw_tips, draw_towers
from studies.parts import Study
from studies.tables import TITLES, deviation_table, parked_peaks, tips_table, towers_table
from studies.tips import Tips, tips_in_turbulence

SUBJECTS = {
    "figure10": "Bode diagram, gust to tip deflection, rigid, NREL and three times softer tower",
    "figure11": "tips of the three turning blades in one homogeneous gust",
    "figure13": "5 + 20 and 15 + 40 structural modes against all",
    "figure14": "20, 50 and 150 aerodynamic states against all",
}
JUDGEMENTS = {
    "figure10": "Agrees: the tower's first fore-aft mode marks the blade's answer near 0.3 Hz, and lower on the softer "
    "tower. Disagrees: of the second, at 2.9 Hz, hardly anything shows. Our air damps the flapwise modes of the "
    "turning blade so much that they make no peak of their own.",
    "figure11": "Agrees: the tips differ slightly, by azimuth; the tower makes the difference. Disagrees: ours swing "
    "down nearly as far as up, which a gust without a mean makes them do; the paper shows a realisation of its own.",
    "figure13": "Agrees: 15 tower and 40 blade modes do (ours are 13 a blade), 5 and 20 get the first modes only.",
    "figure14": "Agrees: 150 states do, 50 hardly. Disagrees: 20 states do not smooth the curve as the paper's do, "
    "because structure and lattice are joined after the reduction; they misplace its level.",
}
"""Of the figures of the whole turbine (docs/turbine.md says more)."""


@dataclass(frozen=True, eq=False)
class Responses:
    """What the figures of the whole turbine show."""

    towers: Curves
    tips: Tips
    structural_modes: Curves
    aerodynamic_states: Curves


def turbine_responses(
    case: Case, model: TurbineModel, cache: Cache, tell: Callable[[str], None]
) -> Responses:
    """The figures' numbers, each figure kept by itself."""
    study, settings = Study(case), {"case": case.hash()}
    return Responses(
        cache.data(Curves, "figure10", settings, lambda: towers(study, tell)),
        cache.data(Tips, "figure11", settings, lambda: tips_in_turbulence(model)),
        cache.data(Curves, "figure13", settings, lambda: structural_modes(study, tell)),
        cache.data(Curves, "figure14", settings, lambda: aerodynamic_states(study, tell)),
    )


def towers_marks(curves: Curves) -> Table:
    """Figure 10: where the tower and the blades mark the answer, and the paper's words."""
    found = {mark.name: mark for mark in tower_marks(curves)}
    rows = []
    for mode, tower, band, paper in MARKS:
        frequency = round(float(found[tower].frequency[band]), 2)
        error = "" if paper is None else f"{100.0 * (frequency / paper - 1.0):+.0f}"
        rows.append((mode, f"{frequency:.2f}", "lower" if paper is None else f"around {paper:g}", error))
    return Table(("mark [Hz]", "ours", "paper", "error [%]"), tuple(rows))


def tips_range(found: Tips) -> Table:
    """Figure 11: range of the tips, and the axis of the paper's figure."""
    low, high = (round(float(value), 2) for value in (found.tips.min(), found.tips.max()))
    return Table(
        ("tips over nine turns [m]", "ours", "paper's axis", "difference [m]"),
        (
            ("lowest", f"{low:+.2f}", "-0.2", f"{low + 0.2:+.2f}"),
            ("highest", f"{high:+.2f}", "+1", f"{high - 1.0:+.2f}"),
        ),
    )


def sizes(model: TurbineModel) -> Table:
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
MARKS = (
    ("1st tower fore-aft", OWN, 0, 0.3),
    ("the same, tower three times softer", SOFT, 0, None),
    ("blade flapwise", OWN, 1, 0.6),
    ("the same, tower three times softer", SOFT, 1, None),
    ("2nd tower fore-aft", OWN, 3, 2.9),
)
"""Name, tower, band of TOWER_BANDS, the paper's frequency [Hz] if it gives one."""
AXES = ("2", "1", "0.1")
"""Of Figure 15: moment [MN m], tip deflection and tower top [m]."""


def turbine_figures(found: Responses, case: Case, model: TurbineModel, folder: Path) -> Section:
    """Figures 10, 11, 13 and 14."""
    judged = was_judged(case.hash())
    pictures = {name: folder / f"{name}.svg" for name in SUBJECTS}
    draw_towers(found.towers, pictures["figure10"])
    draw_tips(found.tips, pictures["figure11"])
    draw_structural_modes(found.structural_modes, pictures["figure13"])
    draw_aerodynamic_states(found.aerodynamic_states, pictures["figure14"])
    tables: dict[str, tuple[str | Table, ...]] = {
        "figure10": (towers_table(found.towers), parked_peaks(found.towers), towers_marks(found.towers)),
        "figure11": (tips_table(found.tips), tips_range(found.tips)),
        "figure13": (deviation_table(found.structural_modes), sizes(model)),
        "figure14": (deviation_table(found.aerodynamic_states),),
    }
    content: list[str | Table | Path] = [
        "Reading: 'stationary' is a joint frozen with blade 1 up while inflow and wake turn; magnitudes in dB of 1 m "
        "per m/s, the paper's in dB of a gust input whose scale it does not give, so shapes are compared, not levels."
    ]
    for name, subject in SUBJECTS.items():
        number = name.removeprefix("figure")
        content += [f"Figure {number}: {subject}.", pictures[name], TITLES[name], *tables[name]]
    judgements = [f"Figure {name.removeprefix('figure')}. {words}" for name, words in JUDGEMENTS.items()]
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
