"""The step as compiled code: plain loops over the arrays of `flapgym.plant.parameters`. numba keeps it on disk.

Many turbines are stepped side by side: flaps with the turbines innermost, modes by matrix products of BLOCK turbines.
Of one turbine, which `flapgym.envs.compiled` steps by the functions from `move` to `read_fixed`, vector units run along
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
WITHIN: dict[str, Any] = OPTIONS | {"inline": "always"}
"""Of what is small or called at one place: alone it would be compiled twice, by itself and within its caller. Not of
`decay_many`, whose loop then comes out slower, with a seventh of a step of 64 turbines."""
_FILES = (__file__, str(actuator.__file__), str(parameters.__file__))
EDITION = zlib.crc32(b"".join(Path(file).read_bytes() for file in _FILES))
"""Of the files that go into compiled code here and in `flapgym.envs.compiled`: numba looks at a function's own file."""

THIRD = 1.0 / BLADES
C1, S1 = math.cos(2.0 * math.pi * THIRD), math.sin(2.0 * math.pi * THIRD)
"""From one blade to the next."""
TURN = 2.0 * math.pi
START = np.int64(0)
"""Where a first place is handed over: numba compiles a function anew for a literal number."""
BLOCK = 128
"""Turbines that are stepped together."""
NEXT_TO_NOTHING = 1e-30
"""Of a mode, whose loads are of the order of its numbers times 1e6."""


class Sizes(NamedTuple):
    """The parameters that are not arrays; see `flapgym.plant.parameters.Parameters`.

    Attributes
    ----------
    modes, rows, given, commanded : int
        2 M and rows of the matrices, Q, and those of the command among them.
    lags : int
    cosine, sine : float
        Of the azimuth of an interval.
    """

    steps: int
    intervals: int
    kept: int
    blades: int
    flaps: int
    pitch: int
    blade_outputs: int
    fixed_outputs: int
    blade_places: int
    fixed_places: int
    record: int
    modes: int
    rows: int
    given: int
    commanded: int
    lags: int
    time_step: float
    turn: float
    lag_decay: float
    cosine: float
    sine: float


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


flap_step = njit(**WITHIN)(actuator.flap_step)


@njit(**OPTIONS)
def actuators(s):  # type: ignore[no-untyped-def]
    """Flaps of all blades, and pitch of each."""
    return s.blades * (s.flaps + s.pitch)


@njit(**OPTIONS)
def move(s, limits, action, flaps, work):  # type: ignore[no-untyped-def]
    """Actuators of one turbine over the interval.

    Returns the sum of the flaps' squared angles over stops, whether a stop was met, and whether angles jumped.

    Parameters
    ----------
    s : Sizes
    limits : (7 blades A,) float
        Angle stop, rate stop, acceleration, effectiveness, lag gain, stiffness and damping of each.
    action : (blades A,) float
    flaps : (4 blades A,) float
        Angle, rate, lagged acceleration and way of each; changed.
    work : (blades A (2 + 2 k),) float
        Filled, of each: command, whether it met a stop, rate gained step by step, jumps step by step.
    """
    count, k = actuators(s), s.steps
    dt, decay = s.time_step, s.lag_decay
    square, stopped, jumped = 0.0, False, False
    for i in range(count):
        work[i] = min(max(float(action[i]), -1.0), 1.0) * limits[2 * count + i]
        work[count + i] = 0.0
    # Steps of one flap wait for one another, those of several flaps run side by side.
    for j in range(k):
        place = (2 + j) * count
        for i in range(count):
            angle, rate, lagged, held = flaps[i], flaps[count + i], flaps[2 * count + i], work[i]
            acting = held + limits[4 * count + i] * (lagged - held)
            acting -= limits[5 * count + i] * angle + limits[6 * count + i] * rate
            moved, after, jump, hit = flap_step(angle, rate, acting, dt, limits[i], limits[count + i])
            flaps[i], flaps[count + i] = moved, after
            flaps[2 * count + i] = held + decay * (lagged - held)
            flaps[3 * count + i] += abs(moved - angle)
            if i < s.blades * s.flaps:
                square += (moved / limits[i]) ** 2
            work[place + i], work[place + k * count + i] = after - rate, jump
            if hit:
                stopped, work[count + i] = True, 1.0
                jumped |= jump != 0.0
    return square, stopped, jumped


