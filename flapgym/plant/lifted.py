"""Many steps in one: the response over an interval of k steps as three matrix products (lifting).

With z the modes at the interval's start and u^0..u^k its inputs, of which the last acts on the last output only,
z^k = values^k z + drive (u^0, ..., u^(k-1)) and (y^1, ..., y^k) = read z + feed u. Exact; it turns k small steps of one
turbine, or of a thousand, into products that run at the machine's speed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flapgym.core.arrays import Array, ComplexArray
from flapgym.plant.modal import Modal


@dataclass(frozen=True, eq=False)
class Lifted:
    """One interval of k steps of a modal system; matrices act from the right on rows, one row a turbine.

    Attributes
    ----------
    decay : (m,) complex
        What an interval leaves of each mode.
    drive : (q, 2 m) float
        Inputs to the modes at the end, real and imaginary parts alternating. Given sample by sample, they are those
        of samples 0..k - 1, q = k nu.
    read : (2 m, rows) float
        Modes at the start to the output rows.
    feed : (q, rows) float
        Inputs to the output rows. Given sample by sample, they are those of samples 0..k, q = (k + 1) nu.
    """

    decay: ComplexArray
    drive: Array
    read: Array
    feed: Array

    def march(self, modes: ComplexArray, pushes: ComplexArray) -> Array:
        """Modes at the start of every interval (T, 2 m), from those of the first (m,) and what each adds (T, m)."""
        starts = np.empty((len(pushes), 2 * len(modes)))
        for start, push in zip(starts, pushes, strict=True):
            start[:] = modes.view(float)
            modes = self.decay * modes + push
        return starts


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
    markov = np.concatenate(
        [modal.D[None], np.einsum("ym,im,mu->iyu", modal.read, powers[:-1], modal.drive).real]
    )
    lag = np.arange(1, steps + 1)[:, None] - np.arange(steps + 1)
    toeplitz = np.where((lag >= 0)[:, :, None, None], markov[np.maximum(lag, 0)], 0.0)
    toeplitz = toeplitz.transpose(0, 2, 1, 3).reshape(steps * ny, (steps + 1) * nu)
    observe = (powers[1:, None, :] * modal.read).reshape(steps * ny, m)
    push = (powers[steps - 1 :: -1, None, :] * modal.drive.T).reshape(steps * nu, m)
    if inputs is not None:
        push, toeplitz = inputs[: steps * nu].T @ push, toeplitz @ inputs
    combined = rows @ observe
    return Lifted(
        decay=powers[steps].copy(),
        drive=np.ascontiguousarray(np.stack([push.real, push.imag], axis=-1).reshape(push.shape[0], 2 * m)),
        read=np.ascontiguousarray(
            np.stack([combined.real, -combined.imag], axis=-1).reshape(rows.shape[0], 2 * m).T
        ),
        feed=np.ascontiguousarray((rows @ toeplitz).T),
    )
