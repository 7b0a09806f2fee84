"""The step as compiled code: plain loops over the arrays of `flapgym.plant.parameters`. numba keeps it on disk.

Many turbines are stepped side by side: flaps with the turbines innermost, modes by matrix products of BLOCK turbines.
Of one turbine, which `flapgym.envs.compiled` steps by the functions from `move` to `advance`, vector units run along
the modes. Compiled code counts the references to every array that it takes out of a tuple or cuts from another, so
these get their arrays one by one, flat, and everything else as `Sizes`.
"""

from __future__ import annotations

import contextlib
import inspect
import math
import sys
import zlib
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numba.core import event

from flapgym.core.arrays import BLADES, FloatArray
from flapgym.plant import actuator, parameters
from flapgym.plant.parameters import Episode, Loads, Parameters, State

OPTIONS: dict[str, Any] = {
    # Sums may be reordered and products fused; NaN and infinity keep their meaning, for a step must notice them.
    "fastmath": {"reassoc", "contract", "nsz"},
    "error_model": "numpy",
}
_FILES = (__file__, str(actuator.__file__), str(parameters.__file__))
EDITION = zlib.crc32(b"".join(Path(file).read_bytes() for file in _FILES))
"""Of the files that go into compiled code here and in `flapgym.envs.compiled`: numba looks at a function's own file."""

THIRD = 1.0 / BLADES
C1, S1 = math.cos(2.0 * math.pi * THIRD), math.sin(2.0 * math.pi * THIRD)
"""From one blade to the next."""
TURN = 2.0 * math.pi
BLOCK = 128
"""Turbines that are stepped together."""
NEXT_TO_NOTHING = 1e-30
"""Of a mode, whose loads are of the order of its numbers times 1e6."""


class Sizes(NamedTuple):
    """The parameters that are not arrays; see `flapgym.plant.parameters.Parameters`.

    Attributes
    ----------
    modes, rows, given : int
        2 M, rows and Q of the matrices.
    cosine, sine : float
        Of the azimuth of an interval.
    """

    steps: int
    intervals: int
    kept: int
    blades: int
    flaps: int
    blade_outputs: int
    fixed_outputs: int
    blade_places: int
    fixed_places: int
    record: int
    modes: int
    rows: int
    given: int
    time_step: float
    turn: float
    lag_decay: float
    lag_gain: float
    cosine: float
    sine: float


WHOLE = 13
"""Of them are whole numbers."""


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
        return _for_this_process(function)(*arguments)


@lru_cache
def _for_this_process(function: Any) -> Any:
    """The same function, whose code is kept nowhere."""
    return njit(**OPTIONS)(function.py_func)


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
def move(s, limits, action, flaps, work):  # type: ignore[no-untyped-def]
    """Flaps of one turbine over the interval.

    Returns the sum of squared angles over stops, and whether a stop took something away.

    Parameters
    ----------
    s : Sizes
    limits : (4 blades F,) float
        Angle stop, rate stop, acceleration and effectiveness of every flap.
    action : (blades F,) float
    flaps : (4 blades F,) float
        Angle, rate, lagged acceleration and way of every flap; changed.
    work : (blades F (2 + 2 k) + 2 k blades F + k,) float
        Filled: command of every flap, whether it met a stop; of every step rate lost and jump of every flap; what a
        step took: 0 nothing, 1 rate, 2 angle.
    """
    count, k = s.blades * s.flaps, s.steps
    dt, decay, gain = s.time_step, s.lag_decay, s.lag_gain
    lost_at = 2 * count
    took_at = lost_at + 2 * k * count
    square, met_any = 0.0, False
    for j in range(k):
        work[took_at + j] = 0.0
    for i in range(count):
        work[i] = min(max(float(action[i]), -1.0), 1.0) * limits[2 * count + i]
        work[count + i] = 0.0
    # Steps of one flap wait for one another, those of several flaps run side by side.
    for j in range(k):
        place = lost_at + 2 * j * count
        for i in range(count):
            angle, rate, lagged, held = flaps[i], flaps[count + i], flaps[2 * count + i], work[i]
            acting = held + gain * (lagged - held)
            moved, after, lost, jump, hit = flap_step(angle, rate, acting, dt, limits[i], limits[count + i])
            flaps[i], flaps[count + i] = moved, after
            flaps[2 * count + i] = held + decay * (lagged - held)
            flaps[3 * count + i] += abs(moved - angle)
            square += (moved / limits[i]) ** 2
            # Round-off of the subtraction is no loss.
            work[place + i], work[place + count + i] = lost * hit, jump
            if hit:
                met_any, work[count + i] = True, 1.0
                work[took_at + j] = max(work[took_at + j], 2.0 if jump != 0.0 else 1.0)
    return square, met_any


