"""The turning rotor seen from the fixed frame: orthonormal multi-blade coordinates and the modes in them.

A blade's q is written q_b = (q_0 + sqrt(2) q_c cos(theta_b) + sqrt(2) q_s sin(theta_b)) / sqrt(3), which keeps
virtual work as it is. For equal blades the azimuth then drops out of M, C and K, and only then do eigenvalues mean
modes; those at a frozen azimuth do not.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse.linalg import LinearOperator, eigs

from flapgym.core.arrays import BLADES, AnyArray
from flapgym.core.fields import Count, Quantity
from flapgym.structure.assembly import assemble
from flapgym.structure.blade import linear_blade
from flapgym.structure.body import LinearBlade
from flapgym.structure.support import LinearSupport, linear_support
from flapgym.turbine import Turbine


def component_weights(azimuth: float) -> AnyArray:
    """Weights (3 blades, 3 components) of the collective, cosine and sine components at a rotor azimuth [rad]."""
    angle = azimuth + 2.0 * np.pi * np.arange(BLADES) / BLADES
    ones = np.full(BLADES, np.sqrt(0.5))
    return np.sqrt(2.0 / BLADES) * np.column_stack([ones, np.cos(angle), np.sin(angle)])


def multi_blade_matrices(
    blades: Sequence[LinearBlade], support: LinearSupport, azimuth: float = 0.0
) -> tuple[AnyArray, AnyArray, AnyArray]:
    """M, C, K of the turbine in multi-blade coordinates, evaluated at one rotor azimuth [rad].

    Unknowns: the components q_0, q_c, q_s (6n each), then the support's. The same at every azimuth when the
    blades are equal; with unequal blades periodic.
    """
    if len(blades) != BLADES:
        raise ValueError(f"multi_blade_matrices.blades: expected {BLADES}, got {len(blades)}")
    mass, damping, stiffness = assemble(blades, support, azimuth)
    size, rest = blades[0].mass.shape[0], support.mass.shape[0]
    speed = blades[0].rotor_speed
    # With T the weights, T' = T J and T'' = T J J for constant speed.
    turning = speed * np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])

    def extend(block: AnyArray, corner: AnyArray) -> AnyArray:
        out = np.zeros((BLADES * size + rest, BLADES * size + rest))
        out[: BLADES * size, : BLADES * size] = np.kron(block, np.eye(size))
        out[BLADES * size :, BLADES * size :] = corner
        return out

    weights = extend(component_weights(azimuth), np.eye(rest))
    rate, acceleration = (extend(part, np.zeros((rest, rest))) for part in (turning, turning @ turning))
    mass, damping, stiffness = (weights.T @ matrix @ weights for matrix in (mass, damping, stiffness))
    return mass, damping + 2.0 * mass @ rate, stiffness + damping @ rate + mass @ acceleration


def rotating_modes(
    turbine: Turbine, elements: int, rotor_speed: float, count: int = 24, around: float = 1.9
) -> tuple[AnyArray, AnyArray]:
    """Undamped frequencies [Hz], ascending, and shapes in multi-blade coordinates of the turning turbine.

    Of the `count` eigenvalues nearest to `around` [Hz] in the fixed frame, found by shift and invert, those that
    oscillate with positive frequency; no wind, no gravity.

    Returns
    -------
    frequency : (m,) float
    shape : (N, m) complex
    """
    Count(at_least=1, at_most=100).check(count, "rotating_modes.count")
    Quantity("frequency", above=0.0).check(around, "rotating_modes.around")
    blade = linear_blade(turbine, elements, rotor_speed)
    support = linear_support(turbine, rotor_speed)
    mass, damping, stiffness = multi_blade_matrices([blade] * BLADES, support)
    size, shift = len(mass), 2j * np.pi * around
    inverse = np.linalg.inv(shift**2 * mass + shift * damping + stiffness)

    def solve(vector: AnyArray) -> AnyArray:
        """Apply (A - shift)^-1 of the first-order form with state (q, q')."""
        position, velocity = vector[:size], vector[size:]
        found = -inverse @ (mass @ (velocity + shift * position) + damping @ position)
        return np.concatenate([found, position + shift * found])

    operator = LinearOperator((2 * size, 2 * size), matvec=solve, dtype=complex)
    start = np.ones(2 * size, dtype=complex)
    inverted, shapes = eigs(operator, k=count, v0=start)
    eigenvalues = shift + 1.0 / inverted
    order = np.argsort(eigenvalues.imag)
    order = order[eigenvalues.imag[order] > 0.0]
    return eigenvalues.imag[order] / (2.0 * np.pi), shapes[:size, order]
