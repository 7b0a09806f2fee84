"""The compiled step of up to LANES turbines side by side; flapgym.plant.compiled_one does the same for one."""

from __future__ import annotations

import math

from numba import njit

from flapgym.plant.compiled_loops import C1, OPTIONS, S1, THIRD, close, widest_vectors
from flapgym.plant.layout import (
    ACCELERATION_LIMIT,
    ANGLE,
    ANGLE_LIMIT,
    BLADE_COUNT,
    COSINE,
    COSINE_TURN,
    DIRECT,
    DRIVE,
    EFFECTIVENESS,
    ENTRY,
    EVERY,
    FLAP_INPUTS,
    GROUP,
    GROUP_SIZE,
    HEAD,
    INTERVALS,
    LAG_DECAY,
    LAG_GAIN,
    LANES,
    MEAN_SQUARE,
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
    READ,
    READ_LAST,
    REWARD_ANGLE,
    ROW,
    SAMPLE,
    SAMPLE_ANGLE,
    SAMPLE_RATE,
    SAMPLE_WIND,
    SINE,
    SINE_TURN,
    STEPS,
    STOPPED,
    STUCK,
    TIME_STEP,
    TOWER,
    TRAVEL,
    TURN,
    WEIGHT_ANGLE,
    WIND,
)

PAIR = 2 * LANES
COMMANDS, STOPS, COSINES, SINES, SQUARES, SUMS, VALUES = 12, 15, 18, 19, 20, 21, 24
"""Rows of a block's work, behind the first twelve numbers of its records: for the flaps, then for the loads."""
WORK = 32
"""Rows of a block's work; behind them the wind's response."""


@njit(**OPTIONS)
def move_block(first, lanes, actions, state, inputs, work, rows, samples):  # type: ignore[no-untyped-def]
    """`move` for up to LANES turbines side by side."""
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
def advance_block(lanes, k, every, count, constants, modes, inputs, outputs):  # type: ignore[no-untyped-def]
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
def read_block(first, lanes, state, inputs, outputs, pool, work, observation, rows, samples):  # type: ignore[no-untyped-def]
    """`read` for up to LANES turbines side by side, with tip deflection and tower always."""
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
        status |= close(t, fore_aft[lane], state, own, observation, row)
    return status
