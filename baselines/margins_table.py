"""Margins of loops as a table of a report."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from baselines.robustness import MARGINS
from flapgym.core.arrays import Array
from studies.document import Table


def margins_table(found: Mapping[str, Array]) -> Table:
    """Margins by label of the controller."""
    rows = ((label, *(_margin(value) for value in values)) for label, values in found.items())
    return Table(("controller", *MARGINS), tuple(rows))


def _margin(value: float) -> str:
    if np.isnan(value):
        return ""
    return "none" if np.isinf(value) else f"{value:.3g}"
