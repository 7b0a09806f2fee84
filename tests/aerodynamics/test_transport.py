"""The wake that moves with the wind: its linearisation, and the state that stands for it."""

from dataclasses import replace

import numpy as np
import pytest

from flapgym.aerodynamics import (
    build_aerodynamics,
    collective_response,
    flap_downwash,
    gust_downwash,
    mean_loads,
    root_moment_load,
    steady_circulation,
    steady_response,
)
from flapgym.aerodynamics.lattice import build_lattice
from flapgym.aerodynamics.model import assemble
from flapgym.aerodynamics.rotor import blade_edges, strip_radius
from flapgym.aerodynamics.steady import incidence_downwash
from flapgym.aerodynamics.transport import (
    WakeState,
    displaced_wake_downwash,
    march_case,
    moving_wake_response,
    wake_displacement,
    wake_transport,
)

# Root moment per m/s from 11 to 12 m/s, rigid rotor, by OpenFAST's free vortex wake: at its peak and in the end [MN m].
FREE_WAKE = 0.887, 0.845
FREE_WAKE_FLAP = 0.116  # per degree of flap, in the end [MN m]
DURATION = 20.0


@pytest.fixture(scope="module")
def long_case(case):
    return march_case(case, 2.0)


@pytest.fixture(scope="module")
def long_wake(long_case):
    return build_aerodynamics(long_case)


@pytest.fixture(scope="module")
def shed(long_case, long_wake):
    return mean_loads(long_case, long_wake).circulation[-long_wake.lattice.strips :]


@pytest.fixture(scope="module")
def states(case, shed):
    return wake_transport(case, shed)


@pytest.fixture(scope="module")
def state(states):
    """Of the wind."""
    return states.wind


@pytest.fixture(scope="module")
def moving(long_case, long_wake, shed):
    """Times and root moment after a step of wind that carries two diameters of wake along."""
    wind = np.ones(round(DURATION / long_wake.time_step))
    moment = moving_wake_response(long_wake, shed, wind, root_moment_load(long_wake, long_case))[:, 0]
    return np.arange(len(wind)) * long_wake.time_step, moment


def fixed_step(case, aero):
    """Times and root moment after a step of wind that strikes the blades alone."""
    wind = np.ones((round(DURATION / aero.time_step), 1))
    gust = gust_downwash(aero).sum(axis=1, keepdims=True)
    return np.arange(len(wind)) * aero.time_step, collective_response(
        aero, wind, gust, root_moment_load(aero, case)
    )


@pytest.fixture(scope="module")
def short_and_state(case, rotor, state):
    """The same by the case's own lattice behind the state."""
    time, moment = fixed_step(case, rotor)
    return time, state.state_space(rotor.time_step, "wind").simulate(moment)[:, 0]


def end_over_peak(response):
    time, moment = response
    return moment[-1] / moment[time > 0.2].max()


def test_steady_answer_is_the_slope_over_the_pitch_of_the_helix(case):
    """The mean circulation solved anew in a helix carried a little faster and slower, against the linear part."""
    short = march_case(case, 0.5)
    aero = build_aerodynamics(short)
    camber = incidence_downwash(aero, np.full(aero.lattice.strips, -0.06))[:, None]

    def circulation(faster):
        flow = replace(aero.inflow, wake_velocity=aero.inflow.wake_velocity + [faster, 0.0, 0.0])
        edges = blade_edges(short, strip_radius(short))
        lattice = build_lattice(*edges, aero.lattice.chordwise, flow, aero.time_step)
        size = {"time_step": aero.time_step, "wake_rows": aero.wake_rows, "blades": 3}
        return steady_circulation(assemble(lattice, flow, air_density=1.0, **size), camber)[:, 0]

    slope = (circulation(0.01) - circulation(-0.01)) / 0.02
    last = circulation(0.0)[-aero.lattice.strips :]
    ages = (np.arange(aero.wake_rows + 1) + 0.25) * aero.time_step
    linear = steady_circulation(aero, (displaced_wake_downwash(aero, last) @ ages)[:, None])[:, 0]
    np.testing.assert_allclose(linear, slope, atol=1e-4 * np.abs(slope).max())


def test_rows_are_carried_by_the_wind_since_they_were_shed():
    step = 0.02
    time = np.arange(400) * step
    moved = wake_displacement(np.sin(time), step, 50)
    age = (np.arange(51) + 0.25) * step
    since = np.maximum(time[:, None] - age, 0.0)
    np.testing.assert_allclose(moved, np.cos(since) - np.cos(time)[:, None], atol=1e-4)


