"""The step of one or many turbines as compiled code: flap actuators, modes, loads, reward and observation in one call.

Superposition (flapgym.plant.responses): the flaps' response is stepped by modes, the wind's is read from a table.
A few turbines are stepped one after another with the modes innermost, those of a batch side by side in blocks; the
tests hold the two to each other. flapgym.plant.sampled does the same with numpy; the layout is flapgym.plant.layout.

Loops that a vector unit shall take run over few slices at constant strides: only then does the compiler see that
nothing overlaps. Indices into whole arrays, strides it does not know, or a slice for every quantity cost a factor of
two to four.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import carray, njit, types
from numba.extending import intrinsic

from flapgym.plant.layout import (
    ACCELERATION_LIMIT,
    ANGLE,
    ANGLE_LIMIT,
    AZIMUTH,
    BLADE_COUNT,
    CONSTANTS,
    COSINE,
    COSINE_TURN,
    COUNT,
    DIRECT,
    DISPLACED,
    DRIVE,
    EDITION,
    EFFECTIVENESS,
    ENTRY,
    EVERY,
    FEWEST_IN_BATCH,
    FLAP_INPUTS,
    GROUP,
    HEAD,
    INTERVALS,
    LAG_DECAY,
    LAG_GAIN,
    LANES,
    LAYOUT,
    MEAN_SQUARE,
    MODES,
    NOISY,
    OBSERVED,
    OWN,
    OWN_ANGLE,
    OWN_AZIMUTH,
    OWN_ELAPSED,
    OWN_LAGGED,
    OWN_LEVEL,
    OWN_RATE,
    OWN_RESPONSE,
    OWN_TRAVEL,
    RATE,
    RATE_LIMIT,
    RBM,
    READ,
    READ_LAST,
    REWARD,
    REWARD_ANGLE,
    REWARD_RBM,
    REWARD_TOWER,
    ROW,
    SAMPLE,
    SAMPLE_ANGLE,
    SAMPLE_RATE,
    SAMPLE_RBM,
    SAMPLE_TIP,
    SAMPLE_TOWER,
    SAMPLE_WIND,
    SINE,
    SINE_TURN,
    STEPS,
    STOPPED,
    STUCK,
    TIME_STEP,
    TIP,
    TOWER,
    TRAVEL,
    TURN,
    WEIGHT_ANGLE,
    WEIGHT_RBM,
    WEIGHT_TOWER,
    WIND,
)

OPTIONS: dict[str, Any] = {
    # Sums may be reordered and products fused; NaN and infinity keep their meaning.
    "fastmath": {"reassoc", "contract", "nsz"},
    "error_model": "numpy",
    "cache": True,
}

C1, S1 = math.cos(2.0 * math.pi / 3.0), math.sin(2.0 * math.pi / 3.0)
"""From one blade to the next."""
THIRD = 1.0 / 3.0
OUTDATED = -(1 << 40)
"""Returned by code that was compiled for another layout."""
PAIR = 2 * LANES
COMMANDS, STOPS, COSINES, SINES, SQUARES, SUMS, VALUES = 12, 15, 18, 19, 20, 21, 24
"""Rows of a block's work, behind the first twelve numbers of its records: for the flaps, then for the loads."""
WORK = 32
"""Rows of a block's work; behind them the wind's response."""
ROW_PAIRS = 2 * GROUP
GROUP_SIZE = CONSTANTS * GROUP


@intrinsic
def _doubles(typingctx, address):  # type: ignore[no-untyped-def]
    """Pointer to double precision from an address."""
    return _pointer_to(types.float64, address)


@intrinsic
def _singles(typingctx, address):  # type: ignore[no-untyped-def]
    """Pointer to single precision from an address."""
    return _pointer_to(types.float32, address)


@intrinsic
def _integers(typingctx, address):  # type: ignore[no-untyped-def]
    """Pointer to integers from an address."""
    return _pointer_to(types.int64, address)


def _pointer_to(kind: Any, address: Any) -> tuple[Any, Any]:
    signature = types.CPointer(kind)(address)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))

    return signature, generate


