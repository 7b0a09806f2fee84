"""Balanced reduction of a large linear system known by its transfer function (Section II.D).

The unsteady vortex lattice is a shift register of thousands of wake states; its transfer function is
cheap, its Gramians are not. The eigensystem realisation algorithm (ERA) factors the Hankel matrix of
the impulse response instead: for an impulse response that has died out within the window, its singular
values are the Hankel singular values and its realisation is the balanced one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from flapgym.core.arrays import ComplexArray
from flapgym.core.fields import Count
from flapgym.core.wording import shown

# Real for the collective component, complex for whirl.
Matrix = NDArray[Any]

# Directions kept beyond the order asked for: the realisation is formed this much larger and then
# residualised, so that the kept states do not carry the randomised factorisation's own error.
_MARGIN = 30
_OVERSAMPLING = 20
_POWER_ITERATIONS = 1


@dataclass(frozen=True, eq=False)
class ReducedSystem:
    """xi+ = A xi + B u, y = C xi + D u, possibly complex (a whirl component is).

    Attributes
    ----------
    A : (r, r), B : (r, nu), C : (ny, r), D : (ny, nu) complex or real
    hankel_singular_values : (>= r,) float
        Of the scaled system, largest first; Figure 12 shows them over the first.
    """

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    hankel_singular_values: NDArray[np.float64]

    def transfer_function(self, z: ComplexArray) -> ComplexArray:
        """Response at points z of the complex plane, shape (nz, ny, nu)."""
        eye = np.eye(self.A.shape[0])
        return np.stack([self.C @ np.linalg.solve(value * eye - self.A, self.B) + self.D for value in z])


def balanced_reduction(
    response: ComplexArray,
    order: int,
    input_scale: NDArray[np.float64],
    output_scale: NDArray[np.float64],
    *,
    real: bool,
    tolerance: float = 0.0,
    block_rows: int = 500,
) -> ReducedSystem:
    """Balanced truncation by singular perturbation, with the exact steady gain.

    Parameters
    ----------
    response : (N, ny, nu) complex
        Transfer function at the N roots of unity z_k = exp(2 pi j k / N), k = 0 .. N - 1. N must be
        longer than the memory of the system (for a lattice, four times its wake rows).
    order : int
        States to keep, or the most of them where ``tolerance`` decides.
    input_scale : (nu,), output_scale : (ny,) float
        Magnitudes that count as one: the system balanced is y / output_scale over u / input_scale.
        The result is in the units of ``response``.
    real : bool
        Whether the impulse response is real (the collective component) or complex (whirl).
    tolerance : float
        States whose singular value is smaller than this share of the largest are dropped.
    block_rows : int
        Block rows and columns of the Hankel matrix; 2 * block_rows <= N.

    Raises
    ------
    ValueError
        If the window is too short for the Hankel matrix, the order exceeds the system's own, or the
        reduced system is unstable.
    """
    Count(at_least=1).check(order, "balanced_reduction.order")
    if response.ndim != 3 or not np.isfinite(response).all():
        raise ValueError(
            f"balanced_reduction.response: expected finite numbers along 3 axes, got {shown(response)}"
        )
    samples, outputs, inputs = response.shape
    if 2 * block_rows > samples:
        raise ValueError(
            f"balanced_reduction: {block_rows} block rows need {2 * block_rows} frequencies, got {samples}"
        )
    scaled = response * input_scale / output_scale[:, None]
    impulse = scipy.fft.ifft(scaled, axis=0)
    if real:
        impulse = impulse.real
    hankel = _BlockHankel(impulse[1:], block_rows)
    shifted = _BlockHankel(impulse[2:], block_rows)

    left, values, right = _randomised_svd(hankel, order + _MARGIN)
    rank = int((values > 1e-12 * values[0]).sum())
    left, values, right = left[:, :rank], values[:rank], right[:, :rank]
    if tolerance > 0.0:
        order = min(order, int((values >= tolerance * values[0]).sum()))
    if order > rank:
        raise ValueError(f"balanced_reduction.order: the system has only {rank} states, got {order}")
    root = np.sqrt(values)
    A = (left / root).conj().T @ shifted.apply(right / root)
    B = (right[:inputs] * root).conj().T
    C = left[:outputs] * root
    A, B, C, D = _residualise(A, B, C, impulse[0], order)
    # The window's truncation and the factorisation leave a small error in the steady gain. Steady loads
    # are what flap and mean wind act by, so the feedthrough absorbs it.
    D = D + (scaled[0].real if real else scaled[0]) - (C @ np.linalg.solve(np.eye(order) - A, B) + D)
    radius = float(np.abs(np.linalg.eigvals(A)).max())
    if radius >= 1.0:
        raise ValueError(
            f"balanced_reduction: order {order} gives an unstable system (spectral radius {radius:.6f}); "
            "change the order"
        )
    return ReducedSystem(
        A=A,
        B=B / input_scale,
        C=C * output_scale[:, None],
        D=D * output_scale[:, None] / input_scale,
        hankel_singular_values=values,
    )


class _BlockHankel:
    """The matrix H[i, j] = h[i + j] of (ny, nu) blocks, applied by FFT without being formed."""

    def __init__(self, impulse: Matrix, block_rows: int) -> None:
        self.rows = block_rows
        self.outputs, self.inputs = impulse.shape[1:]
        self.is_complex = np.iscomplexobj(impulse)
        # What wraps around falls on the first block_rows - 1 entries, which _correlate does not keep.
        self.length = scipy.fft.next_fast_len(2 * block_rows - 1)
        # Half the spectrum of a real impulse response says it all, at half the cost.
        self.forward = scipy.fft.fft if self.is_complex else scipy.fft.rfft
        self.inverse = scipy.fft.ifft if self.is_complex else scipy.fft.irfft
        self.spectrum = self.forward(impulse[: 2 * block_rows - 1], n=self.length, axis=0)

    @property
    def columns(self) -> int:
        return self.rows * self.inputs

    def apply(self, x: Matrix) -> Matrix:
        """H x for x (columns, s): a correlation, so a convolution with the reversed blocks."""
        blocks = x.reshape(self.rows, self.inputs, -1)[::-1]
        return self._correlate(self.spectrum, blocks).reshape(self.rows * self.outputs, -1)

    def apply_adjoint(self, y: Matrix) -> Matrix:
        """H^H y for y (rows, s)."""
        blocks = y.reshape(self.rows, self.outputs, -1)[::-1].conj()
        return self._correlate(np.swapaxes(self.spectrum, 1, 2), blocks).conj().reshape(self.columns, -1)

    def _correlate(self, spectrum: Matrix, blocks: Matrix) -> Matrix:
        product = spectrum @ self.forward(blocks, n=self.length, axis=0)
        return self.inverse(product, n=self.length, axis=0)[self.rows - 1 : 2 * self.rows - 1]


def _randomised_svd(matrix: _BlockHankel, rank: int) -> tuple[Matrix, NDArray[np.float64], Matrix]:
    """Leading singular triplets (Halko, Martinsson and Tropp 2011), deterministic by a fixed seed."""
    rng = np.random.default_rng(0)
    shape = (matrix.columns, rank + _OVERSAMPLING)
    probe = rng.standard_normal(shape)
    if matrix.is_complex:
        probe = probe + 1j * rng.standard_normal(shape)
    basis = np.linalg.qr(matrix.apply(probe))[0]
    for _ in range(_POWER_ITERATIONS):
        basis = np.linalg.qr(matrix.apply_adjoint(basis))[0]
        basis = np.linalg.qr(matrix.apply(basis))[0]
    right, values, left = np.linalg.svd(matrix.apply_adjoint(basis), full_matrices=False)
    return basis @ left.conj().T[:, :rank], values[:rank], right[:, :rank]


def _residualise(
    A: Matrix, B: Matrix, C: Matrix, D: Matrix, order: int
) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    """Singular perturbation: the states beyond ``order`` follow the kept ones without delay."""
    kept, rest = slice(None, order), slice(order, None)
    solve = np.linalg.inv(np.eye(A.shape[0] - order) - A[rest, rest])
    follow, feed = solve @ A[rest, kept], solve @ B[rest]
    return (
        A[kept, kept] + A[kept, rest] @ follow,
        B[kept] + A[kept, rest] @ feed,
        C[:, kept] + C[:, rest] @ follow,
        D + C[:, rest] @ feed,
    )
