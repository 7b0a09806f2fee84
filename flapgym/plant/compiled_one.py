"""The compiled step of one turbine, its modes side by side; flapgym.plant.compiled_batch does the same for many.

Between two stops flaps move under held accelerations (flapgym.plant.held): nine numbers tell what they do over an
interval. Where a flap meets a stop its motion is another, and what the deviations do is added.
"""

from __future__ import annotations

import math

from numba import njit

from flapgym.core.arrays import BLADES
from flapgym.plant.compiled_loops import C1, OPTIONS, S1, THIRD, close, widest_vectors
from flapgym.plant.compiled_modes import add_columns, add_deviations, decay_and_read, decay_push_and_read
from flapgym.plant.layout import (
    ACCELERATION_LIMIT,
    ANGLE,
    ANGLE_LIMIT,
    BLADE_COUNT,
    COSINE,
    COSINE_TURN,
    COUNT,
    DISPLACED,
    EFFECTIVENESS,
    ENTRY,
    EVERY,
    FLAP_INPUTS,
    FREE,
    HEAD,
    INTERVALS,
    LAG_DECAY,
    LAG_GAIN,
    LANES,
    MEAN_SQUARE,
    MODES,
    OBSERVED,
    OTHERS,
    OWN,
    OWN_ANGLE,
    OWN_AZIMUTH,
    OWN_ELAPSED,
    OWN_LAGGED,
    OWN_LEVEL,
    OWN_RATE,
    OWN_RESPONSE,
    OWN_TRAVEL,
    PUSH_ROWS,
    RATE,
    RATE_LIMIT,
    RBM,
    READ_ROWS,
    REWARD_ANGLE,
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
    STEP_INPUTS,
    STEP_ROWS,
    STEPS,
    STOPPED,
    STUCK,
    TIME_STEP,
    TIP,
    TOUCH,
    TOWER,
    TRAVEL,
    TURN,
    WEIGHT_ANGLE,
    WIND,
    WORK,
)


@njit(**OPTIONS)
def begin(width, state, own, pool, outputs):  # type: ignore[no-untyped-def]
    """Outputs under the wind alone. First of all, because the pool is far away: the flaps move while it is fetched."""
    intervals = int(state[INTERVALS])
    interval = int(own[OWN_RESPONSE]) * intervals + min(int(own[OWN_ELAPSED]), intervals - 1)
    wind = pool[interval * width : (interval + 1) * width]
    level = own[OWN_LEVEL]
    for i in range(width):
        outputs[i] = level * wind[i]


