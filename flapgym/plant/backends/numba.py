"""The step as compiled code, for one turbine and for many: plain loops over the arrays of `flapgym.plant.parameters`.

Sums over the modes of one turbine run along the modes, those of many are matrix products; everything else is written
once, with the turbines innermost. numba keeps what it compiled on disk.
"""

from __future__ import annotations

import contextlib
import inspect
import math
import sys
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from numba.core import event
from numba.core.caching import NullCache

from flapgym.core.arrays import BLADES, Array, FloatArray
from flapgym.plant import actuator, parameters
from flapgym.plant.parameters import Episode, Loads, Parameters, State

OPTIONS: dict[str, Any] = {
    # Sums may be reordered and products fused; NaN and infinity keep their meaning, for a step must notice them.
    "fastmath": {"reassoc", "contract", "nsz"},
    "error_model": "numpy",
}
EDITION = zlib.crc32(b"".join(Path(str(module.__file__)).read_bytes() for module in (actuator, parameters)))
"""Of the other files that go into the compiled code: numba looks at this one alone."""

THIRD = 1.0 / BLADES
C1, S1 = math.cos(2.0 * math.pi * THIRD), math.sin(2.0 * math.pi * THIRD)
"""From one blade to the next."""
BLOCK = 128
"""Turbines whose modes are turned together."""


def kept(function: Any) -> Any:
    """Compile on demand and keep the code on disk; for this process alone where no folder takes it."""
    try:
        return njit(cache=True, **OPTIONS)(function)
    except RuntimeError:  # numba may write neither beside this file nor in the user's cache folder
        return njit(**OPTIONS)(function)


def first_cause(error: BaseException) -> BaseException:
    """What began it: an interrupt while results are handed to Python comes out as a SystemError, or one of that."""
    while error.__cause__ is not None:
        error = error.__cause__
    return error


def run_kept(function: Any, *arguments: Any) -> Any:
    """Call a pure function whose code is kept; files damaged there are removed, and nothing there is needed."""
    try:
        return function(*arguments)
    except SystemError as error:
        raise first_cause(error) from None
    except Exception:
        # Numba unpickles what it kept, and of a file that is empty or cut comes any error.
        source = inspect.getfile(function.py_func)
        with contextlib.suppress(OSError, TypeError):
            for damaged in Path(function.stats.cache_path).glob(f"{Path(source).stem}.*.nb?"):
                damaged.unlink()
    try:
        return function(*arguments)
    except OSError:  # the folder is gone since numba chose it
        function._cache = NullCache()
        return function(*arguments)


class _Announcement(event.Listener):
    """Says so when code of this package is compiled in earnest, not when it is read from where it is kept."""

    def __init__(self) -> None:
        super().__init__()
        self._depth = 0

    def on_start(self, event: Any) -> None:
        """One line for all functions that are compiled within the first."""
        function = event.data["dispatcher"]
        if self._depth == 0 and function.py_func.__module__.startswith("flapgym."):
            kept_at = function.stats.cache_path
            once = "once for this installation"
            if kept_at is None:
                once = "for this process alone, since no folder keeps it (name one in NUMBA_CACHE_DIR)"
            if sys.stderr is not None:
                sys.stderr.write(f"flapgym: compiling the turbine's step, {once} (some tens of seconds)\n")
                sys.stderr.flush()
        self._depth += 1

    def on_end(self, event: Any) -> None:
        """Count."""
        self._depth -= 1


event.register("numba:compile", _Announcement())


flap_step = njit(inline="always", **OPTIONS)(actuator.flap_step)


@njit(**OPTIONS)
def components(values, place, p, cosine, sine, given, row):  # type: ignore[no-untyped-def]
    """Components of a quantity of the flaps, values[place + b F + f], into rows from `row` on, three a flap.

    cos(theta + 2 pi b / 3) summed with the blades: what turns with blade 1 (along), and across it.
    """
    for f in range(p.flaps):
        for t in range(cosine.size):
            one = values[place + f, t] * p.effectiveness[f]
            if p.blades == 1:
                given[row, t], given[row + 1, t], given[row + 2, t] = one, 0.0, 0.0
            else:
                two = values[place + p.flaps + f, t] * p.effectiveness[p.flaps + f]
                three = values[place + 2 * p.flaps + f, t] * p.effectiveness[2 * p.flaps + f]
                along, across = one + C1 * (two + three), S1 * (three - two)
                given[row, t] = THIRD * (one + two + three)
                given[row + 1, t] = 2.0 * THIRD * (cosine[t] * along + sine[t] * across)
                given[row + 2, t] = 2.0 * THIRD * (sine[t] * along - cosine[t] * across)
        row += BLADES


