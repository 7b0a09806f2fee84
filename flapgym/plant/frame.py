"""Multi-blade components over an interval of k steps, seen from the azimuth at which the interval starts.

A turbine's azimuth theta at the interval's start enters once, as the transform between blades and components
(flapgym.core.multiblade); the turn by j Omega dt up to sample j is the same in every interval and for
every turbine, so it is folded into the lifted matrices here.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from flapgym.core.arrays import BLADES, Array


def turned(angle: float) -> Array:
    """(3, 3) map of components at azimuth theta to those of the same blade signal at theta + angle.

    From u_c + i u_s = 2/3 sum_b u_b exp(i theta_b): they turn by the angle.
    """
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def input_frame(
    steps: int, turn: float, actuators: int = 1, accelerated: int = 0, time_step: float = 1.0
) -> Array:
    """Native inputs (u^0, ..., u^k) from motion components in the frame of the start, (nu (k + 1), 6 A (k + 1)).

    Rows and columns alike: sample by sample the angles of actuators 1..A of a blade in components 0, c, s, then their
    rates; in the rows behind these the accelerations of the last few in the step that begins at the sample, and in the
    one that ends there: nu = 3 (2 A + 2 accelerated).

    Parameters
    ----------
    steps : int
        Steps k of an interval.
    turn : float
        Azimuth Omega dt [rad] of one step.
    actuators : int
        Actuators A on a blade.
    accelerated : int
        How many of them act by their acceleration, too: the last ones.
    time_step : float
        dt [s].
    """
    signals = 2 * actuators
    frame = np.zeros((steps + 1, signals + 2 * accelerated, BLADES, steps + 1, signals, BLADES))
    for sample in range(steps + 1):
        to_sample = turned(sample * turn)
        for signal in range(signals):
            frame[sample, signal, :, sample, signal] = to_sample
        for which, after in ((0, sample + 1), (accelerated, sample)):
            if not 1 <= after <= steps:
                continue  # the first sample's outputs and what the last one drives belong to other intervals
            for number in range(accelerated):
                row, rate = signals + which + number, signals - accelerated + number
                frame[sample, row, :, after, rate] = to_sample / time_step
                frame[sample, row, :, after - 1, rate] = -to_sample / time_step
    return frame.reshape(len(frame) * frame.shape[1] * BLADES, -1)


@dataclass(frozen=True)
class OutputRows:
    """Which outputs of an interval are computed, in the order of the rows.

    The first blade quantity, the root bending moment, at samples 1..k; the other blade quantities one after the other
    at the samples kept (0, c, s each, in the frame of the start); the fixed quantities at the samples kept; and the
    wind at the samples kept.

    Attributes
    ----------
    steps : int
        Steps k of an interval.
    kept : int
        Samples of everything but the first quantity: all k, or only the last.
    blade_outputs : int
        Quantities of the blades, the first included, B.
    fixed_outputs : int
        Quantities of the fixed frame, without the wind.
    """

    steps: int
    kept: int
    blade_outputs: int = 2
    fixed_outputs: int = 2

    @property
    def blade_rows(self) -> int:
        """Rows that are multi-blade components: they come first."""
        return BLADES * (self.steps + (self.blade_outputs - 1) * self.kept)

    @property
    def structural(self) -> int:
        """Rows without the wind's."""
        return self.blade_rows + self.fixed_outputs * self.kept

    @property
    def count(self) -> int:
        """All rows."""
        return self.structural + self.kept

    def matrix(self, turn: float) -> Array:
        """(count, k ny) rows from the outputs (y^1, ..., y^k), each the turbine's and the wind."""
        return _row_matrix(self, turn)


@lru_cache(maxsize=32)
def _row_matrix(wanted: OutputRows, turn: float) -> Array:
    """Kept, because every episode asks for it."""
    outputs = BLADES * wanted.blade_outputs + wanted.fixed_outputs + 1
    rows = np.zeros((wanted.count, wanted.steps, outputs))
    first_kept = wanted.steps - wanted.kept
    for sample in range(wanted.steps):
        # Back from the sample's own frame into that of the start.
        back = turned(-(sample + 1) * turn)
        rows[BLADES * sample : BLADES * (sample + 1), sample, :BLADES] = back
        if sample < first_kept:
            continue
        place = sample - first_kept
        for quantity in range(1, wanted.blade_outputs):
            row = BLADES * (wanted.steps + (quantity - 1) * wanted.kept + place)
            rows[row : row + BLADES, sample, BLADES * quantity : BLADES * (quantity + 1)] = back
        for quantity in range(wanted.fixed_outputs + 1):
            row = wanted.blade_rows + quantity * wanted.kept + place
            rows[row, sample, BLADES * wanted.blade_outputs + quantity] = 1.0
    matrix = rows.reshape(wanted.count, wanted.steps * outputs)
    matrix.setflags(write=False)  # whoever asks again gets this one
    return matrix
