"""Many steps in one: the response over an interval of k steps as three matrix products (lifting).

With z the modes at the interval's start and u^0..u^k its inputs, of which the last acts on the last output only,
z^k = values^k z + (u^0, ..., u^(k-1)) B and (y^1, ..., y^k) = z C + u D. Exact; it turns k small steps of one turbine,
or of a thousand, into products that run at the machine's speed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flapgym.core.arrays import Array, ComplexArray
from flapgym.core.modal import Modal


@dataclass(frozen=True, eq=False)
class Lifted:
    """One interval of k steps of a modal system; B, C, D act from the right on rows, one row a turbine.

    Attributes
    ----------
    values : (m,) complex
        What an interval leaves of each mode.
    B : (q, 2 m) float
        Inputs to the modes at the end, all real parts before all imaginary ones. Given sample by sample, the inputs are
        those of samples 0..k - 1, q = k nu.
    C : (2 m, rows) float
        Modes at the start, real parts first, to the output rows.
    D : (q, rows) float
        Inputs to the output rows. Given sample by sample, they are those of samples 0..k, q = (k + 1) nu.
    """

    values: ComplexArray
    B: Array
    C: Array
    D: Array


def lift(modal: Modal, steps: int, rows: Array, inputs: Array | None = None) -> Lifted:
    """Lift a modal system over `steps` steps.

    Parameters
    ----------
    modal : Modal
    steps : int
        Steps k of an interval.
    rows : (r, k ny) float
        Output rows wanted, as combinations of (y^1, ..., y^k).
    inputs : ((k + 1) nu, q) float, optional
        Native inputs (u^0, ..., u^k) from the q that will be given; by default they are given sample by sample.
    """
    nu, ny, m = len(modal.inputs), len(modal.outputs), modal.order
    powers = modal.values[None, :] ** np.arange(steps + 1)[:, None]
    # Markov parameters h^0 = D, h^i = C A^(i-1) B, and the response of y^j to u^l is h^(j-l).
    markov = np.concatenate([modal.D[None], np.einsum("ym,im,mu->iyu", modal.C, powers[:-1], modal.B).real])
    lag = np.arange(1, steps + 1)[:, None] - np.arange(steps + 1)
    toeplitz = np.where((lag >= 0)[:, :, None, None], markov[np.maximum(lag, 0)], 0.0)
    toeplitz = toeplitz.transpose(0, 2, 1, 3).reshape(steps * ny, (steps + 1) * nu)
    observe = (powers[1:, None, :] * modal.C).reshape(steps * ny, m)
    push = (powers[steps - 1 :: -1, None, :] * modal.B.T).reshape(steps * nu, m)
    if inputs is not None:
        push, toeplitz = inputs[: steps * nu].T @ push, toeplitz @ inputs
    combined = rows @ observe
    return Lifted(
        values=powers[steps].copy(),
        B=np.hstack([push.real, push.imag]),
        C=np.ascontiguousarray(np.hstack([combined.real, -combined.imag]).T),
        D=np.ascontiguousarray((rows @ toeplitz).T),
    )
