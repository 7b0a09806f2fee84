"""Exported models answer as the model does, in the hands of other programs."""

import numpy as np
import pytest
import scipy.io
import scipy.signal

from flapgym.aeroelastic import load_model
from flapgym.aeroelastic.export import save_mat, to_control, to_dlti

BLADE = load_model("nrel5mw-rated").blade
FREQUENCY = np.array([0.05, 0.5, 2.0])


def test_python_control_gives_the_same_response_under_the_same_names():
    system = to_control(BLADE)
    assert (tuple(system.input_labels), tuple(system.output_labels)) == (BLADE.inputs, BLADE.outputs)
    response = system(np.exp(2j * np.pi * FREQUENCY * BLADE.time_step))
    np.testing.assert_allclose(np.moveaxis(response, -1, 0), BLADE.frequency_response(FREQUENCY), rtol=1e-6)


def test_scipy_simulates_the_same_step():
    u = np.zeros((200, 3))
    u[:, 2] = 1.0
    _, y, _ = scipy.signal.dlsim(to_dlti(BLADE), u)
    np.testing.assert_allclose(y, BLADE.simulate(u), rtol=1e-8, atol=1e-6)


def test_matlab_file_holds_matrices_names_and_hash(tmp_path):
    model = load_model("nrel5mw-rated")
    save_mat(model, tmp_path / "model.mat")
    content = scipy.io.loadmat(tmp_path / "model.mat", simplify_cells=True)
    np.testing.assert_array_equal(content["turbine"]["A"], model.turbine.A)
    assert list(content["blade"]["InputName"]) == list(BLADE.inputs)
    assert content["hash"] == model.hash
    assert content["turbine"]["Ts"] == pytest.approx(0.007)
