"""Margins against loops whose margin is known, and against the closed loop itself."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flapgym.control import Weights, closed_loop, design_model, stability, synthesise
from flapgym.control.channels import BLADE
from flapgym.control.closed_loop import _in_frame
from flapgym.control.margins import (
    DiskMargin,
    delay_margin,
    disk_margin,
    late_measurement,
    sensitivity_difference,
)
from flapgym.core.state_space import StateSpace
from tests.loops import NARROW, radius_at_worst, searched_peak, with_narrow_mode
from tests.synthetic import synthetic_model

MODEL = synthetic_model()
CONTROLLER = synthesise(design_model(MODEL), Weights(rbm=3.0))


def _blade_gains(*gains):
    """A controller of one blade without memory: gains on moment, angle and rate."""
    empty = np.zeros((1, 1)), np.zeros((1, 3)), np.zeros((1, 1))
    return StateSpace(*empty, np.array([gains]), MODEL.time_step, BLADE.inputs, BLADE.outputs)


def test_a_flap_that_is_held_and_answers_no_moment_bears_everything():
    margin = disk_margin(MODEL, _blade_gains(0.0, -400.0, -30.0))
    assert margin.alpha == pytest.approx(2.0)
    assert margin.gain == (0.0, np.inf)
    assert margin.phase == pytest.approx(np.pi / 2)


def test_gain_and_phase_of_a_margin_of_one():
    margin = DiskMargin(1.0, 0.5)
    assert margin.gain == pytest.approx((1.0 / 3.0, 3.0))
    assert np.rad2deg(margin.phase) == pytest.approx(53.13, abs=0.01)


def test_the_loop_is_stable_for_every_gain_within_the_margin():
    fierce = synthesise(design_model(MODEL), Weights(rbm=1e3, acceleration=1e-4))
    margin = disk_margin(MODEL, fierce)
    for gain in np.geomspace(*margin.gain, 7):
        assert closed_loop(MODEL, fierce, float(gain)).spectral_radius() < 1.0


def test_a_mode_far_narrower_than_the_grid_is_seen():
    """With a mode that hardly decays and hardly moves, the loop bears 1.35 times the flaps' effect and no more."""
    model = replace(MODEL, turbine=with_narrow_mode(MODEL.turbine))
    bears = stability(model, CONTROLLER).effectiveness_margin
    assert bears == pytest.approx(1.35, abs=0.05)
    margin = disk_margin(model, CONTROLLER)
    assert margin.gain[1] <= bears + 0.01
    assert margin.frequency == pytest.approx(NARROW, abs=0.01)


@settings(max_examples=20, deadline=None, derandomize=True)
@given(
    frequency=st.floats(0.3, 6.0),
    damping=st.floats(-4.5, -2.5).map(lambda power: 10.0**power),
    seen=st.tuples(st.floats(0.0, 2.0), st.floats(0.0, 6.28)),
)
def test_the_margin_is_that_of_the_highest_peak_beside_any_mode_of_the_loop(frequency, damping, seen):
    """Against gains read densely about every mode of the closed loop and climbed from there."""
    size, phase = 4e4 * damping * frequency * seen[0], seen[1]
    model = replace(
        MODEL, turbine=with_narrow_mode(MODEL.turbine, frequency, damping, size * np.exp(1j * phase))
    )
    loop = closed_loop(model, CONTROLLER)
    margin = disk_margin(model, CONTROLLER)
    if loop.spectral_radius() >= 1.0:
        assert margin.alpha == 0.0
        return
    assert 0.0 < margin.alpha <= 2.0
    difference = sensitivity_difference(loop)
    poles = np.linalg.eigvals(difference.A)
    poles = np.log(poles[poles.imag > 0.0])
    poles = poles[-poles.real < 0.1 * np.abs(poles)]
    near = (poles.imag[:, None] + poles.real[:, None] * np.linspace(-6.0, 6.0, 97)).ravel()
    nodes = np.union1d(np.clip(near, 0.0, np.pi), np.linspace(0.0, np.pi, 700))
    assert margin.alpha == pytest.approx(2.0 / searched_peak(difference, nodes), rel=3e-6)


