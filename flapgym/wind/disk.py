"""Where the points of a rotor's blades are, seen from its tower: what the wind over the disk needs of the turbine."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from flapgym.core.arrays import Array
from flapgym.core.fields import Column, Quantity, check_fields
from flapgym.core.units import DEGREE

_Angle = Annotated[float, Quantity("angle", above=-45 * DEGREE, below=45 * DEGREE)]


@dataclass(frozen=True, eq=False)
class Disk:
    """Geometry of a rotor upwind of its tower; lengths [m], angles [rad]. The bending of the blades is left out.

    Attributes
    ----------
    radius : float
        From the rotor apex to the tip, along the blade.
    hub_height : float
        Of the rotor apex above the ground.
    overhang : float
        From the yaw axis to the apex along the shaft.
    tilt, precone : float
        Of the shaft, its rotor end up, and of the blades, upwind out of the rotor plane.
    tower_height, tower_radius : (n,) float
        Stations above the ground and the tower's radius there.
    """

    radius: Annotated[float, Quantity("length", above=0.0)]
    hub_height: Annotated[float, Quantity("length", above=0.0)]
    overhang: Annotated[float, Quantity("length", above=0.0)]
    tilt: _Angle
    precone: _Angle
    tower_height: Annotated[Array, Column("length", at_least=0.0, increasing=True)]
    tower_radius: Annotated[Array, Column("length", above=0.0)]

    def __post_init__(self) -> None:
        check_fields(self, "disk")
        if not self.radius < self.hub_height:
            raise ValueError(
                f"disk.radius: expected less than disk.hub_height ({self.hub_height:g} m), got {self.radius:g} m"
            )

    def points(self, radius: Array, azimuth: Array) -> tuple[Array, Array, Array]:
        """Places of blade points: ahead (upwind) of the tower's axis, left of it, above the ground, (R, K) each [m].

        Left is that of one who looks downwind.

        Parameters
        ----------
        radius : (R,) float
            From the apex along the blade [m].
        azimuth : (K,) float
            Of the blade [rad]: zero upright, growing clockwise for one who looks downwind.
        """
        outwards, along = radius[:, None] * math.cos(self.precone), radius[:, None] * math.sin(self.precone)
        upright, left = outwards * np.cos(azimuth), -outwards * np.sin(azimuth)
        # The shaft points upwind and up, so the rotor's upright direction leans back by the tilt.
        cosine, sine = math.cos(self.tilt), math.sin(self.tilt)
        ahead = (self.overhang + along) * cosine - upright * sine
        return ahead, left, self.hub_height + along * sine + upright * cosine

    def tower_radius_at(self, height: Array) -> Array:
        """Radius of the tower at heights [m], same shape [m]; above its top that of the top."""
        return np.interp(height, self.tower_height, self.tower_radius)


def annulus_weights(radii: Array) -> Array:
    """Shares (R,) of rings (R,) [m] in the mean over a disk, each for the annulus up to midway to its neighbours."""
    annuli = radii * np.gradient(radii) if len(radii) > 1 else np.ones(1)
    return np.asarray(annuli / annuli.sum())
