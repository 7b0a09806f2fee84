"""The compiled step of LANES turbines side by side; flapgym.plant.compiled_one does the same for one."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from flapgym.core.arrays import BLADES
from flapgym.plant.compiled_loops import C1, OPTIONS, S1, THIRD, close, widest_vectors
from flapgym.plant.compiled_modes import add_products_of_block, push_block
from flapgym.plant.layout import (
    ACCELERATION_LIMIT,
    ANGLE,
    ANGLE_LIMIT,
    BLADE_COUNT,
    COSINE,
    COSINE_TURN,
    COUNT,
    EFFECTIVENESS,
    ENTRY,
    EVERY,
    FLAP_INPUTS,
    HEAD,
    INTERVALS,
    LAG_DECAY,
    LAG_GAIN,
    LANES,
    MEAN_SQUARE,
    MODES,
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
    REWARD_ANGLE,
    ROW,
    SAMPLE,
    SAMPLE_ANGLE,
    SAMPLE_RATE,
    SAMPLE_TOWER,
    SAMPLE_WIND,
    SINE,
    SINE_TURN,
    STEP_INPUTS,
    STEPS,
    STOPPED,
    STUCK,
    TIME_STEP,
    TOUCH,
    TOWER,
    TRAVEL,
    TURN,
    WEIGHT_ANGLE,
    WIND,
)

COMMANDS, COSINES, SINES, SQUARES, STOPS, SUMS, VALUES, JUMPS, WORK_ROWS = 12, 15, 16, 17, 18, 21, 24, 27, 30
"""Rows of a block's work, behind the first twelve numbers of its records: commands, azimuth at the start, sum of
squared angles, stops met, sums of squared moments, and loads, or before them accelerations and jumps of the angles."""


@njit(**OPTIONS)
def begin_block(block, lanes, state, pool, outputs):  # type: ignore[no-untyped-def]
    """Outputs under the wind alone."""
    width, intervals = len(outputs) // LANES, int(state[INTERVALS])
    records = HEAD + ENTRY * int(state[OBSERVED]) + block * LANES * OWN
    for lane in range(lanes):
        own = state[records + lane * OWN : records + (lane + 1) * OWN]
        interval = int(own[OWN_RESPONSE]) * intervals + min(int(own[OWN_ELAPSED]), intervals - 1)
        wind = pool[interval * width : (interval + 1) * width]
        level = own[OWN_LEVEL]
        for i in range(width):
            outputs[i * LANES + lane] = level * wind[i]


@njit(**OPTIONS)
def move_block(block, lanes, actions, state, inputs, work, rows, samples):  # type: ignore[no-untyped-def]
    """`move` for a block of turbines: what the flaps do in every step. Returns whether an angle jumped."""
    widest_vectors()
    k, blades = int(state[STEPS]), int(state[BLADE_COUNT])
    dt, per_step, record = state[TIME_STEP], 1.0 / state[TIME_STEP], samples.size > 0
    top_angle, top_rate, top_acceleration = state[ANGLE_LIMIT], state[RATE_LIMIT], state[ACCELERATION_LIMIT]
    decay, gain, inner = state[LAG_DECAY], state[LAG_GAIN], top_angle * (1.0 - TOUCH)
    cosine_turn, sine_turn = state[COSINE_TURN], state[SINE_TURN]
    records = HEAD + ENTRY * int(state[OBSERVED]) + block * LANES * OWN
    for lane in range(lanes):
        own = state[records + lane * OWN : records + (lane + 1) * OWN]
        azimuth = own[OWN_AZIMUTH] + state[TURN] * k * own[OWN_ELAPSED]
        work[COSINES * LANES + lane], work[SINES * LANES + lane] = math.cos(azimuth), math.sin(azimuth)
        for i in range(12):
            work[i * LANES + lane] = own[i]
        for b in range(BLADES):
            command = 0.0
            if b < blades and state[STUCK + b] == 0.0:
                action = float(actions[(block * LANES + lane) * blades + b])
                command = min(max(action, -1.0), 1.0) * top_acceleration
            work[(COMMANDS + b) * LANES + lane] = command
    square = work[SQUARES * LANES : (SQUARES + 1) * LANES]
    turned = work[SUMS * LANES : (SUMS + 2) * LANES]
    for t in range(LANES):
        square[t] = 0.0
        turned[t], turned[t + LANES] = work[COSINES * LANES + t], work[SINES * LANES + t]
    for i in range(BLADES * LANES):
        work[STOPS * LANES + i] = 0.0
    for kind in range(2):
        motion = work[3 * kind * LANES : 3 * (kind + 1) * LANES]
        _components_of_block(motion, turned, state, inputs[3 * kind * LANES : 3 * (kind + 1) * LANES])
    gained, jumps = work[VALUES * LANES : JUMPS * LANES], work[JUMPS * LANES : WORK_ROWS * LANES]
    for i in range(BLADES * LANES):
        gained[i], jumps[i] = 0.0, 0.0
    off = 0.0
    for j in range(1, k + 1):
        for b in range(blades):
            if state[STUCK + b] != 0.0:
                continue
            own = work[b * LANES : (b + JUMPS + 1) * LANES]
            for t in range(LANES):
                angle, rate = own[t + OWN_ANGLE * LANES], own[t + OWN_RATE * LANES]
                command = own[t + COMMANDS * LANES]
                behind = own[t + OWN_LAGGED * LANES] - command
                wanted = rate + (command + behind * gain) * dt
                reached = min(max(wanted, -top_rate), top_rate)
                going = angle + 0.5 * dt * (rate + reached)
                bounded = min(max(going, -top_angle), top_angle)
                into_stop = (abs(going) > inner) & (going * reached > 0.0)
                moved = math.copysign(top_angle, going) if into_stop else bounded
                after = 0.0 if into_stop else reached
                stopped = 1.0 if (wanted != reached) | (going != bounded) | into_stop else 0.0
                jump = moved - (angle + 0.5 * dt * (rate + after))
                own[t + JUMPS * LANES] = jump if (going != bounded) | into_stop else 0.0
                own[t + VALUES * LANES] = (after - rate) * per_step
                own[t + STOPS * LANES] = max(own[t + STOPS * LANES], stopped)
                own[t + OWN_LAGGED * LANES] = command + behind * decay
                own[t + OWN_TRAVEL * LANES] += abs(moved - angle)
                own[t + OWN_ANGLE * LANES], own[t + OWN_RATE * LANES] = moved, after
        for t in range(LANES):
            cosine, sine = turned[t], turned[t + LANES]
            turned[t] = cosine * cosine_turn - sine * sine_turn
            turned[t + LANES] = sine * cosine_turn + cosine * sine_turn
        place = FLAP_INPUTS + BLADES * (j - 1)
        _components_of_block(gained, turned, state, inputs[place * LANES : (place + BLADES) * LANES])
        place += BLADES * k
        _components_of_block(jumps, turned, state, inputs[place * LANES : (place + BLADES) * LANES])
        for t in range(BLADES * LANES):
            off += abs(jumps[t])
        motion = work[: (SQUARES + 1) * LANES]
        for t in range(LANES):
            one, two, three = motion[t], motion[t + LANES], motion[t + 2 * LANES]
            motion[t + SQUARES * LANES] += one * one + two * two + three * three
        if record:
            for lane in range(lanes):
                sample = ((block * LANES + lane) * k + j - 1) * SAMPLE
                for b in range(BLADES):
                    samples[sample + SAMPLE_ANGLE + b] = work[(OWN_ANGLE + b) * LANES + lane]
                    samples[sample + SAMPLE_RATE + b] = work[(OWN_RATE + b) * LANES + lane]
    _keep(block, lanes, state, work, rows)
    return off > 0.0


@njit(**OPTIONS)
def _keep(block, lanes, state, work, rows):  # type: ignore[no-untyped-def]
    """What the flaps of a block have done, back into its records and rows."""
    k, blades = int(state[STEPS]), int(state[BLADE_COUNT])
    records = HEAD + ENTRY * int(state[OBSERVED]) + block * LANES * OWN
    for lane in range(lanes):
        own = state[records + lane * OWN : records + (lane + 1) * OWN]
        row = rows[(block * LANES + lane) * ROW : (block * LANES + lane + 1) * ROW]
        for i in range(12):
            own[i] = work[i * LANES + lane]
        for b in range(BLADES):
            row[ANGLE + b], row[RATE + b] = own[OWN_ANGLE + b], own[OWN_RATE + b]
            row[TRAVEL + b], row[STOPPED + b] = own[OWN_TRAVEL + b], work[(STOPS + b) * LANES + lane]
        row[REWARD_ANGLE] = -state[WEIGHT_ANGLE] * work[SQUARES * LANES + lane] / (k * blades)


@njit(**OPTIONS)
def _components_of_block(values, azimuths, state, inputs):  # type: ignore[no-untyped-def]
    """`components` for a block of turbines."""
    widest_vectors()
    effect_1, effect_2, effect_3 = state[EFFECTIVENESS], state[EFFECTIVENESS + 1], state[EFFECTIVENESS + 2]
    if state[BLADE_COUNT] != BLADES:
        for t in range(LANES):
            inputs[t], inputs[t + LANES], inputs[t + 2 * LANES] = effect_1 * values[t], 0.0, 0.0
        return
    for t in range(LANES):
        cosine, sine = azimuths[t], azimuths[t + LANES]
        one = effect_1 * values[t]
        two, three = effect_2 * values[t + LANES], effect_3 * values[t + 2 * LANES]
        along, across = one + C1 * (two + three), S1 * (three - two)
        inputs[t] = THIRD * (one + two + three)
        inputs[t + LANES] = 2.0 * THIRD * (cosine * along + sine * across)
        inputs[t + 2 * LANES] = 2.0 * THIRD * (sine * along - cosine * across)


@njit(**OPTIONS)
def read_block(block, lanes, state, outputs, work, observation, rows, samples):  # type: ignore[no-untyped-def]
    """`read` for a block of turbines, with tip deflection and tower always."""
    widest_vectors()
    k, blades = int(state[STEPS]), int(state[BLADE_COUNT])
    every, record = state[EVERY] != 0.0, samples.size > 0
    records = HEAD + ENTRY * int(state[OBSERVED]) + block * LANES * OWN
    kept = k if every else 1
    tips, flat, width = 3 * k, 3 * (k + kept), 3 * (k + 2 * kept)
    turn_cosine, turn_sine = math.cos(k * state[TURN]), math.sin(k * state[TURN])
    azimuths = work[COSINES * LANES : (SINES + 1) * LANES]
    fore_aft, square = work[SQUARES * LANES : (SQUARES + 1) * LANES], work[SUMS * LANES : (SUMS + 3) * LANES]
    for t in range(LANES):
        fore_aft[t], square[t], square[t + LANES], square[t + 2 * LANES] = 0.0, 0.0, 0.0, 0.0
    for j in range(k):
        last = every or j == k - 1
        for quantity in range(2 if last else 1):
            value = work[(VALUES + 3 * quantity) * LANES : (VALUES + 3 * quantity + 3) * LANES]
            place = 3 * j if quantity == 0 else tips + (3 * j if every else 0)
            y = outputs[place * LANES : (place + 3) * LANES]
            if blades == BLADES:
                for t in range(LANES):
                    cosine, sine, mean = azimuths[t], azimuths[t + LANES], y[t]
                    along = y[t + LANES] * cosine + y[t + 2 * LANES] * sine
                    across = y[t + 2 * LANES] * cosine - y[t + LANES] * sine
                    value[t] = mean + along
                    value[t + LANES] = mean + C1 * along + S1 * across
                    value[t + 2 * LANES] = mean + C1 * along - S1 * across
            else:
                for t in range(LANES):
                    value[t], value[t + LANES], value[t + 2 * LANES] = y[t], 0.0, 0.0
        moment = work[VALUES * LANES : (VALUES + 3) * LANES]
        for t in range(BLADES * LANES):
            square[t] += moment[t] ** 2
        place = flat + (3 * j if every else 0)
        if last:
            y = outputs[place * LANES : (place + 1) * LANES]
            for t in range(LANES):
                fore_aft[t] += y[t] ** 2
        if record:
            for lane in range(lanes):
                sample = samples[((block * LANES + lane) * k + j) * SAMPLE :]
                for o in range(6):
                    sample[o] = work[(VALUES + o) * LANES + lane]
                sample[SAMPLE_TOWER] = outputs[place * LANES + lane]
                sample[SAMPLE_TOWER + 1] = outputs[(place + 1) * LANES + lane]
                sample[SAMPLE_WIND] = outputs[(place + 2) * LANES + lane]
    status = 0
    for lane in range(lanes):
        t = block * LANES + lane
        own = state[records + lane * OWN : records + (lane + 1) * OWN]
        row = rows[t * ROW : (t + 1) * ROW]
        for b in range(6):
            row[b] = work[(VALUES + b) * LANES + lane]
        for c in range(2):
            row[TOWER + c] = outputs[(width - 3 + c) * LANES + lane]
        for b in range(BLADES):
            row[MEAN_SQUARE + b] = square[b * LANES + lane]
        row[WIND] = outputs[(width - 1) * LANES + lane]
        cosine, sine = azimuths[lane], azimuths[LANES + lane]
        row[COSINE] = cosine * turn_cosine - sine * turn_sine
        row[SINE] = sine * turn_cosine + cosine * turn_sine
        status |= close(t, fore_aft[lane], state, own, observation, row)
    return status


@njit(**OPTIONS)
def step_together(actions, real, state, pool, samples, observation, rows):  # type: ignore[no-untyped-def]
    """Hold actions for an interval, LANES turbines at a time; their status (flapgym.plant.interface.Plant.step)."""
    n, k, count = int(state[COUNT]), int(state[STEPS]), int(state[MODES])
    groups = (count + LANES - 1) // LANES
    size, room = 2 * groups * LANES, groups * LANES
    rows_wanted = 9 * k if state[EVERY] != 0.0 else 3 * k + 6
    blocks = (n + LANES - 1) // LANES
    # Angle and rate at the start, the accelerations of all steps, and the jumps behind them.
    width, steps = FLAP_INPUTS + STEP_INPUTS * k, STEP_INPUTS * k
    decay, rest = real[:size], real[size:]
    push, rest = rest[: size * steps], rest[size * steps :]
    reading, rest = rest[: rows_wanted * size], rest[rows_wanted * size :]
    modes, rest = rest[: blocks * size * LANES], rest[blocks * size * LANES :]
    inputs, rest = rest[: width * LANES], rest[width * LANES :]
    outputs, feed = rest[: rows_wanted * LANES], rest[rows_wanted * LANES :]
    work = np.empty(WORK_ROWS * LANES)
    # What nobody fills, lanes beyond the last turbine, is nothing at first.
    work[:] = 0.0
    status = 0
    for block in range(blocks):
        lanes = min(LANES, n - block * LANES)
        own_modes = modes[block * size * LANES : (block + 1) * size * LANES]
        begin_block(block, lanes, state, pool, outputs)
        jumped = move_block(block, lanes, actions, state, inputs, work, rows, samples)
        add_products_of_block(feed, width, rows_wanted, inputs, width // 2, outputs)
        add_products_of_block(reading, size, rows_wanted, own_modes, count, outputs)
        taken = steps if jumped else BLADES * k
        push_block(decay, push, steps, own_modes, room // 2, inputs[FLAP_INPUTS * LANES :], taken)
        status |= read_block(block, lanes, state, outputs, work, observation, rows, samples)
    return status
