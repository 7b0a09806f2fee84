"""The wake that follows the rotor's thrust: its linearisation, and the state that stands for it under pitch."""

from dataclasses import replace

import numpy as np
import pytest

from flapgym.aerodynamics import (
    build_aerodynamics,
    gust_downwash,
    momentum_induction,
    rigid_rotor,
    root_moment_load,
    steady_circulation,
)
from flapgym.aerodynamics.biot_savart import ring_influence
from flapgym.aerodynamics.lattice import build_lattice, wake_ages, wake_nodes
from flapgym.aerodynamics.model import assemble, blade_turns
from flapgym.aerodynamics.rotor import blade_edges, strip_radius, thrust_load
from flapgym.aerodynamics.steady import incidence_downwash, momentum_slope, pitch_downwash, spin_downwash
from flapgym.aerodynamics.transport import (
    adapting_wake_response,
    collective_responses,
    displaced_wake_downwash,
    march_case,
    pitch_transport,
    speed_transport,
    travelling_displacement,
)
from flapgym.turbine import load_case

WHOLE = load_case("nrel5mw-corrected")
# Few panels, and the induction that momentum gives these blades, of which the search would lay ten wakes.
CORRECTED = march_case(replace(WHOLE, airloads=replace(WHOLE.airloads, mean_induction=0.233)), 0.25)
PITCH = 0.002  # rad, small enough for differences
SLOWING = 8e-6  # m/s per N: some momentum's worth


@pytest.fixture(scope="module")
def short():
    """A coarse lattice of flat plates, a fifth of a diameter of wake, and the chords' zero-lift angle."""
    case = march_case(load_case("nrel5mw-rated"), 0.2, panels=2)
    case = replace(case, discretisation=replace(case.discretisation, time_step=0.07))
    aero = build_aerodynamics(case)
    camber = np.full(aero.lattice.strips, -0.06)
    mean = steady_circulation(aero, incidence_downwash(aero, camber)[:, None])[:, 0]
    return case, aero, camber, mean


@pytest.fixture(scope="module")
def loads(short):
    """Thrust, then every circulation, as loads of a lattice whose forces are its circulations."""
    _, aero, _, mean = short
    as_load = replace(aero, force=np.eye(len(mean))[None])
    thrust = thrust_load(aero) @ aero.force.sum(axis=0)
    return as_load, thrust, np.vstack([thrust, np.eye(len(mean))])


@pytest.fixture(scope="module")
def linear(short, loads):
    """Change of every circulation (T, n) per radian of a step of pitch."""
    _, aero, _, mean = short
    as_load, _, load = loads
    shed = mean[-aero.lattice.strips :]
    step = np.ones(6 * aero.wake_rows)  # renewed once, the wake still settles
    return adapting_wake_response(
        as_load, shed, step, pitch_downwash(aero), load, np.zeros(len(load)), SLOWING
    )[:, 1:]


def test_rows_keep_the_velocity_they_were_shed_with():
    step = 0.02
    time = np.arange(400) * step
    moved = travelling_displacement(np.sin(time), step, 50)
    age = (np.arange(51) + 0.25) * step
    shed = time[:, None] - age
    np.testing.assert_allclose(moved, np.where(shed > 0.0, age * np.sin(shed), 0.0), atol=1e-4)


@pytest.mark.parametrize("coefficient", [0.3, 0.73, 0.95, 1.1])
def test_momentum_slope_is_the_slope_of_the_induction(coefficient):
    """The last one on Buhl's line."""
    ahead, behind = momentum_induction(coefficient + 1e-5), momentum_induction(coefficient - 1e-5)
    assert momentum_slope(coefficient) == pytest.approx((ahead - behind) / 2e-5, rel=1e-6)


def test_downwash_of_pitch_is_that_of_flat_blades_built_at_another_pitch(short):
    case, aero, camber, _ = short

    def built(pitch):
        point = replace(case.operating_point, pitch=pitch)
        there = build_aerodynamics(replace(case, operating_point=point))
        return incidence_downwash(there, np.zeros_like(camber))

    slope = (built(PITCH) - built(-PITCH)) / (2.0 * PITCH)
    # Pitch also moves the points where the air is met, about the blade's axis.
    np.testing.assert_allclose(pitch_downwash(aero), slope, rtol=2e-3)


