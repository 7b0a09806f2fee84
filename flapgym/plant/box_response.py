"""The response of a turbine to a wind box that passes: read at the strips of the blades, and taken in long blocks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flapgym.core.arrays import Array, ComplexArray
from flapgym.core.modal import Modal
from flapgym.plant.frame import OutputRows
from flapgym.plant.wind_response import Blocks, Blowing
from flapgym.wind.box_field import TRIES, BoxField, BoxOnDisk

RUN_IN = 20.0
"""Time [s] before an episode for which the box is read, too: from equilibrium with the wind at its beginning."""
BLOCK_STEPS = 32
"""Steps taken at once, rounded to whole intervals."""


@dataclass(frozen=True, eq=False)
class BoxResponse:
    """The passage of a box (`flapgym.plant.wind_response.WindResponse`).

    Attributes
    ----------
    modal : Modal
        Winds by strip, in multi-blade coordinates, to the outputs that have rows.
    blocks : Blocks
    turn : float
        Azimuth of one step [rad].
    field : BoxField
    radii : (R,) float
        Of the strips [m].
    """

    modal: Modal
    blocks: Blocks
    turn: float
    field: BoxField
    radii: Array

    @classmethod
    def of(cls, modal: Modal, rows: OutputRows, turn: float, field: BoxField, radii: Array) -> BoxResponse:
        """For intervals of `rows`."""
        return cls(modal, Blocks.of(modal, rows, turn, BLOCK_STEPS), turn, field, radii)

    def noise_count(self, intervals: int) -> int:
        """Numbers that say where in the box an episode begins."""
        return TRIES

    def on_disk(self, noise: Array, intervals: int) -> BoxOnDisk:
        """The box over the disk as it passes."""
        return BoxOnDisk(self.field.box, self.field.begins(noise, self.duration(intervals)), self.radii)

    def respond(self, noise: Array, intervals: int, azimuth: float) -> tuple[Array, Array]:
        """Outputs at sample 0, and rows; told of the wind is its mean over the disk."""
        strips, average = self._passing(noise, intervals, azimuth)
        windows, modes = self._marched(strips)
        first = (self.modal.C @ modes[0]).real + self.modal.D @ strips[self._run_in_blocks * self.blocks.span]
        rows, kept = self.blocks.told(windows, modes, intervals), self.blocks.rows
        # Of the whole box, where the strips know their rings alone.
        after = average[1:][: intervals * kept.steps].reshape(intervals, -1)
        rows[:, kept.structural :] = after[:, kept.steps - kept.kept :]
        first[-1] = average[0]
        return first, rows

    def blowing(self, noise: Array, intervals: int, azimuth: float) -> Blowing:
        """The box as it passes, and the turbine's motion after the run-in."""
        strips, average = self._passing(noise, intervals, azimuth)
        begin = self._run_in_blocks * self.blocks.span
        samples = intervals * self.blocks.rows.steps + 1
        _, modes = self._marched(strips[: begin + self.blocks.span + 1])
        state = (self.modal.expand @ modes[0]).real
        return Blowing(state, strips[begin : begin + samples], average[:samples])

    @property
    def _run_in(self) -> int:
        """Steps before the episode."""
        return round(RUN_IN / self.modal.time_step)

    @property
    def _run_in_blocks(self) -> int:
        """Whole blocks before the episode."""
        return self._run_in // self.blocks.span

    def duration(self, intervals: int) -> float:
        """Of an episode [s]."""
        return intervals * self.blocks.rows.steps * self.modal.time_step

    def _passing(self, noise: Array, intervals: int, azimuth: float) -> tuple[Array, Array]:
        """Winds by strip (., 3 R) from whole blocks before the episode on, and the disk's mean from its start."""
        since = np.arange(-self._run_in, self.blocks.steps(intervals) + 1, dtype=np.float64)
        wind = self.field.passing(noise, since * self.modal.time_step, self.duration(intervals), self.radii)
        strips = wind.components(azimuth + self.turn * since).reshape(len(since), -1)
        begin = self._run_in - self._run_in_blocks * self.blocks.span
        return strips[begin:], wind.rotor_average()[self._run_in :]

    def _marched(self, strips: Array) -> tuple[Array, ComplexArray]:
        """Windows and modes of the episode's blocks, from equilibrium with the first wind."""
        windows, modes = self.blocks.march(self.modal.equilibrium(strips[0]), strips)
        return windows[self._run_in_blocks :], modes[self._run_in_blocks :]