@njit(**OPTIONS)
def components(s, limits, values, first, cosine, sine, inputs, place):  # type: ignore[no-untyped-def]
    """Components of a quantity of the flaps, values[first + b F + f], into inputs from `place` on, three a flap.

    cos(theta + 2 pi b / 3) summed with the blades: what turns with blade 1 (along), and across it.
    """
    flaps, effect = s.flaps, 3 * s.blades * s.flaps
    for f in range(flaps):
        at = first + f
        one, two, three = values[at] * limits[effect + f], 0.0, 0.0
        mean, turning = one, 0.0
        if s.blades == BLADES:
            two = values[at + flaps] * limits[effect + flaps + f]
            three = values[at + 2 * flaps] * limits[effect + 2 * flaps + f]
            mean, turning = THIRD * (one + two + three), 2.0 * THIRD
        along, across = turning * (one + C1 * (two + three)), turning * (S1 * (three - two))
        inputs[place], inputs[place + 1] = mean, cosine * along + sine * across
        inputs[place + 2] = sine * along - cosine * across
        place += BLADES


@njit(**OPTIONS)
def add_inputs(matrix, first, inputs, place, count, result):  # type: ignore[no-untyped-def]
    """Add inputs[place + q] times row `first` + q for q up to `count`; the three of a flap share a pass."""
    for q in range(0, count, BLADES):
        a, b, c = inputs[place + q], inputs[place + q + 1], inputs[place + q + 2]
        row = first + q
        for i in range(result.size):
            result[i] += a * matrix[row, i] + b * matrix[row + 1, i] + c * matrix[row + 2, i]


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
def decayed(decay, parts, before, after_parts, after):  # type: ignore[no-untyped-def]
    """Add what an interval leaves of the modes; next to nothing becomes nothing.

    What flaps at rest leave in the modes would decay to denormal numbers, which take ten times as long.

    Parameters
    ----------
    decay : (2, M) float
    parts, after_parts : (2 n, M) float
        Real and imaginary parts of turbines in turn; to the latter is added.
    before, after : int
        Where those of the turbine begin.
    """
    nothing = parts.dtype.type(0.0)
    for m in range(decay.shape[1]):
        real, imaginary, along, across = decay[0, m], decay[1, m], parts[before, m], parts[before + 1, m]
        first = after_parts[after, m] + (real * along - imaginary * across)
        second = after_parts[after + 1, m] + (real * across + imaginary * along)
        after_parts[after, m] = nothing if abs(first) < NEXT_TO_NOTHING else first
        after_parts[after + 1, m] = nothing if abs(second) < NEXT_TO_NOTHING else second


@njit(**OPTIONS)
def on_blades(mean, along, across, cosine, sine):  # type: ignore[no-untyped-def]
    """Of three blades, from components in the frame in which blade 1 stands at that cosine and sine."""
    with_first, beside = along * cosine + across * sine, across * cosine - along * sine
    return mean + with_first, mean + C1 * with_first + S1 * beside, mean + C1 * with_first - S1 * beside


@njit(**OPTIONS)
def read_blades(s, rows, cosine, sine, last, rbm_square, samples):  # type: ignore[no-untyped-def]
    """Blade quantities: their last sample, mean squares of the root moment and, where they are wanted, all samples."""
    whole = s.blades == BLADES
    row = 0
    for quantity in range(s.blade_outputs):
        place, count = quantity * s.blades, s.steps if quantity == 0 else s.kept
        one, two, three, first, second, third = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for j in range(count):
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
        last[place] = one
        if whole:
            last[place + 1], last[place + 2] = two, three
        if quantity == 0:
            rbm_square[0] = first / count
            if whole:
                rbm_square[1], rbm_square[2] = second / count, third / count
    for place in range(s.blade_outputs * s.blades, s.blade_places * s.blades):
        last[place] = math.nan