@njit(**OPTIONS)
def move(p, state, actions, flaps, command, rate_lost, jumps, stopped, square, samples):  # type: ignore[no-untyped-def]
    """Flaps of n turbines over the interval, step by step. Returns whether a stop took something away.

    Fills flaps (4, blades F, n), command (blades F, n), what stops did (k blades F, n), who met one (blades F, n), the
    sum of squared angles (n,) and, if they are wanted, the samples.
    """
    count, n = command.shape
    dt, decay, gain, met_any = p.time_step, p.lag_decay, p.lag_gain, False
    first_angle = p.blade_places * p.blades
    for i in range(count):
        top_angle, top_rate = p.angle_limit[i], p.rate_limit[i]
        angle, rate, lagged, travel = flaps[0, i], flaps[1, i], flaps[2, i], flaps[3, i]
        held, met = command[i], stopped[i]
        for t in range(n):
            angle[t], rate[t] = state.flaps[0, i, t], state.flaps[1, i, t]
            lagged[t], travel[t] = state.flaps[2, i, t], state.flaps[3, i, t]
            held[t], met[t] = min(max(float(actions[t, i]), -1.0), 1.0) * p.acceleration[i], 0.0
        for j in range(p.steps):
            lost_now, jump_now = rate_lost[j * count + i], jumps[j * count + i]
            for t in range(n):
                acting = held[t] + gain * (lagged[t] - held[t])
                moved, after, lost, jump, hit = flap_step(angle[t], rate[t], acting, dt, top_angle, top_rate)
                lagged[t] = held[t] + decay * (lagged[t] - held[t])
                travel[t] += abs(moved - angle[t])
                square[t] += moved * moved
                angle[t], rate[t] = moved, after
                met[t] = max(met[t], 1.0 * hit)
                # Round-off of the subtraction is no loss.
                lost_now[t], jump_now[t] = lost * hit, jump
            if p.record:
                for t in range(n):
                    samples[t, j, first_angle + i] = angle[t]
                    samples[t, j, first_angle + count + i] = rate[t]
        for t in range(n):
            met_any |= met[t] > 0.0
    return met_any


@njit(**OPTIONS)
def turn_modes(p, modes, given, after):  # type: ignore[no-untyped-def]
    """Modes of many turbines after an interval without stops.

    BLOCK turbines at a time, whose inputs stay in the nearest cache; three inputs share a pass over a mode.
    """
    count, n = p.decay.shape[1], modes.shape[1]
    for first in range(0, n, BLOCK):
        some = slice(first, min(first + BLOCK, n))
        for m in range(count):
            real, imaginary = p.decay[0, m], p.decay[1, m]
            along, across = modes[m, some], modes[count + m, some]
            up, beside = after[m, some], after[count + m, some]
            for t in range(along.size):
                up[t] = real * along[t] - imaginary * across[t]
                beside[t] = real * across[t] + imaginary * along[t]
            for q in range(0, given.shape[0], BLADES):
                first_in, second_in, third_in = given[q, some], given[q + 1, some], given[q + 2, some]
                a, b, c = p.push[m, q], p.push[m, q + 1], p.push[m, q + 2]
                d, e, f = p.push[count + m, q], p.push[count + m, q + 1], p.push[count + m, q + 2]
                for t in range(along.size):
                    up[t] += a * first_in[t] + b * second_in[t] + c * third_in[t]
                    beside[t] += d * first_in[t] + e * second_in[t] + f * third_in[t]


@njit(**OPTIONS)
def add_stops(p, given, which, after, rows):  # type: ignore[no-untyped-def]
    """What stops did to modes and rows of those turbines that met one."""
    lost = np.empty((given.shape[0], which.size), given.dtype)
    for q in range(given.shape[0]):
        for s in range(which.size):
            lost[q, s] = given[q, which[s]]
    pushed, fed = np.dot(p.stop_push, lost), np.dot(p.stop_feed, lost)
    for m in range(pushed.shape[0]):
        for s in range(which.size):
            after[m, which[s]] += pushed[m, s]
    for r in range(fed.shape[0]):
        for s in range(which.size):
            rows[r, which[s]] += fed[r, s]


