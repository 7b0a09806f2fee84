"""Downwash of trailing-edge flaps and of gusts at the collocation points (paper eq. 9).

Positive downwash points downwind, from the pressure to the suction side: it raises lift and root bending moment.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flapgym.aerodynamics.model import Aerodynamics
from flapgym.core.arrays import Array
from flapgym.turbine import Flap


def glauert_lift(chord_fraction: float) -> float:
    """Lift coefficient per flap angle [1/rad] of a thin aerofoil with a plain flap (Glauert 1927)."""
    hinge = np.arccos(2.0 * chord_fraction - 1.0)
    return float(2.0 * (np.pi - hinge + np.sin(hinge)))


def flap_cover(chordwise: int, chord_fraction: float) -> tuple[Array, Array]:
    """Share of each of `chordwise` equal panels that a flap covers, and the flap's arm there, both (chordwise,).

    The arm is the distance from the hinge, in chords, of the three-quarter point of the covered part.
    """
    edge = np.arange(chordwise + 1) / chordwise
    hinge = 1.0 - chord_fraction
    start = np.clip(edge[:-1], hinge, None)
    # Differences below a rounding error would otherwise count a neighbouring panel in.
    covered = np.where(edge[1:] - start > 1e-9, edge[1:] - start, 0.0)
    return covered * chordwise, np.where(covered > 0.0, start + 0.75 * covered - hinge, 0.0)


def panel_lift(cover: Array) -> float:
    """Lift coefficient per angle [1/rad] that a 2-D lattice gives when its panels turn by the shares `cover` (nc,)."""
    nc = cover.size
    vortex = (np.arange(nc) + 0.25) / nc
    point = (np.arange(nc) + 0.75) / nc
    circulation = np.linalg.solve(1.0 / (2.0 * np.pi * (point[:, None] - vortex)), cover)
    return float(2.0 * circulation.sum())


def glauert_scale(chordwise: int, chord_fraction: float) -> float:
    """Ratio of Glauert's flap lift to the lattice's own: 1.123 for one panel of ten."""
    return glauert_lift(chord_fraction) / panel_lift(flap_cover(chordwise, chord_fraction)[0])


def span_cover(edge: Array, span_start: float, span_end: float) -> Array:
    """Share of each strip between two fractions of the span, for strips with edges (strips + 1,) along it.

    An end within a hundredth of a strip of a strip's edge is taken to be there: printed radii are rounded, and a
    deflected blade's strips do not keep their share of the span to the last digit.
    """
    fraction = (edge - edge[0]) / (edge[-1] - edge[0])
    width = np.diff(fraction)
    covered = np.clip(fraction[1:], None, span_end) - np.clip(fraction[:-1], span_start, None)
    share = np.clip(covered / width, 0.0, 1.0)
    return np.where(share < 0.01, 0.0, np.where(share > 0.99, 1.0, share))


def flap_downwash(aero: Aerodynamics, flap: Flap) -> tuple[Array, Array]:
    """Downwash of a plain flap on blade 1, per angle and per rate; those of several flaps add.

    The flap turns about the hinge line `flap.chord_fraction` of the local chord ahead of the trailing edge, over
    the fractions `flap.span_start` to `flap.span_end` of the lattice's span; panels it covers in part count in part.
    `flap.effectiveness` scales all of it: a number, or "glauert" for the ratio that gives Glauert's static lift.

    Returns
    -------
    angle : (n,) float
        Downwash per angle [m/s per rad], trailing edge towards the upwind (pressure) side.
    rate : (n,) float
        Downwash per rate [m/s per rad/s].
    """
    lattice = aero.lattice
    cover, arm = flap_cover(lattice.chordwise, flap.chord_fraction)
    glauert = flap.effectiveness == "glauert"
    scale = glauert_scale(lattice.chordwise, flap.chord_fraction) if glauert else float(flap.effectiveness)
    length = np.linalg.norm(lattice.chord_vector, axis=1)
    chord_direction = lattice.chord_vector / length[:, None]
    velocity = aero.relative_velocity.reshape(lattice.chordwise, lattice.strips, 3)
    tangential = np.einsum("csi,si->cs", velocity, chord_direction)
    share = scale * cover[:, None] * span_cover(lattice.span, flap.span_start, flap.span_end)
    return (share * tangential).ravel(), (share * arm[:, None] * length).ravel()


def gust_downwash(aero: Aerodynamics) -> Array:
    """Downwash of a gust along the shaft, one column a strip, shape (n, strips), m/s per m/s.

    All panels of a strip feel it at once, as in the paper. The sum of the columns is a gust homogeneous over the
    rotor.
    """
    strips = aero.lattice.strips
    return np.asarray(np.tile(np.eye(strips), (aero.lattice.chordwise, 1)) * aero.normal[:, :1])


def gust_arrival(aero: Aerodynamics, z: ArrayLike) -> NDArray[np.complex128]:
    """What a gust that travels along the chord with the relative wind is at each collocation point, (nz, n).

    Over the gust at the strip's leading edge: later panels feel it after the time the air needs to reach them,
    interpolated linearly between steps so that it stays causal.
    """
    lattice = aero.lattice
    length = np.linalg.norm(lattice.chord_vector, axis=1)
    tangential = np.einsum(
        "csi,si->cs",
        aero.relative_velocity.reshape(lattice.chordwise, lattice.strips, 3),
        lattice.chord_vector / length[:, None],
    )
    station = (np.arange(lattice.chordwise) + 0.75)[:, None] / lattice.chordwise * length
    delay = (station / tangential / aero.time_step).ravel()
    whole = np.floor(delay)
    z = np.atleast_1d(np.asarray(z, dtype=complex))[:, None]
    return np.asarray(z**-whole * (1.0 - (delay - whole) * (1.0 - 1.0 / z)))


def convected_gust_downwash(aero: Aerodynamics, z: ArrayLike) -> NDArray[np.complex128]:
    """The downwash of such a gust, one column a strip, shape (nz, n, strips), m/s per m/s."""
    return gust_arrival(aero, z)[:, :, None] * gust_downwash(aero)