@intrinsic
def widest_vectors(typingctx):  # type: ignore[no-untyped-def]
    """Let LLVM use the widest vectors the processor has in the function that calls this; by itself it takes half."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        # A string attribute of LLVM, which llvmlite's own list of attributes does not know.
        set.add(builder.function.attributes, '"prefer-vector-width"="512"')
        return context.get_dummy_value()

    return types.void(), generate


@njit(**OPTIONS)
def advance_double(address, actions, observation, rows):  # type: ignore[no-untyped-def]
    """Hold actions for an interval; returns what happened.

    Parameters
    ----------
    address : int
        Address of eight integers, which are address and length of four arrays: constants of the modes, the modes and
        scratch; the doubles (flapgym.plant.layout); the responses to the wind, in the precision of the modes; samples
        (n, k, SAMPLE), of length 0 if they are not wanted. Every array handed over as such would cost 40 ns.
    actions : (n blades,) float32 or float64
        Fractions of the acceleration limit; clipped to +-1.
    observation : (n observed,) float32
        Filled.
    rows : (n ROW,) float64
        Filled.

    Returns
    -------
    int, float, float, float
        As flapgym.plant.interface.Quick.
    """
    widest_vectors()
    handle = carray(_integers(address), (8,))
    real = carray(_doubles(handle[0]), (handle[1],))
    state = carray(_doubles(handle[2]), (handle[3],))
    pool = carray(_doubles(handle[4]), (handle[5],))
    samples = carray(_doubles(handle[6]), (handle[7],))
    seen = carray(_singles(observation.ctypes.data), (observation.size,))
    row = carray(_doubles(rows.ctypes.data), (rows.size,))
    status = _advance(actions, real, state, pool, samples, seen, row)
    return _told(status, row)


@njit(**OPTIONS)
def advance_single(address, actions, observation, rows):  # type: ignore[no-untyped-def]
    """The same with modes and responses in single precision."""
    widest_vectors()
    handle = carray(_integers(address), (8,))
    real = carray(_singles(handle[0]), (handle[1],))
    state = carray(_doubles(handle[2]), (handle[3],))
    pool = carray(_singles(handle[4]), (handle[5],))
    samples = carray(_doubles(handle[6]), (handle[7],))
    seen = carray(_singles(observation.ctypes.data), (observation.size,))
    row = carray(_doubles(rows.ctypes.data), (rows.size,))
    status = _advance(actions, real, state, pool, samples, seen, row)
    return _told(status, row)


@njit(**OPTIONS)
def _told(status, row):  # type: ignore[no-untyped-def]
    """What of the first row every step of an environment tells: an array's numbers are dear to ask for one by one."""
    if row.size < ROW:
        return status, 0.0, 0.0, 0.0
    return status, row[REWARD], row[WIND], row[AZIMUTH]


@njit(**OPTIONS)
def _advance(actions, real, state, pool, samples, observation, rows):  # type: ignore[no-untyped-def]
    widest_vectors()
    n, k, modes_count = int(state[COUNT]), int(state[STEPS]), int(state[MODES])
    groups = (modes_count + GROUP - 1) // GROUP
    if state[LAYOUT] != EDITION:
        return OUTDATED
    if actions.size != n * int(state[BLADE_COUNT]):
        return -1
    # Beyond the end of an array lies somebody else's memory.
    if observation.size != n * int(state[OBSERVED]) or rows.size != n * ROW:
        return -1
    if samples.size != 0 and samples.size != n * k * SAMPLE:
        return -1
    for i in range(actions.size):
        if not abs(actions[i]) < math.inf:
            return -2 - i
    every, displaced = state[EVERY] != 0.0, state[DISPLACED] != 0.0
    records = HEAD + ENTRY * int(state[OBSERVED])
    constants = real[: groups * GROUP_SIZE]
    status = 0
    if n < FEWEST_IN_BATCH:
        size = groups * ROW_PAIRS
        modes = real[groups * GROUP_SIZE : groups * GROUP_SIZE + n * size]
        scratch = real[groups * GROUP_SIZE + n * size :]
        sums = scratch[: 8 * k * GROUP]
        inputs = scratch[8 * k * GROUP : 8 * k * GROUP + (k + 1) * FLAP_INPUTS]
        outputs = scratch[8 * k * GROUP + (k + 1) * FLAP_INPUTS :]
        for t in range(n):
            own = state[records + t * OWN : records + (t + 1) * OWN]
            _move(t, actions, state, own, inputs, rows, samples)
            own_modes = modes[t * size : (t + 1) * size]
            _modes_of_one(k, every, displaced, modes_count, constants, own_modes, inputs, sums, outputs)
            status |= _read(t, state, own, inputs, outputs, pool, observation, rows, samples)
        return status
    size = groups * GROUP * PAIR
    blocks = (n + LANES - 1) // LANES
    modes = real[groups * GROUP_SIZE : groups * GROUP_SIZE + blocks * size]
    scratch = real[groups * GROUP_SIZE + blocks * size :]
    inputs = scratch[: (k + 1) * FLAP_INPUTS * LANES]
    outputs = scratch[(k + 1) * FLAP_INPUTS * LANES :]
    work = np.empty((WORK + 9 * k) * LANES)
    for block in range(blocks):
        first = block * LANES
        lanes = min(LANES, n - first)
        _move_block(first, lanes, actions, state, inputs, work, rows, samples)
        _modes_of_block(
            lanes, k, every, modes_count, constants, modes[block * size : (block + 1) * size], inputs, outputs
        )
        status |= _read_block(first, lanes, state, inputs, outputs, pool, work, observation, rows, samples)
    return status


