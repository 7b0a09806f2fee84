"""Balanced truncation of a coupled model for the inputs it really sees (after coupling, Section II.D onwards).

In multi-blade coordinates the coupled turbine is time-invariant, so it can be reduced once more as a whole,
which the azimuth-dependent form forbids. Input weighting (Enns 1984, one-sided) spends the states where
turbulence and flaps have their energy, and keeps the reduced model stable.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg

from flapgym.state_space import Array, StateSpace, series


def weighted_truncation(system: StateSpace, weight: StateSpace, order: int) -> tuple[StateSpace, Array]:
    """Reduce a stable system by input-weighted balanced truncation, the steady gain made exact by the feedthrough.

    Parameters
    ----------
    system : StateSpace
        Stable system of n states.
    weight : StateSpace
        Shapes white noise of unit variance into the system's inputs, whose names its outputs bear.
    order : int
        States to keep, 1 <= order <= n.

    Returns
    -------
    reduced : StateSpace
        The same inputs and outputs.
    values : (n,) float
        Weighted Hankel singular values, outputs scaled to their rms under the weight; largest first.

    Raises
    ------
    ValueError
        If ``order`` is out of range or the reduced system is unstable.
    """
    n = system.order
    if not 1 <= order <= n:
        raise ValueError(f"weighted_truncation.order: expected 1 <= order <= {n}, got {order}")
    driven = series(weight, system)
    covariance = driven.stationary_covariance()[-n:, -n:]
    scale = 1.0 / output_rms(driven)
    scaled = scale[:, None] * system.C
    observability = scipy.linalg.solve_discrete_lyapunov(system.A.T, scaled.T @ scaled)
    reach, see = _factor(covariance), _factor(observability)
    left, values, right = np.linalg.svd(see.T @ reach)
    root = np.sqrt(values[:order])
    to_balanced = (see @ left[:, :order] / root).T
    from_balanced = reach @ right[:order].T / root
    A, B = to_balanced @ system.A @ from_balanced, to_balanced @ system.B
    C = system.C @ from_balanced
    D = system.dc_gain() - C @ np.linalg.solve(np.eye(order) - A, B)
    reduced = StateSpace(A, B, C, D, system.time_step, system.inputs, system.outputs)
    radius = reduced.spectral_radius()
    if radius >= 1.0:
        raise ValueError(
            f"weighted_truncation: order {order} gives an unstable system (spectral radius {radius:.6f}); "
            "change the order"
        )
    return reduced, values


def relative_error(system: StateSpace, reduced: StateSpace, weight: StateSpace) -> Array:
    """Rms of each output's error over that output's own rms under the weight's noise, shape (ny,)."""
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
    covariance = driven.C @ driven.stationary_covariance() @ driven.C.T + driven.D @ driven.D.T
    return np.sqrt(np.maximum(np.diag(covariance), 0.0))


def _factor(gramian: Array) -> Array:
    """F with F F^T the symmetric, up to rounding positive semi-definite, Gramian."""
    values, vectors = np.linalg.eigh(0.5 * (gramian + gramian.T))
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))
