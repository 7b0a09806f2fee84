"""Tables of the studies' numbers, and the sentences that go with them."""

from __future__ import annotations

import numpy as np

from studies.bode import (
    BANDS,
    PARKED,
    TOWER_BANDS,
    Curves,
    Mark,
    decibel,
    deviations,
    first_peak,
    resonances,
    tower_marks,
)
from studies.document import Table
from studies.tips import CYCLES, Tips


def towers_table(curves: Curves) -> Table:
    """Figure 10: largest change by band."""
    rows = [(mark.name, *mark_cells(mark)) for mark in tower_marks(curves)]
    return Table(("", *(_band(band) for band in TOWER_BANDS)), tuple(rows))


def mark_cells(mark: Mark) -> list[str]:
    """A mark's changes, band by band."""
    pairs = zip(mark.change, mark.frequency, strict=True)
    return [f"{change:+.1f} at {at:.2f} Hz" for change, at in pairs]


def parked_peaks(curves: Curves) -> str:
    """Figure 10: where the parked structure rings."""
    parked = curves[PARKED]
    peaks = (f"{curves.frequency[i]:.3f} Hz ({decibel(parked)[i]:+.0f} dB)" for i in resonances(parked))
    return f"Parked, windless peaks: {', '.join(peaks)}"


def deviation_table(curves: Curves) -> Table:
    """Figures 13 and 14: largest deviation from the first curve by band, and where the first peak stands."""
    rows = [
        (
            each.name,
            *(
                f"{100.0 * share:.2g} ({level:.2g} dB)"
                for share, level in zip(each.share, each.level, strict=True)
            ),
            peak_cell(curves, each.name),
        )
        for each in deviations(curves)
    ]
    full = str(curves.names[0])
    rows.append((full, *("" for _ in BANDS), peak_cell(curves, full)))
    return Table(("", *(_band(band) for band in BANDS), "first peak"), tuple(rows))


def tips_table(found: Tips) -> Table:
    """Figure 11: how large the tips' motion is, and how far the blades part."""
    tips, apart = found.tips, found.apart
    exact, exact_apart = found.exact_rms
    spread = tips.max(axis=1) - tips.min(axis=1)
    own = (
        f"cycles {CYCLES[0]} to {CYCLES[1]} of one realisation",
        f"{np.sqrt((tips**2).mean()):.3f}",
        f"{tips.min():+.2f} to {tips.max():+.2f}",
        f"{np.sqrt((apart**2).mean()):.4f}",
        f"{100.0 * np.sqrt((apart**2).mean() / (tips**2).mean()):.1f} %",
        f"{spread.max():.3f}",
    )
    ratio = f"{100.0 * exact_apart / exact:.1f} %"
    stationary = ("stationary", f"{exact:.3f}", "", f"{exact_apart:.4f}", ratio, "")
    head = ("", "tip rms [m]", "range [m]", "rms of a blade from the mean of three [m]")
    return Table((*head, "over tip rms", "largest spread [m]"), (own, stationary))


TITLES = {
    "figure10": "Figure 10: tip per gust over that on a rigid tower, largest change [dB]",
    "figure11": "Figure 11: tips of the three blades",
    "figure13": "Figure 13: deviation from all modes and states [%], and in decibels",
    "figure14": "Figure 14: deviation from the full lattice [%], and in decibels",
}
"""Over the tables."""


def _band(band: tuple[float, float]) -> str:
    return f"{band[0]:g} to {band[1]:g} Hz"


def peak_cell(curves: Curves, name: str) -> str:
    """Height and place of a response's first peak."""
    level, frequency = first_peak(curves, name)
    return f"{level:.1f} dB at {frequency:.3f} Hz"