@njit(**OPTIONS)
def read_fixed(s, rows, wind, level, place, last, fixed_square, samples):  # type: ignore[no-untyped-def]
    """Fixed outputs and the wind, last from `place` on; samples from their place on."""
    row, kept = s.rows - s.fixed_outputs * s.kept, s.kept
    column = s.blade_places * s.blades + 2 * s.blades * s.flaps
    for quantity in range(s.fixed_outputs):
        value, square = 0.0, 0.0
        for j in range(kept):
            value = float(rows[row + j])
            square += value * value
            if s.record:
                samples[j, column + quantity] = value
        last[place + quantity] = value
        fixed_square[quantity] = square / kept
        row += kept
    for quantity in range(s.fixed_outputs, s.fixed_places):
        last[place + quantity] = math.nan
    if s.record:
        for j in range(kept):
            samples[j, column + s.fixed_places] = wind[s.rows + j] * level
    last[place + s.fixed_places] = wind[s.rows + kept - 1] * level


@njit(**OPTIONS)
def begin(s, limits, azimuth, elapsed, action, flaps, work, inputs):  # type: ignore[no-untyped-def]
    """Flaps of one turbine; of `inputs`, the Q of motion that is free of stops. The rest is as of `advance`.

    Returns cosine and sine of the azimuth at the start, the sum of squared angles, and whether a stop was met.
    """
    count, each = s.blades * s.flaps, BLADES * s.flaps
    angle = azimuth + s.turn * s.steps * elapsed
    cosine, sine = math.cos(angle), math.sin(angle)
    components(s, limits, flaps, 0, cosine, sine, inputs, 0)
    components(s, limits, flaps, count, cosine, sine, inputs, each)
    if s.lag_gain != 0.0:
        components(s, limits, flaps, 2 * count, cosine, sine, inputs, 3 * each)
    square, met = move(s, limits, action, flaps, work)
    components(s, limits, work, 0, cosine, sine, inputs, 2 * each)
    return cosine, sine, square, met


@njit(**OPTIONS)
def advance(  # type: ignore[no-untyped-def]
    s,
    limits,
    push,
    first_push,
    feed,
    azimuth,
    cosine,
    sine,
    square,
    met,
    wind,
    level,
    elapsed,
    modes,
    flaps,
    rows,
    work,
    inputs,
    last,
    rbm_square,
    fixed_square,
    samples,
):
    """What follows `begin` and the modes' own motion. Returns the mean square of the flap angles.

    Parameters
    ----------
    s : Sizes
    limits : (4 blades F,) float
        As of `move`.
    push, feed : float
        Of the parameters; `push` begins at row `first_push`.
    azimuth, level, elapsed : float, float, int
        At the reset, of the wind's response, actions since the reset.
    wind : (rows + kept,) float
        That response.
    cosine, sine, square, met
        What `begin` returned.
    modes : (2 M,) float
        At the end as if there were no stops; changed.
    flaps : (4 blades F,) float
    rows : (rows,) float
        What the modes and motion that is free of stops make of the rows; changed.
    work : float
        As of `move`.
    inputs : (6 F,) float
        To work in.
    last, rbm_square, fixed_square, samples : float
        Of this turbine's loads; filled.
    """
    k, count, each = s.steps, s.blades * s.flaps, BLADES * s.flaps
    if met:
        for j in range(k):
            took = work[2 * count + 2 * k * count + j]
            if took == 0.0:
                continue
            # Rate is lost often, an angle jumps only where a moving flap hits its stop.
            kinds = 2 if took > 1.0 else 1
            first = s.given + 2 * j * each
            for kind in range(kinds):
                place = kind * each
                components(s, limits, work, 2 * count + (2 * j + kind) * count, cosine, sine, inputs, place)
            add_inputs(feed, first, inputs, 0, kinds * each, rows)
            # What is lost in the last step does not reach the modes at its end.
            if j < k - 1:
                add_inputs(push, first_push + first, inputs, 0, kinds * each, modes)
    for row in range(s.rows):
        rows[row] += wind[row] * level
    read_blades(s, rows, cosine, sine, last, rbm_square, samples)
    place = s.blade_places * s.blades
    for i in range(count):
        last[place + i], last[place + count + i] = flaps[i], flaps[count + i]
        last[place + 2 * count + i], last[place + 3 * count + i] = flaps[3 * count + i], work[count + i]
    place += 4 * count
    read_fixed(s, rows, wind, level, place, last, fixed_square, samples)
    place += s.fixed_places + 1
    angle = azimuth + s.turn * k * (elapsed + 1)
    # Rounding must not leave a turn.
    last[place] = min(max(angle - TURN * math.floor(angle / TURN), 0.0), TURN)
    last[place + 1] = cosine * s.cosine - sine * s.sine
    last[place + 2] = sine * s.cosine + cosine * s.sine
    return square / (k * count)