def test_wake_follows_a_step_of_pitch_as_one_laid_anew_at_each_step(short, loads, linear):
    """Every row of corners where its own velocity has carried it, influences computed anew; to either side."""
    _, aero, camber, mean = short
    _, thrust, _ = loads
    lattice, flow, dt, strips = aero.lattice, aero.inflow, aero.time_step, aero.lattice.strips
    age, undisturbed = wake_ages(dt, aero.wake_rows), wake_nodes(lattice, flow, aero.wake_age)
    steps = aero.wake_rows

    def marched(pitch):
        downwash = incidence_downwash(aero, camber + pitch)
        shed = np.tile(mean[-strips:], (aero.wake_rows, 1))
        velocity, found = np.zeros(steps + 1), np.empty((steps, len(mean)))  # none a step before the first
        for t in range(steps):
            for _ in range(3):  # the air just being shed is slowed by the thrust sought
                carried = age * np.interp((t + 1) * dt - age, np.arange(steps + 1) * dt, velocity)
                node = undisturbed + carried[:, None, None] * [1.0, 0.0, 0.0]
                grid = np.concatenate([lattice.node[:-1], node])
                felt = sum(
                    ring_influence(lattice.collocation, lattice.normal, grid @ turn)
                    for turn in blade_turns(3)
                )
                bound, wake = (
                    felt[:, : lattice.chordwise].reshape(len(mean), -1),
                    felt[:, lattice.chordwise :],
                )
                found[t] = -np.linalg.solve(bound, downwash + np.einsum("nks,ks->n", wake, shed))
                velocity[t + 1] = -SLOWING * (thrust @ (found[t] - mean)).item()
            shed = np.concatenate([found[t, None, -strips:], shed[:-1]])
        return found

    slope = (marched(PITCH) - marched(-PITCH)) / (2.0 * PITCH)
    np.testing.assert_allclose(linear[:steps], slope, atol=2e-4 * np.abs(slope).max())


def test_steady_answer_is_that_of_helices_slowed_by_their_own_thrust(short, loads, linear):
    """Circulations solved anew at two pitches, each in a helix whose speed its thrust has settled."""
    case, aero, camber, mean = short
    _, thrust, _ = loads

    def settled(pitch):
        found = mean
        for _ in range(20):
            faster = -SLOWING * (thrust @ (found - mean)).item()
            flow = replace(aero.inflow, wake_velocity=aero.inflow.wake_velocity + [faster, 0.0, 0.0])
            lattice = build_lattice(
                *blade_edges(case, strip_radius(case)), aero.lattice.chordwise, flow, aero.time_step
            )
            size = {"time_step": aero.time_step, "wake_rows": aero.wake_rows, "blades": 3}
            there = assemble(lattice, flow, air_density=1.0, **size)
            found = steady_circulation(there, incidence_downwash(aero, camber + pitch)[:, None])[:, 0]
        return found

    slope = (settled(PITCH) - settled(-PITCH)) / (2.0 * PITCH)
    np.testing.assert_allclose(linear[-1], slope, atol=1e-3 * np.abs(slope).max())


def test_steady_answer_to_rotor_speed_is_that_of_helices_wound_at_that_speed(short, loads):
    """Circulations solved anew at two rotor speeds, the wake carried as before."""
    case, aero, camber, mean = short
    as_load, _, load = loads
    step = np.ones(3 * aero.wake_rows)
    wound = displaced_wake_downwash(aero, mean[-aero.lattice.strips :], turned=True)
    still = np.zeros(len(load))
    linear = adapting_wake_response(
        as_load, mean[-aero.lattice.strips :], step, spin_downwash(aero, camber), load, still, 0.0, wound
    )[-1, 1:]

    def settled(faster):
        flow = replace(aero.inflow, rotor_speed=aero.inflow.rotor_speed + faster)
        lattice = build_lattice(
            *blade_edges(case, strip_radius(case)), aero.lattice.chordwise, flow, aero.time_step
        )
        there = assemble(
            lattice, flow, air_density=1.0, time_step=aero.time_step, wake_rows=aero.wake_rows, blades=3
        )
        return steady_circulation(there, incidence_downwash(there, camber)[:, None])[:, 0]

    slope = (settled(PITCH) - settled(-PITCH)) / (2.0 * PITCH)
    np.testing.assert_allclose(linear, slope, atol=2e-3 * np.abs(slope).max())


def test_a_faster_rotor_meets_less_wind_below_rated(flow):
    """By momentum alone, and by the helix wound more closely, whose state is the quicker one."""
    state = speed_transport(CORRECTED, flow)
    assert state.gain < 0.0
    assert state.time_constant < pitch_transport(CORRECTED, flow).time_constant


