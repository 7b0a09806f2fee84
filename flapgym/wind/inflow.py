"""The steady wind over the disk: shear, yaw error, upflow and the tower ahead of which the blades pass.

What a blade meets of it depends on its azimuth alone, so multi-blade components of it are constant but for harmonics
of three times the rotor's speed (`Inflow.components`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from flapgym.core.arrays import Array, ComplexArray
from flapgym.core.fields import Count, Flag, Numbers, OrNone, Quantity, check_fields
from flapgym.core.multiblade import component_harmonics
from flapgym.core.units import DEGREE
from flapgym.wind.disk import Disk

LEFT_OUT = 1e-4
"""Share of a ring's variance over the azimuth that the harmonics may leave out by default."""
AZIMUTHS = 2048
"""At which the disk is sampled for its harmonics."""
HIGHEST = AZIMUTHS // 4 - 1
"""Harmonic: beyond it the samples are too few. A tower's dip at radius r, x behind the blade, falls as
exp(-m x / r) with the harmonic m: to below 1e-8 here, as long as x is more than 4 % of r."""

_Misalignment = Annotated[float, Quantity("angle", above=-60 * DEGREE, below=60 * DEGREE)]


@dataclass(frozen=True)
class Inflow:
    """What the steady wind over the disk has beside the model's mean wind; all of it off by default.

    The mean wind U is the model's, along the shaft at hub height. The perturbation is about it, so the mean over the
    disk that shear and tower change is part of the perturbation.

    Attributes
    ----------
    shear_exponent : float
        alpha of the power law U (z / z_hub)^alpha; 0.2 in the normal wind profile of IEC 61400-1:2005, 6.3.1.2.
    roughness_length : float or None
        z_0 of the logarithmic law U ln(z / z_0) / ln(z_hub / z_0) in its place [m].
    yaw_error : float
        Angle between shaft and wind seen from above [rad], positive where the wind blows to the left of one who looks
        downwind along the shaft.
    upflow : float
        Inclination of the wind to the horizontal, upwards [rad]; 8 deg in IEC 61400-1:2005, 6.3.
    tower_shadow : bool
        Whether the tower's dam is felt ahead of it.
    """

    shear_exponent: Annotated[float, Quantity("number", at_least=-1.0, at_most=1.0)] = 0.0
    roughness_length: Annotated[float | None, OrNone(Quantity("length", above=0.0, at_most=10.0))] = None
    yaw_error: _Misalignment = 0.0
    upflow: _Misalignment = 0.0
    tower_shadow: Annotated[bool, Flag()] = False

    def __post_init__(self) -> None:
        check_fields(self, "inflow")
        if self.shear_exponent and self.roughness_length is not None:
            raise ValueError(
                "inflow.roughness_length: expected None beside a shear_exponent (one law of shear), got "
                f"{self.roughness_length:g} m"
            )

    def on_disk(self, radius: Array, azimuth: Array, disk: Disk, mean: float) -> Array:
        """Perturbation along the shaft (R, K) [m/s] about the mean wind [m/s].

        The yaw error's share is that along the shaft, the same everywhere; `crosswind` has the other. The tower's dam
        stays where it is without one.

        Parameters
        ----------
        radius : (R,) float
            From the apex along the blade, up to the tip [m].
        azimuth : (K,) float
            Of the blade [rad]: zero upright, growing clockwise for one who looks downwind.
        disk : Disk
        mean : float
            U [m/s].

        Raises
        ------
        ValueError
            If a radius is beyond the tip, a blade point lies inside the tower, or below the roughness length.
        """
        radius = Numbers("length", axes=1, at_least=0.0, at_most=disk.radius).check(radius, "inflow.radius")
        ahead, left, height = disk.points(radius, Numbers("angle", axes=1).check(azimuth, "inflow.azimuth"))
        factor = self._shear(height, disk) * self._alignment(disk)
        if self.tower_shadow:
            factor = factor * (1.0 + tower_dam(ahead, left, height, disk))
        return mean * (factor - 1.0)

    def _shear(self, height: Array, disk: Disk) -> Array:
        """The wind over that at hub height, same shape."""
        if self.roughness_length is None:
            return (height / disk.hub_height) ** self.shear_exponent
        lowest = float(height.min())
        if not self.roughness_length < min(lowest, disk.hub_height):
            raise ValueError(
                f"inflow.roughness_length: expected less than the height of the lowest blade point ({lowest:.4g} m), "
                f"got {self.roughness_length:g} m"
            )
        return np.log(height / self.roughness_length) / math.log(disk.hub_height / self.roughness_length)

    def _direction(self, disk: Disk) -> tuple[float, float, float]:
        """Wind along the shaft, to the left and up in the rotor plane, over the mean wind."""
        yaw, upflow, tilt = self.yaw_error, self.upflow, disk.tilt
        # Over the cosine of the tilt: the mean wind is what a wind without yaw error and upflow has along the shaft.
        level, up = math.cos(upflow) * math.cos(yaw), math.sin(upflow)
        along = level - up * math.tan(tilt)
        left = math.cos(upflow) * math.sin(yaw) / math.cos(tilt)
        return along, left, level * math.tan(tilt) + up

    def _alignment(self, disk: Disk) -> float:
        return self._direction(disk)[0]

    def crosswind(self, azimuth: Array, disk: Disk, mean: float) -> Array:
        """Wind in the rotor plane, in the direction in which the blade moves (K,) [m/s].

        A section's speed through the air is the rotor speed times its radius less this. It is no part of `on_disk`:
        it is for models that have an input for it. The shaft's tilt has its share, also without yaw error and upflow;
        shear and tower do not.

        Parameters
        ----------
        azimuth : (K,) float
            Of the blade [rad].
        disk : Disk
        mean : float
            Wind along the shaft [m/s].
        """
        _, left, up = self._direction(disk)
        return -mean * (left * np.cos(azimuth) + up * np.sin(azimuth))

    def harmonics(
        self, radius: Array, disk: Disk, mean: float, highest: int | None = None, left_out: float = LEFT_OUT
    ) -> ComplexArray:
        """Harmonics over the azimuth: c_m (M + 1, R) [m/s] of the perturbation Re sum of c_m exp(i m theta).

        Parameters
        ----------
        radius : (R,) float
            [m]
        disk : Disk
        mean : float
            [m/s]
        highest : int or None
            M, a multiple of three and one (what `component_harmonics` needs). By default the lowest that leaves out no
            more than `left_out` of any ring's variance over the azimuth.
        left_out : float

        Raises
        ------
        ValueError
            As `on_disk`, and if `highest` is another number, or more than `HIGHEST`.
        """
        azimuth = np.linspace(0.0, 2.0 * np.pi, AZIMUTHS, endpoint=False)
        samples = self.on_disk(radius, azimuth, disk, mean)
        found = np.fft.rfft(samples, axis=1).T * (2.0 / AZIMUTHS)
        found[0] *= 0.5
        if highest is None:
            highest = _enough(found, left_out)
        Count(at_least=1, at_most=HIGHEST).check(highest, "inflow.highest")
        return np.asarray(found[: highest + 1])

    def components(
        self, radius: Array, disk: Disk, mean: float, highest: int | None = None, left_out: float = LEFT_OUT
    ) -> ComplexArray:
        """Harmonics 0, 3, 6, ... of the multi-blade components of the perturbation, (N + 1, R, 3) [m/s].

        With the rotor's azimuth theta, (u_0, u_c, u_s) = Re sum over k of d_k exp(3 i k theta). Parameters and errors
        are those of `harmonics`.
        """
        return component_harmonics(self.harmonics(radius, disk, mean, highest, left_out))


