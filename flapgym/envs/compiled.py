"""The step of one turbine together with its observation and reward, in one call of compiled code.

An environment of one turbine steps in one or two microseconds, and every array that is handed to compiled code or back
takes a twentieth of one. So few are: constants, state and what is told are a flat array each. Many turbines take
`flapgym.plant` and `flapgym.envs.task` as they are.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numba.np.unsafe.ndarray import to_fixed_tuple
from numpy import empty

from flapgym.core.arrays import BLADES, Array, FloatArray
from flapgym.core.kept import OPTIONS, first_cause, kept, run_kept
from flapgym.envs.task import Scoring
from flapgym.plant.backends.numba import (
    EDITION,
    MOTION,
    ONE,
    START,
    TWO,
    actuators,
    add_inputs,
    choose,
    components,
    last_size,
    let_decay,
    move,
    read_modes,
    tell,
    work_size,
)
from flapgym.plant.linear import LinearPlant
from flapgym.plant.parameters import Sizes, State

SIZES = len(Sizes._fields)


@njit(**OPTIONS)
def score(scoring, squares, blades, angle_square):  # type: ignore[no-untyped-def]
    """`flapgym.envs.task.rewards` for one turbine, from the mean squares of its moments and of its fixed outputs."""
    total = 0.0
    for b in range(blades):
        total += squares[b]
    of_moments, of_angles, of_tower = -scoring[1] * total / blades, -scoring[2] * angle_square, 0.0
    if scoring[0] >= 0.0:
        of_tower = -scoring[3] * squares[blades + int(scoring[0])]
    return of_moments + of_angles + of_tower, of_moments, of_angles, of_tower


@njit(**OPTIONS)
def observe(entries, added, told, observation):  # type: ignore[no-untyped-def]
    """`flapgym.envs.task.observe` for one turbine; entries are columns, factors, offsets, bounds and what is added."""
    count = observation.size
    for i in range(count):
        column, own = int(entries[i]), int(entries[4 * count + i])
        value = told[column] if column >= 0 else 0.0
        if added.size > 0 and own >= 0:
            value += added[own]
        value = value * entries[count + i] + entries[2 * count + i]
        bound = np.float32(entries[3 * count + i])
        # Rounded before it is bounded: a stop rounded up would leave the space.
        observation[i] = min(max(np.float32(value), -bound), bound)


def _entry(edition: int):  # type: ignore[no-untyped-def]
    """The compiled step. What a function closes over is part of what numba looks for on disk."""

    @kept
    def step(real, own, action, observation):  # type: ignore[no-untyped-def]
        """Change the turbine, in parts of `real` and `own` (`CompiledTurbine`), and fill the observation."""
        _ = edition
        for i in range(action.size):
            if not abs(action[i]) < math.inf:
                return False, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        s = Sizes(*to_fixed_tuple(own.view(np.int64), SIZES))
        count, each, k, size = actuators(s), BLADES * (s.flaps + s.pitch), s.steps, last_size(s)
        # Where things are, in the order of `CompiledTurbine`.
        above, fed = 1 + s.rows, s.given + 2 * each * k
        feed_at = (above + fed) * s.modes
        modes_at = feed_at + fed * s.rows
        rows_at = modes_at + s.modes
        inputs_at = rows_at + s.rows
        responses_at = inputs_at + fed
        table_at = SIZES + 4
        heading_at = table_at + 8 * count
        settling_at = heading_at + 2
        motion_at = settling_at + 2 * k
        work_at = motion_at + MOTION * count
        told_at = work_at + work_size(s)
        squares_at = told_at + size
        scoring_at = squares_at + s.blades + s.fixed_outputs
        entries_at = scoring_at + 4
        begun_at = entries_at + 5 * observation.size
        added_at = begun_at + 3

        elapsed, level, azimuth = int(own[begun_at]), own[begun_at + 1], own[begun_at + 2]
        matrix = real[:feed_at].reshape((above + fed, s.modes))
        feed = real[feed_at:modes_at].reshape((fed, s.rows))
        modes, rows, inputs = real[modes_at:rows_at], real[rows_at:inputs_at], real[inputs_at:responses_at]
        table, motion, work = own[table_at:settling_at], own[motion_at:work_at], own[work_at:told_at]
        told, squares = own[told_at:squares_at], own[squares_at:scoring_at]
        wind_at = responses_at + min(elapsed, s.intervals - 1) * (s.rows + s.kept)
        wind = real[wind_at : wind_at + s.rows + s.kept]

        angle = azimuth + own[SIZES + 1] * elapsed
        own[heading_at], own[heading_at + 1] = math.cos(angle), math.sin(angle)
        components(s, ONE, table, motion, START, TWO, inputs, fed, s.commanded)
        if s.lags:
            components(s, ONE, table, motion, 2 * count, ONE, inputs, fed, each)
        met, jumped = move(s, ONE, own[SIZES], table, action, motion, work)
        components(s, ONE, table, work, START, ONE, inputs, fed, START)
        most = s.given + each * k * (met + jumped)
        if met:
            components(s, ONE, table, work, count, k * (met + jumped), inputs, fed, s.given)
            choose(s, ONE, motion, own[settling_at:motion_at], inputs, fed)
        read_modes(matrix, 1, modes, rows)
        add_inputs(feed, START, inputs, most, rows)
        let_decay(matrix[0], modes)
        add_inputs(matrix, above, inputs, most, modes)
        for row in range(s.rows):
            rows[row] += wind[row] * level
        # No samples are wanted, so any array will do.
        angle, further, beside = angle + own[SIZES + 1], own[SIZES + 2], own[SIZES + 3]
        angle_square = tell(
            s, ONE, START, further, beside, angle, table, motion, work, rows, wind, level, told, squares, feed
        )
        own[begun_at] = elapsed + 1.0
        # Past the end of an episode there is no more of it.
        width = (own.size - added_at) // (s.intervals + 1)
        at = added_at + min(elapsed + 1, s.intervals) * width
        observe(own[entries_at:begun_at], own[at : at + width], told, observation)
        reward, of_moments, of_angles, of_tower = score(
            own[scoring_at:entries_at], squares, s.blades, angle_square
        )
        return True, reward, of_moments, of_angles, of_tower, told[size - 4], told[size - 3]

    return step


_step = _entry(EDITION)
Told = tuple[bool, float, float, float, float, float, float]
"""Whether the action is finite; reward, and its terms for moments, flap angles and tower; wind and azimuth at the last
sample."""


class CompiledTurbine:
    """The one turbine of a plant, in flat arrays, which are the plant's state while it is stepped here.

    `real`, in the precision of the modes, holds decay, C, B and D of the parameters; modes; rows and inputs to work in;
    the response to the episode's wind. `own`, in double precision, holds sizes (as whole numbers), time step, azimuth
    of an interval, its cosine and sine, actuators, heading, `settling`, motion, numbers to work in, what is told with
    mean squares behind it, scoring, entries of the observation, actions since the reset, level of the response, azimuth
    at the reset, and what sensors add of their own.

    Parameters
    ----------
    plant : LinearPlant
        Of one turbine.
    scoring : Scoring
    """

    def __init__(self, plant: LinearPlant, scoring: Scoring) -> None:
        self._plant, p = plant, plant.parameters
        self._observed, s, count = len(scoring.columns), p.sizes, p.angle_limit.size
        constants = np.concatenate([each.ravel() for each in (p.decay, p.C.T, p.B, p.D)])
        self._modes = slice(constants.size, constants.size + s.modes)
        self._responses = self._modes.stop + s.rows + len(p.D)
        length = s.intervals * (s.rows + s.kept)
        self._real = np.zeros(self._responses + length, dtype=constants.dtype)
        self._real[: constants.size] = constants
        turn = p.turn * s.steps
        clock = np.array([p.time_step, turn, math.cos(turn), math.sin(turn)])
        sizes = np.array(s, dtype=np.int64).view(np.float64)
        fixed = np.concatenate([sizes, clock, p.actuators.ravel(), np.zeros(2), p.settling.ravel()])
        begin = fixed.size
        self._flaps = slice(begin, begin + 4 * count)
        told = begin + MOTION * count + work_size.py_func(s)
        self._told = slice(told, told + plant.quantities.size + s.blades)
        head = [scoring.fore_aft, scoring.rbm_weight, scoring.angle_weight, scoring.tower_weight]
        table = (scoring.columns, scoring.factors, scoring.offsets, scoring.bounds, scoring.added)
        room = np.zeros(self._told.stop + s.fixed_outputs - begin)
        self._constants = np.concatenate([fixed, room, head, *table], dtype=float)
        self.load(np.empty((0, 0)))
        # A step that leaves no trace: code is compiled or read now, and no step waits for it.
        still = np.zeros(count, dtype=np.float32)
        run_kept(_step, self._real, self._own, still, empty(self._observed, np.float32))
        self.load(np.empty((0, 0)))

    def load(self, own: Array) -> None:
        """Take the plant's turbine, and its sensors' own numbers (intervals + 1, S), or none of size 0."""
        episode, state = self._plant.episode, self._plant.state
        begun = [state.elapsed[0], episode.level[0], episode.azimuth[0]]
        self._own = np.concatenate([self._constants, begun, own.ravel()])
        self._own[self._flaps] = state.flaps.ravel()
        self._begun = self._constants.size
        self._real[self._modes] = state.modes[0]
        self._real[self._responses :] = episode.responses[episode.place[0]].ravel()

    def store(self) -> None:
        """Give the plant its turbine back."""
        elapsed = self._own[self._begun : self._begun + 1].astype(np.int64)
        self._plant.state = State(
            elapsed=elapsed,
            flaps=self._own[self._flaps].reshape(4, -1, 1).copy(),
            modes=self._real[None, self._modes].copy(),
        )

    def step(self, action: FloatArray, observation: np.ndarray) -> Told:
        """What is told at once.

        Parameters
        ----------
        action : (blades A,) float
            Contiguous; clipped to +-1. If it is not finite, that is told and nothing changes.
        observation : (observed,) float32
            Filled.
        """
        try:
            return _step(self._real, self._own, action, observation)
        except SystemError as error:
            raise first_cause(error) from None

    @property
    def told(self) -> Array:
        """What the plant told after the last step, and behind it each moment's mean square; a view."""
        return self._own[self._told]
