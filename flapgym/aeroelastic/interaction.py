"""Beam and lattice joined: motion to downwash (eq. 9 to 11), panel forces to beam forces (Figure 4).

Everything here belongs to one blade and stands in the rotor frame S at azimuth zero.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flapgym.aerodynamics import Aerodynamics, MeanLoads
from flapgym.core.arrays import Array
from flapgym.structure import LinearBlade, blade_beam
from flapgym.structure.rotation import hat
from flapgym.turbine import Case


def lattice_shape(case: Case, blade: LinearBlade) -> tuple[Array, Array]:
    """Where the lattice's strips stand on the beam, and how they are turned from their undeformed attitude."""
    grid = case.discretisation
    first = grid.first_lattice_node
    straight = blade_beam(case.turbine, grid.blade_elements, case.operating_point.pitch).reference
    turned = blade.orientation[first:] @ straight.orientation[first:].transpose(0, 2, 1)
    return blade.position[first:], turned


def interpolation(blade: LinearBlade, point: Array) -> tuple[Array, Array]:
    """Displacement and rotation of points tied rigidly to the nearest station of the beam.

    Between nodes the beam's axis and rotation are interpolated linearly along the span, so a rigid
    motion of the nodes is reproduced exactly and forces on the points do the nodes' virtual work.

    Parameters
    ----------
    blade : LinearBlade
        Blade of n elements, root node clamped.
    point : (p, 3) float
        Points of the lattice [m].

    Returns
    -------
    displacement : (3 p, 6 n) float
        Displacement of the points per nodal degree of freedom.
    rotation : (3 p, 6 n) float
        Rotation of the section at the points per nodal degree of freedom.
    """
    element, outer, foot = _nearest_station(blade, point)
    count = len(blade.position)
    displacement = np.zeros((len(point), 3, count, 6))
    rotation = np.zeros_like(displacement)
    lever = -hat(point - foot)  # theta x arm = -[arm]x theta
    index = np.arange(len(point))
    for end, weight in ((element, 1.0 - outer), (element + 1, outer)):
        displacement[index, :, end, :3] += weight[:, None, None] * np.eye(3)
        displacement[index, :, end, 3:] += weight[:, None, None] * lever
        rotation[index, :, end, 3:] += weight[:, None, None] * np.eye(3)
    shape = (3 * len(point), 6 * (count - 1))
    return displacement[:, :, 1:].reshape(shape), rotation[:, :, 1:].reshape(shape)


def _nearest_station(blade: LinearBlade, point: Array) -> tuple[NDArray[np.int64], Array, Array]:
    """Element (p,) beside each point, how far out on it (0 to 1), and the beam's axis there (p, 3) [m]."""
    node = blade.position
    axis = (node[-1] - node[0]) / np.linalg.norm(node[-1] - node[0])
    station, span = node @ axis, point @ axis
    element = np.clip(np.searchsorted(station, span, side="right") - 1, 0, len(station) - 2)
    outer = (span - station[element]) / (station[element + 1] - station[element])
    return element, outer, (1.0 - outer)[:, None] * node[element] + outer[:, None] * node[element + 1]


def following_moments(blade: LinearBlade, loads: MeanLoads, shape: Array, virtual: Array) -> Array:
    """Loads (m + 6 + k, m) of mean forces and moments that turn with the sections they act on, per unit of the modes.

    The structure holds the trim's nodal forces and moments for dead. But a force's point of attack turns about the
    beam's axis, by (theta x arm) x F, and a section's pitching moment turns with its span, by theta x M: small terms,
    which a complete linearisation has. Rows: the modes ``shape`` (6 n, m), force and moment on the hub apex, and the
    work on ``virtual`` (6 n, k) displacements of the nodes.
    """
    modes = shape.shape[1]
    out = np.zeros((modes + 6 + virtual.shape[1], modes))
    for points, mean, arms in (
        (loads.force_point, loads.force, True),
        (loads.couple_point, loads.couple, False),
    ):
        if not len(points):
            continue
        rotation = interpolation(blade, points)[1]
        turning = rotation @ shape
        turn = turning.reshape(-1, 3, modes)
        if arms:
            arm = points - _nearest_station(blade, points)[2]
            moment = np.einsum("pij,pjk,pkm->pim", -hat(mean), -hat(arm), turn)  # (theta x arm) x F
        else:
            moment = np.einsum("pij,pjm->pim", -hat(mean), turn)
        out[:modes] += turning.T @ moment.reshape(-1, modes)
        out[modes + 3 : modes + 6] += moment.sum(axis=0)
        out[modes + 6 :] += (rotation @ virtual).T @ moment.reshape(-1, modes)
    return out


def turned_forces(
    blade: LinearBlade, point: Array, force: Array, axis: Array, shape: Array, virtual: Array
) -> Array:
    """Loads (m + 6 + k,) of forces (p, 3) at points of a blade, per radian by which they turn about an axis (3,).

    Rows as those of ``following_moments``.
    """
    turned = np.cross(axis, force)
    nodal = interpolation(blade, point)[0].T @ turned.ravel()
    moment = np.cross(point, turned).sum(axis=0)
    return np.concatenate([shape.T @ nodal, turned.sum(axis=0), moment, virtual.T @ nodal])


def velocity_downwash(aero: Aerodynamics, displacement: Array) -> Array:
    """Downwash (p, k) at the collocation points per unit rate of k motions of displacement (3 p, k)."""
    return -np.einsum("pi,pik->pk", aero.normal, _by_point(displacement))


def displacement_downwash(
    aero: Aerodynamics, rotor_speed: float, displacement: Array, rotation: Array
) -> Array:
    """Downwash (p, k) at the collocation points per unit of k held motions in the rotating frame.

    A turned section meets the relative wind at another angle, and a displaced one moves at another speed:
    w = (theta x n) . V_rel - n . (Omega x u).
    """
    normal = aero.normal
    turned = np.einsum(
        "pi,pik->pk", np.cross(normal, aero.relative_velocity), _by_point(rotation)
    )  # (theta x n) . V = theta . (n x V)
    spin = hat(np.array([rotor_speed, 0.0, 0.0]))
    return np.asarray(turned - np.einsum("pi,ij,pjk->pk", normal, spin, _by_point(displacement)))


def hub_turn_downwash(aero: Aerodynamics, wind_speed: float) -> Array:
    """Downwash (p, 3) per unit rotation of the whole rotor, which then meets the wind askew (eq. 11).

    The rotor carries its own rotation axis with it, so only the wind changes: w = -n . (phi x U e_x).
    """
    wind = np.array([wind_speed, 0.0, 0.0])
    return -np.cross(wind, aero.normal)  # n . (phi x U) = phi . (U x n)


def _by_point(matrix: Array) -> Array:
    return matrix.reshape(-1, 3, matrix.shape[1])
