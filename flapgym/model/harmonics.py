"""What the azimuth adds to a turbine of unequal blades: harmonics of its matrices in multi-blade coordinates.

Three equal blades make the multi-blade form constant. Unequal ones leave a periodic part that is small and of low rank
(the blades differ, the lattice and the tower do not), so a file holds it in full where a table of a revolution would
take 390 MB.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from flapgym.core.arrays import Array, ComplexArray
from flapgym.core.state_space import StateSpace

TOLERANCE = 1e-11
"""Harmonics and directions below this are left out, over the largest entry of the scaled mean."""

_FEW, _MOST = 32, 512  # azimuths sampled around the revolution


@dataclass(frozen=True, eq=False)
class PeriodicPart:
    """The part of the matrices that follows the azimuth theta, that of blade 1.

    With S = [[A, B], [C, D]] of the multi-blade form, S(theta) = S_mean + left core(theta) right, where
    core(theta) = Re sum_k core[k - 1] exp(j k theta), k = 1 .. K. A step from theta^n leads from coordinates at
    theta^n to coordinates at theta^(n + 1).

    Attributes
    ----------
    left : (n + ny, r) float
    core : (K, r, s) complex
    right : (s, n + nu) float
        Columns: the states, then the inputs.
    forcing : (K + 1, n + ny) complex
        What the blades' unequal steady loads, turning with the rotor, add to the next state and to the outputs:
        Re sum_k forcing[k] exp(j k theta), k = 0 .. K.
    """

    left: Array
    core: ComplexArray
    right: Array
    forcing: ComplexArray

    @property
    def harmonics(self) -> int:
        """Number K of harmonics."""
        return int(self.core.shape[0])

    @property
    def rank(self) -> int:
        """Rank of the periodic part, at most."""
        return int(min(self.core.shape[1:]))

    def core_at(self, azimuth: ArrayLike) -> Array:
        """core(theta) at azimuths (...) [rad], shape (..., r, s)."""
        phase = self._phase(azimuth)[..., 1:]
        flat = self.core.reshape(self.harmonics, -1)
        value = phase.real @ flat.real - phase.imag @ flat.imag
        return np.asarray(value).reshape(*phase.shape[:-1], *self.core.shape[1:])

    def forcing_at(self, azimuth: ArrayLike) -> Array:
        """Forcing (..., n + ny) at azimuths (...) [rad]."""
        phase = self._phase(azimuth)
        return np.asarray(phase.real @ self.forcing.real - phase.imag @ self.forcing.imag)

    def _phase(self, azimuth: ArrayLike) -> ComplexArray:
        return np.exp(1j * np.asarray(azimuth, dtype=float)[..., None] * np.arange(self.harmonics + 1))


def system_at(mean: StateSpace, periodic: PeriodicPart | None, azimuth: float) -> StateSpace:
    """The turbine's matrices for the step that begins at an azimuth [rad], in multi-blade coordinates."""
    if periodic is None:
        return mean
    n = mean.order
    change = periodic.left @ periodic.core_at(azimuth) @ periodic.right
    return StateSpace(
        mean.A + change[:n, :n],
        mean.B + change[:n, n:],
        mean.C + change[n:, :n],
        mean.D + change[n:, n:],
        mean.time_step,
        mean.inputs,
        mean.outputs,
    )


def shaken_at(mean: StateSpace, periodic: PeriodicPart, azimuth: float) -> StateSpace:
    """`system_at`, with the forcing there behind one more input, "imbalance"."""
    system, forcing = system_at(mean, periodic, azimuth), periodic.forcing_at(azimuth)[:, None]
    return replace(
        system,
        B=np.hstack([system.B, forcing[: system.order]]),
        D=np.hstack([system.D, forcing[system.order :]]),
        inputs=(*system.inputs, "imbalance"),
    )


def simulate_periodic(
    mean: StateSpace,
    periodic: PeriodicPart,
    u: Array,
    azimuth: Array,
    x0: ArrayLike | None = None,
    imbalance: float = 1.0,
) -> Array:
    """Outputs (T, ny) in multi-blade coordinates for inputs u (T, nu) at azimuths (T,) [rad].

    Parameters
    ----------
    mean : StateSpace
        The azimuth's mean, ``TurbineModel.turbine``.
    periodic : PeriodicPart
    u : (T, nu) float
        In the multi-blade coordinates of each step's azimuth.
    azimuth : (T,) float
        Of blade 1 at each step.
    x0 : (n,) float, optional
        State at the first step, default zero.
    imbalance : float
        Factor on the turning steady load of unequal blades; zero leaves only the answer to ``u``.
    """
    n = mean.order
    x = np.zeros(n) if x0 is None else np.array(x0, dtype=float)
    S = np.block([[mean.A, mean.B], [mean.C, mean.D]])
    force = imbalance * periodic.forcing_at(azimuth)
    y = np.empty((len(u), len(mean.outputs)))
    for step, now in enumerate(np.asarray(u, dtype=float)):
        xu = np.concatenate([x, now])
        core = periodic.core_at(azimuth[step])
        out = S @ xu + periodic.left @ (core @ (periodic.right @ xu)) + force[step]
        x, y[step] = out[:n], out[n:]
    return y


