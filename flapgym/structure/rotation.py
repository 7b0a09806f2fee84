"""Finite rotations: matrices, Cartesian rotation vectors, relative rotation of two frames (Section II.A).

Every scalar function of the rotation angle is even and written as a function of its square, so that nothing
branches at zero rotation and a complex step passes through unharmed.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval
from scipy.special import zeta

from flapgym.core.arrays import AnyArray

# Coefficients in w = |psi|^2 of the even functions of the relative rotation psi of two neighbouring nodes:
#   stretch(w) = x / sin x, x = |psi| / 2;  shear(w) = tan(|psi| / 4) / (2 |psi|);
#   deviator(w) = (1 - stretch(w)) / w.
# They converge for |psi| < 2 pi; forty terms are exact to round-off for |psi| <= 3 rad.
_TERMS = np.arange(1, 41)
_ZETA = zeta(2.0 * _TERMS)
_STRETCH_TAIL = 2.0 * (1.0 - 2.0 ** (1.0 - 2.0 * _TERMS)) * _ZETA / (2.0 * np.pi) ** (2.0 * _TERMS)
STRETCH = np.concatenate([[1.0], _STRETCH_TAIL])
DEVIATOR = -_STRETCH_TAIL
SHEAR = (4.0**_TERMS - 1.0) * _ZETA / np.pi ** (2.0 * _TERMS) / 4.0 ** (2.0 * _TERMS - 1.0)
STRETCH_SLOPE, DEVIATOR_SLOPE, SHEAR_SLOPE = polyder(STRETCH), polyder(DEVIATOR), polyder(SHEAR)

_NEXT, _LAST = (1, 2, 0), (2, 0, 1)

LARGEST_RELATIVE_ROTATION = 3.0
"""Largest rotation between the two nodes of one element [rad]; more needs more elements."""


def hat(vector: AnyArray) -> AnyArray:
    """Skew matrix of the cross product, (..., 3) -> (..., 3, 3): hat(a) b = a x b."""
    out = np.zeros((*vector.shape, 3), dtype=vector.dtype)
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -vector[..., 2], vector[..., 1], -vector[..., 0]
    return out - np.swapaxes(out, -1, -2)


def cross(one: AnyArray, other: AnyArray) -> AnyArray:
    """Cross product (..., 3) along the last axis, twenty times as quick as numpy's for the few vectors of a beam."""
    return one.take(_NEXT, -1) * other.take(_LAST, -1) - one.take(_LAST, -1) * other.take(_NEXT, -1)


def rotation_matrix(vector: AnyArray) -> AnyArray:
    """Rotation matrix of a Cartesian rotation vector [rad], (..., 3) -> (..., 3, 3)."""
    angle = np.sqrt(np.sum(vector * vector, axis=-1))[..., None, None]
    skew = hat(vector)
    return np.eye(3) + np.sinc(angle / np.pi) * skew + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * (skew @ skew)


def rotation_vector(matrix: AnyArray) -> AnyArray:
    """Cartesian rotation vector [rad] of a rotation matrix, (..., 3, 3) -> (..., 3); angles below pi."""
    axis_sine = 0.5 * np.stack(
        [
            matrix[..., 2, 1] - matrix[..., 1, 2],
            matrix[..., 0, 2] - matrix[..., 2, 0],
            matrix[..., 1, 0] - matrix[..., 0, 1],
        ],
        axis=-1,
    )
    one_plus_cosine = 0.5 * (1.0 + np.trace(matrix, axis1=-2, axis2=-1))
    tangent_squared = np.sum(axis_sine * axis_sine, axis=-1) / one_plus_cosine**2
    small = np.abs(tangent_squared) < 1e-6
    tangent = np.sqrt(np.where(small, 1.0, tangent_squared))
    arc = np.where(
        small, 1.0 - tangent_squared / 3.0 + tangent_squared**2 / 5.0, np.arctan(tangent) / tangent
    )
    return ((1.0 + tangent_squared) * arc)[..., None] * axis_sine


def about_x(angle: float) -> AnyArray:
    """Rotation matrix about the x axis [rad]."""
    return rotation_matrix(np.array([angle, 0.0, 0.0]))


def about_y(angle: float) -> AnyArray:
    """Rotation matrix about the y axis [rad]."""
    return rotation_matrix(np.array([0.0, angle, 0.0]))


def about_z(angle: float) -> AnyArray:
    """Rotation matrix about the z axis [rad]."""
    return rotation_matrix(np.array([0.0, 0.0, angle]))


def even(coefficients: AnyArray, squared_angle: AnyArray) -> AnyArray:
    """Value of an even function given by its coefficients in the squared angle."""
    return np.asarray(polyval(squared_angle, coefficients))


def rigid_displacement(point: AnyArray) -> AnyArray:
    """Displacement (3 p, 6) of points (p, 3) per unit translation and small rotation about the origin."""
    moves = np.broadcast_to(np.eye(3), (len(point), 3, 3))
    return np.concatenate([moves, -hat(point)], axis=2).reshape(-1, 6)