@njit(**OPTIONS)
def add_product(matrix, vector, result):  # type: ignore[no-untyped-def]
    """Add a matrix times a vector; three rows share what is read of it, their sums stay in registers."""
    size, row = vector.size, 0
    while row + 3 <= result.size:
        one, two, three = matrix[row], matrix[row + 1], matrix[row + 2]
        first, second, third = result[row], result[row + 1], result[row + 2]
        for i in range(size):
            first += one[i] * vector[i]
            second += two[i] * vector[i]
            third += three[i] * vector[i]
        result[row], result[row + 1], result[row + 2] = first, second, third
        row += 3
    for last in range(row, result.size):
        total, one = result[last], matrix[last]
        for i in range(size):
            total += one[i] * vector[i]
        result[last] = total


@njit(**OPTIONS)
def turn_modes_of_one(p, modes, given, after):  # type: ignore[no-untyped-def]
    """`turn_modes` for one turbine, along its modes."""
    count = p.decay.shape[1]
    real, imaginary, along, across = p.decay[0], p.decay[1], modes[:count], modes[count:]
    for m in range(count):
        after[m] = real[m] * along[m] - imaginary[m] * across[m]
        after[count + m] = real[m] * across[m] + imaginary[m] * along[m]


@njit(**OPTIONS)
def read_loads(p, episode, elapsed, rows, flaps, stopped, square, cosine, sine, loads):  # type: ignore[no-untyped-def]
    """Rows (rows, n) of the flaps' response and the wind's, blade by blade, into the loads."""
    k, kept, count, n = p.steps, p.kept, flaps.shape[1], elapsed.size
    structural = rows.shape[0]
    first_fixed = structural - p.fixed_outputs * kept
    angle_at = p.blade_places * p.blades
    fixed_at = angle_at + 4 * count
    wind_at = fixed_at + p.fixed_places
    turn = 2.0 * math.pi
    for t in range(n):
        last, sample = loads.last[t], loads.samples[t]
        at = min(elapsed[t], p.intervals - 1)
        wind, level = episode.responses[episode.place[t], at], episode.level[t]
        along, across = cosine[t], sine[t]
        for quantity in range(p.blade_outputs):
            samples = k if quantity == 0 else kept
            first = 0 if quantity == 0 else BLADES * (k + (quantity - 1) * kept)
            place = quantity * p.blades
            for j in range(samples):
                row = first + BLADES * j
                mean = float(rows[row, t]) + wind[row] * level
                if p.blades == 1:
                    last[place] = mean
                else:
                    c = float(rows[row + 1, t]) + wind[row + 1] * level
                    s = float(rows[row + 2, t]) + wind[row + 2] * level
                    with_first, beside = c * along + s * across, s * along - c * across
                    last[place] = mean + with_first
                    last[place + 1] = mean + C1 * with_first + S1 * beside
                    last[place + 2] = mean + C1 * with_first - S1 * beside
                for b in range(p.blades):
                    if quantity == 0:
                        loads.rbm_square[t, b] += last[b] * last[b] / k
                    if p.record:
                        sample[j, place + b] = last[place + b]
        for place in range(p.blade_outputs * p.blades, angle_at):
            last[place] = math.nan
        for i in range(count):
            last[angle_at + i], last[angle_at + count + i] = flaps[0, i, t], flaps[1, i, t]
            last[angle_at + 2 * count + i], last[angle_at + 3 * count + i] = flaps[3, i, t], stopped[i, t]
        for quantity in range(p.fixed_places):
            last[fixed_at + quantity] = math.nan
        for quantity in range(p.fixed_outputs):
            for j in range(kept):
                row = first_fixed + quantity * kept + j
                value = float(rows[row, t]) + wind[row] * level
                loads.fixed_square[t, quantity] += value * value / kept
                last[fixed_at + quantity] = value
                if p.record:
                    sample[j, angle_at + 2 * count + quantity] = value
        if p.record:
            for j in range(kept):
                sample[j, angle_at + 2 * count + p.fixed_places] = wind[structural + j] * level
        last[wind_at] = wind[structural + kept - 1] * level
        azimuth = episode.azimuth[t] + p.turn * k * (elapsed[t] + 1)
        # Rounding must not leave a turn.
        last[wind_at + 1] = min(max(azimuth - turn * math.floor(azimuth / turn), 0.0), turn)
        last[wind_at + 2], last[wind_at + 3] = math.cos(azimuth), math.sin(azimuth)
        loads.angle_square[t] = square[t] / (k * count)


