"""The step as compiled code: plain loops over the arrays of `flapgym.plant.parameters`.

What is here is written once, for n turbines side by side in arrays that are flat, turbines innermost; of one turbine
`flapgym.envs.compiled` calls the same functions. Only the products differ: of many turbines they are matrix products,
of one, vector units run along the modes. Compiled code counts the references to every array that it takes out of a
tuple or cuts from another, so these functions get few arrays, and everything else as `Sizes`.
"""

from __future__ import annotations

import math
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit

from flapgym.core.arrays import BLADES, FloatArray
from flapgym.core.kept import OPTIONS, kept, run_kept
from flapgym.plant import actuator, parameters
from flapgym.plant.parameters import Episode, Loads, Parameters, State

WITHIN: dict[str, Any] = OPTIONS | {"inline": "always"}
"""Of what is small or called at one place: alone it would be compiled twice, by itself and within its caller."""
_FILES = (__file__, str(actuator.__file__), str(parameters.__file__))
EDITION = zlib.crc32(b"".join(Path(file).read_bytes() for file in _FILES))
"""Of the files that go into compiled code here and in `flapgym.envs.compiled`: numba looks at a function's own file."""

THIRD = 1.0 / BLADES
C1, S1 = math.cos(2.0 * math.pi * THIRD), math.sin(2.0 * math.pi * THIRD)
"""From one blade to the next."""
TURN = 2.0 * math.pi
START, ONE, TWO = np.int64(0), np.int64(1), np.int64(2)
"""Where a first place or a count is handed over: numba compiles a function anew for a literal number."""
BLOCK = 128
"""Turbines that are stepped together."""
NEXT_TO_NOTHING = 1e-30
"""Of a mode, whose loads are of the order of its numbers times 1e6."""
MOTION = 6
"""Numbers of an actuator in motion: angle, rate, lagged acceleration, way; in the interval sum of squared angles over
their stop, and whether a stop was met."""

flap_step = njit(**WITHIN)(actuator.flap_step)


@njit(**OPTIONS)
def actuators(s):  # type: ignore[no-untyped-def]
    """Flaps of all blades, and pitch of each."""
    return s.blades * (s.flaps + s.pitch)


@njit(**OPTIONS)
def work_size(s):  # type: ignore[no-untyped-def]
    """Numbers of a turbine that `move` fills."""
    return s.blades * (s.flaps + s.pitch) * (1 + 4 * s.steps)


@njit(**OPTIONS)
def last_size(s):  # type: ignore[no-untyped-def]
    """Numbers a turbine tells of the last sample."""
    return s.blade_places * s.blades + 4 * actuators(s) + s.fixed_places + 4


@njit(**WITHIN)
def move(s, n, time_step, table, actions, motion, work):  # type: ignore[no-untyped-def]
    """Actuators of n turbines over the interval; returns whether a stop was met, and whether angles jumped.

    Parameters
    ----------
    s : Sizes
    n : int
    time_step : float
    table : (8 blades A n,) float
        `Parameters.actuators`, each entry n times, and headings (`components`).
    actions : (n blades A,) float
    motion : (MOTION blades A n,) float
        Of every actuator, turbines innermost; changed.
    work : (n work_size,) float
        Filled alike: command; step by step the rate gained and the jumps and, if they are recorded, angle and rate.
    """
    count, k = actuators(s), s.steps
    m, jumped = count * n, 0.0
    for i in range(count):
        for t in range(n):
            work[i * n + t] = min(max(float(actions[t * count + i]), -1.0), 1.0) * table[2 * m + i * n + t]
    for t in range(m):
        motion[4 * m + t], motion[5 * m + t] = 0.0, 0.0
    # Unsigned: of a place that could be negative numba asks each time, and no vectors are made of the loop.
    all_of = np.uint64(m)
    row, lag, way = all_of, 2 * all_of, 3 * all_of
    squares, stops = 4 * all_of, 5 * all_of
    decays, gains, stiff, damped = 4 * all_of, 5 * all_of, 6 * all_of, 7 * all_of
    # Steps of one flap wait for one another, those of several flaps run side by side.
    for j in range(k):
        gained, leaps = np.uint64((1 + j) * m), np.uint64((1 + k + j) * m)
        for t in range(all_of):
            angle, rate, lagged, held = motion[t], motion[row + t], motion[lag + t], work[t]
            acting = held + table[gains + t] * (lagged - held)
            acting -= table[stiff + t] * angle + table[damped + t] * rate
            moved, after, jump, hit = flap_step(angle, rate, acting, time_step, table[t], table[row + t])
            motion[t], motion[row + t] = moved, after
            motion[lag + t] = held + table[decays + t] * (lagged - held)
            motion[way + t] += abs(moved - angle)
            motion[squares + t] += (moved / table[t]) ** 2
            motion[stops + t] = max(motion[stops + t], 1.0 * hit)
            work[gained + t], work[leaps + t] = after - rate, jump
            jumped += abs(jump)
        for t in range(m * s.record):
            work[(1 + 2 * k + j) * m + t], work[(1 + 3 * k + j) * m + t] = motion[t], motion[m + t]
    met = 0.0
    for t in range(m):
        met += motion[5 * m + t]
    return met > 0.0, jumped > 0.0