def test_short_wake_behind_the_state_follows_the_moving_wake(moving, short_and_state):
    time, moment = short_and_state
    wanted = np.interp(time, *moving)
    from_start = time > 0.1
    np.testing.assert_allclose(moment[from_start], wanted[from_start], rtol=0.025)
    assert moment[-1] == pytest.approx(wanted[-1], rel=0.01)


def test_moving_wake_falls_after_its_peak_as_the_free_wake_does(moving):
    assert end_over_peak(moving) == pytest.approx(FREE_WAKE[1] / FREE_WAKE[0], abs=0.01)


def test_short_wake_behind_the_state_falls_after_its_peak_as_the_free_wake_does(short_and_state):
    assert end_over_peak(short_and_state) == pytest.approx(FREE_WAKE[1] / FREE_WAKE[0], abs=0.01)


def test_a_long_fixed_wake_falls_far_more(long_case, long_wake):
    time, moment = fixed_step(long_case, long_wake)
    assert end_over_peak((time, moment[:, 0])) < FREE_WAKE[1] / FREE_WAKE[0] - 0.08


def test_state_does_not_depend_on_the_size_of_the_march(case, state, shed):
    fine = wake_transport(case, shed, panels=6).wind
    assert fine.gain == pytest.approx(state.gain, rel=0.005)
    assert fine.time_constant == pytest.approx(state.time_constant, rel=0.02)
    longer = wake_transport(case, shed, wake_length=3.0).wind
    assert longer.gain == pytest.approx(state.gain, rel=0.02)


def test_slow_flow_at_the_same_tip_speed_ratio_has_the_same_gain_and_a_lag_longer_in_proportion(
    case, states, shed
):
    half = replace(
        case,
        operating_point=replace(case.operating_point, wind_speed=0.5 * case.operating_point.wind_speed),
        discretisation=replace(case.discretisation, time_step=2.0 * case.discretisation.time_step),
    )
    slow = wake_transport(half, 0.5 * shed)
    for ours, theirs in ((slow.wind, states.wind), (slow.flaps[0], states.flaps[0])):
        assert ours.gain == pytest.approx(theirs.gain, rel=1e-5)
        assert ours.time_constant == pytest.approx(2.0 * theirs.time_constant, rel=1e-3)


def test_state_is_exact_for_a_wind_that_is_linear_between_steps():
    step, lag = 0.3, 0.8
    system = WakeState(gain=0.1, time_constant=lag, misfit=0.0).state_space(step, "wind")
    time = np.arange(40) * step
    ramp = system.simulate(time[:, None])[:, 0]
    np.testing.assert_allclose(ramp, time + 0.1 * (time - lag * (1.0 - np.exp(-time / lag))), atol=1e-12)
    assert system.dc_gain().item() == pytest.approx(1.1)


def test_state_takes_off_a_steady_flap_what_a_free_wake_does(case, rotor, states):
    turned = flap_downwash(rotor, case.flaps[0])[0][:, None]
    moment = steady_response(rotor, turned, root_moment_load(rotor, case)).item() * np.radians(1.0) / 1e6
    assert moment == pytest.approx(1.07 * FREE_WAKE_FLAP, rel=0.01)
    assert moment * (1.0 + states.flaps[0].gain) == pytest.approx(FREE_WAKE_FLAP, rel=0.01)


def test_flap_s_state_follows_a_long_fixed_wake(case, rotor, long_case, long_wake, states):
    """Slow angles alone are taken down: a flap moves no wake."""
    moments = []
    for of, aero in ((case, rotor), (long_case, long_wake)):
        step = np.ones((round(DURATION / aero.time_step), 1))
        turned = flap_downwash(aero, case.flaps[0])[0][:, None]
        moments.append(collective_response(aero, step, turned, root_moment_load(aero, of)))
    ours = states.flaps[0].state_space(rotor.time_step, "flap").simulate(moments[0])[:, 0]
    time, late = (np.arange(len(m)) * a.time_step for m, a in zip(moments, (rotor, long_wake), strict=True))
    wanted = np.interp(time, late, moments[1][:, 0])
    np.testing.assert_allclose(ours[time > 0.1], wanted[time > 0.1], rtol=0.02)
