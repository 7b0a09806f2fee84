"""Multi-blade components over an interval of k steps, seen from the azimuth at which the interval starts.

A turbine's azimuth theta at the interval's start enters once, as the transform between blades and components
(flapgym.model.multiblade); the turn by j Omega dt up to sample j is the same in every interval and for
every turbine, so it is folded into the lifted matrices here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flapgym.core.arrays import BLADES, Array
from flapgym.model.turbine_model import TURBINE_OUTPUTS


def turned(angle: float) -> Array:
    """(3, 3) map of components at azimuth theta to those of the same blade signal at theta + angle.

    From u_c + i u_s = 2/3 sum_b u_b exp(i theta_b): they turn by the angle.
    """
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def input_frame(steps: int, turn: float) -> Array:
    """Native inputs (u^0, ..., u^k) from motion components in the frame of the start, (6 (k + 1), 6 (k + 1)).

    Rows and columns alike: sample by sample flap angle 0, c, s and flap rate 0, c, s.

    Parameters
    ----------
    steps : int
        Steps k of an interval.
    turn : float
        Azimuth Omega dt [rad] of one step.
    """
    frame = np.zeros((steps + 1, 2, BLADES, steps + 1, 2, BLADES))
    for sample in range(steps + 1):
        for kind in range(2):
            frame[sample, kind, :, sample, kind] = turned(sample * turn)
    return frame.reshape(6 * (steps + 1), 6 * (steps + 1))


@dataclass(frozen=True)
class OutputRows:
    """Which outputs of an interval are computed, in the order of the rows.

    Root bending moment at samples 1..k, tip deflection at the samples kept (0, c, s each, in the frame of the
    start), then tower fore-aft and side-to-side and the wind at the samples kept.

    Attributes
    ----------
    steps : int
        Steps k of an interval.
    kept : int
        Samples of tip, tower and wind: all k, or only the last.
    """

    steps: int
    kept: int

    @property
    def blade_rows(self) -> int:
        """Rows that are multi-blade components: they come first."""
        return BLADES * (self.steps + self.kept)

    @property
    def count(self) -> int:
        """All rows."""
        return self.blade_rows + 3 * self.kept

    def matrix(self, turn: float) -> Array:
        """(count, k 9) rows from the outputs (y^1, ..., y^k), each the turbine's eight and the wind."""
        outputs = len(TURBINE_OUTPUTS) + 1
        rows = np.zeros((self.count, self.steps, outputs))
        first_kept = self.steps - self.kept
        for sample in range(self.steps):
            back = turned(-(sample + 1) * turn)
            rows[BLADES * sample : BLADES * (sample + 1), sample, 0:3] = back
            if sample >= first_kept:
                place = sample - first_kept
                tip = BLADES * (self.steps + place)
                rows[tip : tip + BLADES, sample, 3:6] = back
                # Behind the blades: fore-aft, side-to-side and wind, sample by sample.
                flat = self.blade_rows + 3 * place
                rows[flat : flat + 3, sample, 6:9] = np.eye(3)
        return rows.reshape(self.count, self.steps * outputs)