@njit(**OPTIONS)
def components(s, n, table, values, first, many, inputs, width, place):  # type: ignore[no-untyped-def]
    """Components of `many` quantities of n turbines' actuators, values[first:], into inputs of `width` from `place` on.

    Three each. What turns with blade 1 (along), and across it, is turned back by the headings behind the table, (2 n,),
    cosines before sines.
    """
    count, each = actuators(s), s.flaps + s.pitch
    # Unsigned, as in `move`.
    effect, headings, all_of, wide = (
        np.uint64(3 * count * n),
        np.uint64(8 * count * n),
        np.uint64(n),
        np.uint64(width),
    )
    for q in range(many):
        begin = np.uint64(first + q * count * n)
        for f in range(each):
            # Flaps come blade by blade, pitch behind them.
            own, next_blade = (f, s.flaps) if f < s.flaps else (s.blades * s.flaps, 1)
            a, on, to = (
                np.uint64(own * n),
                np.uint64(next_blade * n),
                np.uint64(place + BLADES * (q * each + f)),
            )
            b, c = a + on, a + on + on
            for t in range(all_of):
                one, along, across = values[begin + a + t] * table[effect + a + t], 0.0, 0.0
                mean = one
                if s.blades == BLADES:
                    two = values[begin + b + t] * table[effect + b + t]
                    three = values[begin + c + t] * table[effect + c + t]
                    mean = THIRD * (one + two + three)
                    along = 2.0 * THIRD * (one + C1 * (two + three))
                    across = 2.0 * THIRD * (S1 * (three - two))
                cosine, sine, at = table[headings + t], table[headings + all_of + t], t * wide + to
                inputs[at], inputs[at + 1] = mean, cosine * along + sine * across
                inputs[at + 2] = sine * along - cosine * across


@njit(**WITHIN)
def choose(s, n, motion, settling, inputs, width):  # type: ignore[no-untyped-def]
    """Take out of the inputs of n turbines what does not hold: the command where a stop was met, else what is stepwise.

    Turbine by turbine: what one does must not depend on who is stepped beside it. And take from the rate that pitch
    gained step by step what angle and rate at its start account for.
    """
    count, each = actuators(s), BLADES * (s.flaps + s.pitch)
    for t in range(n):
        met, own = 0.0, t * width
        for i in range(count):
            met += motion[(5 * count + i) * n + t]
        if met == 0.0:
            for c in range(s.given, width):
                inputs[own + c] = 0.0
        else:
            for c in range(s.commanded):
                inputs[own + c] = 0.0
            for c in range(BLADES * s.flaps, each):
                angle, rate = inputs[own + s.commanded + c], inputs[own + s.commanded + each + c]
                for j in range(s.steps):
                    inputs[own + s.given + j * each + c] -= (
                        settling[2 * j] * angle + settling[2 * j + 1] * rate
                    )


