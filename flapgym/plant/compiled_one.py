"""The compiled step of one turbine, its modes side by side; flapgym.plant.compiled_batch does the same for many."""

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
    DISPLACED,
    DRIVE,
    EFFECTIVENESS,
    EVERY,
    FLAP_INPUTS,
    GROUP,
    GROUP_SIZE,
    INTERVALS,
    LAG_DECAY,
    LAG_GAIN,
    MEAN_SQUARE,
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
    STEPS,
    STOPPED,
    STUCK,
    TIME_STEP,
    TIP,
    TOWER,
    TRAVEL,
    TURN,
    WEIGHT_ANGLE,
    WIND,
)

ROW_PAIRS = 2 * GROUP


@njit(**OPTIONS)
def move(t, actions, state, own, inputs, rows, samples):  # type: ignore[no-untyped-def]
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
def advance_modes(k, every, displaced, count, constants, modes, inputs, sums, outputs):  # type: ignore[no-untyped-def]
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
def read(t, state, own, inputs, outputs, pool, observation, rows, samples):  # type: ignore[no-untyped-def]
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
    return close(t, fore_aft, state, own, observation, row)