@njit(**OPTIONS)
def components(s, limits, values, first, cosine, sine, inputs, place):  # type: ignore[no-untyped-def]
    """Components of a quantity of the actuators, values[first:], into inputs from `place` on, three of each.

    cos(theta + 2 pi b / 3) summed with the blades: what turns with blade 1 (along), and across it.
    """
    effect = 3 * actuators(s)
    for f in range(s.flaps + s.pitch):
        # Flaps come blade by blade, pitch behind them.
        own, next_blade = (f, s.flaps) if f < s.flaps else (s.blades * s.flaps, 1)
        at = first + own
        one, two, three = values[at] * limits[effect + own], 0.0, 0.0
        mean, turning = one, 0.0
        if s.blades == BLADES:
            two = values[at + next_blade] * limits[effect + own + next_blade]
            three = values[at + 2 * next_blade] * limits[effect + own + 2 * next_blade]
            mean, turning = THIRD * (one + two + three), 2.0 * THIRD
        along, across = turning * (one + C1 * (two + three)), turning * (S1 * (three - two))
        inputs[place], inputs[place + 1] = mean, cosine * along + sine * across
        inputs[place + 2] = sine * along - cosine * across
        place += BLADES


@njit(**OPTIONS)
def settle(s, settling, inputs):  # type: ignore[no-untyped-def]
    """Take from the rate that pitch gained step by step what angle and rate at its start account for."""
    each = BLADES * (s.flaps + s.pitch)
    for c in range(BLADES * s.flaps, each):
        angle, rate = inputs[s.commanded + c], inputs[s.commanded + each + c]
        for j in range(s.steps):
            inputs[s.given + j * each + c] -= settling[2 * j] * angle + settling[2 * j + 1] * rate


@njit(**OPTIONS)
def add_inputs(matrix, first, inputs, least, most, result):  # type: ignore[no-untyped-def]
    """Add inputs[q] times row `first` + q for q from `least` up to `most`, multiples of three, which share a pass.

    Three that are zero, as of flaps that rest, are left out; nine share a pass where none is.
    """
    q = least
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
def let_decay(decay, modes):  # type: ignore[no-untyped-def]
    """Leave of the modes (2 M,) of a turbine what an interval does; next to nothing becomes nothing.

    What flaps at rest leave in the modes would decay to denormal numbers, which take ten times as long.
    """
    nothing, half = modes.dtype.type(0.0), modes.size // 2
    along, across = modes[:half], modes[half:]
    for m in range(half):
        first = decay[m] * along[m] - decay[half + m] * across[m]
        second = decay[m] * across[m] + decay[half + m] * along[m]
        along[m] = nothing if abs(first) < NEXT_TO_NOTHING else first
        across[m] = nothing if abs(second) < NEXT_TO_NOTHING else second


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
    column = s.blade_places * s.blades + 2 * actuators(s)
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
def heading(s, azimuth, elapsed, cosine, sine):  # type: ignore[no-untyped-def]
    """Azimuth at the end of an interval, within a turn, its cosine and its sine, from those at the beginning."""
    angle = azimuth + s.turn * s.steps * (elapsed + 1)
    # Rounding must not leave a turn.
    within = min(max(angle - TURN * math.floor(angle / TURN), 0.0), TURN)
    return within, cosine * s.cosine - sine * s.sine, sine * s.cosine + cosine * s.sine


@njit(**OPTIONS)
def sizes_of(p):  # type: ignore[no-untyped-def]
    """Sizes of parameters."""
    return Sizes(
        p.steps,
        p.intervals,
        p.kept,
        p.blades,
        p.flaps,
        p.pitch,
        p.blade_outputs,
        p.fixed_outputs,
        p.blade_places,
        p.fixed_places,
        int(p.record),
        p.read.shape[0],
        p.read.shape[1],
        BLADES * (p.flaps + p.pitch) * (4 if p.lags else 3),
        BLADES * (p.flaps + p.pitch) * (2 if p.lags else 1),
        int(p.lags),
        p.time_step,
        p.turn,
        p.lag_decay,
        math.cos(p.turn * p.steps),
        math.sin(p.turn * p.steps),
    )


@njit(**OPTIONS)
def work_size(s):  # type: ignore[no-untyped-def]
    """Numbers `move` works with."""
    return s.blades * (s.flaps + s.pitch) * (2 + 2 * s.steps)


@njit(**OPTIONS)
def last_size(s):  # type: ignore[no-untyped-def]
    """Numbers a turbine tells of the last sample."""
    return s.blade_places * s.blades + 4 * actuators(s) + s.fixed_places + 4