@njit(**OPTIONS)
def _move(t, actions, state, own, inputs, rows, samples):  # type: ignore[no-untyped-def]
    """Flaps of turbine t over the interval, as components at samples 0 to k; the row's part that is the flaps'."""
    k, blades = int(state[STEPS]), int(state[BLADE_COUNT])
    dt, record = state[TIME_STEP], samples.size > 0
    top_angle, top_rate = state[ANGLE_LIMIT], state[RATE_LIMIT]
    decay, gain = state[LAG_DECAY], state[LAG_GAIN]
    angle_0, angle_c, angle_s = 0.0, 0.0, 0.0
    azimuth = own[OWN_AZIMUTH] + state[TURN] * k * own[OWN_ELAPSED]
    cosine, sine = math.cos(azimuth), math.sin(azimuth)
    row = rows[t * ROW : (t + 1) * ROW]
    row[COSINE], row[SINE] = cosine, sine
    square = 0.0
    for b in range(3):
        row[STOPPED + b] = 0.0
    for j in range(k + 1):
        if j:
            for b in range(blades):
                if state[STUCK + b] != 0.0:
                    continue
                command = min(max(float(actions[t * blades + b]), -1.0), 1.0) * state[ACCELERATION_LIMIT]
                behind = own[OWN_LAGGED + b] - command
                angle, rate = own[OWN_ANGLE + b], own[OWN_RATE + b]
                reached = rate + (command + behind * gain) * dt
                own[OWN_LAGGED + b] = command + behind * decay
                if reached > top_rate:
                    reached = top_rate
                    row[STOPPED + b] = 1.0
                elif reached < -top_rate:
                    reached = -top_rate
                    row[STOPPED + b] = 1.0
                moved = angle + 0.5 * dt * (rate + reached)
                if moved > top_angle:
                    moved, reached = top_angle, min(reached, 0.0)
                    row[STOPPED + b] = 1.0
                elif moved < -top_angle:
                    moved, reached = -top_angle, max(reached, 0.0)
                    row[STOPPED + b] = 1.0
                own[OWN_TRAVEL + b] += abs(moved - angle)
                own[OWN_ANGLE + b], own[OWN_RATE + b] = moved, reached
            cosine, sine = (
                cosine * state[COSINE_TURN] - sine * state[SINE_TURN],
                sine * state[COSINE_TURN] + cosine * state[SINE_TURN],
            )
            for b in range(3):
                square += own[OWN_ANGLE + b] ** 2
                if record:
                    sample = (t * k + j - 1) * SAMPLE + b
                    samples[sample + SAMPLE_ANGLE] = own[OWN_ANGLE + b]
                    samples[sample + SAMPLE_RATE] = own[OWN_RATE + b]
        for kind in range(2):
            first = state[EFFECTIVENESS] * own[3 * kind]
            second = state[EFFECTIVENESS + 1] * own[3 * kind + 1]
            third = state[EFFECTIVENESS + 2] * own[3 * kind + 2]
            if blades == 3:
                # cos(theta + 2 pi b / 3) summed with the flaps: what turns with blade 1, and across it.
                along = first + C1 * (second + third)
                across = S1 * (third - second)
                angle_0 = THIRD * (first + second + third)
                angle_c = 2.0 * THIRD * (cosine * along + sine * across)
                angle_s = 2.0 * THIRD * (sine * along - cosine * across)
            else:
                angle_0 = first
            place = FLAP_INPUTS * j + 3 * kind
            inputs[place], inputs[place + 1], inputs[place + 2] = angle_0, angle_c, angle_s
    for b in range(3):
        row[ANGLE + b], row[RATE + b] = own[OWN_ANGLE + b], own[OWN_RATE + b]
        row[TRAVEL + b] = own[OWN_TRAVEL + b]
    row[REWARD_ANGLE] = -state[WEIGHT_ANGLE] * square / (k * blades)


