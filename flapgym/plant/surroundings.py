"""What blows over the disk and pulls at the blades: a turbulent field, steady inflow, gravity, and their response.

Superposition again: the response of an episode is computed at once. A field is drawn at the strips of the blades and
lifted over many steps; what is steady depends on the azimuth alone, and its response is a few harmonics of three times
the rotor's speed (harmonic balance).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.constants import g as STANDARD_GRAVITY

from flapgym.core.arrays import BLADES, Array, ComplexArray
from flapgym.core.state_space import StateSpace
from flapgym.model.multiblade import to_blades
from flapgym.model.nameplate import nameplate
from flapgym.model.signals import COMPONENTS, grouped, strip_inputs
from flapgym.model.turbine_model import TurbineModel
from flapgym.plant.frame import OutputRows
from flapgym.plant.lifted import Lifted, lift
from flapgym.plant.modal import Modal
from flapgym.wind import Inflow
from flapgym.wind.field import DiskTurbulence, DiskWind, disk_turbulence
from flapgym.wind.turbulence import Turbulence

RUN_IN = 20.0
"""Time [s] before an episode for which its field is drawn, too: from equilibrium with the wind at its beginning."""
BLOCK_STEPS = 32
"""Steps taken at once, rounded to whole intervals."""
LEFT_OUT = 1e-10
"""Share of the steady wind's variance in each strip that harmonics may leave out. By default it is much more, as it is
of no account for the wind; but edgewise loads and the tower's acceleration are mostly of the highest harmonics."""


@dataclass(frozen=True)
class Surroundings:
    """Beside, or in place of, a homogeneous wind.

    Attributes
    ----------
    field : Turbulence or None
        Which replaces the homogeneous turbulence; it knows its intensity and scale.
    inflow : Inflow or None
        What is steady of the wind over the disk.
    gravity : bool
        Whether the blades feel it.
    """

    field: Turbulence | None = None
    inflow: Inflow | None = None
    gravity: bool = False

    @property
    def steady(self) -> bool:
        """Whether there is what depends on the azimuth alone."""
        return self.inflow is not None or self.gravity

    @property
    def turns(self) -> bool:
        """Whether the response of an episode depends on the azimuth at its start."""
        return self.steady or self.field is not None

    def require(self, model: TurbineModel) -> None:
        """Refuse a model without the inputs that this takes.

        Raises
        ------
        ValueError
            The message names the setting and a model that has them.
        """
        wants = [
            ("wind.field", self.field is not None, "winds by strip", model.strips > 0),
            ("wind.inflow", self.inflow is not None, "winds by strip", model.strips > 0),
            ("gravity", self.gravity, "gravity as an input", "gravity" in model.turbine.inputs),
        ]
        for name, wanted, what, there in wants:
            if not wanted:
                continue
            if not there:
                raise ValueError(
                    f"{name}: expected a model with {what}, such as nrel5mw-site, got {model.name}; "
                    "see [signals] in the case file"
                )
            if model.periodic is not None:
                raise ValueError(f"{name}: expected a model of equal blades, got {model.name}")
            if name != "gravity" and nameplate(model.case).disk is None:
                raise ValueError(
                    f"{name}: expected a model whose case tells rotor and tower, got {model.name}"
                )


@dataclass(frozen=True, eq=False)
class Steady:
    """The response to what is steady, about its mean over a revolution: that mean is a matter of the trim.

    Attributes
    ----------
    outputs : tuple of str
        Of the turbine, ny, the blades' in multi-blade coordinates.
    harmonics : (N + 1, ny + 1) complex
        Outputs in multi-blade coordinates, and the wind, are the real part of their sum times exp(3 i n azimuth).
    mean : (ny + 1,) float
        What is left out: of each blade in `_0`, of the fixed outputs.
    """

    outputs: tuple[str, ...]
    harmonics: ComplexArray
    mean: Array

    def at(self, azimuth: Array) -> Array:
        """Outputs and wind (T, ny + 1) at azimuths (T,) [rad]."""
        turns = np.exp(1j * BLADES * azimuth[:, None] * np.arange(len(self.harmonics)))
        return np.asarray((turns @ self.harmonics).real)

    def told(self, azimuth: Array) -> dict[str, Array]:
        """Outputs by name at azimuths of blade 1 (T,) [rad]: the blades' (T, 3), the fixed ones (T,)."""
        found, told = self.at(azimuth), dict[str, Array]()
        for base, of_blades in grouped(self.outputs):
            at = self.outputs.index(f"{base}_{COMPONENTS[0]}" if of_blades else base)
            told[base] = to_blades(found[:, at : at + BLADES], azimuth) if of_blades else found[:, at]
        return told