@njit(**WITHIN)
def move_many(p, actions, flaps, command, gained, jumps, stopped, square, samples):  # type: ignore[no-untyped-def]
    """`move` for n turbines, which stand innermost; returns whether a stop was met and whether angles jumped.

    Changes flaps (4, blades A, n); fills command (blades A, n), rate gained and jumps (k, blades A, n), who met a stop
    (blades A, n), the sum of squared angles over stops (n,) and, where they are wanted, the samples (n, k, size).
    """
    count, n = command.shape
    at = p.blade_places * p.blades
    dt, decay = p.time_step, p.lag_decay
    met_any, jumped = 0.0, 0.0
    square[:] = 0.0
    for i in range(count):
        top_angle, top_rate, most = p.angle_limit[i], p.rate_limit[i], p.acceleration[i]
        gain, stiffness, damping = p.lag_gain[i], p.stiffness[i], p.damping[i]
        counts = 1.0 if i < p.blades * p.flaps else 0.0
        angle, rate, lagged, travel = flaps[0, i], flaps[1, i], flaps[2, i], flaps[3, i]
        held, met = command[i], stopped[i]
        for t in range(n):
            held[t], met[t] = min(max(actions[t, i], -1.0), 1.0) * most, 0.0
        for j in range(p.steps):
            gained_now, jump_now = gained[j, i], jumps[j, i]
            for t in range(n):
                acting = held[t] + gain * (lagged[t] - held[t])
                acting -= stiffness * angle[t] + damping * rate[t]
                moved, after, jump, hit = flap_step(angle[t], rate[t], acting, dt, top_angle, top_rate)
                lagged[t] = held[t] + decay * (lagged[t] - held[t])
                travel[t] += abs(moved - angle[t])
                square[t] += counts * (moved / top_angle) ** 2
                gained_now[t], jump_now[t] = after - rate[t], jump
                angle[t], rate[t] = moved, after
                met[t] = max(met[t], 1.0 * hit)
                jumped += abs(jump)
            for t in range(n * p.record):
                samples[t, j, at + i], samples[t, j, at + count + i] = angle[t], rate[t]
        for t in range(n):
            met_any += met[t]
    return met_any > 0.0, jumped > 0.0


@njit(**WITHIN)
def choose(stopped, command, lagged, gained):  # type: ignore[no-untyped-def]
    """Leave the command of turbines whose actuators are all free, and the rate gained in every step of the others.

    Turbine by turbine, and not for all at once: what one does must not depend on who is stepped beside it.
    """
    count, n = stopped.shape
    for t in range(n):
        met = 0.0
        for i in range(count):
            met = max(met, stopped[i, t])
        for i in range(count):
            command[i, t] *= 1.0 - met
            lagged[i, t] *= 1.0 - met
            for j in range(len(gained)):
                gained[j, i, t] *= met


@njit(**OPTIONS)
def components_many(values, effectiveness, s, cosine, sine, given, place):  # type: ignore[no-untyped-def]
    """Components of a quantity of the actuators (blades A, n) into columns of `given`, from `place` on, three each."""
    for f in range(s.flaps + s.pitch):
        at = place + BLADES * f
        first, next_blade = (f, s.flaps) if f < s.flaps else (s.blades * s.flaps, 1)
        for t in range(cosine.size):
            one = values[first, t] * effectiveness[first]
            if s.blades < BLADES:
                given[t, at], given[t, at + 1], given[t, at + 2] = one, 0.0, 0.0
            else:
                second, third = first + next_blade, first + 2 * next_blade
                two, three = (
                    values[second, t] * effectiveness[second],
                    values[third, t] * effectiveness[third],
                )
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


@njit(**WITHIN)
def add_jumps(p, s, jumps, cosine, sine, after, rows):  # type: ignore[no-untyped-def]
    """What jumps of angles (k, blades A, n) did to modes and rows: few actuators hit a stop at once."""
    k, count, n = jumps.shape
    width = BLADES * (s.flaps + s.pitch)
    one, inputs = np.empty((count, 1)), np.empty((1, width), after.dtype)
    for j in range(k):
        row = s.given + width * (k + j)
        for t in range(n):
            total = 0.0
            for i in range(count):
                one[i, 0] = jumps[j, i, t]
                total += abs(jumps[j, i, t])
            if total > 0.0:
                components_many(one, p.effectiveness, s, cosine[t : t + 1], sine[t : t + 1], inputs, START)
                add_inputs(p.push, row, inputs[0], START, width, after[t])
                add_inputs(p.feed, row, inputs[0], START, width, rows[t])


