"""What the blades of a rotor that turns steadily meet of a field over the disk (`flapgym.wind.field`), drawn at once.

With blade b at theta_b = theta + 2 pi (b - 1) / 3 and theta = theta_0 + Omega t, a field's harmonics U_m of the azimuth
are to the blades

    u(r, theta_b, t) = u_0(r, t) + 2 Re[z(r, t) exp(i theta_b)],
    u_0 = sum U_3k exp(3 i k theta),  z = sum U_3k+1 exp(3 i k theta)  over all k of either sign.

The U_m are stationary and independent, so u_0 and z are as well, and their cross-spectra are the sums of the
harmonics', each moved by the 3 k turns that the blades make against it. Sums of normal numbers are normal: u_0 and z
are drawn by themselves, however many harmonics there are, and theta_0 does not count. Which harmonic a wave belongs to
is lost, so this is no field on the disk; `flapgym.wind.field.disk_turbulence` makes one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from flapgym.core.arrays import BLADES, Array, ComplexArray
from flapgym.core.fields import Quantity
from flapgym.wind.field import WITHIN, checked_rings, shares_by_decay
from flapgym.wind.turbulence import Turbulence

REACH = 3.0
"""Highest harmonic that is summed, over the waves a turn that the blades pass at the highest frequency."""
BEYOND = 2.0
"""Frequency in the field, over the highest that blades meet, from which on nothing is summed: with harmonics that are
passed the other way, it would come down to what blades meet. Both limits together take 0.5 % of the spectrum at 3 Hz
at 0.7 of the radius, and 1.3 % at 0.4 of it (von Karman, 11 m/s)."""
PARTS = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 1.0], [0.0, 1.0j, -1.0j]])
"""Components 0, c, s of waves from those of u_0, 2 z at f, and the conjugate of 2 z at -f: from u_c - i u_s = 2 z."""


@dataclass(frozen=True, eq=False)
class BladeTurbulence:
    """Square roots of the cross-spectra of what blades meet at R rings, for unit standard deviation of the wind.

    Attributes
    ----------
    radii : (R,) float
        Of the rings [m].
    period : float
        After which a realisation repeats itself [s].
    frequencies : (F,) float
        At which there are waves, multiples of 1 / period from zero on [Hz].
    root : (F, 3, R, R) float
        Symmetric: root root' is the covariance of the real part of the waves of each part (`PARTS`), and of the
        imaginary part. Halved at zero, where both signs of f meet.
    """

    radii: Array
    period: float
    frequencies: Array
    root: Array

    @property
    def noise_count(self) -> int:
        """Standard normal numbers that make one realisation."""
        return 2 * self.root[..., 0].size

    def parts(self, noise: Array) -> ComplexArray:
        """Unit complex waves (F, 3, R) in the order of `root` from normal numbers (noise_count,).

        Raises
        ------
        ValueError
            If there is another number of them.
        """
        if noise.shape != (self.noise_count,):
            raise ValueError(f"noise: expected the shape ({self.noise_count},), got {noise.shape}")
        return np.ascontiguousarray(noise).view(np.complex128).reshape(self.root.shape[:3])

    def waves(self, noise: Array) -> ComplexArray:
        """Waves (F, R, 3): component c at ring r is the real part of their sum times exp(2 pi i f t)."""
        return np.einsum("cp,fprs,fps->frc", PARTS, self.root, self.parts(noise))


def blade_turbulence(
    field: Turbulence,
    radii: Array,
    wind_speed: float,
    rotor_speed: float,
    period: float,
    highest_frequency: float = 3.0,
) -> BladeTurbulence:
    """Prepare what blades meet of a field; kept, so that asking again costs nothing.

    Parameters
    ----------
    field : Turbulence
        Its strength does not count here.
    radii : (R,) float
        Of the rings, rising [m].
    wind_speed, rotor_speed : float
        [m/s, rad/s]
    period : float
        [s]
    highest_frequency : float
        Up to which the blades meet all that the field has [Hz]. The components have waves up to one turn above.

    Raises
    ------
    ValueError
        If one of these is out of range, or the field does not know its scale.
    """
    rings = checked_rings(radii, wind_speed, rotor_speed, highest_frequency)
    Quantity("time", above=0.0).check(period, "field.period")
    return _prepare(field, rings, wind_speed, rotor_speed, period, highest_frequency)


@lru_cache(maxsize=8)
def _prepare(
    field: Turbulence,
    rings: tuple[float, ...],
    wind_speed: float,
    rotor_speed: float,
    period: float,
    highest_frequency: float,
) -> BladeTurbulence:
    turn = rotor_speed / (2.0 * np.pi)
    highest = highest_frequency + turn
    frequencies = np.arange(math.floor(highest * period) + 1) / period
    # Averages about each frequency, so that no variance is lost or won, as in `disk_turbulence`.
    about = frequencies[:, None] + ((np.arange(WITHIN) + 0.5) / WITHIN - 0.5) / period
    shares = _shares(field, rings, wind_speed, BEYOND * highest, math.ceil(REACH * highest / turn))
    harmonics = len(shares) - 1
    covariance = np.zeros((len(frequencies), 3, len(rings), len(rings)))
    # In the order of PARTS: u_0 is of the harmonics 3 k, z of 3 k + 1 at either sign of the frequency.
    for part, (first, sign) in enumerate(((0, 1.0), (1, 1.0), (1, -1.0))):
        for m in range(-harmonics, harmonics + 1):
            if (m - first) % BLADES:
                continue
            met = np.abs(sign * about - (m - first) * turn)
            near = met.min(axis=1) < BEYOND * highest
            if near.any():
                inside = met[near]
                share = shares[abs(m)](field.decay(inside.ravel(), wind_speed))
                share = share.reshape(*inside.shape, *share.shape[1:])
                weight = field.spectrum(inside, wind_speed) / (WITHIN * period)
                covariance[near, part] += np.einsum("fw,fwrs->frs", weight, share)
    covariance[0] *= 0.5
    values, vectors = np.linalg.eigh(covariance)
    # At low frequencies u_0 is almost the same at all rings; round-off may leave the rest below zero.
    root = (vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :]) @ vectors.swapaxes(-1, -2)
    return BladeTurbulence(np.array(rings), period, frequencies, root)


@lru_cache(maxsize=4)
def _shares(
    field: Turbulence, rings: tuple[float, ...], wind_speed: float, highest: float, harmonics: int
) -> list[Callable[[Array], Array]]:
    """Kept by themselves, as they take longest, and are the same for realisations of any period."""
    limits = field.decay(np.array([0.0, highest]), wind_speed)
    return shares_by_decay(field, np.array(rings), limits, harmonics)