def fourier_series(
    sample: Callable[[float], tuple[StateSpace, Array]],
) -> tuple[StateSpace, PeriodicPart]:
    """Mean and periodic part of matrices known by azimuth.

    Harmonics are kept until all others are below ``TOLERANCE``, directions of states, inputs and outputs likewise; both
    are judged with states balanced and inputs and outputs scaled by their rows and columns. Azimuths are sampled as
    densely as that takes.

    Parameters
    ----------
    sample : callable
        From an azimuth [rad] to the matrices there and their forcing (n + ny,).

    Raises
    ------
    ValueError
        If 512 azimuths do not resolve the series.
    """
    count = _FEW
    first, matrices, forcing = _sampled(sample, np.arange(count) / count)
    while True:
        size = _sizes(first, matrices.mean(axis=0))
        series = np.fft.rfft(matrices / size, axis=0) / count
        push = np.fft.rfft(forcing, axis=0) / count
        limit = TOLERANCE * np.abs(series[0]).max()
        significant = np.abs(series).max(axis=(1, 2)) > limit
        shake = np.abs(push).max(axis=1)
        significant |= shake > 10.0 * TOLERANCE * shake.max()
        kept = int(np.flatnonzero(significant).max())
        if kept <= count // 4:
            break
        if count == _MOST:
            raise ValueError(
                f"periodic form: {_MOST} azimuths do not resolve the blades' differences; make them smaller"
            )
        _, *between = _sampled(sample, (np.arange(count) + 0.5) / count)
        matrices, forcing = (
            np.stack(pair, axis=1).reshape(2 * count, *pair[0].shape[1:])
            for pair in zip((matrices, forcing), between, strict=True)
        )
        count *= 2
    n = first.order
    mean = series[0].real * size
    harmonic = 2.0 * series[1 : kept + 1]
    parts = np.concatenate([harmonic.real, harmonic.imag])
    left = _column_space(parts.transpose(1, 0, 2).reshape(parts.shape[1], -1), limit)
    right = _column_space(parts.transpose(2, 0, 1).reshape(parts.shape[2], -1), limit)
    rows, columns = size[:, :1], size[:1] / size[:1, :1]
    push[1:] *= 2.0
    return (
        StateSpace(
            mean[:n, :n],
            mean[:n, n:],
            mean[n:, :n],
            mean[n:, n:],
            first.time_step,
            first.inputs,
            first.outputs,
        ),
        PeriodicPart(
            left=left * rows,
            core=left.T @ harmonic @ right,
            right=right.T * columns,
            forcing=push[: kept + 1],
        ),
    )


def _sampled(
    sample: Callable[[float], tuple[StateSpace, Array]], turns: Array
) -> tuple[StateSpace, Array, Array]:
    systems, forcing = zip(*(sample(2.0 * np.pi * float(turn)) for turn in turns), strict=True)
    matrices = [np.block([[system.A, system.B], [system.C, system.D]]) for system in systems]
    return systems[0], np.stack(matrices), np.stack(forcing)


def _sizes(system: StateSpace, mean: Array) -> Array:
    """Size (n + ny, n + nu) of an entry that matters: balanced states, inputs and outputs by their largest."""
    n = system.order
    _, (scale, _) = scipy.linalg.matrix_balance(mean[:n, :n], permute=False, separate=True)
    inputs = 1.0 / np.abs(mean[:n, n:] / scale[:, None]).max(axis=0)
    outputs = np.abs(mean[n:, :n] * scale).max(axis=1)
    return np.asarray(np.concatenate([scale, outputs])[:, None] / np.concatenate([scale, inputs]))


def _column_space(matrix: Array, limit: float) -> Array:
    """Orthonormal basis (m, r) of what in a wide matrix exceeds a limit."""
    triangle = scipy.linalg.qr(matrix.T, mode="r", check_finite=False)[0][: matrix.shape[0]]
    basis, values, _ = np.linalg.svd(triangle.T)
    return np.asarray(basis[:, : int((values > limit).sum())])
