"""The modal form is the same system, or it is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flapgym.core.modal import modal_form
from flapgym.core.state_space import StateSpace
from tests.synthetic import synthetic_turbine


def test_the_frequency_response_is_kept():
    system = synthetic_turbine()
    modal = modal_form(system)
    frequency = np.geomspace(0.01, 60.0, 40)
    z = np.exp(2j * np.pi * frequency * system.time_step)
    # Response of z' = l z + b u read by Re(c z): c b / (s - l) and its mirror image, halved.
    near = np.einsum("ym,fm,mu->fyu", modal.C, 1 / (z[:, None] - modal.values), modal.B)
    far = np.einsum("ym,fm,mu->fyu", modal.C.conj(), 1 / (z[:, None] - modal.values.conj()), modal.B.conj())
    expected = system.frequency_response(frequency)
    scale = np.abs(expected).max(axis=(0, 2))[None, :, None]
    assert (np.abs((near + far) / 2 + modal.D - expected) / scale).max() < 1e-10


def test_a_defective_matrix_is_refused_with_its_condition_number():
    jordan = np.array([[0.9, 1.0], [0.0, 0.9]])
    system = StateSpace(jordan, np.ones((2, 1)), np.ones((1, 2)), np.zeros((1, 1)), 0.007, ("u",), ("y",))
    with pytest.raises(ValueError, match="condition number"):
        modal_form(system)


def test_an_unstable_system_is_refused():
    system = synthetic_turbine()
    with pytest.raises(ValueError, match="stable"):
        modal_form(replace(system, A=1.01 * system.A))


def test_the_closed_form_covariance_solves_the_lyapunov_equation():
    system = synthetic_turbine().select(inputs=["wind"])
    covariance = modal_form(system).stationary_covariance()
    residual = system.A @ covariance @ system.A.T + system.B @ system.B.T - covariance
    scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance))).max()
    assert np.abs(residual).max() < 1e-10 * scale
