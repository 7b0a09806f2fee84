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

from flapgym.core.arrays import Array, FloatArray
from flapgym.envs.task import Scoring
from flapgym.plant.backends.numba import (
    EDITION,
    OPTIONS,
    Sizes,
    add_inputs,
    advance,
    begin,
    decayed,
    first_cause,
    kept,
    last_size,
    read_modes,
    run_kept,
    sizes_of,
    work_size,
)
from flapgym.plant.linear import LinearPlant
from flapgym.plant.parameters import State

OWN = 4
"""Numbers of a turbine before its flaps' and modes': elapsed, place and level of its response, azimuth at the reset."""


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
        numbers[13],
        numbers[14],
        numbers[15],
        numbers[16],
        numbers[17],
        numbers[18],
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
def observe(entries, noise, told, observation):  # type: ignore[no-untyped-def]
    """`flapgym.envs.task.observe` for one turbine; entries are columns, factors, bounds and noisy blades."""
    count = observation.size
    for i in range(count):
        value, noisy = told[int(entries[i])], int(entries[3 * count + i])
        if noise.size > 0 and noisy >= 0:
            value += noise[noisy]
        bound = np.float32(entries[2 * count + i])
        # Rounded before it is bounded: a stop rounded up would leave the space.
        observation[i] = min(max(np.float32(value * entries[count + i]), -bound), bound)


def _entry(edition: int):  # type: ignore[no-untyped-def]
    """The compiled step. What a function closes over is part of what numba looks for on disk."""

    @kept
    def step(matrix, feed, numbers, responses, own, action, after, observation):  # type: ignore[no-untyped-def]
        """Fills two new arrays, the turbine after the step with what is told behind it, and the observation.

        An array that compiled code makes takes three times as long as one that it is given.
        """
        _ = edition
        for i in range(action.size):
            if not abs(action[i]) < math.inf:
                return False, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        s = sizes_in(numbers)
        count, observed = s.blades * s.flaps, observation.size
        size = last_size(s)
        flaps_at, modes_at, told_at = OWN, OWN + 4 * count, OWN + 4 * count + s.modes
        limits_at = len(s)
        scoring_at = limits_at + 4 * count
        limits, scoring = numbers[limits_at:scoring_at], numbers[scoring_at : scoring_at + 4]
        entries = numbers[scoring_at + 4 : scoring_at + 4 + 4 * observed]
        noise = numbers[scoring_at + 4 + 4 * observed :]
        elapsed = int(own[0])
        width = s.rows + s.kept
        wind_at = (int(own[1]) * s.intervals + min(elapsed, s.intervals - 1)) * width
        wind = responses[wind_at : wind_at + width]
        # The modes in the precision of the matrices.
        kind, half = matrix.dtype, s.modes // 2
        room = np.empty(2 * s.modes + s.rows + s.given + 6 * s.flaps, kind)
        both, modes = room[: 2 * s.modes], room[s.modes : 2 * s.modes]
        parts = both.reshape((4, half))
        rows, inputs = room[2 * s.modes : 2 * s.modes + s.rows], room[2 * s.modes + s.rows :]
        work = np.empty(work_size(s) + s.fixed_outputs)
        fixed_square = work[work_size(s) :]
        for i in range(modes_at):
            after[i] = own[i]
        for m in range(s.modes):
            both[m] = own[modes_at + m]
        read_modes(matrix, 1, both[: s.modes], rows)
        told = after[told_at:]
        flaps = after[flaps_at:modes_at]
        cosine, sine, square, met = begin(s, limits, own[3], elapsed, action, flaps, work, inputs)
        add_inputs(feed, 0, inputs, 0, s.given, rows)
        modes[:] = 0.0
        add_inputs(matrix, 1 + s.rows, inputs, 0, s.given, modes)
        decayed(matrix[0].reshape((2, half)), parts, 0, parts, 2)
        angle_square = advance(
            s,
            limits,
            matrix,
            1 + s.rows,
            feed,
            own[3],
            cosine,
            sine,
            square,
            met,
            wind,
            own[2],
            elapsed,
            modes,
            flaps,
            rows,
            work,
            inputs[s.given :],
            told,
            told[size:],
            fixed_square,
            feed,  # no samples are wanted, so any array will do for them
        )
        after[0] = elapsed + 1.0
        for m in range(s.modes):
            after[modes_at + m] = modes[m]
        if noise.size > 0:
            # Past the end of an episode there is no more noise.
            at = min(elapsed + 1, s.intervals) * s.blades
            noise = noise[at : at + s.blades]
        observe(entries, noise, told, observation)
        reward, of_moments, of_angles, of_tower = score(
            scoring, told, size, s.blades, angle_square, fixed_square
        )
        wind_now, azimuth = told[size - 4], told[size - 3]
        return True, reward, of_moments, of_angles, of_tower, wind_now, azimuth

    return step