@njit(**OPTIONS)
def move(t, actions, state, own, inputs, rows, samples):  # type: ignore[no-untyped-def]
    """Flaps of turbine t over the interval; the row's part that is the flaps'.

    Fills the inputs: what decides the flaps' motion under held accelerations and, from the first step in which their
    motion is another, its deviations. Returns that step, counted from 1, or k + 1 if there is none.
    """
    k, blades = int(state[STEPS]), int(state[BLADE_COUNT])
    dt, record = state[TIME_STEP], samples.size > 0
    top_angle, top_rate = state[ANGLE_LIMIT], state[RATE_LIMIT]
    decay, gain, inner = state[LAG_DECAY], state[LAG_GAIN], top_angle * (1.0 - TOUCH)
    cosine_turn, sine_turn = state[COSINE_TURN], state[SINE_TURN]
    azimuth = own[OWN_AZIMUTH] + state[TURN] * k * own[OWN_ELAPSED]
    cosine, sine = math.cos(azimuth), math.sin(azimuth)
    row = rows[t * ROW : (t + 1) * ROW]
    state[WORK + 3], state[WORK + 4] = cosine, sine
    for b in range(BLADES):
        row[STOPPED + b], row[ANGLE + b], row[RATE + b] = 0.0, 0.0, 0.0
        state[WORK + b] = 0.0
        if b < blades and state[STUCK + b] == 0.0:
            state[WORK + b] = min(max(float(actions[t * blades + b]), -1.0), 1.0) * state[ACCELERATION_LIMIT]
    for kind in range(3):
        one, two, three = own[3 * kind], own[3 * kind + 1], own[3 * kind + 2]
        if kind == 2:
            one, two, three = state[WORK], state[WORK + 1], state[WORK + 2]
        inputs[3 * kind], inputs[3 * kind + 1], inputs[3 * kind + 2] = components(
            one, two, three, cosine, sine, state
        )
    # A lagging acceleration is no held one.
    first, square = 1 if gain != 0.0 else k + 1, 0.0
    for j in range(1, k + 1):
        for b in range(blades):
            if state[STUCK + b] != 0.0:
                continue
            command = state[WORK + b]
            behind = own[OWN_LAGGED + b] - command
            angle, rate = own[OWN_ANGLE + b], own[OWN_RATE + b]
            wanted = rate + (command + behind * gain) * dt
            own[OWN_LAGGED + b] = command + behind * decay
            reached = min(max(wanted, -top_rate), top_rate)
            going = angle + 0.5 * dt * (rate + reached)
            moved = min(max(going, -top_angle), top_angle)
            into_stop = (abs(going) > inner) & (going * reached > 0.0)
            if (wanted != reached) | (going != moved) | into_stop:
                row[STOPPED + b] = 1.0
                first = min(first, j)
                if into_stop:
                    moved, reached = math.copysign(top_angle, going), 0.0
            own[OWN_TRAVEL + b] += abs(moved - angle)
            own[OWN_ANGLE + b], own[OWN_RATE + b] = moved, reached
            # By what acceleration and angle differ from those of the held acceleration.
            row[ANGLE + b] = (reached - rate) / dt - command
            row[RATE + b] = moved - (angle + 0.5 * dt * (rate + reached))
        cosine, sine = cosine * cosine_turn - sine * sine_turn, sine * cosine_turn + cosine * sine_turn
        for b in range(BLADES):
            square += own[OWN_ANGLE + b] ** 2
        if record:
            for b in range(BLADES):
                sample = (t * k + j - 1) * SAMPLE + b
                samples[sample + SAMPLE_ANGLE] = own[OWN_ANGLE + b]
                samples[sample + SAMPLE_RATE] = own[OWN_RATE + b]
        if j >= first:
            for kind in range(2):
                place = FREE + STEP_INPUTS * (j - 1) + 3 * kind
                off = row[ANGLE + 3 * kind : ANGLE + 3 * kind + 3]
                inputs[place], inputs[place + 1], inputs[place + 2] = components(
                    off[0], off[1], off[2], cosine, sine, state
                )
    if first <= k:
        for i in range(FREE, FREE + STEP_INPUTS * (first - 1)):
            inputs[i] = 0.0
    row[COSINE], row[SINE] = cosine, sine
    for b in range(BLADES):
        row[ANGLE + b], row[RATE + b] = own[OWN_ANGLE + b], own[OWN_RATE + b]
        row[TRAVEL + b] = own[OWN_TRAVEL + b]
    row[REWARD_ANGLE] = -state[WEIGHT_ANGLE] * square / (k * blades)
    return first


@njit(**OPTIONS)
def components(one, two, three, cosine, sine, state):  # type: ignore[no-untyped-def]
    """Multi-blade components of what the flaps do, by their effectiveness; a single blade is the mean."""
    one *= state[EFFECTIVENESS]
    if state[BLADE_COUNT] != BLADES:
        return one, 0.0, 0.0
    two *= state[EFFECTIVENESS + 1]
    three *= state[EFFECTIVENESS + 2]
    # cos(theta + 2 pi b / 3) summed with the flaps: what turns with blade 1, and across it.
    along, across = one + C1 * (two + three), S1 * (three - two)
    mean, most = THIRD * (one + two + three), 2.0 * THIRD
    return mean, most * (cosine * along + sine * across), most * (sine * along - cosine * across)


