"""The march of a plant's modes from interval to interval, compiled: it is half of what a bound computes."""

from __future__ import annotations

import numpy as np
from numba import njit

from flapgym.core.arrays import Array


@njit(cache=True)  # type: ignore[untyped-decorator]
def march(real: Array, imaginary: Array, pushes: Array) -> Array:
    """Modes at the start of every interval, from rest, of what each interval adds to them; real parts first (K, 2 M).

    Parameters
    ----------
    real, imaginary : (M,) float
        Of what an interval leaves of the modes.
    pushes : (K, 2 M) float
    """
    count, half = pushes.shape[0], real.size
    found = np.empty((count, 2 * half))
    found[0] = 0.0
    for k in range(count - 1):
        for m in range(half):
            x, y = found[k, m], found[k, half + m]
            found[k + 1, m] = real[m] * x - imaginary[m] * y + pushes[k, m]
            found[k + 1, half + m] = real[m] * y + imaginary[m] * x + pushes[k, half + m]
    return found
