"""The published law of torque and pitch, and the operating points over wind speed."""

from dataclasses import replace

import numpy as np
import pytest

from flapgym.turbine import load_case

CASE = load_case("nrel5mw-range")
LAW, RPM, DEGREE = CASE.speed_control, np.pi / 30.0, np.pi / 180.0


def test_rated_torque_is_the_published_one():
    assert LAW.rated_torque == pytest.approx(43093.55, rel=1e-6)  # NREL/TP-500-38060, Table 7-2


def test_optimal_torque_is_the_published_constant_times_the_speed_in_rpm_squared():
    assert LAW.torque(1000.0 * RPM) == pytest.approx(0.0255764 * 1000.0**2, rel=1e-6)


def test_torque_begins_where_it_is_published_to():
    assert LAW.torque(669.0 * RPM) == 0.0
    assert LAW.torque(871.0 * RPM) == pytest.approx(0.0255764 * 871.0**2, rel=1e-4)


@pytest.mark.parametrize("speed", [720.0, 821.5, 998.7, 1153.3, 1170.0])
def test_slope_is_that_of_the_torque(speed):
    small = 1e-4
    difference = (LAW.torque(speed * RPM + small) - LAW.torque(speed * RPM - small)) / (2 * small)
    assert LAW.torque_slope(speed * RPM, 0.0) == pytest.approx(difference, rel=1e-6)


def test_above_rated_power_is_constant():
    speed, small = 1173.7 * RPM, 1e-3
    powers = [
        (LAW.rated_torque + sign * small * LAW.torque_slope(speed, 0.1)) * (speed + sign * small)
        for sign in (1, -1)
    ]
    assert powers == pytest.approx([LAW.rated_power] * 2, rel=1e-9)


def test_gains_halve_at_their_published_pitch_and_are_none_below_rated():
    proportional, integral = LAW.pitch_gains(6.302336 * DEGREE)
    assert (proportional, integral) == pytest.approx((0.5 * 0.01882681, 0.5 * 0.008068634))
    assert LAW.pitch_gains(0.0) == (0.0, 0.0)


def test_case_at_a_wind_speed_has_the_listed_rotor_speed_and_pitch():
    there = CASE.at_wind_speed(16.5)
    assert there.rotor_speed == pytest.approx(12.1 * RPM)
    assert there.operating_point.pitch == pytest.approx(0.5 * (12.06 + 13.54) * DEGREE)
    assert there.name == "nrel5mw-range-16.5"


def test_wind_beyond_the_schedule_is_refused():
    with pytest.raises(
        ValueError, match="^schedule.wind_speed: expected a wind speed from 3 to 25 m/s, got 26 m/s"
    ):
        CASE.at_wind_speed(26.0)


def test_case_without_a_schedule_says_what_is_missing():
    with pytest.raises(ValueError, match=r"^schedule: expected a table \[schedule\]"):
        load_case("nrel5mw-site").at_wind_speed(9.0)


def test_speed_control_wants_blades_that_pitch():
    with pytest.raises(ValueError, match="^signals.pitch: expected true with a table"):
        replace(CASE, signals=replace(CASE.signals, pitch=False))


def test_its_outputs_are_refused_where_speed_is_prescribed():
    with pytest.raises(
        ValueError, match="^signals.outputs: expected no rotor_speed of a rotor whose speed is prescribed"
    ):
        replace(CASE, speed_control=None)


def test_speeds_of_the_law_must_rise():
    with pytest.raises(
        ValueError, match="^speed_control.rated_speed: expected more than speed_control.optimal_from"
    ):
        replace(LAW, rated_speed=80.0)
