"""Modal truncation of the structure (Section II.D)."""

from __future__ import annotations

import numpy as np
import scipy.linalg

from flapgym.core.arrays import Array
from flapgym.core.fields import Count, Numbers


def normal_modes(mass: Array, stiffness: Array, count: int) -> tuple[Array, Array]:
    """Lowest undamped modes, mass-normalised.

    Parameters
    ----------
    mass, stiffness : (n, n) float
        Symmetric; mass positive definite.
    count : int
        Modes to keep, 1 <= count <= n.

    Returns
    -------
    frequency : (count,) float
        Angular natural frequencies [rad/s], ascending.
    shape : (n, count) float
        Mode shapes with shape.T @ mass @ shape = I, each with its largest entry positive.

    Raises
    ------
    ValueError
        If ``count`` is out of range or a mode is not restored by its stiffness.
    """
    n = mass.shape[0]
    for name, matrix in (("mass", mass), ("stiffness", stiffness)):
        if Numbers(axes=2).check(matrix, f"normal_modes.{name}").shape != (n, n):
            raise ValueError(f"normal_modes.{name}: expected shape {(n, n)}, got {matrix.shape}")
    Count(at_least=1, at_most=n).check(count, "normal_modes.count")
    values, shape = scipy.linalg.eigh(
        0.5 * (stiffness + stiffness.T), 0.5 * (mass + mass.T), subset_by_index=[0, count - 1]
    )
    if values[0] <= 0.0:
        raise ValueError(f"normal_modes: lowest squared frequency is {values[0]:.3g}, the structure is loose")
    largest = np.abs(shape).argmax(axis=0)
    return np.sqrt(values), shape * np.sign(shape[largest, np.arange(count)])
