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


@dataclass(frozen=True, eq=False)
class Modal:
    """z^{n+1} = values * z^n + drive u^n, y^n = Re(read z^n) + D u^n.

    Of each complex pair of modes only the one with the positive imaginary part is kept, its row of
    ``read`` counted twice; a real mode stays real.

    Attributes
    ----------
    values : (m,) complex
        Eigenvalues.
    drive : (m, nu) complex
        Inputs to modes.
    read : (ny, m) complex
        Modes to outputs.
    D : (ny, nu) float
        Feedthrough.
    time_step : float
        Sampling time [s].
    inputs, outputs : tuple of str
        Names, as in the state space.
    condition : float
        Condition number of the scaled eigenvectors.
    project : (m, n) complex
        States of the state space to modes.
    expand : (n, m) complex
        Modes to states: x = Re(expand z).
    """

    values: ComplexArray
    drive: ComplexArray
    read: ComplexArray
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

    def simulate(self, u: Array) -> Array:
        """Outputs (T, ny) from rest for inputs u (T, nu), one step at a time."""
        drive = u @ self.drive.T
        z = np.zeros(self.order, dtype=complex)
        states = np.empty((u.shape[0], self.order), dtype=complex)
        for n in range(u.shape[0]):
            states[n] = z
            z = self.values * z + drive[n]
        return np.asarray((states @ self.read.T).real + u @ self.D.T)


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
        drive=project @ system.B,
        read=system.C @ expand,
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
