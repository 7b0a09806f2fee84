"""The turbine of non-linear beams: still at its trim, linear for small inputs, departing from it in proportion."""

from dataclasses import replace

import numpy as np
import pytest

from flapgym.aeroelastic.blade_lattice import reduce_component
from flapgym.aeroelastic.build import assemble_parts
from flapgym.aeroelastic.coupling import couple, multiblade_aerodynamics
from flapgym.aeroelastic.equations import turbine_equations
from flapgym.core.multiblade import to_blades, to_components
from flapgym.turbine import load_case
from reference.nonlinear import nonlinear_turbine
from reference.nonlinear_march import NonlinearMarch

DT, STEPS = 0.025, 50


@pytest.fixture(scope="module")
def turbines():
    """The linear and the non-linear turbine of one coarse lattice."""
    case = load_case("nrel5mw-rated")
    grid = replace(case.discretisation, chordwise_panels=3, wake_length=0.1, time_step=DT)
    case = replace(case, discretisation=grid)
    parts, rotor = assemble_parts(case)
    collective, whirl = (reduce_component(rotor, parts.lattice, component, 20) for component in (0, 1))

    def seen(speed: float):
        return multiblade_aerodynamics(collective, whirl, speed, DT)

    linear = couple(turbine_equations(parts), seen(case.rotor_speed), DT)
    beams, relieved = (nonlinear_turbine(parts, seen(0.0), without) for without in (False, True))
    return case, linear, beams, relieved


@pytest.fixture(scope="module")
def runs(turbines):
    """Outputs per unit input: linear, of beams without mean load on their support, of beams at three amplitudes.

    The inputs are a gust of 1 m/s and unequal flaps.
    """
    case, linear, beams, relieved = turbines
    time = DT * np.arange(STEPS)
    wave, slope = np.sin(2.0 * time) ** 2, 2.0 * np.sin(4.0 * time)
    share = np.array([0.05, 0.0, -0.03])
    flap, rate, wind = np.outer(wave, share), np.outer(slope, share), wave[:, None]
    azimuth = case.rotor_speed * time
    y = linear.simulate(np.hstack([to_components(flap, azimuth), to_components(rate, azimuth), wind]))
    linear_run = np.hstack([to_blades(y[:, :3], azimuth), to_blades(y[:, 3:6], azimuth), y[:, 6:]])
    inputs = np.hstack([flap, rate, wind])

    def march(turbine, amplitude):
        steps = NonlinearMarch(turbine)
        return np.array([steps.step(amplitude * now) for now in inputs]) / amplitude

    return linear_run, march(relieved, 0.02), {a: march(beams, a) for a in (0.02, 0.5, 1.0)}


def apart(one, other, scale):
    """Rms of the difference of two runs for root moment, tip, tower fore-aft and side-to-side, over that of a third."""
    groups = (slice(0, 3), slice(3, 6), slice(6, 7), slice(7, 8))
    return np.array([np.linalg.norm((one - other)[:, g]) / np.linalg.norm(scale[:, g]) for g in groups])


def test_without_inputs_the_beams_stay_at_the_trim(turbines):
    steps = NonlinearMarch(turbines[2])
    outputs = np.array([steps.step(np.zeros(7)) for _ in range(5)])
    assert np.abs(outputs[:, :3]).max() < 1.0  # N m, of some 10 MN m
    assert np.abs(outputs[:, 3:]).max() < 1e-8


def test_small_inputs_give_the_linear_turbine(runs):
    linear, relieved, _ = runs
    # What is left is the time step's and the blade modes' left out.
    assert apart(relieved, linear, linear).max() < 5e-4


def test_mean_thrust_and_torque_on_the_support_move_little(runs):
    linear, _, marched = runs
    assert (apart(marched[0.02], linear, linear) < [0.001, 0.001, 0.002, 0.01]).all()


def test_what_departs_from_the_linear_turbine_grows_with_the_amplitude(runs):
    linear, _, marched = runs
    half, whole = (apart(marched[amplitude], marched[0.02], linear) for amplitude in (0.5, 1.0))
    expected = (1.0 - 0.02) / (0.5 - 0.02)
    np.testing.assert_allclose(whole / half, expected, rtol=0.1)
    assert (whole < 0.01).all()


def test_a_march_taken_up_again_goes_on_as_it_would_have(turbines):
    inputs = np.outer(np.linspace(0.0, 1.0, 6), [0.05, 0.0, -0.03, 0.4, 0.0, -0.2, 1.0])
    whole, first, second = (NonlinearMarch(turbines[2]) for _ in range(3))
    expected = [whole.step(now) for now in inputs]
    for now in inputs[:3]:
        first.step(now)
    second.restore(first.snapshot())
    for now, then in zip(inputs[3:], expected[3:], strict=True):
        np.testing.assert_allclose(second.step(now), then, rtol=1e-6, atol=1e-9)


def test_a_pitched_rotor_is_refused_by_name(turbines):
    beams = turbines[2]
    case = beams.parts.case
    pitched = replace(case, operating_point=replace(case.operating_point, pitch=0.1))
    with pytest.raises(ValueError, match="operating_point.pitch"):
        nonlinear_turbine(replace(beams.parts, case=pitched), beams.lattice)