@njit(**OPTIONS)
def sizes_of(p):  # type: ignore[no-untyped-def]
    """Sizes of parameters."""
    return Sizes(
        p.steps,
        p.intervals,
        p.kept,
        p.blades,
        p.flaps,
        p.blade_outputs,
        p.fixed_outputs,
        p.blade_places,
        p.fixed_places,
        int(p.record),
        p.read.shape[1],
        p.read.shape[0],
        BLADES * p.flaps * (4 if p.lag_gain != 0.0 else 3),
        p.time_step,
        p.turn,
        p.lag_decay,
        p.lag_gain,
        math.cos(p.turn * p.steps),
        math.sin(p.turn * p.steps),
    )


@njit(**OPTIONS)
def work_size(s):  # type: ignore[no-untyped-def]
    """Numbers `move` works with."""
    return s.blades * s.flaps * (2 + 2 * s.steps) + s.steps


@njit(**OPTIONS)
def last_size(s):  # type: ignore[no-untyped-def]
    """Numbers a turbine tells of the last sample."""
    return s.blade_places * s.blades + 4 * s.blades * s.flaps + s.fixed_places + 4


@njit(**OPTIONS)
def move_many(p, before, actions, flaps, command, lost, jumps, stopped, square, samples):  # type: ignore[no-untyped-def]
    """`move` for many turbines, which stand innermost; returns whether a stop took something away.

    Fills flaps (4, blades F, n), command (blades F, n), rate lost and jumps (k, blades F, n), who met a stop
    (blades F, n), the sum of squared angles over stops (n,) and, where they are wanted, the samples.
    """
    count, n = command.shape
    dt, decay, gain = p.time_step, p.lag_decay, p.lag_gain
    at, met_any = p.blade_places * p.blades, 0.0
    for i in range(count):
        top_angle, top_rate, most = p.angle_limit[i], p.rate_limit[i], p.acceleration[i]
        angle, rate, lagged, travel = flaps[0, i], flaps[1, i], flaps[2, i], flaps[3, i]
        held, met = command[i], stopped[i]
        angle[:], rate[:], lagged[:], travel[:] = before[0, i], before[1, i], before[2, i], before[3, i]
        for t in range(n):
            held[t], met[t] = min(max(actions[t, i], -1.0), 1.0) * most, 0.0
        for j in range(p.steps):
            lost_now, jump_now = lost[j, i], jumps[j, i]
            for t in range(n):
                acting = held[t] + gain * (lagged[t] - held[t])
                moved, after, off, jump, hit = flap_step(angle[t], rate[t], acting, dt, top_angle, top_rate)
                lagged[t] = held[t] + decay * (lagged[t] - held[t])
                travel[t] += abs(moved - angle[t])
                square[t] += (moved / top_angle) ** 2
                angle[t], rate[t] = moved, after
                met[t] = max(met[t], 1.0 * hit)
                # Round-off of the subtraction is no loss.
                lost_now[t], jump_now[t] = off * hit, jump
            for t in range(n * p.record):
                samples[t, j, at + i], samples[t, j, at + count + i] = angle[t], rate[t]
        met_any += met.sum()
    return met_any > 0.0