@njit(**OPTIONS)
def add_products(rows, width, stride, matrix, vector, outputs):  # type: ignore[no-untyped-def]
    """Add the first `width` columns of a matrix times a vector; three rows at a time share what is read of it."""
    widest_vectors()
    for triple in range(rows // 3):
        one = matrix[3 * triple * stride : 3 * triple * stride + width]
        two = matrix[(3 * triple + 1) * stride : (3 * triple + 1) * stride + width]
        three = matrix[(3 * triple + 2) * stride : (3 * triple + 2) * stride + width]
        first, second, third = outputs[3 * triple], outputs[3 * triple + 1], outputs[3 * triple + 2]
        for i in range(width):
            first += one[i] * vector[i]
            second += two[i] * vector[i]
            third += three[i] * vector[i]
        outputs[3 * triple], outputs[3 * triple + 1], outputs[3 * triple + 2] = first, second, third


@njit(**OPTIONS)
def advance(groups, state, reading, others, push, inputs, modes, outputs):  # type: ignore[no-untyped-def]
    """Modes of one turbine over an interval under held accelerations, and what they add to its outputs.

    The accelerations reach the modes with the last sample, whose outputs are read behind it.
    """
    widest_vectors()
    k, every, displaced = int(state[STEPS]), state[EVERY] != 0.0, state[DISPLACED] != 0.0
    cosine_turn, sine_turn = state[COSINE_TURN], state[SINE_TURN]
    cosine, sine, size = 1.0, 0.0, 2 * groups * LANES
    for j in range(k):
        if j < k - 1:
            mean, along, across = decay_and_read(reading, modes, groups)
        else:
            one, two, three = inputs[FLAP_INPUTS], inputs[FLAP_INPUTS + 1], inputs[FLAP_INPUTS + 2]
            mean, along, across = decay_push_and_read(reading, modes, groups, push, one, two, three)
        cosine, sine = cosine * cosine_turn - sine * sine_turn, sine * cosine_turn + cosine * sine_turn
        # Back into the frame of the interval's start.
        outputs[3 * j] += mean
        outputs[3 * j + 1] += cosine * along + sine * across
        outputs[3 * j + 2] += cosine * across - sine * along
        if every or (displaced and j == k - 1):
            tip, flat = (3 * (k + j), 3 * (2 * k + j)) if every else (3 * k, 3 * k + 3)
            along, across = outputs[tip + 1], outputs[tip + 2]
            outputs[tip + 1], outputs[tip + 2] = 0.0, 0.0
            add_products(3, size, size, others, modes, outputs[tip : tip + 3])
            add_products(3, size, size, others[3 * size :], modes, outputs[flat : flat + 3])
            along += cosine * outputs[tip + 1] + sine * outputs[tip + 2]
            outputs[tip + 2] = across + cosine * outputs[tip + 2] - sine * outputs[tip + 1]
            outputs[tip + 1] = along


@njit(**OPTIONS)
def read(t, state, own, outputs, observation, rows, samples):  # type: ignore[no-untyped-def]
    """Loads, reward and observation of turbine t; its clock goes on."""
    k, blades = int(state[STEPS]), int(state[BLADE_COUNT])
    every, displaced, record = state[EVERY] != 0.0, state[DISPLACED] != 0.0, samples.size > 0
    kept = k if every else 1
    tips, flat = 3 * k, 3 * (k + kept)
    cosine, sine = state[WORK + 3], state[WORK + 4]
    row = rows[t * ROW : (t + 1) * ROW]
    for b in range(3):
        row[MEAN_SQUARE + b] = 0.0
    for j in range(k):
        _to_blades(outputs[3 * j : 3 * j + 3], cosine, sine, blades, row[RBM : RBM + 3])
        for b in range(3):
            row[MEAN_SQUARE + b] += row[RBM + b] ** 2
        if record:
            for b in range(3):
                samples[(t * k + j) * SAMPLE + SAMPLE_RBM + b] = row[RBM + b]
    fore_aft = 0.0
    for j in range(kept):
        if displaced:
            _to_blades(outputs[tips + 3 * j : tips + 3 * j + 3], cosine, sine, blades, row[TIP : TIP + 3])
            row[TOWER], row[TOWER + 1] = outputs[flat + 3 * j], outputs[flat + 3 * j + 1]
        else:
            for b in range(3):
                row[TIP + b] = math.nan
            row[TOWER], row[TOWER + 1] = math.nan, math.nan
        fore_aft += row[TOWER] ** 2
        row[WIND] = outputs[flat + 3 * j + 2]
        if record:
            sample = samples[(t * k + j) * SAMPLE : (t * k + j + 1) * SAMPLE]
            for b in range(3):
                sample[SAMPLE_TIP + b] = row[TIP + b]
            sample[SAMPLE_TOWER], sample[SAMPLE_TOWER + 1] = row[TOWER], row[TOWER + 1]
            sample[SAMPLE_WIND] = row[WIND]
    return close(t, fore_aft if displaced else 0.0, state, own, observation, row)


@njit(**OPTIONS)
def _to_blades(components, cosine, sine, blades, values):  # type: ignore[no-untyped-def]
    """Loads of the blades from multi-blade components."""
    mean = float(components[0])
    if blades != 3:
        values[0], values[1], values[2] = mean, 0.0, 0.0
        return
    along = components[1] * cosine + components[2] * sine
    across = components[2] * cosine - components[1] * sine
    values[0] = mean + along
    values[1] = mean + C1 * along + S1 * across
    values[2] = mean + C1 * along - S1 * across


@njit(**OPTIONS)
def step_singly(actions, real, state, pool, samples, observation, rows):  # type: ignore[no-untyped-def]
    """Hold actions for an interval, one turbine after another; their status (flapgym.plant.interface.Plant.step)."""
    n, k, count = int(state[COUNT]), int(state[STEPS]), int(state[MODES])
    groups = (count + LANES - 1) // LANES
    size, room = 2 * groups * LANES, groups * LANES
    rows_wanted = 9 * k if state[EVERY] != 0.0 else 3 * k + 6
    records = HEAD + ENTRY * int(state[OBSERVED])
    # What the flaps do: what decides their motion, and deviations from it. Its way to the outputs, column by column.
    given, column = FREE + STEP_INPUTS * k, (rows_wanted + LANES - 1) // LANES * LANES
    width = (given + LANES - 1) // LANES * LANES
    needed = (column if state[DISPLACED] != 0.0 else 3 * k + LANES - 1) // LANES
    stepping, rest = real[: room * STEP_ROWS], real[room * STEP_ROWS :]
    push, rest = rest[: room * PUSH_ROWS], rest[room * PUSH_ROWS :]
    reading, rest = rest[: room * READ_ROWS], rest[room * READ_ROWS :]
    others, rest = rest[: OTHERS * size], rest[OTHERS * size :]
    feed, rest = rest[: given * column], rest[given * column :]
    modes, rest = rest[: n * size], rest[n * size :]
    inputs, outputs = rest[:width], rest[width : width + column]
    status = 0
    for t in range(n):
        own = state[records + t * OWN : records + (t + 1) * OWN]
        own_modes = modes[t * size : (t + 1) * size]
        begin(rows_wanted, state, own, pool, outputs)
        first = move(t, actions, state, own, inputs, rows, samples)
        add_columns(feed, column, inputs, given if first <= k else FREE, needed, outputs)
        advance(groups, state, reading, others, push, inputs, own_modes, outputs)
        if first <= k:
            add_deviations(stepping, own_modes, groups, inputs[FREE:], first, k)
        status |= read(t, state, own, outputs, observation, rows, samples)
    return status
