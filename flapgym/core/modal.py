"""Modal form of a state space: one complex number a mode instead of a full matrix (design of the fast plant).

An LTI system of n states steps in O(n) in these coordinates. They exist and are safe as long as the
eigenvectors are well conditioned, which is proved on construction, not assumed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from flapgym.core.arrays import Array, ComplexArray
from flapgym.core.state_space import StateSpace

CONDITION_LIMIT = 1e8
"""Largest condition number of the scaled eigenvectors; round-off grows by it, so 1e8 leaves eight digits."""
AGREEMENT = 1e-9
"""Largest difference from the matrix form over the trial run, relative to the largest value."""
TRIAL_STEPS = 300
CHUNK = 2048
"""Steps whose modes a simulation keeps at once."""


@dataclass(frozen=True, eq=False)
class Modal:
    """z^{n+1} = values * z^n + B u^n, y^n = Re(C z^n) + D u^n.

    Of each complex pair of modes only the one with the positive imaginary part is kept, its column of C counted
    twice; a real mode stays real.

    Attributes
    ----------
    values : (m,), B : (m, nu), C : (ny, m) complex
        Eigenvalues, inputs to modes, modes to outputs.
    D : (ny, nu) float
        Feedthrough.
    time_step : float
        Sampling time [s].
    inputs, outputs : tuple of str
        Names, as in the state space.
    condition : float
        Condition number of the scaled eigenvectors.
    project : (m, n), expand : (n, m) complex
        States to modes; modes to states, x = Re(expand z).
    """

    values: ComplexArray
    B: ComplexArray
    C: ComplexArray
    D: Array
    time_step: float
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    condition: float
    project: ComplexArray
    expand: ComplexArray

    @property
    def order(self) -> int:
        """Number of modes kept: pairs count once."""
        return int(self.values.size)

    def equilibrium(self, u: Array) -> ComplexArray:
        """Modes (m,) under a constant input (nu,)."""
        return np.asarray(self.B @ u / (1.0 - self.values))

    def simulate(self, u: Array, modes: ComplexArray | None = None) -> Array:
        """Outputs (T, ny) for inputs u (T, nu), one step at a time, from modes (m,) at sample 0 or from rest."""
        outputs = u @ self.D.T
        start = np.zeros(self.order, dtype=complex) if modes is None else modes
        for first in range(0, len(u), CHUNK):
            some = slice(first, first + CHUNK)
            starts, start = marched(self.values, start, u[some] @ self.B.T)
            outputs[some] += (starts @ self.C.T).real
        return np.asarray(outputs)

    def frequency_response(self, frequency: Array) -> ComplexArray:
        """Outputs over inputs (F, ny, nu) at frequencies (F,) [Hz]."""
        ahead = np.exp(2j * np.pi * frequency * self.time_step)[:, None]
        # A mode stands for itself and its conjugate, and its column is counted twice; so is that of a real one, halved.
        own, conjugate = 1.0 / (ahead - self.values), 1.0 / (ahead - self.values.conj())
        answer = (own[:, None] * self.C) @ self.B
        answer += (conjugate[:, None] * self.C.conj()) @ self.B.conj()
        return np.asarray(0.5 * answer + self.D)

    def stationary_covariance(self) -> Array:
        """Covariance (n, n) of the states under unit white noise, at the cost of a product.

        In modal coordinates the Lyapunov equation is solved entry by entry: E[z_i conj(z_j)] =
        b_i b_j' / (1 - l_i conj(l_j)) with b_j conjugate, and E[z_i z_j] alike without the conjugates.
        """
        b, values, expand = self.B, self.values, self.expand
        direct = b @ b.conj().T / (1.0 - np.outer(values, values.conj()))
        mirrored = b @ b.T / (1.0 - np.outer(values, values))
        return np.asarray(0.5 * (expand @ direct @ expand.conj().T + expand @ mirrored @ expand.T).real)

    def stationary_root(self) -> Array:
        """Map (2 m, n) of standard normal numbers to stationary modes, real and imaginary parts alternating.

        The symmetric root of the states' covariance, each state scaled to unit variance: unlike a factor of the modes'
        it does not depend on the order and the phase in which a machine happens to return its eigenvectors.
        """
        covariance = self.stationary_covariance()
        scale = np.sqrt(np.diag(covariance))
        scale[scale == 0.0] = 1.0
        weights, vectors = scipy.linalg.eigh(covariance / np.outer(scale, scale))
        root = scale[:, None] * (vectors * np.sqrt(np.clip(weights, 0.0, None))) @ vectors.T
        modes = self.project @ root
        return np.stack([modes.real, modes.imag], axis=1).reshape(2 * self.order, -1)


def marched(
    values: ComplexArray, modes: ComplexArray, pushes: ComplexArray
) -> tuple[ComplexArray, ComplexArray]:
    """Modes (T, m) at the start of every step and (m,) after all, from the first (m,) and what steps add (T, m)."""
    starts = np.empty((len(pushes), len(modes)), dtype=complex)
    for start, push in zip(starts, pushes, strict=True):
        start[:] = modes
        modes = values * modes + push
    return starts, modes


def modal_form(system: StateSpace) -> Modal:
    """Diagonalise a state space, and prove that the result can be trusted.

    Raises
    ------
    ValueError
        If the system is unstable, its eigenvectors are too badly conditioned, or a trial run with a random
        input differs from the matrix form.
    """
    values, vectors = np.linalg.eig(system.A)
    if np.abs(values).max() >= 1.0:
        raise ValueError(
            f"modal form: expected a stable system, got spectral radius {np.abs(values).max():.9f}"
        )
    # The states' units are arbitrary: the matrix is balanced before the condition is judged.
    _, (rows, _) = scipy.linalg.matrix_balance(system.A, permute=False, separate=True)
    scaled = vectors / rows[:, None]
    columns = np.linalg.norm(scaled, axis=0)
    scaled = scaled / columns
    condition = float(np.linalg.cond(scaled))
    if not condition < CONDITION_LIMIT:
        raise ValueError(
            f"modal form: eigenvectors have condition number {condition:.1e}, above {CONDITION_LIMIT:.0e}; "
            "balance or reduce the model before stepping it by modes"
        )
    kept = values.imag >= 0.0
    pair = np.where(values[kept].imag > 0.0, 2.0, 1.0)
    project = (np.linalg.inv(scaled) / rows)[kept].astype(complex)
    expand = (rows[:, None] * scaled[:, kept] * pair).astype(complex)
    modal = Modal(
        values=values[kept].astype(complex),
        B=project @ system.B,
        C=system.C @ expand,
        D=system.D,
        time_step=system.time_step,
        inputs=system.inputs,
        outputs=system.outputs,
        condition=condition,
        project=project,
        expand=expand,
    )
    _prove(modal, system)
    return modal


def _prove(modal: Modal, system: StateSpace) -> None:
    """Compare a short random run with the matrix form.

    Outputs of one quantity (names that begin with the same word: rbm_0, rbm_c, rbm_s) are judged by the largest of
    them, because symmetry makes some of them zero but for round-off; a quantity that stays zero is not judged.
    """
    u = np.random.default_rng(0).standard_normal((TRIAL_STEPS, len(system.inputs)))
    expected = system.simulate(u)
    error = np.abs(modal.simulate(u) - expected).max(axis=0)
    largest: dict[str, float] = {}
    quantities = [name.split("_")[0] for name in system.outputs]
    for quantity, value in zip(quantities, np.abs(expected).max(axis=0), strict=True):
        largest[quantity] = max(value, largest.get(quantity, 0.0))
    for quantity, value in zip(quantities, error, strict=True):
        if largest[quantity] > 0.0 and not value <= AGREEMENT * largest[quantity]:
            raise ValueError(
                f"modal form: {quantity} differs from the matrix form by {value / largest[quantity]:.1e} relative, "
                f"above {AGREEMENT:.0e}"
            )
