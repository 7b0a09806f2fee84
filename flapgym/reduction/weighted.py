"""Balanced truncation of a coupled model for the inputs it really sees (after coupling, Section II.D onwards).

In multi-blade coordinates the coupled turbine is time-invariant, so it can be reduced once more as a whole,
which the azimuth-dependent form forbids. Input weighting (Enns 1984, one-sided) spends the states where
turbulence and flaps have their energy; but for rounding it keeps the reduced model stable.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from flapgym.core.arrays import Array
from flapgym.core.state_space import StateSpace, require_time_step, series


@dataclass(frozen=True, eq=False)
class Balanced:
    """A system in input-weighted balanced coordinates, ready to be cut at any order.

    Attributes
    ----------
    system : StateSpace
        The full system.
    values : (n,) float
        Weighted Hankel singular values, outputs scaled to their rms under the weight; largest first.
    into, back : (n, n) float
        To and from balanced coordinates, each scaled by the root of the values.
    """

    system: StateSpace
    values: Array
    into: Array
    back: Array

    def truncated(self, order: int) -> StateSpace:
        """The system of so many states, its steady gain made exact by the feedthrough.

        Raises
        ------
        ValueError
            If the order is out of range or rounding makes the cut system unstable.
        """
        full = self.system
        if not 1 <= order <= full.order:
            raise ValueError(f"truncated.order: expected 1 <= order <= {full.order}, got {order}")
        root = np.sqrt(self.values[:order])
        into, back = self.into[:order] / root[:, None], self.back[:, :order] / root
        A, B, C = into @ full.A @ back, into @ full.B, full.C @ back
        D = full.dc_gain() - C @ np.linalg.solve(np.eye(order) - A, B)
        reduced = StateSpace(A, B, C, D, full.time_step, full.inputs, full.outputs)
        radius = reduced.spectral_radius()
        if radius >= 1.0:
            raise ValueError(
                f"truncated: order {order} is unstable (spectral radius {radius:.6f}); "
                "take another order, or a larger coupled_tolerance"
            )
        return reduced


def balance(system: StateSpace, weight: StateSpace) -> Balanced:
    """Balance a stable system for white noise shaped by ``weight`` into its inputs (names must match)."""
    n = system.order
    driven = series(weight, system)
    covariance = driven.stationary_covariance()
    scaled = system.C / _rms(driven, covariance)[:, None]
    observability = scipy.linalg.solve_discrete_lyapunov(system.A.T, scaled.T @ scaled)
    reach, see = _factor(covariance[-n:, -n:]), _factor(observability)
    left, values, right = np.linalg.svd(see.T @ reach)
    return Balanced(system, values, (see @ left).T, reach @ right.T)


def relative_error(system: StateSpace, reduced: StateSpace, weight: StateSpace) -> Array:
    """Rms of each output's error over that output's own rms under the weight's noise, shape (ny,)."""
    require_time_step("relative_error.reduced.time_step", reduced.time_step, system.time_step, "the system's")
    difference = StateSpace(
        scipy.linalg.block_diag(system.A, reduced.A),
        np.vstack([system.B, reduced.B]),
        np.hstack([system.C, -reduced.C]),
        system.D - reduced.D,
        system.time_step,
        system.inputs,
        system.outputs,
    )
    return output_rms(series(weight, difference)) / output_rms(series(weight, system))


def output_rms(driven: StateSpace) -> Array:
    """Stationary rms of every output under white noise of unit variance, shape (ny,)."""
    return _rms(driven, driven.stationary_covariance())


def _rms(driven: StateSpace, covariance: Array) -> Array:
    square = driven.C @ covariance @ driven.C.T + driven.D @ driven.D.T
    return np.sqrt(np.maximum(np.diag(square), 0.0))


def _factor(gramian: Array) -> Array:
    """F with F F^T the symmetric, up to rounding positive semi-definite, Gramian."""
    values, vectors = np.linalg.eigh(0.5 * (gramian + gramian.T))
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))