@njit(**OPTIONS)
def advance(p, episode, state, actions):  # type: ignore[no-untyped-def]
    """The step; see `step`."""
    n, count, k = state.elapsed.size, p.angle_limit.size, p.steps
    kind = p.read.dtype
    flaps, command, stopped = np.empty((4, count, n)), np.empty((count, n)), np.empty((count, n))
    rate_lost, jumps, square = np.empty((k * count, n)), np.empty((k * count, n)), np.zeros(n)
    cosine, sine, elapsed = np.empty(n), np.empty(n), np.empty(n, np.int64)
    for t in range(n):
        azimuth = episode.azimuth[t] + p.turn * k * state.elapsed[t]
        cosine[t], sine[t] = math.cos(azimuth), math.sin(azimuth)
        elapsed[t] = state.elapsed[t] + 1
    wide = p.record * (p.blade_places * p.blades + 2 * count + p.fixed_places + 1)
    loads = Loads(
        np.empty((n, p.blade_places * p.blades + 4 * count + p.fixed_places + 4)),
        np.zeros((n, p.blades)),
        np.zeros(n),
        np.zeros((n, p.fixed_outputs)),
        np.empty((n, k * p.record, wide)),
    )
    met = move(p, state, actions, flaps, command, rate_lost, jumps, stopped, square, loads.samples)
    given = np.empty((p.push.shape[1], n), kind)
    width = BLADES * p.flaps
    components(state.flaps[0], 0, p, cosine, sine, given, 0)
    components(state.flaps[1], 0, p, cosine, sine, given, width)
    components(command, 0, p, cosine, sine, given, 2 * width)
    if p.lag_gain != 0.0:
        components(state.flaps[2], 0, p, cosine, sine, given, 3 * width)
    after = np.empty(state.modes.shape, kind)
    if n == 1:
        rows = np.zeros((p.read.shape[0], 1), kind)
        modes, pushed = state.modes.reshape(-1), after.reshape(-1)
        add_product(p.read, modes, rows.reshape(-1))
        add_product(p.feed, given.reshape(-1), rows.reshape(-1))
        turn_modes_of_one(p, modes, given, pushed)
        add_product(p.push, given.reshape(-1), pushed)
    else:
        rows = np.dot(p.read, state.modes) + np.dot(p.feed, given)
        turn_modes(p, state.modes, given, after)
    if met:
        lost = np.empty((2 * k * width, n), kind)
        for j in range(k):
            components(rate_lost, j * count, p, cosine, sine, lost, j * width)
            components(jumps, j * count, p, cosine, sine, lost, (k + j) * width)
        if n == 1:
            add_product(p.stop_push, lost.reshape(-1), after.reshape(-1))
            add_product(p.stop_feed, lost.reshape(-1), rows.reshape(-1))
        else:
            which = np.empty(n, np.int64)
            several = 0
            for t in range(n):
                for i in range(count):
                    if stopped[i, t] > 0.0:
                        which[several] = t
                        several += 1
                        break
            add_stops(p, lost, which[:several], after, rows)
    read_loads(p, episode, state.elapsed, rows, flaps, stopped, square, cosine, sine, loads)
    return State(elapsed, flaps, after), loads


