"""The step of one turbine together with its observation and reward, in one call of compiled code.

An environment of one turbine steps in one or two microseconds, and every array that is handed to compiled code or back
takes a twentieth of one. So few are: constants, state and what is told are a flat array each. Many turbines take
`flapgym.plant` and `flapgym.envs.task` as they are.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy import empty

from flapgym.core.arrays import BLADES, Array, FloatArray
from flapgym.envs.task import Scoring
from flapgym.plant.backends.numba import (
    EDITION,
    OPTIONS,
    START,
    Sizes,
    actuators,
    add_inputs,
    components,
    first_cause,
    heading,
    kept,
    last_size,
    let_decay,
    move,
    read_blades,
    read_fixed,
    read_modes,
    run_kept,
    settle,
    sizes_of,
    work_size,
)
from flapgym.plant.linear import LinearPlant
from flapgym.plant.parameters import State


@njit(**OPTIONS)
def sizes_in(numbers):  # type: ignore[no-untyped-def]
    """The sizes at the head of the numbers."""
    return Sizes(
        int(numbers[0]),
        int(numbers[1]),
        int(numbers[2]),
        int(numbers[3]),
        int(numbers[4]),
        int(numbers[5]),
        int(numbers[6]),
        int(numbers[7]),
        int(numbers[8]),
        int(numbers[9]),
        int(numbers[10]),
        int(numbers[11]),
        int(numbers[12]),
        int(numbers[13]),
        int(numbers[14]),
        int(numbers[15]),
        numbers[16],
        numbers[17],
        numbers[18],
        numbers[19],
        numbers[20],
    )


@njit(**OPTIONS)
def score(scoring, told, size, blades, angle_square, fixed_square):  # type: ignore[no-untyped-def]
    """`flapgym.envs.task.rewards` for one turbine, behind the mean squares of its moments in what is told."""
    total = 0.0
    for b in range(blades):
        total += told[size + b]
    of_moments, of_angles, of_tower = -scoring[1] * total / blades, -scoring[2] * angle_square, 0.0
    if scoring[0] >= 0.0:
        of_tower = -scoring[3] * fixed_square[int(scoring[0])]
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
        s = sizes_in(own)
        count, each, k, size = actuators(s), BLADES * (s.flaps + s.pitch), s.steps, last_size(s)
        # Where things are, in the order of `CompiledTurbine`.
        above, fed = 1 + s.rows, s.given + 2 * each * k
        feed_at = (above + fed) * s.modes
        modes_at = feed_at + fed * s.rows
        rows_at = modes_at + s.modes
        inputs_at = rows_at + s.rows
        responses_at = inputs_at + fed
        limits_at = len(s)
        settling_at = limits_at + 7 * count
        flaps_at = settling_at + 2 * k
        work_at = flaps_at + 4 * count
        squares_at = work_at + work_size(s)
        told_at = squares_at + s.fixed_outputs
        scoring_at = told_at + size + s.blades
        entries_at = scoring_at + 4
        begun_at = entries_at + 5 * observation.size
        added_at = begun_at + 3

        matrix, feed = (
            real[:feed_at].reshape((above + fed, s.modes)),
            real[feed_at:modes_at].reshape((fed, s.rows)),
        )
        modes, rows, inputs = real[modes_at:rows_at], real[rows_at:inputs_at], real[inputs_at:responses_at]
        limits, flaps, work = own[limits_at:settling_at], own[flaps_at:work_at], own[work_at:squares_at]
        fixed_square, told, scoring = (
            own[squares_at:told_at],
            own[told_at:scoring_at],
            own[scoring_at:entries_at],
        )
        elapsed, level, azimuth = int(own[begun_at]), own[begun_at + 1], own[begun_at + 2]
        wind_at = responses_at + min(elapsed, s.intervals - 1) * (s.rows + s.kept)
        wind = real[wind_at : wind_at + s.rows + s.kept]

        angle = azimuth + s.turn * k * elapsed
        cosine, sine = math.cos(angle), math.sin(angle)
        components(s, limits, flaps, START, cosine, sine, inputs, s.commanded)
        components(s, limits, flaps, count, cosine, sine, inputs, s.commanded + each)
        if s.lags:
            components(s, limits, flaps, 2 * count, cosine, sine, inputs, each)
        square, stopped, jumped = move(s, limits, action, flaps, work)
        least, most = 0, s.given
        if stopped:
            # The command does not tell what follows, the rate gained in every step does.
            least, most = s.commanded, s.given + k * each * (2 if jumped else 1)
            for j in range(k * (2 if jumped else 1)):
                components(s, limits, work, (2 + j) * count, cosine, sine, inputs, s.given + j * each)
            if s.pitch:
                settle(s, own[settling_at:flaps_at], inputs)
        else:
            components(s, limits, work, START, cosine, sine, inputs, START)
        read_modes(matrix, 1, modes, rows)
        add_inputs(feed, START, inputs, least, most, rows)
        let_decay(matrix[0], modes)
        add_inputs(matrix, above, inputs, least, most, modes)

        for row in range(s.rows):
            rows[row] += wind[row] * level
        read_blades(
            s, rows, cosine, sine, told, told[size:], feed
        )  # no samples are wanted, so any array will do
        place = s.blade_places * s.blades
        for i in range(count):
            told[place + i], told[place + count + i] = flaps[i], flaps[count + i]
            told[place + 2 * count + i], told[place + 3 * count + i] = flaps[3 * count + i], work[count + i]
        place += 4 * count
        read_fixed(s, rows, wind, level, place, told, fixed_square, feed)
        place += s.fixed_places + 1
        told[place], told[place + 1], told[place + 2] = heading(s, azimuth, elapsed, cosine, sine)
        own[begun_at] = elapsed + 1.0
        # Past the end of an episode there is no more of it.
        width = (own.size - added_at) // (s.intervals + 1)
        at = added_at + min(elapsed + 1, s.intervals) * width
        observe(own[entries_at:begun_at], own[at : at + width], told, observation)
        reward, of_moments, of_angles, of_tower = score(
            scoring, told, size, s.blades, square / (k * s.blades * s.flaps), fixed_square
        )
        return True, reward, of_moments, of_angles, of_tower, told[place - 1], told[place]

    return step


_step = _entry(EDITION)
Told = tuple[bool, float, float, float, float, float, float]
"""Whether the action is finite; reward, and its terms for moments, flap angles and tower; wind and azimuth at the last
sample."""


class CompiledTurbine:
    """The one turbine of a plant, in flat arrays, which are the plant's state while it is stepped here.

    `real`, in the precision of the modes, holds decay, read, push and feed of the parameters; modes; rows and inputs to
    work in; the response to the episode's wind. `own`, in double precision, holds sizes, limits, `settling`, flaps,
    numbers to work in, what is told with each moment's mean square behind it, scoring, entries of the observation,
    actions since the reset, level of the response, azimuth at the reset, and what sensors add of their own.

    Parameters
    ----------
    plant : LinearPlant
        Of one turbine.
    scoring : Scoring
    """

    def __init__(self, plant: LinearPlant, scoring: Scoring) -> None:
        self._plant, p = plant, plant.parameters
        self._observed = len(scoring.columns)
        s = Sizes(*sizes_of.py_func(p))
        constants = np.concatenate([each.ravel() for each in (p.decay, p.read.T, p.push, p.feed)])
        self._modes = slice(constants.size, constants.size + s.modes)
        self._responses = constants.size + s.modes + s.rows + len(p.feed)
        length = s.intervals * (s.rows + s.kept)
        self._real = np.zeros(self._responses + length, dtype=constants.dtype)
        self._real[: constants.size] = constants
        of_each = (
            p.angle_limit,
            p.rate_limit,
            p.acceleration,
            p.effectiveness,
            p.lag_gain,
            p.stiffness,
            p.damping,
        )
        limits = np.concatenate([*of_each, p.settling.ravel()])
        flaps = len(s) + limits.size
        self._flaps = slice(flaps, flaps + plant.state.flaps.size)
        told = self._flaps.stop + work_size.py_func(s) + s.fixed_outputs
        self._told = slice(told, told + plant.quantities.size + s.blades)
        head = [scoring.fore_aft, scoring.rbm_weight, scoring.angle_weight, scoring.tower_weight]
        table = (scoring.columns, scoring.factors, scoring.offsets, scoring.bounds, scoring.added)
        room = np.zeros(self._told.stop - self._flaps.start)
        self._constants = np.concatenate([s, limits, room, head, *table], dtype=float)
        self.load(np.empty((0, 0)))
        # A step that leaves no trace: code is compiled or read now, and no step waits for it.
        still = np.zeros(p.angle_limit.size, dtype=np.float32)
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
        self._plant.state = State(
            elapsed=self._own[self._begun : self._begun + 1].astype(np.int64),
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
