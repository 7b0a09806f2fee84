"""Weighted truncation against the bound it must keep and systems whose answer is known."""

import numpy as np
import pytest
import scipy.linalg

from flapgym.core.state_space import StateSpace, series
from flapgym.reduction import balance, output_rms, relative_error

DT = 0.1


def system(order=12, inputs=2, outputs=2, seed=1):
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((order, order))
    A *= 0.9 / np.abs(np.linalg.eigvals(A)).max()
    B, C = rng.standard_normal((order, inputs)), rng.standard_normal((outputs, order))
    return StateSpace(A, B, C, np.zeros((outputs, inputs)), DT, ("a", "b"), ("y", "z"))


def white(names=("a", "b")):
    """No shaping: the inputs are white noise themselves."""
    n = len(names)
    return StateSpace(
        np.zeros((0, 0)),
        np.zeros((0, n)),
        np.zeros((n, 0)),
        np.eye(n),
        DT,
        tuple(f"w_{x}" for x in names),
        names,
    )


def lowpass():
    a = 0.95 * np.eye(2)
    return StateSpace(a, np.eye(2), np.eye(2), np.zeros((2, 2)), DT, ("w_a", "w_b"), ("a", "b"))


def test_values_under_white_noise_are_the_hankel_singular_values_of_the_scaled_system():
    full = system()
    scale = np.diag(1.0 / output_rms(series(white(), full)))
    control = scipy.linalg.solve_discrete_lyapunov(full.A, full.B @ full.B.T)
    observe = scipy.linalg.solve_discrete_lyapunov(full.A.T, full.C.T @ scale @ scale @ full.C)
    expected = np.sqrt(np.sort(np.linalg.eigvals(control @ observe).real)[::-1])
    values = balance(full, white()).values
    np.testing.assert_allclose(values[:8], expected[:8], rtol=1e-6)


def test_all_states_kept_reproduce_the_system():
    full = system()
    reduced = balance(full, lowpass()).truncated(full.order)
    f = np.array([0.01, 0.3, 2.0, 4.5])
    np.testing.assert_allclose(
        reduced.frequency_response(f), full.frequency_response(f), rtol=1e-6, atol=1e-8
    )


@pytest.mark.parametrize("order", [3, 6, 9])
def test_steady_gain_is_exact_at_any_order(order):
    full = system()
    reduced = balance(full, lowpass()).truncated(order)
    np.testing.assert_allclose(reduced.dc_gain(), full.dc_gain(), rtol=1e-9)


def test_relative_error_is_what_a_simulation_measures():
    full = system()
    reduced = balance(full, lowpass()).truncated(5)
    noise = np.random.default_rng(0).standard_normal((200_000, 2))
    u = lowpass().simulate(noise)
    y, approximate = full.simulate(u), reduced.simulate(u)
    measured = np.sqrt(((y - approximate) ** 2).mean(axis=0) / (y**2).mean(axis=0))
    np.testing.assert_allclose(relative_error(full, reduced, lowpass()), measured, rtol=0.03)


def test_order_out_of_range_is_refused():
    with pytest.raises(ValueError, match=r"order: expected 1 <= order <= 12, got 13"):
        balance(system(), white()).truncated(13)
