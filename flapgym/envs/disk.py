"""The wind over the rotor's disk for a picture: what blows in an episode, and its colours, pixel by pixel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flapgym.core.arrays import Array, BoolArray, IntArray
from flapgym.plant.surroundings import Surroundings
from flapgym.wind import Inflow
from flapgym.wind.blade_field import FieldOnDisk
from flapgym.wind.box_field import BoxOnDisk

AZIMUTHS = 360
"""At which rings are sampled: at the rim of the picture, two pixels apart."""
SHOWN_DEVIATIONS = 3.0
"""Ends of the colours, in standard deviations of the wind over the disk."""

SCALE = np.array([(166, 110, 40), (245, 245, 242), (30, 135, 120)], dtype=float)
"""Colours from slow to fast wind: brown over near-white to teal. Neither is a flap's blue or red, and eyes that
do not tell red from green tell them (the choice of ColorBrewer's BrBG). Blades and their numbers stand out on all."""


@dataclass(frozen=True, eq=False)
class EpisodeWind:
    """All that blows at the blades in one episode.

    Attributes
    ----------
    field : FieldOnDisk or BoxOnDisk
        The turbulence.
    azimuth, turn : float
        Of blade 1 as the episode begins, and of one step [rad].
    time_step : float
        [s]
    steps_per_action : int
    steady : (R, AZIMUTHS) float
        Shear, tower and the like [m/s].
    gust : (T + 1,) float
        Of every plant step of the episode, the same over the disk [m/s].
    deviation : float
        Standard deviation of turbulence and steady wind over the disk and time [m/s].
    parts : str
        What it is made of, for people.
    """

    field: FieldOnDisk | BoxOnDisk
    azimuth: float
    turn: float
    time_step: float
    steps_per_action: int
    steady: Array
    gust: Array
    deviation: float
    parts: str

    def at(self, elapsed: int) -> Array:
        """Perturbation (R, AZIMUTHS) [m/s] on rings and azimuths after so many actions; the last after the episode."""
        step = min(elapsed * self.steps_per_action, len(self.gust) - 1)
        field = self.field.on_disk(step * self.time_step, self.azimuth + step * self.turn, azimuths())
        return field + self.steady + self.gust[step]


def azimuths() -> Array:
    """Evenly over a turn, (AZIMUTHS,) [rad]."""
    return np.linspace(0.0, 2.0 * np.pi, AZIMUTHS, endpoint=False)


def parts_of(around: Surroundings, gust: bool) -> str:
    """What the wind over the disk is made of, in words."""
    inflow = Inflow() if around.inflow is None else around.inflow
    there = {
        "field": around.field is not None,
        "shear": bool(inflow.shear_exponent) or inflow.roughness_length is not None,
        "yaw error": bool(inflow.yaw_error),
        "upflow": bool(inflow.upflow),
        "tower": inflow.tower_shadow,
        "gust": gust,
    }
    return " + ".join(name for name, blows in there.items() if blows)


@dataclass(frozen=True, eq=False)
class Raster:
    """The pixels of a disk, and where each stands between rings and azimuths.

    Attributes
    ----------
    inside : (D, D) bool
        Columns, then rows from the top: pixels of the disk.
    ring, turn : (n,) int
        Ring, counted with the centre as the zeroth, and azimuth just before each of these pixels.
    between_rings, between_turns : (n,) float
        Share of the way to the next.
    """

    inside: BoolArray
    ring: IntArray
    turn: IntArray
    between_rings: Array
    between_turns: Array

    @classmethod
    def of(cls, radii: Array, rotor_radius: float, reach: int) -> Raster:
        """Of rings of these radii (R,) [m]; the rotor's radius [m] is `reach` pixels, and D is 2 reach + 1."""
        right, down = np.meshgrid(np.arange(-reach, reach + 1), np.arange(-reach, reach + 1), indexing="ij")
        distance = np.hypot(right, down) * (rotor_radius / reach)
        inside = distance <= rotor_radius
        # Beyond the outermost ring its wind goes on to the tip.
        rings = np.concatenate([[0.0], radii])
        place = np.interp(distance[inside], rings, np.arange(len(rings)))
        ring = np.minimum(place.astype(np.int64), len(radii) - 1)
        # From the top clockwise, as azimuths grow seen from upwind.
        turned = (np.arctan2(right, -down)[inside] / (2.0 * np.pi) % 1.0) * AZIMUTHS
        turn = turned.astype(np.int64)
        return cls(inside, ring, turn % AZIMUTHS, place - ring, turned - turn)

    def values(self, wind: Array) -> Array:
        """Wind (n,) at the pixels of a wind (R, AZIMUTHS) on rings, linear between them."""
        # At the centre all azimuths meet.
        rings = np.vstack([np.full(wind.shape[1], wind[0].mean()), wind])
        after = (self.turn + 1) % AZIMUTHS
        inner, outer = (
            rings[ring, self.turn] * (1.0 - self.between_turns) + rings[ring, after] * self.between_turns
            for ring in (self.ring, self.ring + 1)
        )
        return np.asarray(inner + (outer - inner) * self.between_rings)


def wind_colours(share: Array) -> NDArray[np.uint8]:
    """Colours (n, 3) of winds over the end of the scale (n,); those beyond -1 and 1 have the colours of the ends."""
    bands = [np.interp(share, (-1.0, 0.0, 1.0), band) for band in SCALE.T]
    return np.rint(np.stack(bands, axis=-1)).astype(np.uint8)
