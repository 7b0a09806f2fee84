"""Figures 8 and 12, the aerodynamics beside the paper's, as sections of the report."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from baselines.cache import Cache
from flapgym.turbine import Case
from studies.document import Section, Table
from studies.figures import draw_gust_loads, draw_hankel_values
from studies.gust import WAKES, GustLoads, gust_loads
from studies.hankel import TOTALS, hankel_values
from studies.parts import Study

PAPER_LOSS = -15.0
"""Figure 8: the full rotor's steady load against a single blade's [%]."""
PAPER_STATES = 150
"""Figure 12: where the paper truncates, three orders of magnitude down."""
PAPER_VALUE = 1e-3


def figure_8(case: Case, folder: Path, cache: Cache) -> Section:
    """Impulsive gust on the full rotor against one blade."""
    found = cache.data(GustLoads, "figure8", {"case": case.hash()}, lambda: gust_loads(case))
    draw_gust_loads(found, picture := folder / "figure8.svg")
    rows = tuple(
        (
            f"{length:g} diameters, induction {induction:g}",
            f"{loss:+.1f}",
            f"{PAPER_LOSS:+.0f}",
            f"{loss - PAPER_LOSS:+.1f}",
        )
        for (length, induction), loss in zip(WAKES, found.loss, strict=True)
    )
    short, long = found.loss
    turns = WAKES[0][0] * 2.0 * case.turbine.rotor.radius / case.operating_point.wind_speed * case.rotor_speed
    return Section(
        "Figure 8: load after an impulsive gust, full rotor against a single blade",
        (
            "Rigid, undeflected blades; flapwise root moment; dotted lines at thirds of a turn, where blades meet shed "
            "wake.",
            picture,
            Table(("wake", "steady load, full over single [%]", "paper [%]", "difference [points]"), rows),
        ),
        f"steady loss {short:+.1f} % with the wake length stated, {long:+.1f} % with a longer and slower one; the "
        f"paper has about {PAPER_LOSS:.0f} %",
        (
            f"With the wake length the paper states, a quarter of a diameter, we disagree: {short:+.1f} % instead of "
            f"about {PAPER_LOSS:.0f} %. That wake is {turns / (2 * np.pi):.2f} turns "
            f"long, too short for a blade to meet its own. A wake of one diameter slowed by induction gives "
            f"{long:+.1f} %, with dips at each third of a turn as in the paper.",
        ),
    )


def figure_12(case: Case, folder: Path, cache: Cache) -> Section:
    """Hankel singular values of the rotor's aerodynamics."""
    found = cache.arrays("figure12", {"case": case.hash()}, lambda: {"values": hankel_values(Study(case))})
    values = found["values"] / found["values"][0]
    draw_hankel_values(values, picture := folder / "figure12.svg")
    rows = tuple(
        (
            str(states),
            f"{values[states - 1]:.2g}",
            f"about {PAPER_VALUE:.0e}" if states == PAPER_STATES else "",
            f"{np.log10(values[states - 1] / PAPER_VALUE):+.1f}" if states == PAPER_STATES else "",
        )
        for states in TOTALS
    )
    return Section(
        "Figure 12: Hankel singular values of the rotor's aerodynamics",
        (
            "Collective and whirl components together, over the largest. Reading: inputs scaled to unit rms downwash, "
            "outputs to their size at 0.2 Hz; the decay depends on that scaling, which the paper does not give.",
            picture,
            Table(("state", "value over the largest", "paper", "difference [orders of magnitude]"), rows),
        ),
        f"{-np.log10(values[PAPER_STATES - 1]):.1f} orders of magnitude down at state {PAPER_STATES}; the paper: three",
        (
            f"At the paper's truncation, 150 states, ours have fallen by {-np.log10(values[149]):.1f} orders of "
            "magnitude where the paper's figure shows three"
            + ("." if values[149] > 3e-4 else ": ours fall further, in our scaling."),
        ),
    )