@njit(**OPTIONS)
def _modes_of_one(k, every, displaced, count, constants, modes, inputs, sums, outputs):  # type: ignore[no-untyped-def]
    """Modes of one turbine over the interval: outputs at samples 1 to k, without the feedthrough."""
    widest_vectors()
    sums[: k * 8 * GROUP] = 0.0
    for j in range(k):
        u = inputs[j * FLAP_INPUTS : (j + 1) * FLAP_INPUTS]
        u0, u1, u2, u3, u4, u5 = u[0], u[1], u[2], u[3], u[4], u[5]
        y = sums[j * 8 * GROUP : (j + 1) * 8 * GROUP]
        for g in range((count + GROUP - 1) // GROUP):
            c = constants[g * GROUP_SIZE : (g + 1) * GROUP_SIZE]
            z = modes[g * ROW_PAIRS : (g + 1) * ROW_PAIRS]
            for i in range(GROUP):
                re, im = z[i], z[i + GROUP]
                real = (
                    c[i] * re
                    - c[i + GROUP] * im
                    + c[i + DRIVE * GROUP] * u0
                    + c[i + (DRIVE + 1) * GROUP] * u1
                    + c[i + (DRIVE + 2) * GROUP] * u2
                    + c[i + (DRIVE + 3) * GROUP] * u3
                    + c[i + (DRIVE + 4) * GROUP] * u4
                    + c[i + (DRIVE + 5) * GROUP] * u5
                )
                imag = (
                    c[i + GROUP] * re
                    + c[i] * im
                    + c[i + (DRIVE + 6) * GROUP] * u0
                    + c[i + (DRIVE + 7) * GROUP] * u1
                    + c[i + (DRIVE + 8) * GROUP] * u2
                    + c[i + (DRIVE + 9) * GROUP] * u3
                    + c[i + (DRIVE + 10) * GROUP] * u4
                    + c[i + (DRIVE + 11) * GROUP] * u5
                )
                z[i], z[i + GROUP] = real, imag
                y[i] += c[i + READ * GROUP] * real + c[i + (READ + 1) * GROUP] * imag
                y[i + GROUP] += c[i + (READ + 2) * GROUP] * real + c[i + (READ + 3) * GROUP] * imag
                y[i + 2 * GROUP] += c[i + (READ + 4) * GROUP] * real + c[i + (READ + 5) * GROUP] * imag
            if every or (displaced and j == k - 1):
                for i in range(GROUP):
                    real, imag = z[i], z[i + GROUP]
                    for o in range(5):
                        y[i + (3 + o) * GROUP] += (
                            c[i + (READ_LAST + 2 * o) * GROUP] * real
                            + c[i + (READ_LAST + 2 * o + 1) * GROUP] * imag
                        )
    for j in range(k):
        for o in range(8 if every or (displaced and j == k - 1) else 3):
            y = sums[(8 * j + o) * GROUP : (8 * j + o + 1) * GROUP]
            total = y[0]
            for i in range(1, GROUP):
                total += y[i]
            outputs[8 * j + o] = total


@njit(**OPTIONS)
def _modes_of_block(lanes, k, every, count, constants, modes, inputs, outputs):  # type: ignore[no-untyped-def]
    """The same for up to LANES turbines side by side, two modes at a time."""
    widest_vectors()
    outputs[: 8 * k * LANES] = 0.0
    for pair in range(count // 2):
        c = constants[(pair // (GROUP // 2)) * GROUP_SIZE + 2 * (pair % (GROUP // 2)) :]
        l0, l1 = c[0], c[GROUP]
        a0, a1, a2 = c[DRIVE * GROUP], c[(DRIVE + 1) * GROUP], c[(DRIVE + 2) * GROUP]
        a3, a4, a5 = c[(DRIVE + 3) * GROUP], c[(DRIVE + 4) * GROUP], c[(DRIVE + 5) * GROUP]
        b0, b1, b2 = c[(DRIVE + 6) * GROUP], c[(DRIVE + 7) * GROUP], c[(DRIVE + 8) * GROUP]
        b3, b4, b5 = c[(DRIVE + 9) * GROUP], c[(DRIVE + 10) * GROUP], c[(DRIVE + 11) * GROUP]
        r0, r1, r2 = c[READ * GROUP], c[(READ + 1) * GROUP], c[(READ + 2) * GROUP]
        r3, r4, r5 = c[(READ + 3) * GROUP], c[(READ + 4) * GROUP], c[(READ + 5) * GROUP]
        d = c[1:]
        m0, m1 = d[0], d[GROUP]
        e0, e1, e2 = d[DRIVE * GROUP], d[(DRIVE + 1) * GROUP], d[(DRIVE + 2) * GROUP]
        e3, e4, e5 = d[(DRIVE + 3) * GROUP], d[(DRIVE + 4) * GROUP], d[(DRIVE + 5) * GROUP]
        f0, f1, f2 = d[(DRIVE + 6) * GROUP], d[(DRIVE + 7) * GROUP], d[(DRIVE + 8) * GROUP]
        f3, f4, f5 = d[(DRIVE + 9) * GROUP], d[(DRIVE + 10) * GROUP], d[(DRIVE + 11) * GROUP]
        s0, s1, s2 = d[READ * GROUP], d[(READ + 1) * GROUP], d[(READ + 2) * GROUP]
        s3, s4, s5 = d[(READ + 3) * GROUP], d[(READ + 4) * GROUP], d[(READ + 5) * GROUP]
        z = modes[2 * pair * PAIR : 2 * (pair + 1) * PAIR]
        for j in range(k):
            u = inputs[j * FLAP_INPUTS * LANES : (j + 1) * FLAP_INPUTS * LANES]
            y = outputs[8 * j * LANES : 8 * (j + 1) * LANES]
            for t in range(lanes):
                u0, u1, u2 = u[t], u[t + LANES], u[t + 2 * LANES]
                u3, u4, u5 = u[t + 3 * LANES], u[t + 4 * LANES], u[t + 5 * LANES]
                re, im, sr, si = z[t], z[t + LANES], z[t + 2 * LANES], z[t + 3 * LANES]
                real = l0 * re - l1 * im + a0 * u0 + a1 * u1 + a2 * u2 + a3 * u3 + a4 * u4 + a5 * u5
                imag = l1 * re + l0 * im + b0 * u0 + b1 * u1 + b2 * u2 + b3 * u3 + b4 * u4 + b5 * u5
                next_real = m0 * sr - m1 * si + e0 * u0 + e1 * u1 + e2 * u2 + e3 * u3 + e4 * u4 + e5 * u5
                next_imag = m1 * sr + m0 * si + f0 * u0 + f1 * u1 + f2 * u2 + f3 * u3 + f4 * u4 + f5 * u5
                z[t], z[t + LANES], z[t + 2 * LANES], z[t + 3 * LANES] = real, imag, next_real, next_imag
                y[t] += r0 * real + r1 * imag + s0 * next_real + s1 * next_imag
                y[t + LANES] += r2 * real + r3 * imag + s2 * next_real + s3 * next_imag
                y[t + 2 * LANES] += r4 * real + r5 * imag + s4 * next_real + s5 * next_imag
            if every or j == k - 1:
                for o in range(5):
                    g0, g1 = c[(READ_LAST + 2 * o) * GROUP], c[(READ_LAST + 2 * o + 1) * GROUP]
                    h0, h1 = d[(READ_LAST + 2 * o) * GROUP], d[(READ_LAST + 2 * o + 1) * GROUP]
                    last = y[(3 + o) * LANES : (4 + o) * LANES]
                    for t in range(lanes):
                        last[t] += (
                            g0 * z[t] + g1 * z[t + LANES] + h0 * z[t + 2 * LANES] + h1 * z[t + 3 * LANES]
                        )


@njit(**OPTIONS)
def _read(t, state, own, inputs, outputs, pool, observation, rows, samples):  # type: ignore[no-untyped-def]
    """Loads, reward and observation of turbine t; its clock goes on."""
    k, blades = int(state[STEPS]), int(state[BLADE_COUNT])
    every, displaced, record = state[EVERY] != 0.0, state[DISPLACED] != 0.0, samples.size > 0
    level, elapsed = own[OWN_LEVEL], int(own[OWN_ELAPSED])
    direct = state[DIRECT : DIRECT + 8 * FLAP_INPUTS]
    width = 9 * k if every else 3 * k + 6
    interval = int(own[OWN_RESPONSE]) * int(state[INTERVALS]) + min(elapsed, int(state[INTERVALS]) - 1)
    wind = pool[interval * width : (interval + 1) * width]
    row = rows[t * ROW : (t + 1) * ROW]
    cosine, sine = row[COSINE], row[SINE]
    for b in range(3):
        row[MEAN_SQUARE + b] = 0.0
    if not displaced:
        for column in range(3):
            row[TIP + column] = math.nan
        row[TOWER], row[TOWER + 1] = math.nan, math.nan
    fore_aft = 0.0
    y0, y1, y2 = 0.0, 0.0, 0.0
    for j in range(1, k + 1):
        cosine, sine = (
            cosine * state[COSINE_TURN] - sine * state[SINE_TURN],
            sine * state[COSINE_TURN] + cosine * state[SINE_TURN],
        )
        last = every or (displaced and j == k)
        for quantity in range(2 if last else 1):
            start = 3 * (j - 1) if quantity == 0 else 3 * k + (3 * (j - 1) if every else 0)
            for c in range(3):
                value = float(outputs[8 * (j - 1) + 3 * quantity + c])
                for i in range(FLAP_INPUTS):
                    value += direct[(3 * quantity + c) * FLAP_INPUTS + i] * inputs[j * FLAP_INPUTS + i]
                value += level * wind[start + c]
                if c == 0:
                    y0 = value
                elif c == 1:
                    y1 = value
                else:
                    y2 = value
            base = RBM if quantity == 0 else TIP
            if blades == 3:
                along, across = y1 * cosine + y2 * sine, y2 * cosine - y1 * sine
                row[base] = y0 + along
                row[base + 1] = y0 + C1 * along + S1 * across
                row[base + 2] = y0 + C1 * along - S1 * across
            else:
                row[base], row[base + 1], row[base + 2] = y0, 0.0, 0.0
        for b in range(3):
            row[MEAN_SQUARE + b] += row[RBM + b] ** 2
        if last:
            start = 6 * k + 3 * (j - 1) if every else 3 * k + 3
            for c in range(2):
                value = float(outputs[8 * (j - 1) + 6 + c])
                for i in range(FLAP_INPUTS):
                    value += direct[(6 + c) * FLAP_INPUTS + i] * inputs[j * FLAP_INPUTS + i]
                row[TOWER + c] = value + level * wind[start + c]
            fore_aft += row[TOWER] ** 2
        if every or j == k:
            row[WIND] = level * wind[(6 * k + 3 * (j - 1) if every else 3 * k + 3) + 2]
        if record:
            sample = samples[(t * k + j - 1) * SAMPLE : (t * k + j) * SAMPLE]
            for b in range(3):
                sample[SAMPLE_RBM + b], sample[SAMPLE_TIP + b] = row[RBM + b], row[TIP + b]
            sample[SAMPLE_TOWER], sample[SAMPLE_TOWER + 1] = row[TOWER], row[TOWER + 1]
            sample[SAMPLE_WIND] = row[WIND]
    row[COSINE], row[SINE] = cosine, sine
    return _close(t, fore_aft, state, own, observation, row)


@njit(**OPTIONS)
def _close(t, fore_aft, state, own, observation, row):  # type: ignore[no-untyped-def]
    """Reward, clock and observation of turbine t, whose row holds sums of squares; returns its status."""
    k, blades, elapsed = int(state[STEPS]), int(state[BLADE_COUNT]), int(own[OWN_ELAPSED])
    total = 0.0
    for b in range(3):
        row[MEAN_SQUARE + b] /= k
        total += row[MEAN_SQUARE + b]
    row[REWARD_RBM] = -state[WEIGHT_RBM] * total / blades
    row[REWARD_TOWER] = -state[WEIGHT_TOWER] * fore_aft / k
    row[REWARD] = row[REWARD_RBM] + row[REWARD_ANGLE] + row[REWARD_TOWER]
    own[OWN_ELAPSED] += 1.0
    turn = 2.0 * math.pi
    azimuth = own[OWN_AZIMUTH] + state[TURN] * k * own[OWN_ELAPSED]
    row[AZIMUTH] = min(max(azimuth - turn * math.floor(azimuth / turn), 0.0), turn)
    _observe(t, elapsed + 1, state, row, observation)
    status = 0 if abs(row[REWARD]) < math.inf else 1
    return status | (2 if elapsed + 1 >= state[INTERVALS] else 0)


@njit(**OPTIONS)
def _move_block(first, lanes, actions, state, inputs, work, rows, samples):  # type: ignore[no-untyped-def]
    """`_move` for up to LANES turbines side by side."""
    widest_vectors()
    k, blades = int(state[STEPS]), int(state[BLADE_COUNT])
    dt, record = state[TIME_STEP], samples.size > 0
    top_angle, top_rate, top_acceleration = state[ANGLE_LIMIT], state[RATE_LIMIT], state[ACCELERATION_LIMIT]
    decay, gain = state[LAG_DECAY], state[LAG_GAIN]
    cosine_turn, sine_turn = state[COSINE_TURN], state[SINE_TURN]
    effect_1, effect_2, effect_3 = state[EFFECTIVENESS], state[EFFECTIVENESS + 1], state[EFFECTIVENESS + 2]
    records = HEAD + ENTRY * int(state[OBSERVED]) + first * OWN
    cosine, sine = work[COSINES * LANES : (COSINES + 1) * LANES], work[SINES * LANES : (SINES + 1) * LANES]
    square = work[SQUARES * LANES : (SQUARES + 1) * LANES]
    for lane in range(lanes):
        own = state[records + lane * OWN : records + (lane + 1) * OWN]
        azimuth = own[OWN_AZIMUTH] + state[TURN] * k * own[OWN_ELAPSED]
        cosine[lane], sine[lane] = math.cos(azimuth), math.sin(azimuth)
        square[lane] = 0.0
        row = rows[(first + lane) * ROW : (first + lane + 1) * ROW]
        row[COSINE], row[SINE] = cosine[lane], sine[lane]
        for i in range(12):
            work[i * LANES + lane] = own[i]
        for b in range(3):
            work[(STOPS + b) * LANES + lane] = 0.0
        for b in range(blades):
            command = min(max(float(actions[(first + lane) * blades + b]), -1.0), 1.0)
            work[(COMMANDS + b) * LANES + lane] = command * top_acceleration
    for j in range(k + 1):
        if j:
            for b in range(blades):
                if state[STUCK + b] != 0.0:
                    continue
                own = work[b * LANES : (b + STOPS + 1) * LANES]
                for t in range(lanes):
                    angle, rate = own[t + OWN_ANGLE * LANES], own[t + OWN_RATE * LANES]
                    command = own[t + COMMANDS * LANES]
                    behind = own[t + OWN_LAGGED * LANES] - command
                    wanted = rate + (command + behind * gain) * dt
                    reached = min(max(wanted, -top_rate), top_rate)
                    going = angle + 0.5 * dt * (rate + reached)
                    moved = min(max(going, -top_angle), top_angle)
                    stopped = 1.0 if (wanted != reached) | (going != moved) else 0.0
                    lowest = 0.0 if going < -top_angle else -top_rate
                    highest = 0.0 if going > top_angle else top_rate
                    own[t + STOPS * LANES] = max(own[t + STOPS * LANES], stopped)
                    own[t + OWN_LAGGED * LANES] = command + behind * decay
                    own[t + OWN_TRAVEL * LANES] += abs(moved - angle)
                    own[t + OWN_ANGLE * LANES] = moved
                    own[t + OWN_RATE * LANES] = min(max(reached, lowest), highest)
            for t in range(lanes):
                turned = cosine[t] * cosine_turn - sine[t] * sine_turn
                sine[t] = sine[t] * cosine_turn + cosine[t] * sine_turn
                cosine[t] = turned
            for b in range(3):
                angle = work[(OWN_ANGLE + b) * LANES : (OWN_ANGLE + b + 1) * LANES]
                for t in range(lanes):
                    square[t] += angle[t] ** 2
            if record:
                for lane in range(lanes):
                    sample = ((first + lane) * k + j - 1) * SAMPLE
                    for b in range(3):
                        samples[sample + SAMPLE_ANGLE + b] = work[(OWN_ANGLE + b) * LANES + lane]
                        samples[sample + SAMPLE_RATE + b] = work[(OWN_RATE + b) * LANES + lane]
        for kind in range(2):
            motion = work[3 * kind * LANES : 3 * (kind + 1) * LANES]
            u = inputs[(FLAP_INPUTS * j + 3 * kind) * LANES : (FLAP_INPUTS * j + 3 * kind + 3) * LANES]
            if blades == 3:
                for t in range(lanes):
                    one, two, three = (
                        effect_1 * motion[t],
                        effect_2 * motion[t + LANES],
                        effect_3 * motion[t + 2 * LANES],
                    )
                    along = one + C1 * (two + three)
                    across = S1 * (three - two)
                    u[t] = THIRD * (one + two + three)
                    u[t + LANES] = 2.0 * THIRD * (cosine[t] * along + sine[t] * across)
                    u[t + 2 * LANES] = 2.0 * THIRD * (sine[t] * along - cosine[t] * across)
            else:
                for t in range(lanes):
                    u[t], u[t + LANES], u[t + 2 * LANES] = effect_1 * motion[t], 0.0, 0.0
    for lane in range(lanes):
        own = state[records + lane * OWN : records + (lane + 1) * OWN]
        row = rows[(first + lane) * ROW : (first + lane + 1) * ROW]
        for i in range(12):
            own[i] = work[i * LANES + lane]
        for b in range(3):
            row[ANGLE + b], row[RATE + b] = own[OWN_ANGLE + b], own[OWN_RATE + b]
            row[TRAVEL + b], row[STOPPED + b] = own[OWN_TRAVEL + b], work[(STOPS + b) * LANES + lane]
        row[REWARD_ANGLE] = -state[WEIGHT_ANGLE] * square[lane] / (k * blades)


@njit(**OPTIONS)
def _read_block(first, lanes, state, inputs, outputs, pool, work, observation, rows, samples):  # type: ignore[no-untyped-def]
    """`_read` for up to LANES turbines side by side, with tip deflection and tower always."""
    widest_vectors()
    k, blades = int(state[STEPS]), int(state[BLADE_COUNT])
    every, record = state[EVERY] != 0.0, samples.size > 0
    cosine_turn, sine_turn = state[COSINE_TURN], state[SINE_TURN]
    intervals = int(state[INTERVALS])
    records = HEAD + ENTRY * int(state[OBSERVED]) + first * OWN
    width = 9 * k if every else 3 * k + 6
    cosine, sine = work[COSINES * LANES : (COSINES + 1) * LANES], work[SINES * LANES : (SINES + 1) * LANES]
    fore_aft = work[SQUARES * LANES : (SQUARES + 1) * LANES]
    square = work[SUMS * LANES : (SUMS + 3) * LANES]
    winds = work[WORK * LANES :]
    for lane in range(lanes):
        own = state[records + lane * OWN : records + (lane + 1) * OWN]
        interval = int(own[OWN_RESPONSE]) * intervals + min(int(own[OWN_ELAPSED]), intervals - 1)
        wind = pool[interval * width : (interval + 1) * width]
        level = own[OWN_LEVEL]
        for i in range(width):
            winds[i * LANES + lane] = level * wind[i]
        row = rows[(first + lane) * ROW : (first + lane + 1) * ROW]
        cosine[lane], sine[lane], fore_aft[lane] = row[COSINE], row[SINE], 0.0
        for b in range(3):
            square[b * LANES + lane] = 0.0
    for j in range(1, k + 1):
        for t in range(lanes):
            turned = cosine[t] * cosine_turn - sine[t] * sine_turn
            sine[t] = sine[t] * cosine_turn + cosine[t] * sine_turn
            cosine[t] = turned
        last = every or j == k
        u = inputs[j * FLAP_INPUTS * LANES : (j + 1) * FLAP_INPUTS * LANES]
        for o in range(8 if last else 3):
            # Moments, tips, tower; the rows of the wind's response follow the same order.
            start = 3 * (j - 1) + o
            if o >= 3:
                start = (3 * k if o < 6 else 6 * k) + 3 * (j - 1) + o % 3 if every else 3 * k + o - 3
            d = state[DIRECT + o * FLAP_INPUTS : DIRECT + (o + 1) * FLAP_INPUTS]
            d0, d1, d2, d3, d4, d5 = d[0], d[1], d[2], d[3], d[4], d[5]
            y = outputs[(8 * (j - 1) + o) * LANES : (8 * (j - 1) + o + 1) * LANES]
            w = winds[start * LANES : (start + 1) * LANES]
            value = work[(VALUES + o) * LANES : (VALUES + o + 1) * LANES]
            for t in range(lanes):
                value[t] = (
                    y[t]
                    + w[t]
                    + d0 * u[t]
                    + d1 * u[t + LANES]
                    + d2 * u[t + 2 * LANES]
                    + d3 * u[t + 3 * LANES]
                    + d4 * u[t + 4 * LANES]
                    + d5 * u[t + 5 * LANES]
                )
        if blades == 3:
            for quantity in range(2 if last else 1):
                value = work[(VALUES + 3 * quantity) * LANES : (VALUES + 3 * quantity + 3) * LANES]
                for t in range(lanes):
                    mean = value[t]
                    along = value[t + LANES] * cosine[t] + value[t + 2 * LANES] * sine[t]
                    across = value[t + 2 * LANES] * cosine[t] - value[t + LANES] * sine[t]
                    value[t] = mean + along
                    value[t + LANES] = mean + C1 * along + S1 * across
                    value[t + 2 * LANES] = mean + C1 * along - S1 * across
        else:
            work[(VALUES + 1) * LANES : (VALUES + 3) * LANES] = 0.0
            work[(VALUES + 4) * LANES : (VALUES + 6) * LANES] = 0.0
        moment = work[VALUES * LANES : (VALUES + 3) * LANES]
        for b in range(3):
            for t in range(b * LANES, b * LANES + lanes):
                square[t] += moment[t] ** 2
        if last:
            tower = work[(VALUES + 6) * LANES : (VALUES + 7) * LANES]
            for t in range(lanes):
                fore_aft[t] += tower[t] ** 2
        if record:
            place = (6 * k + 3 * (j - 1) + 2) * LANES
            for lane in range(lanes):
                sample = samples[((first + lane) * k + j - 1) * SAMPLE : ((first + lane) * k + j) * SAMPLE]
                for o in range(8):
                    sample[o] = work[(VALUES + o) * LANES + lane]
                sample[SAMPLE_WIND] = winds[place + lane]
    place = (9 * k - 1 if every else 3 * k + 5) * LANES
    status = 0
    for lane in range(lanes):
        t = first + lane
        own = state[records + lane * OWN : records + (lane + 1) * OWN]
        row = rows[t * ROW : (t + 1) * ROW]
        for b in range(6):
            row[b] = work[(VALUES + b) * LANES + lane]
        for c in range(2):
            row[TOWER + c] = work[(VALUES + 6 + c) * LANES + lane]
        for b in range(3):
            row[MEAN_SQUARE + b] = square[b * LANES + lane]
        row[WIND] = winds[place + lane]
        row[COSINE], row[SINE] = cosine[lane], sine[lane]
        status |= _close(t, fore_aft[lane], state, own, observation, row)
    return status


@njit(**OPTIONS)
def _observe(t, sample, state, row, observation):  # type: ignore[no-untyped-def]
    """The observation of a row, rounded before it is bounded: a stop rounded up would leave the space."""
    observed = int(state[OBSERVED])
    noise = HEAD + ENTRY * observed + OWN * int(state[COUNT])
    noise += 3 * (t * (int(state[INTERVALS]) + 1) + sample)
    for i in range(observed):
        entry = state[HEAD + ENTRY * i : HEAD + ENTRY * (i + 1)]
        value = row[int(entry[0])]
        if state[NOISY] != 0.0 and entry[3] >= 0.0:
            value += state[noise + int(entry[3])]
        bound = np.float32(entry[2])
        observation[t * observed + i] = min(max(np.float32(value * entry[1]), -bound), bound)
