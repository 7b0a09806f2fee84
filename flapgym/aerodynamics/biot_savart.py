"""Velocity induced by straight vortex segments and by grids of vortex rings (Biot-Savart law)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from flapgym.core.arrays import Array

# Below this 1 + cos(angle seen between the ends) a point lies on the segment to within rounding.
_ON_SEGMENT = 1e-13
_BLOCK = 200_000  # point-node pairs handled at once: keeps the temporary arrays below about 50 MB


def _segment_velocity(start: Array, end: Array, start_length: Array, end_length: Array) -> Array:
    """Velocity per unit circulation, shape (..., 3), of segments given by vectors from the point to their ends.

    The form is singular on the segment only, not on its prolongation, so no vortex core is needed. On the segment
    itself, where the mean of the velocity over a circle around it is meant, it is zero.
    """
    product = start_length * end_length
    gap = product + np.einsum("...i,...i->...", start, end)
    on_segment = gap <= _ON_SEGMENT * product
    scale = (start_length + end_length) / (4.0 * np.pi * product * np.where(on_segment, np.inf, gap))
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
    for block in _blocks(m, node):
        influence[block] = np.einsum("mabi,mi->mab", ring_velocity(point[block], node), normal[block])
    return influence


def velocity_influence(point: Array, node: Array) -> Array:
    """Velocity at points (m, 3) per unit circulation of every ring of a grid, shape (m, 3, a, b) [1/m]."""
    m, (a, b) = point.shape[0], (node.shape[0] - 1, node.shape[1] - 1)
    influence = np.empty((m, 3, a, b))
    for block in _blocks(m, node):
        influence[block] = ring_velocity(point[block], node).transpose(0, 3, 1, 2)
    return influence


def induced_velocity(point: Array, node: Array, circulation: Array) -> Array:
    """Velocity (m, 3) [m/s] at points (m, 3) of a grid of rings with circulations (a, b) [m^2/s]."""
    velocity = np.empty_like(point)
    for block in _blocks(point.shape[0], node):
        velocity[block] = np.einsum("mabi,ab->mi", ring_velocity(point[block], node), circulation)
    return velocity


def _blocks(points: int, node: Array) -> Iterator[slice]:
    step = max(1, _BLOCK // (node.shape[0] * node.shape[1]))
    return (slice(first, first + step) for first in range(0, points, step))