def steady_response(model: TurbineModel, surroundings: Surroundings, outputs: tuple[str, ...]) -> Steady:
    """By harmonic balance: the turbine's frequency response at three, six, ... times the rotor's speed.

    Parameters
    ----------
    model : TurbineModel
    surroundings : Surroundings
    outputs : tuple of str
        Of the turbine; the wind is told behind them, and is zero.
    """
    turbine = model.turbine
    forced: list[tuple[list[str], ComplexArray]] = []
    if surroundings.inflow is not None:
        disk = nameplate(model.case).disk
        assert disk is not None
        found = surroundings.inflow.components(strip_radii(model), disk, model.wind_speed, left_out=LEFT_OUT)
        forced.append((list(strip_inputs(model.strips)), found.reshape(len(found), -1)))
    if surroundings.gravity:
        forced.append((["gravity"], np.full((1, 1), STANDARD_GRAVITY, dtype=complex)))
    count = max(len(forcing) for _, forcing in forced)
    frequency = BLADES * np.arange(count) * model.rotor_speed / (2.0 * np.pi)
    harmonics = np.zeros((count, len(outputs) + 1), dtype=complex)
    for inputs, forcing in forced:
        part = turbine.select(inputs=inputs, outputs=list(outputs))
        response = part.frequency_response(frequency[: len(forcing)])
        harmonics[: len(forcing), :-1] += np.einsum("nyu,nu->ny", response, forcing)
    constant = [i for i, name in enumerate(outputs) if not name.endswith(("_c", "_s"))]
    mean = np.zeros(len(outputs) + 1)
    mean[constant] = harmonics[0, constant].real
    harmonics[0, constant] = 0.0
    return Steady(outputs, harmonics, mean)


def strip_radii(model: TurbineModel) -> Array:
    """Middle of each strip along the blade, from the rotor's apex [m], (strips,)."""
    return nameplate(model.case).strip_radii


@dataclass(frozen=True, eq=False)
class FieldResponse:
    """Draws fields and gives the outputs they cause; the counterpart of `flapgym.plant.disturbance.Disturbance`.

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
    field : Turbulence
    radii : (R,) float
        Of the strips [m].
    wind_speed : float
        [m/s]
    """

    modal: Modal
    block: Lifted
    intervals_per_block: int
    rows: OutputRows
    turn: float
    field: Turbulence
    radii: Array
    wind_speed: float

    @classmethod
    def of(
        cls, modal: Modal, rows: OutputRows, turn: float, field: Turbulence, model: TurbineModel
    ) -> FieldResponse:
        """For intervals of `rows`; `turn` is the azimuth [rad] of one step."""
        intervals = max(1, round(BLOCK_STEPS / rows.steps))
        matrix = np.kron(np.eye(intervals), rows.matrix(turn))
        block = lift(modal, intervals * rows.steps, np.asarray(matrix, dtype=float))
        return cls(modal, block, intervals, rows, turn, field, strip_radii(model), model.wind_speed)

    @property
    def _span(self) -> int:
        return self.intervals_per_block * self.rows.steps

    @property
    def _run_in(self) -> int:
        """Steps before the episode."""
        return round(RUN_IN / self.modal.time_step)

    def _blocks(self, intervals: int) -> int:
        return -(-intervals // self.intervals_per_block)

    def _disk(self, intervals: int) -> DiskTurbulence:
        # The same numbers make another wind where it is to last longer. So lengths are few: whoever holds actions
        # longer, and has to round its episode up to whole ones, meets the same wind.
        steps = 2.0 ** (
            math.ceil(4.0 * math.log2(self._run_in + self._blocks(intervals) * self._span + 1)) / 4.0
        )
        time_step = self.modal.time_step
        return disk_turbulence(
            self.field, self.radii, self.wind_speed, self.turn / time_step, time_step, math.ceil(steps)
        )

    def noise_count(self, intervals: int) -> int:
        """Random numbers one realisation of so many intervals takes."""
        return self._disk(intervals).noise_count

    def realisation(self, noise: Array, intervals: int) -> tuple[DiskWind, int]:
        """The field that normal numbers (noise_count,) make, and its step at which the episode begins."""
        wind = self._disk(intervals).draw(noise, self.field.deviation(self.wind_speed))
        return wind, self._run_in

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
        span, blocks = self._span, self._blocks(intervals)
        wind, _ = self.realisation(noise, intervals)
        since = np.arange(wind.steps, dtype=np.float64) - self._run_in
        strips = wind.components(azimuth + self.turn * since).reshape(len(since), -1)
        # Whole blocks before the episode.
        run_in = self._run_in // span
        begin = self._run_in - run_in * span
        strips = strips[begin : begin + (run_in + blocks) * span + 1]
        average = wind.rotor_average()
        # Windows of one block each; the last sample of one is the first of the next.
        windows = np.lib.stride_tricks.sliding_window_view(strips, span + 1, axis=0)[::span]
        windows = windows.transpose(0, 2, 1).reshape(run_in + blocks, -1)
        inputs = strips.shape[1]
        pushes = (windows[:, : span * inputs] @ self.block.drive).view(complex)
        equilibrium = self.modal.drive @ strips[0] / (1.0 - self.modal.values)
        states = self.block.march(equilibrium, pushes)[run_in:]
        first = (self.modal.read @ states[0].view(complex)).real + self.modal.D @ strips[run_in * span]
        rows = states @ self.block.read + windows[run_in:] @ self.block.feed
        rows = rows.reshape(-1, self.rows.count)[:intervals]
        # The wind has no modes: its rows, at the samples kept, are what they are.
        after = average[self._run_in + 1 :][: intervals * self.rows.steps].reshape(intervals, -1)
        rows[:, self.rows.structural :] = after[:, self.rows.steps - self.rows.kept :]
        first[-1] = average[self._run_in]
        return first, rows


def strip_system(model: TurbineModel) -> StateSpace:
    """The turbine under winds by strip alone."""
    return model.turbine.select(inputs=list(strip_inputs(model.strips)))