@pytest.fixture(scope="module")
def flow():
    return rigid_rotor(CORRECTED).flow


@pytest.fixture(scope="module")
def state(flow):
    return pitch_transport(CORRECTED, flow)


@pytest.fixture(scope="module")
def after_step(flow, state):
    """Time, root moment per radian with the adapting wake, with the case's own, and with it behind the state."""
    induction = 1.0 - flow.aero.inflow.wake_velocity[0] / flow.aero.inflow.velocity[0]
    slow = replace(CORRECTED.discretisation, induction=induction)
    long_case = march_case(replace(CORRECTED, discretisation=slow), 2.0)
    aero, own = build_aerodynamics(long_case), build_aerodynamics(CORRECTED)
    pressure = flow.loads.thrust / flow.loads.thrust_coefficient
    slowing = 11.0 * momentum_slope(flow.loads.thrust_coefficient) / pressure
    load = np.concatenate([thrust_load(aero), root_moment_load(aero, long_case)])
    step = np.ones(aero.wake_rows)
    adapting = adapting_wake_response(
        aero, flow.shed, step, pitch_downwash(aero), load, np.zeros(2), slowing
    )[:, 1]
    struck = np.column_stack([pitch_downwash(own), gust_downwash(own).sum(axis=1)])
    fixed, gust = collective_responses(own, step, struck, root_moment_load(own, CORRECTED)).T
    lagged = state.state_space(aero.time_step, "pitch").simulate(gust[:, None])[:, 0] - gust
    return np.arange(len(adapting)) * aero.time_step, adapting, fixed, fixed + lagged


def test_short_wake_behind_the_state_follows_the_adapting_wake(after_step):
    time, adapting, _, ours = after_step
    later = time > 0.1
    np.testing.assert_allclose(ours[later], adapting[later], rtol=0.045)
    assert ours[-1] == pytest.approx(adapting[-1], rel=0.01)


def test_pitch_begins_with_the_fixed_wake_s_load_and_ends_a_fifth_below(after_step):
    time, adapting, fixed, ours = after_step
    early = (time > 0.05) & (time < 0.3)
    np.testing.assert_allclose(ours[early], fixed[early], rtol=0.01)
    assert ours[-1] / fixed[-1] == pytest.approx(0.815, abs=0.01)
    assert adapting[-1] / fixed[-1] == pytest.approx(0.815, abs=0.01)


def test_time_constant_lies_between_an_actuator_disk_s_and_that_of_oye_s_far_wake(flow, state):
    """The disk's with the air it carries along (Carpenter and Fridovich, NACA TN 3044, 1953), 8/3 rho R^3, linearised
    as 4 R / (3 pi U (1 - 2 a)); Oye's slower one 1.1 / (1 - 1.3 a) R / U (Hansen, Aerodynamics of Wind Turbines)."""
    radius, wind = CORRECTED.turbine.rotor.radius, flow.aero.inflow.velocity[0]
    induction = 1.0 - flow.aero.inflow.wake_velocity[0] / wind
    disk = 4.0 * radius / (3.0 * np.pi * wind * (1.0 - 2.0 * induction))
    far_wake = 1.1 / (1.0 - 1.3 * induction) * radius / wind
    assert disk < state.time_constant < far_wake


def test_state_of_pitch_does_not_depend_on_the_size_of_the_march(flow, state):
    fine, longer = (
        pitch_transport(WHOLE, flow, panels=6),
        pitch_transport(CORRECTED, flow, wake_length=3.0),
    )
    assert fine.gain == pytest.approx(state.gain, rel=0.005)
    assert fine.time_constant == pytest.approx(state.time_constant, rel=0.005)
    assert longer.gain == pytest.approx(state.gain, rel=0.01)
    assert longer.time_constant == pytest.approx(state.time_constant, rel=0.02)


def test_slow_flow_at_the_same_tip_speed_ratio_has_half_the_velocity_and_twice_the_lag(state):
    point, grid = CORRECTED.operating_point, CORRECTED.discretisation
    half = replace(
        CORRECTED,
        operating_point=replace(point, wind_speed=0.5 * point.wind_speed),
        discretisation=replace(grid, time_step=2.0 * grid.time_step),
    )
    slow = pitch_transport(half, rigid_rotor(half).flow)
    assert slow.gain == pytest.approx(0.5 * state.gain, rel=1e-3)
    assert slow.time_constant == pytest.approx(2.0 * state.time_constant, rel=1e-3)