@njit(**OPTIONS)
def parameters_in(matrices, numbers):  # type: ignore[no-untyped-def]
    """The parameters that `packed` made flat."""
    sizes, reals = numbers[:12], numbers[12:16]
    blades, flaps, modes, rows, given = int(sizes[3]), int(sizes[4]), int(sizes[10]), int(sizes[11]), 0
    k, count = int(sizes[0]), blades * flaps
    given = BLADES * flaps * (4 if reals[3] != 0.0 else 3)
    stops = 2 * BLADES * flaps * k
    each = numbers[16:]
    decay, rest = matrices[: 2 * modes], matrices[2 * modes :]
    push, rest = rest[: 2 * modes * given], rest[2 * modes * given :]
    read, rest = rest[: rows * 2 * modes], rest[rows * 2 * modes :]
    feed, rest = rest[: rows * given], rest[rows * given :]
    stop_push, stop_feed = rest[: 2 * modes * stops], rest[2 * modes * stops :]
    return Parameters(
        k,
        int(sizes[1]),
        int(sizes[2]),
        blades,
        flaps,
        int(sizes[5]),
        int(sizes[6]),
        int(sizes[7]),
        int(sizes[8]),
        sizes[9] != 0.0,
        reals[0],
        reals[1],
        reals[2],
        reals[3],
        each[:count],
        each[count : 2 * count],
        each[2 * count : 3 * count],
        each[3 * count : 4 * count],
        decay.reshape((2, modes)),
        push.reshape((2 * modes, given)),
        read.reshape((rows, 2 * modes)),
        feed.reshape((rows, given)),
        stop_push.reshape((2 * modes, stops)),
        stop_feed.reshape((rows, stops)),
    )


def packed(p: Parameters) -> tuple[FloatArray, Array]:
    """Parameters as two flat arrays: their matrices, and everything else.

    Every array that is handed to compiled code costs a tenth of a microsecond, and a step of one turbine takes one.
    """
    matrices = (p.decay, p.push, p.read, p.feed, p.stop_push, p.stop_feed)
    sizes = [float(each) for each in p[:10]]
    sizes += [p.decay.shape[1], p.read.shape[0]]
    reals = [p.time_step, p.turn, p.lag_decay, p.lag_gain]
    limits = (p.angle_limit, p.rate_limit, p.acceleration, p.effectiveness)
    return np.concatenate([each.ravel() for each in matrices]), np.concatenate([sizes, reals, *limits])


@njit(**OPTIONS)
def turbine_in(own, modes, responses):  # type: ignore[no-untyped-def]
    """Episode and state of the one turbine that `turbine_packed` made flat."""
    elapsed, place = np.empty(1, np.int64), np.empty(1, np.int64)
    elapsed[0], place[0] = int(own[0]), int(own[1])
    flaps = own[4:].reshape((4, (own.size - 4) // 4, 1))
    return Episode(own[2:3], responses, place, own[3:4]), State(
        elapsed, flaps, modes.reshape((modes.size, 1))
    )


def turbine_packed(episode: Episode, state: State) -> tuple[Array, FloatArray]:
    """Episode and state of one turbine as two flat arrays: its modes, and everything else."""
    own = [state.elapsed, episode.place, episode.azimuth, episode.level, state.flaps.ravel()]
    return np.concatenate(own, dtype=float), state.modes.ravel()


def turbine_unpacked(own: Array, modes: FloatArray) -> State:
    """The state, of views."""
    return State(own[:1].astype(np.int64), own[4:].reshape(4, -1, 1), modes.reshape(-1, 1))


@njit(**OPTIONS)
def own_after(own, state):  # type: ignore[no-untyped-def]
    """`turbine_packed`'s first array, after a step."""
    after = np.empty(own.size)
    after[:4] = own[:4]
    after[0] += 1.0
    after[4:] = state.flaps.reshape(-1)
    return after


def _entry(edition: int) -> Any:
    """The compiled step. What a function closes over is part of what numba looks for on disk."""

    @kept
    def step(parameters, episode, state, actions):  # type: ignore[no-untyped-def]
        _ = edition
        after, loads = advance(parameters, episode, state, actions)
        # Plain tuples: to make a named one Python's own code runs, and an interrupt there is the end of the process.
        return (after.elapsed, after.flaps, after.modes), (
            loads.last,
            loads.rbm_square,
            loads.angle_square,
            loads.fixed_square,
            loads.samples,
        )

    return step


_step = _entry(EDITION)


def step(parameters: Parameters, episode: Episode, state: State, actions: FloatArray) -> tuple[State, Loads]:
    """Hold actions for k plant steps; as `flapgym.plant.backends.numpy.step`."""
    # Of one type: for another the code would be compiled anew, in the midst of an episode.
    after, loads = run_kept(_step, parameters, episode, state, np.array(actions, dtype=float))
    return State(*after), Loads(*loads)
