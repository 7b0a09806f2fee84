"""The actuator is a double integrator between hard stops."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flapgym.plant import Actuator, Faults

ANGLE, RATE, DT = np.deg2rad(10.0), np.deg2rad(100.0), 0.007


def test_a_held_acceleration_gives_the_parabola_of_kinematics():
    command = np.array([[0.01, -0.02, 0.0], [0.1, 0.0, -0.2], [0.0, 0.0, 0.0], [1.0, -2.0, 3.0]])
    motion, stopped = Actuator(ANGLE, RATE, DT, steps=10).move(command[None])
    time = DT * np.arange(11)[:, None]
    assert stopped is None
    np.testing.assert_allclose(
        motion[0, 0::2], command[0] + command[1] * time + command[3] * time**2 / 2, atol=1e-15
    )
    np.testing.assert_allclose(motion[0, 1::2], command[1] + command[3] * time, atol=1e-15)


def test_full_acceleration_reaches_the_angle_stop_and_rests_there():
    acceleration = np.deg2rad(600.0)
    actuator = Actuator(ANGLE, RATE, DT, steps=100)
    motion, stopped = actuator.move(np.array([[[0.0], [0.0], [0.0], [acceleration]]]))
    assert stopped is not None
    assert stopped.all()
    # Rest to rate limit in 1/6 s over 8.33 degrees, then 1.67 degrees at 100 deg/s: 26.2 steps in all.
    angle, rate = motion[0, 0::2, 0], motion[0, 1::2, 0]
    arrival = int(np.argmax(angle >= ANGLE))
    assert arrival == 27
    assert rate.max() == RATE
    assert (angle[arrival:] == ANGLE).all()
    assert (rate[arrival:] == 0.0).all()


def test_a_flap_leaves_the_stop_as_soon_as_it_is_pulled():
    motion, _ = Actuator(ANGLE, RATE, DT, steps=2).move(np.array([[[ANGLE], [0.0], [0.0], [-5.0]]]))
    np.testing.assert_allclose(motion[0, 0::2, 0], ANGLE - 2.5 * (DT * np.arange(3)) ** 2)


def test_a_lagged_acceleration_gives_the_rate_of_its_integral():
    lag, command = 0.05, 2.0
    actuator = Actuator(ANGLE, RATE, DT, steps=10, lag=lag)
    start = np.array([[[0.0], [0.0], [-1.0], [command]]])
    motion, _ = actuator.move(start)
    time = DT * np.arange(11)
    difference = -1.0 - command
    expected = command * time + difference * lag * (1.0 - np.exp(-time / lag))
    np.testing.assert_allclose(motion[0, 1::2, 0], expected, atol=1e-14)
    np.testing.assert_allclose(
        actuator.lagged(start), command + difference * np.exp(-time[-1:] / lag)[:, None]
    )


@settings(max_examples=200, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.floats(-ANGLE, ANGLE),
            st.floats(-RATE, RATE),
            st.floats(-100.0, 100.0),
            st.floats(-100.0, 100.0),
        ),
        min_size=1,
        max_size=8,
    ),
    st.integers(1, 20),
    st.sampled_from([0.0, 0.1]),
)
def test_no_motion_passes_a_stop_and_few_and_many_flaps_move_alike(starts, steps, lag):
    actuator = Actuator(ANGLE, RATE, DT, steps, lag)
    few = np.array(starts)[:, :, None]
    motion, _ = actuator.move(few)
    assert np.abs(motion[:, 0::2]).max() <= ANGLE
    assert np.abs(motion[:, 1::2]).max() <= RATE
    # Enough copies that the flaps at a stop are stepped together instead of one by one.
    many, _ = actuator.move(np.repeat(few, 20, axis=0))
    np.testing.assert_array_equal(many[::20], motion)


@pytest.mark.parametrize("field, value", [("angle_limit", 0.0), ("rate_limit", np.nan), ("time_step", -1.0)])
def test_impossible_stops_are_refused_by_name(field, value):
    numbers = {"angle_limit": ANGLE, "rate_limit": RATE, "time_step": DT} | {field: value}
    with pytest.raises(ValueError, match=f"actuator.{field}"):
        Actuator(**numbers, steps=5)


@pytest.mark.parametrize(
    "field, value", [("effectiveness", (1.0, np.nan, 1.0)), ("stuck", (0.0, None)), ("lag", -0.1)]
)
def test_impossible_faults_are_refused_by_name(field, value):
    with pytest.raises(ValueError, match=f"faults.{field}"):
        Faults(**{field: value})