@njit(**OPTIONS)
def let_decay(decay, modes):  # type: ignore[no-untyped-def]
    """Leave of the modes (2 M,) of a turbine what an interval does; next to nothing becomes nothing.

    What flaps at rest leave in the modes would decay to denormal numbers, which take ten times as long.
    """
    # In place, which `leave` cannot be without losing its vectors: a tenth of a step of one turbine is here.
    nothing, half = modes.dtype.type(0.0), modes.size // 2
    along, across = modes[:half], modes[half:]
    for m in range(half):
        first = decay[m] * along[m] - decay[half + m] * across[m]
        second = decay[m] * across[m] + decay[half + m] * along[m]
        along[m] = first if abs(first) > NEXT_TO_NOTHING else nothing
        across[m] = second if abs(second) > NEXT_TO_NOTHING else nothing


@njit(**OPTIONS)
def leave(decay, modes, after):  # type: ignore[no-untyped-def]
    """Add what an interval leaves of the modes of turbines, (n 2 M,), to what came in it, as `let_decay`."""
    nothing, half = after.dtype.type(0.0), np.uint64(decay.size // 2)
    for at in range(np.uint64(0), np.uint64(modes.size), half + half):
        for m in range(half):
            real, imaginary = at + m, at + half + m
            first = after[real] + decay[m] * modes[real] - decay[half + m] * modes[imaginary]
            second = after[imaginary] + decay[m] * modes[imaginary] + decay[half + m] * modes[real]
            after[real] = first if abs(first) > NEXT_TO_NOTHING else nothing
            after[imaginary] = second if abs(second) > NEXT_TO_NOTHING else nothing


@njit(**OPTIONS)
def add_inputs(matrix, first, inputs, most, result):  # type: ignore[no-untyped-def]
    """Add inputs[q] times row `first` + q for q up to `most`, a multiple of three, which share a pass.

    Three that are zero, as of flaps that rest, are left out; nine share a pass where none is.
    """
    q = 0
    while q < most:
        if inputs[q] == 0.0 and inputs[q + 1] == 0.0 and inputs[q + 2] == 0.0:
            q += 3
            continue
        if q + 9 > most:
            break
        row = first + q
        a, b, c, d, e = inputs[q], inputs[q + 1], inputs[q + 2], inputs[q + 3], inputs[q + 4]
        f, g, h, j = inputs[q + 5], inputs[q + 6], inputs[q + 7], inputs[q + 8]
        for i in range(result.size):
            result[i] += (
                a * matrix[row, i]
                + b * matrix[row + 1, i]
                + c * matrix[row + 2, i]
                + d * matrix[row + 3, i]
                + e * matrix[row + 4, i]
                + f * matrix[row + 5, i]
                + g * matrix[row + 6, i]
                + h * matrix[row + 7, i]
                + j * matrix[row + 8, i]
            )
        q += 9
    while q < most:
        row, a, b, c = first + q, inputs[q], inputs[q + 1], inputs[q + 2]
        for i in range(result.size):
            result[i] += a * matrix[row, i] + b * matrix[row + 1, i] + c * matrix[row + 2, i]
        q += 3


@njit(**OPTIONS)
def read_modes(matrix, first, modes, result):  # type: ignore[no-untyped-def]
    """Rows from `first` on, times the modes of a turbine; three share what is read of those."""
    nothing = result.dtype.type(0.0)
    place = 0
    while place + 3 <= result.size:
        row = first + place
        one, two, three = nothing, nothing, nothing
        for i in range(modes.size):
            one += matrix[row, i] * modes[i]
            two += matrix[row + 1, i] * modes[i]
            three += matrix[row + 2, i] * modes[i]
        result[place], result[place + 1], result[place + 2] = one, two, three
        place += 3
    for last in range(place, result.size):
        one = nothing
        for i in range(modes.size):
            one += matrix[first + last, i] * modes[i]
        result[last] = one


@njit(**OPTIONS)
def on_blades(mean, along, across, cosine, sine):  # type: ignore[no-untyped-def]
    """Of three blades, from components in the frame in which blade 1 stands at that cosine and sine."""
    with_first, beside = along * cosine + across * sine, across * cosine - along * sine
    return mean + with_first, mean + C1 * with_first + S1 * beside, mean + C1 * with_first - S1 * beside


@njit(**WITHIN)
def tell(s, n, t, further, beside, angle, table, motion, work, rows, wind, level, told, squares, samples):  # type: ignore[no-untyped-def]
    """All that turbine t of n tells; returns the mean square of its angles over their stops.

    Parameters
    ----------
    s : Sizes
    n, t : int
    further, beside : float
        Cosine and sine of the azimuth of an interval.
    angle : float
        Azimuth of blade 1 at the end, turns and all.
    table, motion, work : float
        As in `components` and `move`.
    rows : (rows,) float
        Loads, the wind's part added.
    wind, level : (rows + kept,) float, float
        The wind itself is behind what it does to the rows; the factor on it.
    told : (last_size,) float
        Filled: the last sample.
    squares : (blades + fixed_outputs,) float
        Filled: mean squares of the root moments, then of the fixed outputs.
    samples : (k, size) float
        Filled where they are wanted.
    """
    whole, count, kept = s.blades == BLADES, actuators(s), s.kept
    m = count * n
    cosine, sine = table[8 * m + t], table[8 * m + n + t]
    row = 0
    for quantity in range(s.blade_outputs):
        place, steps = quantity * s.blades, s.steps if quantity == 0 else kept
        one, two, three, first, second, third = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for j in range(steps):
            one = float(rows[row])
            if whole:
                one, two, three = on_blades(one, float(rows[row + 1]), float(rows[row + 2]), cosine, sine)
            first += one * one
            second += two * two
            third += three * three
            if s.record:
                samples[j, place] = one
                if whole:
                    samples[j, place + 1], samples[j, place + 2] = two, three
            row += BLADES
        told[place] = one
        if whole:
            told[place + 1], told[place + 2] = two, three
        if quantity == 0:
            squares[0] = first / steps
            if whole:
                squares[1], squares[2] = second / steps, third / steps
    place = s.blade_places * s.blades
    for unknown in range(s.blade_outputs * s.blades, place):
        told[unknown] = math.nan
    square = 0.0
    for i in range(count):
        at = i * n + t
        told[place + i], told[place + count + i] = motion[at], motion[m + at]
        told[place + 2 * count + i], told[place + 3 * count + i] = motion[3 * m + at], motion[5 * m + at]
        square += motion[4 * m + at] if i < s.blades * s.flaps else 0.0
        for j in range(s.steps * s.record):
            samples[j, place + i] = work[(1 + 2 * s.steps + j) * m + at]
            samples[j, place + count + i] = work[(1 + 3 * s.steps + j) * m + at]
    column, place = place + 2 * count, place + 4 * count
    for quantity in range(s.fixed_outputs):
        value, sum_of_squares = 0.0, 0.0
        for j in range(kept):
            value = float(rows[row])
            sum_of_squares += value * value
            if s.record:
                samples[j, column + quantity] = value
            row += 1
        told[place + quantity], squares[s.blades + quantity] = value, sum_of_squares / kept
    for unknown in range(s.fixed_outputs, s.fixed_places):
        told[place + unknown] = math.nan
    place += s.fixed_places
    if s.record:
        for j in range(kept):
            samples[j, column + s.fixed_places] = wind[s.rows + j] * level
    told[place] = wind[s.rows + kept - 1] * level
    # Rounding must not leave a turn.
    told[place + 1] = min(max(angle - TURN * math.floor(angle / TURN), 0.0), TURN)
    told[place + 2] = cosine * further - sine * beside
    told[place + 3] = sine * further + cosine * beside
    return square / (s.steps * s.blades * s.flaps)


def _entry(edition: int) -> Any:
    """The compiled step. What a function closes over is part of what numba looks for on disk."""

    @kept
    def step(p, episode, state, actions):  # type: ignore[no-untyped-def]
        _ = edition
        s, n, kind = p.sizes, state.elapsed.size, p.C.dtype
        count, k, each = actuators(s), s.steps, BLADES * (s.flaps + s.pitch)
        settling, decay, total = p.settling.ravel(), p.decay.ravel(), np.empty(s.rows)
        turn = p.turn * k
        cosine, sine = math.cos(turn), math.sin(turn)
        listed = np.concatenate((p.actuators.ravel(), np.zeros(2)))
        flaps, modes = np.empty((4, count, n)), np.empty((n, s.modes), kind)
        last, squares = np.empty((n, last_size(s))), np.empty((n, s.blades + s.fixed_outputs))
        angle_square = np.empty(n)
        width = s.record * (s.blade_places * s.blades + 2 * count + s.fixed_places + 1)
        samples = np.empty((n, k * s.record, width))
        for first in range(0, n, BLOCK):
            # What belongs to a block of turbines stays in the nearer caches while all is done with it.
            some = slice(first, min(first + BLOCK, n))
            azimuth = episode.azimuth[some] + turn * state.elapsed[some]
            size = azimuth.size
            table = np.repeat(listed, size)
            for t in range(size):
                table[8 * count * size + t] = math.cos(azimuth[t])
                table[8 * count * size + size + t] = math.sin(azimuth[t])
            motion, work = np.empty(MOTION * count * size), np.empty(size * work_size(s))
            # Number by number: with a slice numba compiles the message that its size is another, for two seconds.
            for what in range(4):
                for i in range(count):
                    for t in range(size):
                        motion[(what * count + i) * size + t] = state.flaps[what, i, first + t]
            started = motion.copy()
            met, jumped = move(s, size, p.time_step, table, actions[some].ravel(), motion, work)
            wide, m = s.given + each * k * met, count * size
            inputs = np.empty(size * wide, kind)
            components(s, size, table, work, START, ONE, inputs, wide, START)
            if s.lags:
                components(s, size, table, started, 2 * m, ONE, inputs, wide, each)
            components(s, size, table, started, START, TWO, inputs, wide, s.commanded)
            components(s, size, table, work, m, k * met, inputs, wide, s.given)
            if met:
                choose(s, size, motion, settling, inputs, wide)
            given, before, after = inputs.reshape((size, wide)), state.modes[some], modes[some]
            rows, more = np.empty((size, s.rows), kind), np.empty((size, s.rows), kind)
            np.dot(given, p.B[:wide], after)
            leave(decay, before.reshape(-1), after.reshape(-1))
            np.dot(before, p.C, rows)
            np.dot(given, p.D[:wide], more)
            rows += more
            if jumped:
                # Few actuators hit a stop at once.
                leaps, jump_at = np.empty(size * each * k, kind), s.given + each * k
                components(s, size, table, work, (1 + k) * m, k, leaps, each * k, START)
                for t in range(size):
                    own, leapt = leaps[t * each * k : (t + 1) * each * k], 0.0
                    for q in range(each * k):
                        leapt += abs(own[q])
                    if leapt == 0.0:
                        continue
                    add_inputs(p.B, jump_at, own, each * k, after[t])
                    add_inputs(p.D, jump_at, own, each * k, rows[t])
            for what in range(4):
                for i in range(count):
                    for t in range(size):
                        flaps[what, i, first + t] = motion[(what * count + i) * size + t]
            for t in range(size):
                at = first + t
                elapsed, level = state.elapsed[at], episode.level[at]
                wind = episode.responses[episode.place[at], min(elapsed, s.intervals - 1)]
                for row in range(s.rows):
                    total[row] = rows[t, row] + wind[row] * level
                angle, told, own, every = azimuth[t] + turn, last[at], squares[at], samples[at]
                angle_square[at] = tell(
                    s, size, t, cosine, sine, angle, table, motion, work, total, wind, level, told, own, every
                )
        # Plain tuples: to make a named one Python's own code runs, and an interrupt there is the end of the process.
        return (state.elapsed + 1, flaps, modes), (last, squares, angle_square, samples)

    return step


_step = _entry(EDITION)


def step(parameters: Parameters, episode: Episode, state: State, actions: FloatArray) -> tuple[State, Loads]:
    """Hold actions for k plant steps; as `flapgym.plant.backends.numpy.step`."""
    # Of one type: for another the code would be compiled anew, in the midst of an episode.
    after, told = run_kept(_step, parameters, episode, state, np.array(actions, dtype=float))
    last, squares, angle_square, samples = told
    blades = parameters.sizes.blades
    return State(*after), Loads(last, squares[:, :blades], angle_square, squares[:, blades:], samples)