@njit(**OPTIONS)
def components_many(values, effectiveness, flaps, cosine, sine, given, place):  # type: ignore[no-untyped-def]
    """Components of a quantity of the flaps (blades F, n) into columns of `given`, from `place` on, three a flap."""
    single = len(values) == flaps
    for f in range(flaps):
        at = place + BLADES * f
        for t in range(cosine.size):
            one = values[f, t] * effectiveness[f]
            if single:
                given[t, at], given[t, at + 1], given[t, at + 2] = one, 0.0, 0.0
            else:
                two = values[flaps + f, t] * effectiveness[flaps + f]
                three = values[2 * flaps + f, t] * effectiveness[2 * flaps + f]
                # What turns with blade 1, and what stands across it.
                along, across = one + C1 * (two + three), S1 * (three - two)
                given[t, at] = THIRD * (one + two + three)
                given[t, at + 1] = 2.0 * THIRD * (cosine[t] * along + sine[t] * across)
                given[t, at + 2] = 2.0 * THIRD * (sine[t] * along - cosine[t] * across)


@njit(**OPTIONS)
def decay_many(decay, modes, after):  # type: ignore[no-untyped-def]
    """Add what an interval leaves of the modes of many turbines."""
    half = decay.shape[1]
    real, imaginary = decay[0], decay[1]
    for t in range(len(modes)):
        along, across, up, beside = modes[t, :half], modes[t, half:], after[t, :half], after[t, half:]
        for m in range(half):
            first = up[m] + real[m] * along[m] - imaginary[m] * across[m]
            second = beside[m] + real[m] * across[m] + imaginary[m] * along[m]
            # Smaller ones decay to denormal numbers, which take a processor ten times as long.
            up[m] = first if abs(first) > NEXT_TO_NOTHING else 0.0
            beside[m] = second if abs(second) > NEXT_TO_NOTHING else 0.0


@njit(**OPTIONS)
def add_stops(p, of, first, width, cosine, sine, after, rows):  # type: ignore[no-untyped-def]
    """What stops did, `of` (k, blades F, n), to modes and rows of the turbines that met one.

    In the matrices a step's columns are 2 `width` apart and begin with the column `first`.
    """
    k, count, n = of.shape
    which, several = np.empty(n, np.int64), 0
    for t in range(n):
        total = 0.0
        for j in range(k):
            for i in range(count):
                total += abs(of[j, i, t])
        if total > 0.0:
            which[several] = t
            several += 1
    if several == 0:
        return
    which = which[:several]
    some_cosine, some_sine = cosine[which], sine[which]
    given, part = np.empty((several, k * width), after.dtype), np.empty((count, several))
    push, feed = (
        np.empty((k * width, after.shape[1]), after.dtype),
        np.empty((k * width, rows.shape[1]), after.dtype),
    )
    push[:] = 0.0
    for j in range(k):
        for i in range(count):
            for t in range(several):
                part[i, t] = of[j, i, which[t]]
        components_many(part, p.effectiveness, p.flaps, some_cosine, some_sine, given, j * width)
        at = first + 2 * width * j
        feed[j * width : (j + 1) * width] = p.feed[at : at + width]
        if at + width <= len(p.push):  # what the last step does reaches the modes with the next interval
            push[j * width : (j + 1) * width] = p.push[at : at + width]
    pushed, fed = np.dot(given, push), np.dot(given, feed)
    for t in range(several):
        after[which[t]] += pushed[t]
        rows[which[t]] += fed[t]


