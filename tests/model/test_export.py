"""Exported models answer as the model does, in the hands of other programs, or are handed out with a warning."""

import warnings

import control
import numpy as np
import pytest
import scipy.io
import scipy.signal

from flapgym.model import load_model
from flapgym.model.export import (
    ExportWarning,
    reduced_blade,
    save_mat,
    to_control,
    to_dlti,
    to_frd,
    to_zpk,
)

MODEL = load_model("nrel5mw-rated")
BLADE = MODEL.blade
FREQUENCY = np.geomspace(0.01, 20.0, 50)
RADIANS = 2.0 * np.pi * FREQUENCY


def _relative(found, exact):
    """Largest error of a channel of (nf, ny, nu) responses over the channel's largest response."""
    return (np.abs(found - exact).max(axis=0) / np.abs(exact).max(axis=0)).max()


def test_python_control_gives_the_same_response_under_the_same_names():
    with pytest.warns(ExportWarning, match="ss2tf, tf and balred .* at order 76: take"):
        system = to_control(BLADE)
    assert (tuple(system.input_labels), tuple(system.output_labels)) == (BLADE.inputs, BLADE.outputs)
    response = system.frequency_response(RADIANS).complex
    assert _relative(np.moveaxis(response, -1, 0), BLADE.frequency_response(FREQUENCY)) < 1e-9


def test_frequency_response_data_are_those_of_the_system():
    data = to_frd(BLADE, FREQUENCY)
    assert isinstance(data, control.FrequencyResponseData)
    assert (tuple(data.input_labels), tuple(data.output_labels)) == (BLADE.inputs, BLADE.outputs)
    np.testing.assert_allclose(data.omega, RADIANS)
    np.testing.assert_array_equal(np.moveaxis(data.complex, -1, 0), BLADE.frequency_response(FREQUENCY))
    with pytest.raises(
        ValueError, match=r"to_frd.frequency: expected a frequency from 0 to 71.4\d* Hz, got 80 Hz"
    ):
        to_frd(BLADE, [1.0, 80.0])


@pytest.mark.parametrize(
    "system",
    [BLADE, MODEL.turbine.select(["flap_angle_c", "wind"], ["rbm_c", "tower_side_side"])],
    ids=["blade", "turbine"],
)
def test_poles_and_zeros_of_every_channel_give_its_response_in_scipy(system):
    exact = system.frequency_response(FREQUENCY)
    channels = to_zpk(system)
    assert set(channels) == {(output, source) for output in system.outputs for source in system.inputs}
    for (output, source), channel in channels.items():
        _, response = channel.freqresp(RADIANS * system.time_step)
        wanted = exact[:, system.outputs.index(output), system.inputs.index(source)]
        assert np.abs(response - wanted).max() < 1e-6 * np.abs(wanted).max()


def test_scipy_simulates_the_same_step_and_is_handed_out_with_a_warning_of_its_frequency_responses():
    u = np.zeros((200, 3))
    u[:, 2] = 1.0
    with pytest.warns(ExportWarning, match="scipy's freqresp, bode and to_tf .* at order 76"):
        system = to_dlti(BLADE)
    _, y, _ = scipy.signal.dlsim(system, u)
    np.testing.assert_allclose(y, BLADE.simulate(u), rtol=1e-8, atol=1e-6)


def test_what_the_warning_says_of_scipy_is_so():
    channel = BLADE.select(["flap_angle"], ["rbm"])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        _, wrong = to_dlti(channel).freqresp(RADIANS * channel.time_step)
    exact = channel.frequency_response(FREQUENCY)[:, 0, 0]
    assert np.abs(20.0 * np.log10(np.abs(wrong / exact))).max() > 20.0


def test_a_small_system_is_handed_out_without_a_warning_and_answers_as_itself_everywhere():
    small = reduced_blade(MODEL, 0.05)
    assert small.order <= 6
    for source in small.inputs:
        channel = small.select([source], ["rbm"])
        exact = channel.frequency_response(FREQUENCY)[:, 0, 0]
        _, in_scipy = to_dlti(channel).freqresp(RADIANS * channel.time_step)
        through_tf = control.ss2tf(to_control(channel))(np.exp(1j * RADIANS * channel.time_step))
        np.testing.assert_allclose(in_scipy, exact, rtol=2e-3)
        np.testing.assert_allclose(through_tf, exact, rtol=2e-3)


def test_a_reduced_blade_answers_turbulence_and_flap_within_its_tolerance():
    small = reduced_blade(MODEL, 1e-3)
    assert small.order < 0.4 * BLADE.order
    np.testing.assert_allclose(small.dc_gain(), BLADE.dc_gain(), rtol=1e-9)
    below = FREQUENCY[FREQUENCY < 1.5]
    assert _relative(small.frequency_response(below), BLADE.frequency_response(below)) < 0.02


def test_matlab_file_holds_matrices_names_and_hash(tmp_path):
    save_mat(MODEL, tmp_path / "model.mat")
    content = scipy.io.loadmat(tmp_path / "model.mat", simplify_cells=True)
    np.testing.assert_array_equal(content["turbine"]["A"], MODEL.turbine.A)
    assert list(content["blade"]["InputName"]) == list(BLADE.inputs)
    assert content["hash"] == MODEL.hash
    assert content["turbine"]["Ts"] == pytest.approx(0.007)
