"""The mean load behind a wake with induction: momentum theory, what the wake's size moves, and the whole rotor."""

from dataclasses import replace

import numpy as np
import pytest

import flapgym.aerodynamics.rotor as rotor_module
from flapgym.aerodynamics import build_mean_aerodynamics, mean_loads, momentum_induction, rigid_rotor
from flapgym.turbine import load_case

# Three panels along the chord, on which steady loads do not depend.
CORRECTED = load_case("nrel5mw-corrected")
CORRECTED = replace(
    CORRECTED, discretisation=replace(CORRECTED.discretisation, chordwise_panels=3, time_step=0.0233)
)


@pytest.mark.parametrize("induction", [0.0, 0.1, 1.0 / 3.0, 0.39])
def test_induction_is_that_of_the_thrust_of_an_actuator_disc(induction):
    assert momentum_induction(4.0 * induction * (1.0 - induction)) == pytest.approx(induction, abs=1e-12)


def test_induction_goes_on_without_a_step_where_momentum_theory_ends():
    """At a thrust coefficient of 0.96 and an induction of 0.4, with the same slope, on towards 1 at a thrust of 2."""
    below, at, above = (momentum_induction(0.96 + step) for step in (-1e-6, 0.0, 1e-6))
    assert at == pytest.approx(0.4, abs=1e-6)
    assert at - below == pytest.approx(1e-6 / (4.0 - 8.0 * 0.4), rel=1e-2)
    assert above - at == pytest.approx(at - below, rel=1e-2)
    assert momentum_induction(2.0) == pytest.approx(1.0)


def test_rotor_that_pushes_the_wind_has_no_induction():
    assert momentum_induction(-0.2) == 0.0


def loads(case=CORRECTED, induction=0.25, rows_turn=None, monkeypatch=None):
    if monkeypatch is not None:
        monkeypatch.setattr(rotor_module, "MEAN_WAKE_TURN", rows_turn)
    return mean_loads(case, build_mean_aerodynamics(case, induction))


@pytest.fixture(scope="module")
def mean():
    return loads()


def test_rows_half_as_long_move_no_mean_load_by_two_thousandths(mean, monkeypatch):
    fine = loads(rows_turn=np.deg2rad(2.5), monkeypatch=monkeypatch)
    for name in ("thrust", "torque", "root_moment"):
        assert getattr(fine, name) == pytest.approx(getattr(mean, name), rel=2e-3)


def test_a_wake_half_as_long_again_moves_the_mean_loads_little(mean):
    longer = loads(replace(CORRECTED, airloads=replace(CORRECTED.airloads, mean_wake=3.0)))
    assert longer.thrust == pytest.approx(mean.thrust, rel=0.01)
    assert longer.torque == pytest.approx(mean.torque, rel=0.02)


def test_mean_wake_is_as_long_as_the_case_asks_whatever_its_speed():
    for induction in (0.0, 0.3):
        aero = build_mean_aerodynamics(CORRECTED, induction)
        length = aero.wake_age[-1] * aero.inflow.wake_velocity[0]
        assert length == pytest.approx(2.0 * 126.0, rel=0.01)


def test_mean_load_in_the_perturbations_wake_stands_on_flat_plates_whatever_their_slopes():
    airloads = replace(CORRECTED.airloads, mean_wake="perturbations")
    found = []
    for slope in ("sections", "thin aerofoil"):
        rotor = rigid_rotor(replace(CORRECTED, airloads=replace(airloads, lift_slope=slope)))
        found.append((rotor.loads.thrust, rotor.flow.aero.wake_age[-1]))
    assert found[0] == found[1]


@pytest.fixture(scope="module")
def rigid():
    return rigid_rotor(CORRECTED)


def test_rotor_s_thrust_and_induction_balance(rigid):
    speed = CORRECTED.operating_point.wind_speed
    induction = 1.0 - rigid.flow.aero.inflow.wake_velocity[0] / speed
    disc = 0.5 * 1.225 * speed**2 * np.pi * 63.0**2
    assert rigid.loads.thrust == pytest.approx(4.0 * induction * (1.0 - induction) * disc, rel=1e-6)


def test_rigid_rotor_s_gust_torque_is_that_of_free_wake_and_blade_elements(rigid):
    """OpenFAST, free vortex wake and blade element momentum alike: 0.94 MN m per m/s."""
    point = rigid.aero.force_point
    about_shaft = 3.0 * np.stack([np.zeros(len(point)), -point[:, 2], point[:, 1]], axis=1)
    torque = rigid.steady(about_shaft.reshape(1, -1))[0, 0]
    assert torque == pytest.approx(0.94e6, rel=0.05)