def test_the_margin_is_the_same_seen_from_either_frame():
    """Scaled multi-blade components keep the sum of squares: three copies of a controller on uncoupled blades."""
    loose = synthetic_model(tower_coupling=0.0)
    controller = synthesise(design_model(loose), Weights(rbm=30.0))
    together = disk_margin(loose, controller)
    blade = loose.blade
    dt, m = loose.time_step, controller.order
    kick = np.array([[0.5 * dt**2], [dt]])
    a = np.block(
        [
            [np.array([[1.0, dt], [0.0, 1.0]]) + kick @ controller.D[:, 1:], kick @ controller.C],
            [controller.B[:, 1:], controller.A],
        ]
    )
    flap = StateSpace(a, np.vstack([kick @ controller.D[:, :1], controller.B[:, :1]]), np.eye(2, m + 2),
                      np.zeros((2, 1)), dt, ("rbm",), ("flap_angle", "flap_rate"))  # fmt: skip
    frequency = np.geomspace(0.01, 30.0, 2000)
    plant = blade.select(["flap_angle", "flap_rate"], ["rbm"]).frequency_response(frequency)
    loop = -(plant @ flap.frequency_response(frequency))[:, 0, 0]
    alone = 2.0 / np.abs((1.0 - loop) / (1.0 + loop)).max()
    assert together.alpha == pytest.approx(alone, rel=0.01)


def test_a_late_measurement_answers_so_many_steps_later():
    rng = np.random.default_rng(0)
    moments = np.hstack([rng.standard_normal((60, 1)), np.zeros((60, 2))])
    on_time = CONTROLLER.simulate(moments)
    late = late_measurement(CONTROLLER, 3, MODEL.rotor_speed).simulate(moments)
    np.testing.assert_allclose(late[3:], on_time[:-3], atol=1e-12)
    np.testing.assert_array_equal(late[:3], 0.0)


def test_a_delay_in_the_blades_is_the_same_delay_in_multi_blade_coordinates():
    late_copies = _in_frame(late_measurement(CONTROLLER, 4, MODEL.rotor_speed), MODEL, MODEL.turbine)
    copies_late = late_measurement(_in_frame(CONTROLLER, MODEL, MODEL.turbine), 4, MODEL.rotor_speed)
    frequency = [0.05, 0.5, 3.0]
    np.testing.assert_allclose(
        late_copies.frequency_response(frequency),
        copies_late.frequency_response(frequency),
        rtol=1e-8,
        atol=1e-9,
    )


def test_an_unstable_loop_has_no_margin_of_any_kind():
    wild = _blade_gains(2e-4, -400.0, -30.0)
    loop = closed_loop(MODEL, wild)
    values = np.linalg.eigvals(loop.A)
    fastest = values[np.abs(values).argmax()]
    assert abs(fastest) > 1.001
    margin = disk_margin(MODEL, wild)
    assert margin.alpha == margin.phase == 0.0
    assert margin.gain == (1.0, 1.0)
    assert margin.frequency == pytest.approx(abs(np.angle(fastest)) / (2.0 * np.pi * MODEL.time_step))
    assert delay_margin(MODEL, wild) == 0
    assert stability(MODEL, wild).effectiveness_margin == 0.0


def test_a_loop_that_only_a_delay_makes_stable_has_no_delay_margin():
    """The phase in which a mode is seen is turned until it grows on time and decays a step late."""

    def radius(model, delay):
        return closed_loop(model, late_measurement(CONTROLLER, delay, model.rotor_speed)).spectral_radius()

    for phase in np.linspace(0.0, 2.0 * np.pi, 200):
        model = replace(
            MODEL, turbine=with_narrow_mode(MODEL.turbine, seen=20.0 * np.exp(1j * phase), damping=1e-5)
        )
        if radius(model, 0) >= 1.0 > radius(model, 1):
            break
    else:
        pytest.fail("no phase found")
    assert delay_margin(model, CONTROLLER) == 0


def test_the_worst_matrix_within_the_margin_is_borne_and_a_little_more_makes_the_loop_grow():
    fierce = synthesise(design_model(MODEL), Weights(rbm=1e3, acceleration=1e-4))
    margin = disk_margin(MODEL, fierce)
    inside, outside = (radius_at_worst(MODEL, fierce, margin, share) for share in (0.99, 1.01))
    assert inside < 1.0 < outside


def test_the_delay_margin_is_where_stability_ends():
    fierce = synthesise(design_model(MODEL), Weights(rbm=1e3, acceleration=1e-4))
    steps = delay_margin(MODEL, fierce)
    assert 0 < steps < 60
    for delay, stable in ((steps, True), (steps + 1, False)):
        late = late_measurement(fierce, delay, MODEL.rotor_speed)
        assert (closed_loop(MODEL, late).spectral_radius() < 1.0) == stable
