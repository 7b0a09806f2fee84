"""Velocity induced by straight vortex segments and by grids of vortex rings (Biot-Savart law)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_BLOCK = 200_000  # point-node pairs handled at once: keeps the temporary arrays below about 50 MB


def _segment_velocity(start: Array, end: Array, start_length: Array, end_length: Array) -> Array:
    """Velocity per unit circulation, shape (..., 3), of segments given by vectors from the point to their ends.

    The form is singular on the segment only, not on its prolongation, so no vortex core is needed.
    """
    product = start_length * end_length
    along = np.einsum("...i,...i->...", start, end)
    scale = (start_length + end_length) / (4.0 * np.pi * product * (product + along))
    return np.asarray(np.cross(start, end) * scale[..., None])


def segment_velocity(point: Array, start: Array, end: Array) -> Array:
    """Velocity at points (..., 3) per unit circulation [1/m] of segments from start to end (..., 3) [m]."""
    a, b = start - point, end - point
    return _segment_velocity(a, b, np.linalg.norm(a, axis=-1), np.linalg.norm(b, axis=-1))


def ring_velocity(point: Array, node: Array) -> Array:
    """Velocity at points (m, 3) per unit circulation of every ring of a grid.

    Parameters
    ----------
    point : (m, 3) float
        Where the velocity is wanted [m], off every segment.
    node : (a + 1, b + 1, 3) float
        Corners of the rings [m]: first index downstream, second along the span, root to tip. Positive circulation
        runs root to tip along the upstream side.

    Returns
    -------
    (m, a, b, 3) float, [1/m].
    """
    r = node[None] - point[:, None, None]
    d = np.linalg.norm(r, axis=-1)
    across = _segment_velocity(r[:, :, :-1], r[:, :, 1:], d[:, :, :-1], d[:, :, 1:])
    down = _segment_velocity(r[:, :-1], r[:, 1:], d[:, :-1], d[:, 1:])
    return np.asarray(across[:, :-1] - across[:, 1:] + down[:, :, 1:] - down[:, :, :-1])


def ring_influence(point: Array, normal: Array, node: Array) -> Array:
    """Normal velocity at points (m, 3) per unit circulation of every ring of a grid, shape (m, a, b) [1/m]."""
    m, (a, b) = point.shape[0], (node.shape[0] - 1, node.shape[1] - 1)
    influence = np.empty((m, a, b))
    step = max(1, _BLOCK // (node.shape[0] * node.shape[1]))
    for first in range(0, m, step):
        block = slice(first, first + step)
        influence[block] = np.einsum("mabi,mi->mab", ring_velocity(point[block], node), normal[block])
    return influence