@njit(**OPTIONS)
def read_many(p, s, episode, elapsed, rows, flaps, stopped, square, cosine, sine, loads):  # type: ignore[no-untyped-def]
    """Loads of many turbines from their rows, the wind's response added."""
    last, rbm_square, angle_square, fixed_square, samples = loads
    azimuth, responses, place, level = episode.azimuth, episode.responses, episode.place, episode.level
    count, n = len(stopped), elapsed.size
    at = p.blade_places * p.blades
    fixed_at = at + 4 * count
    wind_at = fixed_at + p.fixed_places
    own = np.empty(rows.shape[1])
    for t in range(n):
        wind, told, each = responses[place[t], min(elapsed[t], p.intervals - 1)], last[t], samples[t]
        for r in range(own.size):
            own[r] = rows[t, r] + wind[r] * level[t]
        read_blades(s, own, cosine[t], sine[t], told, rbm_square[t], each)
        read_fixed(s, own, wind, level[t], fixed_at, told, fixed_square[t], each)
        for i in range(count):
            told[at + i], told[at + count + i] = flaps[0, i, t], flaps[1, i, t]
            told[at + 2 * count + i], told[at + 3 * count + i] = flaps[3, i, t], stopped[i, t]
        angle = azimuth[t] + p.turn * p.steps * (elapsed[t] + 1)
        # Rounding must not leave a turn.
        told[wind_at + 1] = min(max(angle - TURN * math.floor(angle / TURN), 0.0), TURN)
        told[wind_at + 2] = cosine[t] * s.cosine - sine[t] * s.sine
        told[wind_at + 3] = sine[t] * s.cosine + cosine[t] * s.sine
        angle_square[t] = square[t] / (p.steps * count)


def _entry(edition: int) -> Any:
    """The compiled step. What a function closes over is part of what numba looks for on disk."""

    @kept
    def step(p, episode, state, actions):  # type: ignore[no-untyped-def]
        _ = edition
        s, n, count, k = sizes_of(p), state.elapsed.size, p.angle_limit.size, p.steps
        kind, width = p.read.dtype, BLADES * p.flaps
        flaps, command, stopped = np.empty((4, count, n)), np.empty((count, n)), np.empty((count, n))
        lost, jumps, square = np.empty((k, count, n)), np.empty((k, count, n)), np.zeros(n)
        azimuth = episode.azimuth + p.turn * k * state.elapsed
        cosine, sine = np.cos(azimuth), np.sin(azimuth)
        last, rbm_square, angle_square = np.empty((n, last_size(s))), np.empty((n, s.blades)), np.empty(n)
        fixed_square = np.empty((n, s.fixed_outputs))
        wide = s.record * (s.blade_places * s.blades + 2 * count + s.fixed_places + 1)
        samples = np.empty((n, k * s.record, wide))
        met = move_many(p, state.flaps, actions, flaps, command, lost, jumps, stopped, square, samples)
        given = np.empty((n, s.given), kind)
        components_many(state.flaps[0], p.effectiveness, p.flaps, cosine, sine, given, 0)
        components_many(state.flaps[1], p.effectiveness, p.flaps, cosine, sine, given, width)
        components_many(command, p.effectiveness, p.flaps, cosine, sine, given, 2 * width)
        if p.lag_gain != 0.0:
            components_many(state.flaps[2], p.effectiveness, p.flaps, cosine, sine, given, 3 * width)
        modes, push, to_rows, decay = state.modes, p.push[: s.given], p.read.T, p.decay
        after, rows = np.empty(modes.shape, kind), np.empty((n, s.rows), kind)
        for first in range(0, n, BLOCK):
            # A block's modes stay in the nearer caches while all is done with them.
            some = slice(first, min(first + BLOCK, n))
            np.dot(modes[some], to_rows, rows[some])
            np.dot(given[some], push, after[some])
            decay_many(decay, modes[some], after[some])
        rows += np.dot(given, p.feed[: s.given])
        if met:
            # Rate is lost often, an angle jumps only where a moving flap hits its stop.
            add_stops(p, lost, s.given, width, cosine, sine, after, rows)
            add_stops(p, jumps, s.given + width, width, cosine, sine, after, rows)
        loads = (last, rbm_square, angle_square, fixed_square, samples)
        read_many(p, s, episode, state.elapsed, rows, flaps, stopped, square, cosine, sine, loads)
        # Plain tuples: to make a named one Python's own code runs, and an interrupt there is the end of the process.
        return (state.elapsed + 1, flaps, after), loads

    return step


_step = _entry(EDITION)


def step(parameters: Parameters, episode: Episode, state: State, actions: FloatArray) -> tuple[State, Loads]:
    """Hold actions for k plant steps; as `flapgym.plant.backends.numpy.step`."""
    # Of one type: for another the code would be compiled anew, in the midst of an episode.
    after, loads = run_kept(_step, parameters, episode, state, np.array(actions, dtype=float))
    return State(*after), Loads(*loads)