def tower_dam(ahead: Array, left: Array, height: Array, disk: Disk) -> Array:
    """Change of the wind ahead of the tower over the undisturbed wind, same shape as the places [m].

    Potential flow around a cylinder of radius a, its axis at x = y = 0, is that of dipoles along the axis:
    u / U - 1 = a^2 (y^2 - x^2) / (x^2 + y^2)^2. Here the dipoles end at the tower's top, so the potential is
    U a^2 x / (2 rho^2) (1 + h / s), rho^2 = x^2 + y^2 and s^2 = rho^2 + h^2, at a depth h below the top: the cylinder's
    for h >> rho, half of it at the top's height, nothing far above. The radius is the local one (slender taper).

    Raises
    ------
    ValueError
        If a place below the top lies inside the tower.
    """
    radius = disk.tower_radius_at(height)
    depth = disk.tower_height[-1] - height
    square = ahead**2 + left**2
    inside = (square <= radius**2) & (depth >= 0.0)
    if inside.any():
        raise ValueError(
            "disk.overhang: expected blades that pass clear of the tower, got a point "
            f"{math.sqrt(square[inside].min()):.3g} m from its axis, where its radius is {radius[inside].max():.3g} m"
        )
    distance = np.sqrt(square + depth**2)
    cylinder = (left**2 - ahead**2) / square**2
    end = ahead**2 * depth / (square * distance**3)
    return 0.5 * radius**2 * (cylinder * (1.0 + depth / distance) - end)


def _enough(harmonics: ComplexArray, left_out: float) -> int:
    """Lowest multiple of three and one beyond which no ring has more than a share of its variance.

    A ring whose wind hardly changes (to rounding) asks for none.
    """
    power = np.abs(harmonics[1:]) ** 2  # of harmonics 1 and up
    beyond = power[::-1].cumsum(axis=0)[::-1]  # of harmonics 1, 2, ... and all above
    smallest = np.finfo(np.float64).eps * max(1.0, float(np.abs(harmonics[0]).max()) ** 2)
    needed = (beyond > np.maximum(left_out * beyond[0], smallest)).any(axis=1)
    last = int(np.flatnonzero(needed).max(initial=-1)) + 1
    return min(1 + 3 * max(0, math.ceil((last - 1) / 3)), HIGHEST)
