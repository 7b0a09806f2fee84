"""The response of a turbine to a wind box that passes: read at the strips of the blades, and lifted over many steps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flapgym.core.arrays import Array
from flapgym.plant.frame import OutputRows
from flapgym.plant.lifted import Lifted, lift
from flapgym.plant.modal import Modal
from flapgym.plant.start import Blowing
from flapgym.wind.box_field import TRIES, BoxField, BoxOnDisk, BoxWind

RUN_IN = 20.0
"""Time [s] before an episode for which the box is read, too: from equilibrium with the wind at its beginning."""
BLOCK_STEPS = 32
"""Steps taken at once, rounded to whole intervals."""


@dataclass(frozen=True, eq=False)
class BoxResponse:
    """Gives the outputs that the passage of a box causes; the counterpart of `flapgym.plant.disturbance.Disturbance`.

    Attributes
    ----------
    modal : Modal
        Winds by strip, in multi-blade coordinates, to the outputs that have rows.
    block : Lifted
        Several intervals at once.
    intervals_per_block : int
    rows : OutputRows
        Rows of one interval.
    turn : float
        Azimuth of one step [rad].
    field : BoxField
    radii : (R,) float
        Of the strips [m].
    """

    modal: Modal
    block: Lifted
    intervals_per_block: int
    rows: OutputRows
    turn: float
    field: BoxField
    radii: Array

    @classmethod
    def of(
        cls,
        modal: Modal,
        rows: OutputRows,
        turn: float,
        field: BoxField,
        radii: Array,
    ) -> BoxResponse:
        """For intervals of `rows`; `turn` is the azimuth [rad] of one step."""
        intervals = max(1, round(BLOCK_STEPS / rows.steps))
        matrix = np.kron(np.eye(intervals), rows.matrix(turn))
        block = lift(modal, intervals * rows.steps, np.asarray(matrix, dtype=float))
        return cls(modal, block, intervals, rows, turn, field, radii)

    @property
    def _span(self) -> int:
        return self.intervals_per_block * self.rows.steps

    @property
    def _run_in(self) -> int:
        """Steps before the episode."""
        return round(RUN_IN / self.modal.time_step)

    def _blocks(self, intervals: int) -> int:
        return -(-intervals // self.intervals_per_block)

    def noise_count(self, intervals: int) -> int:
        """Random numbers one realisation of so many intervals takes."""
        return TRIES

    def _wind(self, noise: Array, intervals: int) -> BoxWind:
        """From `_run_in` steps before the episode to the end of its last block."""
        steps = np.arange(-self._run_in, self._blocks(intervals) * self._span + 1, dtype=np.float64)
        duration = intervals * self.rows.steps * self.modal.time_step
        return self.field.passing(noise, steps * self.modal.time_step, duration, self.radii)

    def on_disk(self, noise: Array, intervals: int) -> BoxOnDisk:
        """The box over the disk as it passes, for a picture."""
        duration = intervals * self.rows.steps * self.modal.time_step
        return BoxOnDisk(self.field.box, self.field.begins(noise, duration), self.radii)

    def respond(self, noise: Array, intervals: int, azimuth: float) -> tuple[Array, Array]:
        """Outputs that a realisation of the field causes.

        Parameters
        ----------
        noise : (noise_count,) float
            Standard normal numbers.
        intervals : int
            Length of the episode.
        azimuth : float
            Of blade 1 at its start [rad].

        Returns
        -------
        first : (ny + 1,) float
            Outputs at sample 0, blades in multi-blade coordinates, and the wind, here the mean over the disk.
        rows : (intervals, rows.count) float
            Rows of every interval.
        """
        strips, average = self._passing(noise, intervals, azimuth)
        run_in = self._whole_run_in
        windows, states = self._marched(strips)
        windows, states = windows[run_in:], states[run_in:]
        first = (self.modal.read @ states[0].view(complex)).real + self.modal.D @ strips[run_in * self._span]
        rows = states @ self.block.read + windows @ self.block.feed
        rows = rows.reshape(-1, self.rows.count)[:intervals]
        # The wind has no modes: its rows, at the samples kept, are what they are.
        after = average[1:][: intervals * self.rows.steps].reshape(intervals, -1)
        rows[:, self.rows.structural :] = after[:, self.rows.steps - self.rows.kept :]
        first[-1] = average[0]
        return first, rows

    def blowing(self, noise: Array, intervals: int, azimuth: float) -> Blowing:
        """The box itself as it passes, and the turbine's motion after the run-in; given as to `respond`."""
        strips, average = self._passing(noise, intervals, azimuth)
        begin, samples = self._whole_run_in * self._span, intervals * self.rows.steps + 1
        _, states = self._marched(strips[: begin + self._span + 1])
        return Blowing(states[-1].view(complex), strips[begin : begin + samples], average[:samples])

    @property
    def _whole_run_in(self) -> int:
        """Whole blocks before the episode."""
        return self._run_in // self._span

    def _passing(self, noise: Array, intervals: int, azimuth: float) -> tuple[Array, Array]:
        """Winds by strip (., 3 R) from whole blocks before the episode on, and the disk's mean from its start."""
        wind = self._wind(noise, intervals)
        since = np.arange(wind.steps, dtype=np.float64) - self._run_in
        strips = wind.components(azimuth + self.turn * since).reshape(len(since), -1)
        begin = self._run_in - self._whole_run_in * self._span
        return strips[begin:], wind.rotor_average()[self._run_in :]

    def _marched(self, strips: Array) -> tuple[Array, Array]:
        """Windows (blocks, .) of one block each of winds by strip, and modes (blocks, 2 M) at the blocks' starts."""
        # The last sample of a window is the first of the next.
        windows = np.lib.stride_tricks.sliding_window_view(strips, self._span + 1, axis=0)[:: self._span]
        windows = windows.transpose(0, 2, 1).reshape(len(windows), -1)
        pushes = (windows[:, : self._span * strips.shape[1]] @ self.block.drive).view(complex)
        equilibrium = self.modal.drive @ strips[0] / (1.0 - self.modal.values)
        return windows, self.block.march(equilibrium, pushes)
