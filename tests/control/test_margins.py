"""Margins against loops whose margin is known, and against the closed loop itself."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import block_diag

from flapgym.control import Weights, closed_loop, design_model, stability, synthesise
from flapgym.control.channels import BLADE
from flapgym.control.closed_loop import _in_frame
from flapgym.control.margins import DiskMargin, delay_margin, disk_margin, late_measurement
from flapgym.state_space import StateSpace
from tests.synthetic import synthetic_model

MODEL = synthetic_model()
CONTROLLER = synthesise(design_model(MODEL), Weights(rbm=3.0))


def test_no_control_bears_everything():
    idle = StateSpace(
        np.zeros((1, 1)),
        np.zeros((1, 3)),
        np.zeros((1, 1)),
        np.zeros((1, 3)),
        0.007,
        BLADE.inputs,
        BLADE.outputs,
    )
    margin = disk_margin(MODEL, idle)
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
    model = replace(MODEL, turbine=_with_narrow_mode(MODEL.turbine))
    bears = stability(model, CONTROLLER).effectiveness_margin
    assert bears == pytest.approx(1.35, abs=0.05)
    margin = disk_margin(model, CONTROLLER)
    assert margin.gain[1] <= bears + 0.01
    assert margin.frequency == pytest.approx(NARROW, abs=0.01)


NARROW = 1.787
"""Frequency of a mode between two of the grid [Hz]."""


def _with_narrow_mode(turbine):
    """Moved by the collective flap angle, seen in the collective moment; half a millihertz wide."""
    pole = np.exp(2j * np.pi * NARROW * (1.0 + 1.4e-4j) * MODEL.time_step)
    seen = 10.0 * np.exp(4.0j)
    b, c = np.zeros((2, len(turbine.inputs))), np.zeros((len(turbine.outputs), 2))
    b[0, turbine.inputs.index("flap_angle_0")] = 1.0
    c[turbine.outputs.index("rbm_0")] = seen.real, seen.imag
    return replace(
        turbine,
        A=block_diag(turbine.A, [[pole.real, -pole.imag], [pole.imag, pole.real]]),
        B=np.vstack([turbine.B, b]),
        C=np.hstack([turbine.C, c]),
    )


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


def test_the_delay_margin_is_where_stability_ends():
    fierce = synthesise(design_model(MODEL), Weights(rbm=1e3, acceleration=1e-4))
    steps = delay_margin(MODEL, fierce)
    assert 0 < steps < 60
    for delay, stable in ((steps, True), (steps + 1, False)):
        late = late_measurement(fierce, delay, MODEL.rotor_speed)
        assert (closed_loop(MODEL, late).spectral_radius() < 1.0) == stable
