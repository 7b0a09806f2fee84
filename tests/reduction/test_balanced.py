"""Balanced reduction against dense Gramian-based balancing and the properties it promises."""

import numpy as np
import pytest
import scipy.linalg

from flapgym.reduction import balanced_reduction

SAMPLES = 1024
Z = np.exp(2j * np.pi * np.arange(SAMPLES) / SAMPLES)


def random_system(order, inputs, outputs, *, real, seed=0, radius=0.95):
    """A stable random system whose impulse response dies out within the window."""
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((order, order)) + (0 if real else 1j * rng.standard_normal((order, order)))
    A = A * radius / np.abs(np.linalg.eigvals(A)).max()
    B = rng.standard_normal((order, inputs)) + (0 if real else 1j * rng.standard_normal((order, inputs)))
    C = rng.standard_normal((outputs, order))
    return A, B, C, rng.standard_normal((outputs, inputs))


def response(system, z=Z):
    A, B, C, D = system
    return np.stack([C @ np.linalg.solve(zk * np.eye(len(A)) - A, B) + D for zk in z])


def hankel_singular_values(A, B, C):
    controllability = scipy.linalg.solve_discrete_lyapunov(A, B @ B.conj().T)
    observability = scipy.linalg.solve_discrete_lyapunov(A.conj().T, C.conj().T @ C)
    squares = np.linalg.eigvals(controllability @ observability).real
    return np.sqrt(np.sort(np.maximum(squares, 0.0))[::-1])


@pytest.mark.parametrize("real", [True, False])
def test_singular_values_are_those_of_the_gramians(real):
    system = random_system(40, 3, 2, real=real)
    reduced = balanced_reduction(response(system), 8, np.ones(3), np.ones(2), real=real, block_rows=400)
    exact = hankel_singular_values(*system[:3])
    np.testing.assert_allclose(reduced.hankel_singular_values[:8], exact[:8], rtol=1e-6)


@pytest.mark.parametrize("real", [True, False])
def test_error_stays_within_twice_the_sum_of_the_discarded_singular_values(real):
    system = random_system(40, 3, 2, real=real)
    order = 12
    reduced = balanced_reduction(response(system), order, np.ones(3), np.ones(2), real=real, block_rows=400)
    error = np.linalg.norm(response(system) - reduced.transfer_function(Z), ord=2, axis=(1, 2)).max()
    discarded = hankel_singular_values(*system[:3])[order:]
    # The feedthrough correction may add its own (tiny) steady error once more.
    assert error <= 2.0 * discarded.sum() * 1.001


@pytest.mark.parametrize("real", [True, False])
def test_steady_gain_is_exact(real):
    system = random_system(40, 3, 2, real=real)
    reduced = balanced_reduction(response(system), 6, np.ones(3), np.ones(2), real=real, block_rows=400)
    np.testing.assert_allclose(
        reduced.transfer_function(np.ones(1)), response(system, np.ones(1)), rtol=1e-10, atol=1e-10
    )


def test_full_order_reproduces_the_system_whatever_the_scales():
    system = random_system(10, 3, 2, real=True, radius=0.8)
    scales = np.array([1e-3, 1.0, 1e4]), np.array([10.0, 1e-5])
    padded = response(system)
    reduced = balanced_reduction(padded, 10, *scales, real=True, block_rows=300)
    np.testing.assert_allclose(reduced.transfer_function(Z[::37]), padded[::37], rtol=1e-7, atol=1e-9)


def test_short_window_is_refused():
    with pytest.raises(ValueError, match="400 block rows need 800 frequencies"):
        balanced_reduction(
            np.zeros((512, 1, 1), complex), 1, np.ones(1), np.ones(1), real=True, block_rows=400
        )


def test_system_that_grows_is_refused_not_returned():
    growing = (
        1.01 ** np.arange(SAMPLES)[:, None, None]
    )  # an impulse response with its pole outside the circle
    with pytest.raises(ValueError, match="order 1 gives an unstable system"):
        balanced_reduction(np.fft.fft(growing, axis=0), 1, np.ones(1), np.ones(1), real=True, block_rows=300)
