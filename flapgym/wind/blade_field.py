"""What the blades of a rotor that turns steadily meet of a field over the disk (`flapgym.wind.field`), drawn at once.

With blade b at theta_b = theta + 2 pi (b - 1) / 3 and theta = theta_0 + Omega t, a field's harmonics U_m of the azimuth
are to the blades

    u(r, theta_b, t) = u_0(r, t) + 2 Re[z(r, t) exp(i theta_b)],
    u_0 = sum U_3k exp(3 i k theta),  z = sum U_3k+1 exp(3 i k theta)  over all k of either sign.

The U_m are stationary and independent, so u_0 and z are as well, and their cross-spectra are the sums of the
harmonics', each moved by the 3 k turns that the blades make against it. Sums of normal numbers are normal: u_0 and z
are drawn by themselves, however many harmonics there are, and theta_0 does not count. Which harmonic a wave belongs to
is not drawn. For a picture of the disk each harmonic takes what it most likely has of the sum (`field_on_disk`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from flapgym.core.arrays import BLADES, Array, BoolArray, ComplexArray, IntArray
from flapgym.core.fields import Quantity
from flapgym.wind.field import WITHIN, checked_rings, shares_by_decay
from flapgym.wind.turbulence import Turbulence

REACH = 3.0
"""Highest harmonic that is summed, over the waves a turn that the blades pass at the highest frequency."""
BEYOND = 2.0
"""Frequency in the field, over the highest that blades meet, from which on nothing is summed: with harmonics that are
passed the other way, it would come down to what blades meet. Both limits together take 0.5 % of the spectrum at 3 Hz
at 0.7 of the radius, and 1.3 % at 0.4 of it (von Karman, 11 m/s)."""
PARTS = np.array([[1.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 1.0], [0.0, 0.0, 1.0j, -1.0j]])
"""Components 0, c, s of waves from those of U_0, which is the mean around each ring, the rest of u_0, 2 z at f, and the
conjugate of 2 z at -f: from u_c - i u_s = 2 z."""


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
    root : (F, 4, R, R) float
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
        """Unit complex waves (F, 4, R) in the order of `root` from normal numbers (noise_count,).

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
    frequencies = np.arange(math.floor((highest_frequency + turn) * period) + 1) / period
    covariance = np.zeros((len(frequencies), len(PARTS.T), len(rings), len(rings)))
    for part, _, near, _, own in of_harmonics(field, rings, wind_speed, turn, period, frequencies):
        covariance[near, part] += own
    values, vectors = np.linalg.eigh(covariance)
    # At low frequencies u_0 is almost the same at all rings; round-off may leave the rest below zero.
    root = (vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :]) @ vectors.swapaxes(-1, -2)
    return BladeTurbulence(np.array(rings), period, frequencies, root)


def of_harmonics(
    field: Turbulence,
    rings: tuple[float, ...],
    wind_speed: float,
    turn: float,
    period: float,
    frequencies: Array,
) -> Iterator[tuple[int, int, BoolArray, Array, Array]]:
    """Part, harmonic m, at which frequencies (F,) it counts, those the field has there, its share in the covariance.

    Parameters
    ----------
    field : Turbulence
    rings : tuple of R float
        Radii [m].
    wind_speed : float
        [m/s]
    turn : float
        Turns of the rotor a second [Hz].
    period : float
        [s]
    frequencies : (F,) float
        That blades meet, multiples of 1 / period from zero on [Hz].

    Yields
    ------
    part, m : int
    near : (F,) bool
    met : (.,) float
        Modulus of the frequencies in axes that stand [Hz].
    own : (., R, R) float
        Of the part's covariance at these frequencies.
    """
    highest = frequencies[-1]
    # Averages about each frequency, so that no variance is lost or won, as in `disk_turbulence`.
    about = frequencies[:, None] + ((np.arange(WITHIN) + 0.5) / WITHIN - 0.5) / period
    shares = _shares(field, rings, wind_speed, BEYOND * highest, math.ceil(REACH * highest / turn))
    harmonics = len(shares) - 1
    every = range(-harmonics, harmonics + 1)
    # In the order of PARTS: u_0 is of the harmonics 3 k, z of 3 k + 1 at either sign of the frequency.
    of_parts = (
        (0, 1.0, [0]),
        (0, 1.0, [m for m in every if m and m % BLADES == 0]),
        (1, 1.0, [m for m in every if m % BLADES == 1]),
        (1, -1.0, [m for m in every if m % BLADES == 1]),
    )
    for part, (first, sign, of_part) in enumerate(of_parts):
        for m in of_part:
            met = np.abs(sign * about - (m - first) * turn)
            near = met.min(axis=1) < BEYOND * highest
            if near.any():
                inside = met[near]
                share = shares[abs(m)](field.decay(inside.ravel(), wind_speed))
                share = share.reshape(*inside.shape, *share.shape[1:])
                weight = field.spectrum(inside, wind_speed) / (WITHIN * period)
                weight[frequencies[near] == 0.0] *= 0.5
                yield part, m, near, inside.mean(axis=1), np.einsum("fw,fwrs->frs", weight, share)