@njit(**WITHIN)
def read_many(s, episode, elapsed, rows, flaps, stopped, square, cosine, sine, first, loads):  # type: ignore[no-untyped-def]
    """Loads of turbines from `first` on from their rows, the wind's response added."""
    last, rbm_square, angle_square, fixed_square, samples = loads
    responses = episode.responses
    count, n = len(stopped), len(rows)
    at = s.blade_places * s.blades
    fixed_at = at + 4 * count
    wind_at = fixed_at + s.fixed_places
    own = np.empty(s.rows)
    for t in range(n):
        turbine = first + t
        level, since = episode.level[turbine], elapsed[turbine]
        wind, told = responses[episode.place[turbine], min(since, s.intervals - 1)], last[turbine]
        each = samples[turbine]
        for r in range(s.rows):
            own[r] = rows[t, r] + wind[r] * level
        read_blades(s, own, cosine[t], sine[t], told, rbm_square[turbine], each)
        read_fixed(s, own, wind, level, fixed_at, told, fixed_square[turbine], each)
        for i in range(count):
            told[at + i], told[at + count + i] = flaps[0, i, t], flaps[1, i, t]
            told[at + 2 * count + i], told[at + 3 * count + i] = flaps[3, i, t], stopped[i, t]
        turned = heading(s, episode.azimuth[turbine], since, cosine[t], sine[t])
        told[wind_at + 1], told[wind_at + 2], told[wind_at + 3] = turned
        angle_square[turbine] = square[t] / (s.steps * s.blades * s.flaps)


def _entry(edition: int) -> Any:
    """The compiled step. What a function closes over is part of what numba looks for on disk."""

    @kept
    def step(p, episode, state, actions):  # type: ignore[no-untyped-def]
        _ = edition
        s, n, count, k = sizes_of(p), state.elapsed.size, p.angle_limit.size, p.steps
        kind, width = p.read.dtype, BLADES * (p.flaps + p.pitch)
        flaps, modes, elapsed = np.empty((4, count, n)), np.empty(state.modes.shape, kind), state.elapsed
        last, rbm_square, angle_square = np.empty((n, last_size(s))), np.empty((n, s.blades)), np.empty(n)
        fixed_square = np.empty((n, s.fixed_outputs))
        wide = s.record * (s.blade_places * s.blades + 2 * count + s.fixed_places + 1)
        loads = (last, rbm_square, angle_square, fixed_square, np.empty((n, k * s.record, wide)))
        for first in range(0, n, BLOCK):
            # What belongs to a block of turbines stays in the nearer caches while all is done with it.
            some = slice(first, min(first + BLOCK, n))
            azimuth = episode.azimuth[some] + p.turn * k * elapsed[some]
            cosine, sine = np.cos(azimuth), np.sin(azimuth)
            size = cosine.size
            started, command, stopped = (
                np.empty((4, count, size)),
                np.empty((count, size)),
                np.empty((count, size)),
            )
            gained, jumps, square = np.empty((k, count, size)), np.empty((k, count, size)), np.empty(size)
            before, after = state.modes[some], modes[some]
            # Number by number: with a slice numba compiles the message that its size is another, for two seconds.
            for what in range(4):
                for i in range(count):
                    for t in range(size):
                        started[what, i, t] = state.flaps[what, i, first + t]
            moved = started.copy()
            met, jumped = move_many(
                p, actions[some], moved, command, gained, jumps, stopped, square, loads[4][some]
            )
            if met:
                choose(stopped, command, started[2], gained)
            wide = s.given + width * k * met
            given = np.empty((size, wide), kind)
            components_many(command, p.effectiveness, s, cosine, sine, given, START)
            if p.lags:
                components_many(started[2], p.effectiveness, s, cosine, sine, given, width)
            components_many(started[0], p.effectiveness, s, cosine, sine, given, s.commanded)
            components_many(started[1], p.effectiveness, s, cosine, sine, given, s.commanded + width)
            for j in range(k * met):
                components_many(gained[j], p.effectiveness, s, cosine, sine, given, s.given + j * width)
            for t in range(size * met * p.pitch):
                if stopped[:, t].any():
                    settle(s, p.settling.ravel(), given[t])
            np.dot(given, p.push[:wide], after)
            decay_many(p.decay, before, after)
            rows, fed = np.empty((size, s.rows), kind), np.empty((size, s.rows), kind)
            np.dot(before, p.read, rows)
            np.dot(given, p.feed[:wide], fed)
            rows += fed
            if jumped:
                add_jumps(p, s, jumps, cosine, sine, after, rows)
            for what in range(4):
                for i in range(count):
                    for t in range(size):
                        flaps[what, i, first + t] = moved[what, i, t]
            read_many(s, episode, elapsed, rows, moved, stopped, square, cosine, sine, first, loads)
        # Plain tuples: to make a named one Python's own code runs, and an interrupt there is the end of the process.
        return (elapsed + 1, flaps, modes), loads

    return step


_step = _entry(EDITION)


def step(parameters: Parameters, episode: Episode, state: State, actions: FloatArray) -> tuple[State, Loads]:
    """Hold actions for k plant steps; as `flapgym.plant.backends.numpy.step`."""
    # Of one type: for another the code would be compiled anew, in the midst of an episode.
    after, loads = run_kept(_step, parameters, episode, state, np.array(actions, dtype=float))
    return State(*after), Loads(*loads)
