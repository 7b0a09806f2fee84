"""The actuator is a double integrator between hard stops."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flapgym.plant.actuator import TOUCH, Law, flap_step, free_motion, lag_constants, stepwise_motion

ANGLE, RATE, DT = np.deg2rad(10.0), np.deg2rad(100.0), 0.007
FLAPS = st.tuples(st.floats(-ANGLE, ANGLE), st.floats(-RATE, RATE), st.floats(-100.0, 100.0))


def _free(steps, lag, start):
    """Angles and rates (k + 1,) from command, where there is a lag acceleration, angle and rate."""
    return (free_motion(steps, DT, Law(*lag_constants(DT, lag)), lag > 0.0) @ start).reshape(steps + 1, 2).T


def _march(angle, rate, command, lagged, steps, lag):
    """Angles and rates (k + 1,), jumps of the angle (k,), and whether a stop was met in each step."""
    decay, gain = lag_constants(DT, lag)
    motion, jumps, met = [(angle, rate)], [], []
    for _ in range(steps):
        acting = command + gain * (lagged - command)
        angle, rate, *stop = flap_step(angle, rate, acting, DT, ANGLE, RATE)
        lagged = command + decay * (lagged - command)
        motion.append((angle, rate))
        for each, value in zip((jumps, met), stop, strict=True):
            each.append(value)
    return np.array(motion).T, np.array(jumps), np.array(met)


def test_a_held_acceleration_gives_the_parabola_of_kinematics():
    time = DT * np.arange(11)
    for angle, rate, acceleration in [(0.01, 0.1, 1.0), (-0.02, 0.0, -2.0), (0.0, -0.2, 3.0)]:
        expected = [angle + rate * time + acceleration * time**2 / 2, rate + acceleration * time]
        np.testing.assert_allclose(_free(10, 0.0, [acceleration, angle, rate]), expected, atol=1e-15)
        marched, jumps, met = _march(angle, rate, acceleration, 0.0, 10, 0.0)
        np.testing.assert_allclose(marched, expected, atol=1e-15)
        # Nothing is in the way: not even round-off jumps.
        assert not jumps.any()
        assert not met.any()


def test_full_acceleration_reaches_the_angle_stop_and_rests_there():
    (angle, rate), *_, met = _march(0.0, 0.0, np.deg2rad(600.0), 0.0, 100, 0.0)
    # Rest to rate limit in 1/6 s over 8.33 degrees, then 1.67 degrees at 100 deg/s: 26.2 steps in all.
    arrival = int(np.argmax(angle >= ANGLE))
    assert arrival == 27
    assert rate.max() == RATE
    assert (angle[arrival:] == ANGLE).all()
    assert (rate[arrival:] == 0.0).all()
    assert met[arrival - 1 :].all()


def test_a_flap_leaves_the_stop_as_soon_as_it_is_pulled():
    (angle, _), *_, met = _march(ANGLE, 0.0, -5.0, 0.0, 2, 0.0)
    np.testing.assert_allclose(angle, ANGLE - 2.5 * (DT * np.arange(3)) ** 2)
    assert not met.any()


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_round_off_does_not_decide_whether_a_stop_is_met(sign):
    for share in (1.0, 1.0 - 1e-15, 1.0 - 0.5 * TOUCH):
        # So slow that it covers a hundredth of what counts as touching.
        after = flap_step(sign * share * ANGLE, sign * 1e-13 * RATE, 0.0, DT, ANGLE, RATE)
        assert after[:2] == (sign * ANGLE, 0.0)
        assert after[3]
    # The same, but turned away.
    angle, rate, jump, met = flap_step(sign * ANGLE, -sign * 1e-13 * RATE, 0.0, DT, ANGLE, RATE)
    assert abs(angle) <= ANGLE
    assert (rate, jump, met) == (-sign * 1e-13 * RATE, 0.0, False)


def test_a_lagged_acceleration_gives_the_rate_of_its_integral():
    lag, command, lagged = 0.05, 2.0, -1.0
    time = DT * np.arange(11)
    expected = command * time + (lagged - command) * lag * (1.0 - np.exp(-time / lag))
    np.testing.assert_allclose(_free(10, lag, [command, lagged, 0.0, 0.0])[1], expected, atol=1e-14)
    np.testing.assert_allclose(_march(0.0, 0.0, command, lagged, 10, lag)[0][1], expected, atol=1e-14)


@pytest.mark.parametrize("lag", [1e-9, 1e-5, 1e-3, 1.0, 1e6, 1e20])
def test_any_lag_leaves_what_its_exponential_does(lag):
    decay, gain = lag_constants(DT, lag)
    assert decay == pytest.approx(np.exp(-DT / lag), rel=1e-14)
    # Mean of exp(-t / lag) over a step; its series where it hardly decays.
    short = 1.0 - DT / lag / 2.0 + (DT / lag) ** 2 / 6.0
    expected = short if DT / lag < 1e-5 else (1.0 - np.exp(-DT / lag)) * lag / DT
    assert gain == pytest.approx(expected, rel=1e-13)


@settings(max_examples=300, deadline=None)
@given(FLAPS, st.floats(-100.0, 100.0), st.integers(1, 20), st.sampled_from([0.0, 1e-6, 0.1, 1e6]))
def test_no_motion_passes_a_stop_and_its_start_and_the_steps_add_up_to_it(flap, lagged, steps, lag):
    marched, jumps, met = _march(*flap, lagged, steps, lag)
    assert np.abs(marched[0]).max() <= ANGLE
    assert np.abs(marched[1]).max() <= RATE
    without_command = _free(steps, 0.0, np.array([0.0, *flap[:2]]))
    stepwise = stepwise_motion(steps, DT) @ np.concatenate([np.diff(marched[1]), jumps])
    rebuilt = without_command + stepwise.reshape(steps + 1, 2).T
    assert (np.abs(rebuilt - marched) <= 1e-13 * np.array([[ANGLE], [RATE]])).all()
    if not met.any():
        free = _free(steps, lag, np.array([flap[2], *([lagged] if lag else []), *flap[:2]]))
        assert (np.abs(free - marched) <= 1e-13 * np.array([[ANGLE], [RATE]])).all()
    assert not jumps[~met].any()


@settings(max_examples=300, deadline=None)
@given(FLAPS)
def test_a_stop_gives_no_energy(flap):
    angle, rate, acceleration = flap
    moved, after, _, met = flap_step(angle, rate, acceleration, DT, ANGLE, RATE)
    wanted = rate + acceleration * DT
    assert abs(after) <= abs(wanted)
    assert after * wanted >= 0.0
    assert abs(after) == 0.0 or moved * after < 0.0 or abs(moved) < ANGLE
    if not met:
        assert after == wanted
        assert moved == angle + 0.5 * DT * (rate + after)


@settings(max_examples=100, deadline=None)
@given(st.lists(FLAPS, min_size=1, max_size=40))
def test_numbers_and_arrays_move_alike(flaps):
    together = flap_step(*np.array(flaps).T, DT, ANGLE, RATE)
    alone = [flap_step(*each, DT, ANGLE, RATE) for each in flaps]
    for many, one in zip(together, zip(*alone, strict=True), strict=True):
        np.testing.assert_array_equal(many, one)
