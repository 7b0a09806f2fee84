"""What a lidar sees of the wind that arrives at the blades later: of a field, a box or a homogeneous wind.

A field's harmonics U_m at the rings of the blades and on the lidar's circle are normal, and what the blades meet are
sums of them (`flapgym.wind.blade_field`). Those sums are drawn first, without the lidar; the harmonics on its circle
are then drawn with their distribution given the sums: their regression on them, and a rest with normal numbers of its
own. So a seed brings the same wind to the blades with a lidar and without, and both are of one field exactly. What
becomes of the wind on its way only lowers the covariances between circle and blades. A beam, which stands, also sees
waves that are short around the circle and slow; the blades would meet them too fast for what they are drawn with
(`flapgym.wind.blade_field.blade_turbulence`). They are drawn beside, by what the beams make of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.fft import irfft, rfft

from flapgym.core.arrays import BLADES, Array, ComplexArray, IntArray
from flapgym.wind.blade_field import PARTS, BladeTurbulence, of_harmonics
from flapgym.wind.box import WindBox
from flapgym.wind.field import WITHIN, harmonic_shares
from flapgym.wind.lidar import Lidar
from flapgym.wind.turbulence import Turbulence

SMALLEST = 1e-6
"""Over the largest, of the blades' root, below which it is round-off of a smooth field; over the wind's deviation, of a
harmonic on the circle, below which it is left out."""


@dataclass(frozen=True, eq=False)
class UpwindTurbulence:
    """Waves on a lidar's circle given those at the blades, for unit standard deviation of the wind.

    Attributes
    ----------
    turbulence : BladeTurbulence
        What the blades meet.
    lidar : Lidar
    rotor_speed : float
        [rad/s]
    harmonics : tuple of (H,) int
        Of the azimuth, of each part of the blades' waves (`flapgym.wind.blade_field.PARTS`).
    regression : tuple of (F, H, R) float
        On the blades' unit waves.
    rest : tuple of (F, H, H) float
        Symmetric: its square is the covariance of what regression leaves, of real and of imaginary part.
    unmet : (F, N) float
        Standard deviation of the real part of waves in axes that stand that the blades do not meet, by the harmonic 0
        to N - 1 that N beams cannot tell them from.
    """

    turbulence: BladeTurbulence
    lidar: Lidar
    rotor_speed: float
    harmonics: tuple[IntArray, ...]
    regression: tuple[Array, ...]
    rest: tuple[Array, ...]
    unmet: Array

    @property
    def noise_count(self) -> int:
        """Standard normal numbers that make the rest of one realisation."""
        return 2 * (sum(math.prod(rest.shape[:2]) for rest in self.rest) + self.unmet.size)

    def waves(self, noise: Array, own: Array) -> list[ComplexArray]:
        """Waves (F, H) of each part, in axes that turn with the blades, and (F, N) of those that they do not meet.

        Parameters
        ----------
        noise : (turbulence.noise_count,) float
            That makes the blades' wind.
        own : (noise_count,) float
        """
        # Real and imaginary parts side by side, as the matrices are real.
        of_blades = self.turbulence.parts(noise)[..., None].view(np.float64)
        waves, first = [], 0
        for part, (regression, rest) in enumerate(zip(self.regression, self.rest, strict=True)):
            unit = own[first : first + 2 * math.prod(rest.shape[:2])].reshape(*rest.shape[:2], 2)
            first += unit.size
            both = regression @ of_blades[:, part] + rest @ unit
            waves.append(both.view(np.complex128)[..., 0])
        return [*waves, self.unmet * own[first:].view(np.complex128).reshape(self.unmet.shape)]

    def seen(self, noise: Array, own: Array, time: Array, azimuth: float) -> Array:
        """Wind along the shaft (S, N) that each beam has measured, over the standard deviation.

        Parameters
        ----------
        noise, own : see `waves`
        time : (S,) float
            At which it arrives at the rotor, evenly spaced [s].
        azimuth : float
            Of blade 1 at time zero [rad].
        """
        waves = np.concatenate(self.waves(noise, own), axis=1)
        step = float(time[1] - time[0]) if len(time) > 1 else 0.0
        transform = _transform(len(waves), len(time), float(time[0]), step, self.turbulence.period)
        ends = np.cumsum([len(each) for each in self.harmonics])
        *series, unmet = np.split(transform(waves, axis=0), ends, axis=1)
        rotor = azimuth + self.rotor_speed * time
        seen = (unmet @ np.exp(1j * np.outer(np.arange(self.lidar.beams), self.lidar.azimuths))).real
        # Of z, the wave at -f is told by its conjugate.
        series[3] = series[3].conj()
        for part, (each, harmonics) in enumerate(zip(series, self.harmonics, strict=True)):
            # In axes that stand; of z, which a blade meets times exp(i theta), one turn more.
            still = each * np.exp(-1j * np.outer(rotor, harmonics - (part >= 2)))
            seen += (still @ np.exp(1j * np.outer(harmonics, self.lidar.azimuths))).real
        return seen


# As many as what it is made of is kept for (`flapgym.plant.field_response`), so that going round wind speeds is quick.
@lru_cache(maxsize=16)
def upwind_turbulence(
    field: Turbulence,
    turbulence: BladeTurbulence,
    wind_speed: float,
    rotor_speed: float,
    lidar: Lidar,
) -> UpwindTurbulence:
    """Prepare what a lidar sees of a field; kept, so that asking again costs nothing.

    Parameters
    ----------
    field : Turbulence
        Its strength does not count here.
    turbulence : BladeTurbulence
        Of this field.
    wind_speed, rotor_speed : float
        [m/s, rad/s]
    lidar : Lidar
    """
    rings = (*turbulence.radii.tolist(), lidar.radius)
    frequencies, turn = turbulence.frequencies, rotor_speed / (2.0 * np.pi)
    found: list[dict[int, tuple[Array, Array]]] = [{} for _ in PARTS.T]
    for part, m, near, met, own in of_harmonics(
        field, rings, wind_speed, turn, turbulence.period, frequencies
    ):
        averaging = lidar.averaging(met, wind_speed)
        shared, power = np.zeros((len(frequencies), len(rings) - 1)), np.zeros(len(frequencies))
        shared[near] = own[:, -1, :-1] * (averaging * lidar.likeness(met, wind_speed))[:, None]
        power[near] = own[:, -1, -1] * averaging**2
        if power.sum() > SMALLEST**2:
            found[part][m] = shared, power
    of_noise = np.linalg.pinv(turbulence.root, rcond=SMALLEST, hermitian=True)
    harmonics, regressions, rests = list[IntArray](), list[Array](), list[Array]()
    for part, each in enumerate(found):
        shared = (
            np.stack([one for one, _ in each.values()], axis=1)
            if each
            else np.zeros((len(frequencies), 0, len(rings) - 1))
        )
        power = (
            np.stack([one for _, one in each.values()], axis=1) if each else np.zeros((len(frequencies), 0))
        )
        regression = shared @ of_noise[:, part]
        left = power[:, :, None] * np.eye(len(each)) - regression @ regression.swapaxes(1, 2)
        values, vectors = np.linalg.eigh(left)
        harmonics.append(np.array(list(each), dtype=np.int64))
        regressions.append(regression)
        rests.append((vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]) @ vectors.swapaxes(1, 2))
    return UpwindTurbulence(
        turbulence,
        lidar,
        rotor_speed,
        tuple(harmonics),
        tuple(regressions),
        tuple(rests),
        _unmet(field, wind_speed, turn, turbulence, lidar),
    )


def _unmet(
    field: Turbulence, wind_speed: float, turn: float, turbulence: BladeTurbulence, lidar: Lidar
) -> Array:
    """`UpwindTurbulence.unmet`: of all that the beams see at each frequency, what is left without what blades meet."""
    frequencies, highest = turbulence.frequencies, turbulence.frequencies[-1] + 0.5 / turbulence.period
    chords = 2.0 * lidar.radius * np.sin(0.5 * lidar.azimuths)
    coherence = field.coherence(field.decay(frequencies, wind_speed)[:, None] * chords)
    left = np.fft.fft(coherence, axis=1).real / lidar.beams
    most = math.ceil(2.0 * highest / turn) + 1
    shares = harmonic_shares(field, np.array([lidar.radius]), wind_speed, frequencies, most)[..., 0, 0]
    for m in range(-most, most + 1):
        # u_0 has the harmonics 3 k, z those one above, and its conjugate those one below.
        first = (m + 1) % BLADES - 1
        met = np.abs(frequencies + (m - first) * turn) <= highest
        left[met, m % lidar.beams] -= shares[abs(m), met]
    about = np.abs(frequencies[:, None] + ((np.arange(WITHIN) + 0.5) / WITHIN - 0.5) / turbulence.period)
    power = field.spectrum(about, wind_speed).mean(axis=1) / turbulence.period
    power[frequencies == 0.0] *= 0.5
    power *= lidar.averaging(frequencies, wind_speed) ** 2
    return np.asarray(np.sqrt(power[:, None] * np.maximum(left, 0.0)))


@lru_cache(maxsize=16)
def _transform(count: int, samples: int, first: float, step: float, period: float) -> Any:
    """From waves at multiples of 1 / period from zero on to their sum at even times from `first` on [s].

    The sum over f of waves times exp(2 pi i f t), a chirp z-transform, as the times share no grid with the period.
    """
    from scipy.signal import CZT  # half a second to import

    return CZT(count, samples, np.exp(2j * np.pi * step / period), np.exp(-2j * np.pi * first / period))


def seen_of_box(box: WindBox, begin: float, lidar: Lidar, time: Array) -> Array:
    """Wind along the shaft (S, N) [m/s] that each beam has measured of a box, which is frozen.

    Before its first plane it is taken to have stood still, and after its last one.

    Parameters
    ----------
    box : WindBox
    begin : float
        Moment of the box at time zero [s].
    lidar : Lidar
    time : (S,) float
        At which it arrives at the rotor [s].
    """
    before, weights = lidar.along(box.mean_wind)
    moments = np.clip(begin + time[:, None] - before, 0.0, box.duration)
    left, up = -lidar.radius * np.sin(lidar.azimuths), lidar.radius * np.cos(lidar.azimuths)
    return np.asarray(np.einsum("k,ksn->sn", weights, box.at(moments.T[..., None], left, up)))


def seen_of_gust(wind: Array, other: Array, lidar: Lidar, wind_speed: float, time_step: float) -> Array:
    """What each beam has measured of a homogeneous turbulence, (T,) [m/s], by when it arrives.

    Parameters
    ----------
    wind : (T,) float
        That arrives at the rotor, at even times [m/s].
    other : (T,) float
        Another realisation: what a beam sees of wind that changes before it arrives.
    lidar : Lidar
    wind_speed, time_step : float
        [m/s, s]
    """
    steps = len(wind)
    # Mirrored at both ends, beyond which it is not known.
    both = np.stack([wind, other])
    both = np.concatenate([both, both[:, ::-1]], axis=1)
    points = 2 * steps
    frequency = np.arange(steps + 1, dtype=np.float64) / (points * time_step)
    likeness = lidar.likeness(frequency, wind_speed)
    share = np.stack([likeness, np.sqrt(1.0 - likeness**2)]) * lidar.averaging(frequency, wind_speed)
    return np.asarray(irfft((rfft(both, axis=1) * share).sum(axis=0), points)[:steps])
