"""What the wind's part of superposition is made of: realisations of it, and an episode of them taken in long blocks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from flapgym.core.arrays import Array, ComplexArray
from flapgym.core.lifted import Lifted, lift
from flapgym.core.modal import Modal, marched
from flapgym.plant.frame import OutputRows
from flapgym.wind.blade_field import FieldOnDisk
from flapgym.wind.box_field import BoxOnDisk


class Blowing(NamedTuple):
    """A realisation for a plant that steps through it, and the turbine it meets at sample 0.

    Attributes
    ----------
    state : (n,) float
        Of the turbine at sample 0.
    winds : (T + 1, w) float
        At samples 0 to T [m/s]: the homogeneous wind, w = 1, or winds of R strips in components 0, c, s, w = 3 R.
    average : (T + 1,) float
        Their mean over the disk [m/s].
    """

    state: Array
    winds: Array
    average: Array


class WindResponse(Protocol):
    """Makes realisations of a wind from normal numbers, and what they do to a turbine.

    Every method takes noise (noise_count,), standard normal numbers; the length of the episode in intervals; and the
    azimuth of blade 1 at its start [rad], where that matters.
    """

    def noise_count(self, intervals: int) -> int:
        """Numbers that one realisation of so many intervals takes."""
        ...

    def respond(self, noise: Array, intervals: int, azimuth: float) -> tuple[Array, Array]:
        """Outputs and wind (ny + 1,) at sample 0, in multi-blade coordinates, and rows (intervals, rows.count)."""
        ...

    def blowing(self, noise: Array, intervals: int, azimuth: float) -> Blowing:
        """The wind itself."""
        ...

    def on_disk(self, noise: Array, intervals: int) -> FieldOnDisk | BoxOnDisk:
        """The wind over the disk, for a picture; ValueError where it is the same all over."""
        ...


@dataclass(frozen=True, eq=False)
class Blocks:
    """A modal system under inputs that are known for a whole episode: several intervals at once.

    Attributes
    ----------
    lifted : Lifted
        A block.
    intervals : int
        Of a block.
    rows : OutputRows
        Of one interval.
    """

    lifted: Lifted
    intervals: int
    rows: OutputRows

    @classmethod
    def of(cls, modal: Modal, rows: OutputRows, turn: float, steps: int) -> Blocks:
        """Of about so many steps; `turn` is the azimuth [rad] of one."""
        intervals = max(1, round(steps / rows.steps))
        matrix = np.asarray(np.kron(np.eye(intervals), rows.matrix(turn)), dtype=float)
        return cls(lift(modal, intervals * rows.steps, matrix), intervals, rows)

    @property
    def span(self) -> int:
        """Steps of a block."""
        return self.intervals * self.rows.steps

    def steps(self, intervals: int) -> int:
        """Steps of as many whole blocks as so many intervals take."""
        return -(-intervals // self.intervals) * self.span

    def march(self, modes: ComplexArray, inputs: Array) -> tuple[Array, ComplexArray]:
        """Windows (blocks, (span + 1) nu) of inputs (blocks span + 1, nu), and modes (blocks, m) at their starts."""
        # The last sample of a window is the first of the next. Copied: products of overlapping views are slow.
        windows = np.lib.stride_tricks.sliding_window_view(inputs, self.span + 1, axis=0)[:: self.span]
        windows = windows.transpose(0, 2, 1).reshape(len(windows), -1).copy()
        real, imaginary = np.hsplit(windows[:, : len(self.lifted.B)] @ self.lifted.B, 2)
        return windows, marched(self.lifted.values, modes, real + 1j * imaginary)[0]

    def told(self, windows: Array, modes: ComplexArray, intervals: int) -> Array:
        """Rows (intervals, rows.count) of what `march` gives."""
        rows = np.hstack([modes.real, modes.imag]) @ self.lifted.C + windows @ self.lifted.D
        return np.asarray(rows.reshape(-1, self.rows.count)[:intervals])