@lru_cache(maxsize=4)
def _shares(
    field: Turbulence, rings: tuple[float, ...], wind_speed: float, highest: float, harmonics: int
) -> list[Callable[[Array], Array]]:
    """Kept by themselves, as they take longest, and are the same for realisations of any period."""
    limits = field.decay(np.array([0.0, highest]), wind_speed)
    return shares_by_decay(field, np.array(rings), limits, harmonics)


@dataclass(frozen=True, eq=False)
class FieldOnDisk:
    """The likeliest field over the disk in which the blades meet what they do; off the blades it is smoother than one.

    Attributes
    ----------
    radii : (R,) float
        Of the rings [m].
    frequencies : (F,) float
        [Hz]
    harmonics : (H,) int
        Of the azimuth: 3 k and 3 k + 1, of either sign.
    waves : (H, 2, F, R) complex
        Of each harmonic in axes that turn with blade 1, times exp(2 pi i f t) and times exp(-2 pi i f t) [m/s].
    """

    radii: Array
    frequencies: Array
    harmonics: IntArray
    waves: ComplexArray

    def on_disk(self, time: float, rotor: float, azimuth: Array) -> Array:
        """Wind (R, A) [m/s] at a time [s], blade 1 at azimuth `rotor`, at azimuths (A,) [rad]."""
        ahead = np.exp(2j * np.pi * self.frequencies * time)
        sums = np.einsum("hsfr,sf->rh", self.waves, np.stack([ahead, ahead.conj()]))
        # exp(i m (azimuth - rotor)); of z, which a blade meets times exp(i theta), one turn more.
        turned = np.exp(1j * self.harmonics[:, None] * (azimuth - rotor))
        turned *= np.exp(1j * rotor * (self.harmonics % BLADES))[:, None]
        return np.asarray((sums @ turned).real)


def field_on_disk(
    field: Turbulence, turbulence: BladeTurbulence, wind_speed: float, rotor_speed: float, noise: Array
) -> FieldOnDisk:
    """What the disk most likely shows while blades meet what normal numbers make of a field.

    Of normal harmonics with covariances C_m whose sum is known, harmonic m is most likely C_m C^-1 times it, where C is
    the sum of the C_m.

    Parameters
    ----------
    field : Turbulence
        Its strength counts.
    turbulence : BladeTurbulence
        Of this field.
    wind_speed, rotor_speed : float
        [m/s, rad/s]
    noise : (noise_count,) float
    """
    rings, turn = tuple(turbulence.radii.tolist()), rotor_speed / (2.0 * np.pi)
    # What the root lacks, round-off of a smooth field, the noise does not make either.
    of_noise = np.linalg.pinv(turbulence.root, rcond=1e-6, hermitian=True)
    weighted = np.einsum("fprs,fps->fpr", of_noise, turbulence.parts(noise))
    weighted *= field.deviation(wind_speed)
    waves: dict[int, ComplexArray] = {}
    frequencies = turbulence.frequencies
    for part, m, near, _, own in of_harmonics(field, rings, wind_speed, turn, turbulence.period, frequencies):
        at = waves.setdefault(m, np.zeros((2, len(frequencies), len(rings)), dtype=complex))
        found = np.einsum("frs,fs->fr", own, weighted[near, part])
        if part < len(PARTS.T) - 1:
            at[0, near] = found
        else:
            at[1, near] = found.conj()
    return FieldOnDisk(turbulence.radii, frequencies, np.array(list(waves)), np.stack(list(waves.values())))
