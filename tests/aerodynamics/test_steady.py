"""Mean loads of the rotor against momentum balances, published coefficients and independent estimates."""

from dataclasses import replace

import numpy as np
import pytest

from flapgym.aerodynamics import (
    build_aerodynamics,
    gust_downwash,
    mean_loads,
    root_moment_load,
    steady_circulation,
)
from flapgym.aerodynamics.biot_savart import segment_velocity
from flapgym.aerodynamics.steady import incidence_downwash, induced_velocity_at


def variant(case, *, wake_length=0.25, induction=0.0, **operating_point):
    return replace(
        case,
        operating_point=replace(case.operating_point, **operating_point),
        discretisation=replace(case.discretisation, wake_length=wake_length, induction=induction),
    )


@pytest.fixture(scope="module")
def mean(case, rotor):
    return mean_loads(case, rotor)


def test_flow_does_not_cross_the_lattice(case, rotor, mean):
    planform = case.turbine.planform
    zero_lift = np.interp(
        mean.radius,
        planform.radius,
        [case.turbine.airfoil(name).zero_lift_angle_attached for name in planform.airfoil],
    )
    induced = induced_velocity_at(rotor, rotor.collocation, mean.circulation)
    through = np.einsum("ni,ni->n", induced, rotor.normal) + incidence_downwash(rotor, zero_lift)
    np.testing.assert_allclose(through, 0.0, atol=1e-9)


def test_thrust_at_rated_wind_is_what_trials_found(mean):
    assert 715e3 < mean.thrust < 765e3


def test_sections_add_up_to_the_rotor(case, rotor, mean):
    width = np.diff(case.turbine.blade_sections(12).radius[2:])
    assert 3 * (mean.out_of_plane * width).sum() == pytest.approx(mean.thrust, rel=1e-12)
    cone = np.cos(case.turbine.rotor.precone)
    assert 3 * (mean.in_plane * width * mean.radius).sum() * cone == pytest.approx(mean.torque, rel=2e-3)
    lever = mean.radius - case.turbine.rotor.hub_radius
    assert (mean.out_of_plane * width * lever).sum() == pytest.approx(mean.root_moment, rel=0.01)


def test_work_of_the_torque_is_the_winds_and_the_induced_drag(rotor, mean, case):
    # Joukowski's force does no work in the velocity it is made of: T U = Q Omega + losses, losses positive.
    assert 0.05 < 1.0 - mean.power / (mean.thrust * case.operating_point.wind_speed) < 0.4


def test_torque_by_leading_edge_suction_agrees_with_joukowskis(mean):
    assert mean.torque_by_suction == pytest.approx(mean.torque, rel=0.01)


def test_coefficients_come_near_the_published_ones_with_a_long_slow_wake(case):
    # Published at 12 m/s and 12.1 rpm; coefficients follow the tip-speed ratio.
    slow = variant(case, wake_length=1.0, induction=0.3, tip_speed_ratio=12.1 * np.pi / 30 * 63 / 12)
    mean = mean_loads(slow, build_aerodynamics(slow))
    # Free wake of five revolutions: Cp 0.52, Ct 0.70; blade-element momentum: 0.488, 0.698.
    assert mean.power_coefficient == pytest.approx(0.52, abs=0.03)
    assert mean.thrust_coefficient == pytest.approx(0.70, abs=0.03)


def test_linear_gust_gain_is_the_slope_of_the_mean_loads(case, rotor, mean):
    """The mean loads under a little more wind, the wake held where it is, against the perturbation model."""

    def under(wind):
        inflow = replace(rotor.inflow, velocity=np.array([wind, 0.0, 0.0]))
        return mean_loads(case, replace(rotor, inflow=inflow))

    more, less = under(11.1), under(10.9)
    circulation = steady_circulation(rotor, gust_downwash(rotor).sum(axis=1, keepdims=True))
    linear = (rotor.force.sum(axis=0) @ circulation).reshape(-1, 3)
    # Perturbation loads leave out the mean circulation in the perturbed velocity: 3 % of thrust and root moment.
    assert 3 * linear[:, 0].sum() == pytest.approx((more.thrust - less.thrust) / 0.2, rel=0.04)
    moment = (root_moment_load(rotor, case) @ linear.ravel()).item()
    assert moment == pytest.approx((more.root_moment - less.root_moment) / 0.2, rel=0.04)
    torque = 3 * np.cross(rotor.force_point, linear).sum(axis=0)[0]
    assert torque / ((more.torque - less.torque) / 0.2) == pytest.approx(0.58, abs=0.02)


def test_pitch_to_feather_takes_load_off(case, mean):
    pitched = variant(case, pitch=np.radians(2.0))
    assert mean_loads(pitched, build_aerodynamics(pitched)).thrust < 0.9 * mean.thrust


def test_velocity_on_a_segment_itself_is_zero():
    ends = np.array([0.3, -1.0, 2.0]), np.array([1.7, 0.2, 5.0])
    np.testing.assert_array_equal(segment_velocity(0.5 * (ends[0] + ends[1]), *ends), np.zeros(3))