_step = _entry(EDITION)
Told = tuple[bool, float, float, float, float, float, float]
"""Whether the action is finite; reward, and its terms for moments, flap angles and tower; wind and azimuth at the last
sample."""


class CompiledTurbine:
    """The one turbine of a plant, in flat arrays, which are the plant's state while it is stepped here.

    Parameters
    ----------
    plant : LinearPlant
        Of one turbine.
    scoring : Scoring
    """

    def __init__(self, plant: LinearPlant, scoring: Scoring) -> None:
        self._plant, p = plant, plant.parameters
        # All that runs along the modes in one array.
        self._matrix = np.concatenate([p.decay.reshape(1, -1), p.read, p.push])
        limits = (p.angle_limit, p.rate_limit, p.acceleration, p.effectiveness)
        head = [scoring.fore_aft, scoring.rbm_weight, scoring.angle_weight, scoring.tower_weight]
        table = (scoring.columns, scoring.factors, scoring.bounds, scoring.noisy)
        sizes = np.array(sizes_of.py_func(p), dtype=float)
        self._constants = np.concatenate([sizes, *limits, head, *table], dtype=float)
        self._first_told = OWN + 4 * p.angle_limit.size + p.read.shape[1]
        self._size = self._first_told + plant.quantities.size + p.blades
        self._observed = len(scoring.columns)
        self.load(np.empty((0, 0)))
        # A step that leaves no trace: code is compiled or read now, and no step waits for it.
        still = np.zeros(p.angle_limit.size, dtype=np.float32)
        run_kept(
            _step,
            self._matrix,
            p.feed,
            self._numbers,
            self._responses,
            self._own,
            still,
            empty(self._size),
            empty(self._observed, np.float32),
        )

    def load(self, noise: Array) -> None:
        """Take the plant's turbine, and its measurement noise (intervals + 1, blades) [N m], or none of size 0."""
        episode, state = self._plant.episode, self._plant.state
        self._numbers = np.concatenate([self._constants, noise.ravel()])
        self._responses = episode.responses.reshape(-1)
        own = [state.elapsed, episode.place, episode.level, episode.azimuth, state.flaps, state.modes]
        self._own = np.concatenate([each.ravel() for each in own], dtype=float)

    def store(self) -> None:
        """Give the plant its turbine back."""
        p, own = self._plant.parameters, self._own
        modes = OWN + 4 * p.angle_limit.size
        self._plant.state = State(
            elapsed=own[:1].astype(np.int64),
            flaps=own[OWN:modes].reshape(4, -1, 1).copy(),
            modes=own[None, modes : self._first_told].astype(self._plant.stepping.precision),
        )

    def step(self, action: FloatArray, observation: np.ndarray) -> Told:
        """What is told at once.

        Parameters
        ----------
        action : (blades F,) float
            Contiguous; clipped to +-1. If it is not finite, that is told and nothing changes.
        observation : (observed,) float32
            Filled.
        """
        after = empty(self._size)
        try:
            told = _step(
                self._matrix,
                self._plant.parameters.feed,
                self._numbers,
                self._responses,
                self._own,
                action,
                after,
                observation,
            )
        except SystemError as error:
            raise first_cause(error) from None
        if told[0]:
            self._own = after
        return told

    @property
    def told(self) -> Array:
        """What the plant tells since the last step, and behind it each moment's mean square."""
        return self._own[self._first_told :]
