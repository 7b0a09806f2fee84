"""Turbulence over the rotor's disk, made harmonic by harmonic of the azimuth; no grid, and no interpolation across it.

On rings of radii r the covariance depends on the difference D of azimuths alone, so the harmonics of
u(r, theta, t) = sum_m U_m(r, t) exp(i m theta) are independent of each other, with the cross-spectra between rings

    S_m(r1, r2, f) = 1/(2 pi) int S(f) coherence(c(f) d) cos(m D) dD,   d^2 = (r1 - r2)^2 + 4 r1 r2 sin^2(D / 2).

U_-m is the conjugate of U_m, as u is real. For m > 0, U_m is complex and its spectrum two-sided: S_m(f) = S_m(-f), but
what is drawn at f and at -f is independent. `disk_turbulence` prepares the square roots of S_m once; `draw` makes a
realisation of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.fft import dct, ifft, next_fast_len

from flapgym.core.arrays import BLADES, Array, ComplexArray
from flapgym.core.fields import Count, Numbers, Quantity
from flapgym.wind.disk import annulus_weights
from flapgym.wind.turbulence import Turbulence

KEPT = 0.9
"""Share of the spectrum, as the outermost ring's turning point meets it at the highest frequency, that is kept."""
SCALES_APART = 5.0
"""Integral time scales from the end of a realisation to its periodic repetition. Von Karman's correlation is 0.014
there, that of Kaimal's spectrum, whose corner at zero is a long memory, 0.032."""
WITHIN = 4
"""Points between two frequencies over which cross-spectra are averaged."""
TAPS = 8
"""Coarse samples that one fine sample is made of: to 5e-4 of an amplitude at the highest frequency."""
NODES = 4
"""Values of the decay, for each factor e, at which S_m is computed; a cubic spline of its logarithm goes between."""


@dataclass(frozen=True, eq=False)
class DiskTurbulence:
    """Square roots of the harmonics' cross-spectra at R rings, prepared for realisations of T steps.

    Attributes
    ----------
    radii : (R,) float
        Of the rings [m].
    time_step : float
        [s]
    steps : int
        T.
    period : float
        After which a realisation would repeat itself [s].
    frequencies : (F,) float
        At which it has content, multiples of 1 / period from zero to the highest [Hz].
    root : (M + 1, F, R, R) float
        Symmetric; root root' is the covariance of the real part of the harmonics' Fourier coefficients, and of the
        imaginary part, for unit standard deviation of the wind. Halved at zero, where both signs of f meet.
    left_out : (R,) float
        Share of the variance at each ring that lies beyond the harmonics and frequencies kept.
    clipped : float
        Largest share of a ring's variance that clipping has added, where round-off left a cross-spectrum indefinite.
    """

    radii: Array
    time_step: float
    steps: int
    period: float
    frequencies: Array
    root: Array
    left_out: Array
    clipped: float
    coarse: int  # fine steps to one of the inverse FFT's
    points: int  # of the inverse FFT
    weights: Array  # (coarse, TAPS)

    @property
    def harmonics(self) -> int:
        """M, the highest harmonic of the azimuth."""
        return len(self.root) - 1

    @property
    def noise_count(self) -> int:
        """Standard normal numbers that make one realisation."""
        return 4 * self.root[..., 0].size

    def draw(self, noise: Array, deviation: float) -> DiskWind:
        """A realisation from normal numbers (noise_count,), proportional to the wind's standard deviation [m/s].

        Raises
        ------
        ValueError
            If there is another number of them.
        """
        if noise.shape != (self.noise_count,):
            raise ValueError(f"noise: expected the shape ({self.noise_count},), got {noise.shape}")
        harmonics, frequencies, rings, _ = self.root.shape
        # Real and imaginary part at f, then at -f.
        drawn = self.root @ noise.reshape(harmonics, frequencies, rings, 4)
        coefficients = np.ascontiguousarray(drawn).view(np.complex128)
        spectrum = np.zeros((harmonics, self.points, rings), dtype=np.complex128)
        spectrum[:, :frequencies] = coefficients[..., 0]
        spectrum[:, 0] += coefficients[:, 0, :, 1]
        spectrum[:, -1:-frequencies:-1] = coefficients[:, 1:, :, 1]
        series = ifft(spectrum, axis=1, norm="forward", overwrite_x=True)
        # The first weight belongs to a sample before the first step; the series is periodic.
        blocks = -(-self.steps // self.coarse)
        needed = np.arange(1 - TAPS // 2, blocks + TAPS // 2) % self.points
        samples = np.take(series, needed, axis=1)
        samples *= deviation
        # The zeroth harmonic is real: the real part of a complex series, which has half its variance.
        samples[0] = math.sqrt(2.0) * samples[0].real
        return DiskWind(self.radii, self.steps, samples, self.weights)


@dataclass(frozen=True, eq=False)
class DiskWind:
    """One realisation at T steps and R rings, in m/s about the mean.

    Attributes
    ----------
    radii : (R,) float
        Of the rings [m].
    steps : int
        T.
    samples : (M + 1, ..., R) complex
        The harmonics at coarse steps, some before the first and after the last step.
    weights : (coarse, TAPS) float
        What fine steps take of the coarse samples around them.
    """

    radii: Array
    steps: int
    samples: ComplexArray
    weights: Array

    def harmonic(self, m: int) -> ComplexArray:
        """U_m (T, R) [m/s], m from 0 to the highest; the zeroth is real."""
        coarse = self.samples[m].view(np.float64)  # (..., 2 R)
        blocks = len(coarse) - TAPS + 1
        around = np.stack([coarse[tap : tap + blocks] for tap in range(TAPS)], axis=1)
        fine = (self.weights @ around).reshape(-1, coarse.shape[1])
        return fine[: self.steps].view(np.complex128)

    def components(self, azimuth: Array) -> Array:
        """Multi-blade components (T, R, 3) of what the blades meet, from blade 1's azimuth (T,) [rad].

        u_b = u_0 + u_c cos(theta_b) + u_s sin(theta_b) is exactly the field at theta_b = theta + 2 pi (b - 1) / 3.
        """
        mean = self.harmonic(0).real.copy()
        turning = np.zeros(mean.shape, dtype=np.complex128)
        third, phase = np.exp(1j * BLADES * azimuth)[:, None], np.ones((len(azimuth), 1), dtype=np.complex128)
        # exp(i m theta_b) is exp(i m theta) for all blades where m is a multiple of three. One more, and it is
        # exp(i (m - 1) theta) exp(i theta_b); one less is the conjugate of -m, which is one more.
        for m in range(1, len(self.samples)):
            if m % BLADES == BLADES - 1:
                phase = phase * third  # of the multiple of three next to m
                turning += (self.harmonic(m) * phase).conj()
            elif m % BLADES == 0:
                mean += 2.0 * (self.harmonic(m) * phase).real
            else:
                turning += self.harmonic(m) * phase
        return np.stack([mean, 2.0 * turning.real, -2.0 * turning.imag], axis=-1)

    def at(self, azimuth: Array) -> Array:
        """The field (T, R) at one azimuth a step, (T,) [rad]: a blade's, or that of a point that stands."""
        field = self.harmonic(0).real.copy()
        for m in range(1, len(self.samples)):
            field += 2.0 * (self.harmonic(m) * np.exp(1j * m * azimuth)[:, None]).real
        return field

    def on_disk(self, step: int, azimuth: Array) -> Array:
        """The field (R, A) at one step and azimuths (A,) [rad], to be drawn."""
        block, fine = divmod(step, len(self.weights))
        harmonics = np.einsum("k,mkr->rm", self.weights[fine], self.samples[:, block : block + TAPS])
        harmonics[:, 1:] *= 2.0
        waves = np.exp(1j * np.outer(np.arange(len(self.samples)), azimuth))
        return np.asarray((harmonics @ waves).real)

    def rotor_average(self) -> Array:
        """The mean over the disk (T,), each ring for the annulus up to midway to its neighbours."""
        return np.asarray(self.harmonic(0).real @ annulus_weights(self.radii))


def disk_turbulence(
    field: Turbulence,
    radii: Array,
    wind_speed: float,
    rotor_speed: float,
    time_step: float,
    steps: int,
    highest_frequency: float = 3.0,
) -> DiskTurbulence:
    """Prepare realisations of a field over the disk; kept, so that asking again costs nothing.

    The field has frequencies up to the highest, and harmonics up to the one that `needed_harmonics` says.

    Parameters
    ----------
    field : Turbulence
        Its strength does not count here: `draw` is told it.
    radii : (R,) float
        Of the rings, rising [m].
    wind_speed, rotor_speed : float
        [m/s, rad/s]
    time_step : float
        [s]
    steps : int
        T.
    highest_frequency : float
        Up to which a turning blade shall meet what the field has [Hz].

    Raises
    ------
    ValueError
        If one of these is out of range, or the field does not know its scale.
    """
    rings = checked_rings(radii, wind_speed, rotor_speed, highest_frequency)
    Quantity("time", above=0.0, at_most=0.5 / highest_frequency).check(time_step, "field.time_step")
    Count(at_least=1).check(steps, "field.steps")
    return _prepare(field, rings, wind_speed, rotor_speed, time_step, steps, highest_frequency)


def checked_rings(
    radii: Array, wind_speed: float, rotor_speed: float, highest_frequency: float
) -> tuple[float, ...]:
    """The radii of rings (R,) [m], which rise; speeds [m/s, rad/s] and frequency [Hz] are above zero.

    Raises
    ------
    ValueError
        Otherwise; the message names the value.
    """
    rings = Numbers(dimension="length", axes=1, above=0.0).check(radii, "field.radii")
    if (np.diff(rings) <= 0.0).any():
        raise ValueError(f"field.radii: expected them to rise, got {', '.join(f'{r:g}' for r in rings)} m")
    for name, value, dimension in (
        ("wind_speed", wind_speed, "speed"),
        ("rotor_speed", rotor_speed, "angular rate"),
        ("highest_frequency", highest_frequency, "frequency"),
    ):
        Quantity(dimension, above=0.0).check(value, f"field.{name}")
    return tuple(rings.tolist())


@lru_cache(maxsize=8)
def _prepare(
    field: Turbulence,
    rings: tuple[float, ...],
    wind_speed: float,
    rotor_speed: float,
    time_step: float,
    steps: int,
    highest: float,
) -> DiskTurbulence:
    radii = np.array(rings)
    # Four coarse steps to the shortest period: the fewer, the more taps it takes to go between them.
    coarse = max(1, math.floor(0.25 / (highest * time_step)))
    least = steps * time_step + SCALES_APART * time_scale(field, wind_speed)
    points = next_fast_len(math.ceil(least / (coarse * time_step)) + TAPS)
    period = points * coarse * time_step
    frequencies = np.arange(min(math.floor(highest * period), (points - 1) // 2) + 1) / period
    harmonics = needed_harmonics(field, radii[-1], wind_speed, rotor_speed, highest)
    # Averages about each frequency, so that no variance is lost or won: at zero Kaimal's spectrum has a corner, where
    # its value alone would count for more than is below it. In turn a covariance at a lag t is sinc(t / period) times
    # what it should be.
    about = np.abs(frequencies[:, None] + ((np.arange(WITHIN) + 0.5) / WITHIN - 0.5) / period)
    shares = harmonic_shares(field, radii, wind_speed, about.ravel(), harmonics)
    shares = shares.reshape(harmonics + 1, *about.shape, *shares.shape[2:])
    covariance = np.einsum(
        "fw,mfwrs->mfrs", 0.5 / (WITHIN * period) * field.spectrum(about, wind_speed), shares
    )
    covariance[:, 0] *= 0.5
    values, vectors = np.linalg.eigh(covariance)
    # S_0 at low frequencies is almost of rank one, and harmonics far above what a ring's size holds almost zero.
    kept = np.maximum(values, 0.0)
    root = (vectors * np.sqrt(0.5 * kept)[..., None, :]) @ vectors.swapaxes(-1, -2)
    signs = np.full((harmonics + 1, 1, 1), 4.0)  # of m and of f
    signs[0] = 2.0
    variance = (signs * np.einsum("mfrr->mfr", covariance)).sum(axis=(0, 1))
    clipped = (signs * np.einsum("mfrk,mfk->mfr", vectors**2, kept - values)).sum(axis=(0, 1))
    return DiskTurbulence(
        radii=radii,
        time_step=time_step,
        steps=steps,
        period=period,
        frequencies=frequencies,
        root=root,
        left_out=1.0 - variance,
        clipped=float((clipped / variance).max()),
        coarse=coarse,
        points=points,
        weights=interpolation_weights(coarse, highest * time_step, TAPS),
    )


def time_scale(field: Turbulence, wind_speed: float) -> float:
    """Integral of the correlation at a point [s], at a mean wind [m/s]."""
    return float(field.spectrum(np.zeros(1), wind_speed)[0]) / 4.0


def needed_harmonics(
    field: Turbulence, radius: float, wind_speed: float, rotor_speed: float, frequency: float
) -> int:
    """Highest harmonic that a turning point needs for 0.9 of its spectrum at a frequency [Hz].

    A point that turns n times a second meets the sum over m of S_m(f - m n): harmonic m about m times a turn. So it is
    a little over the number of periods in a turn, more at a larger radius [m].
    """
    turn = rotor_speed / (2.0 * np.pi)
    # Four times as far the harmonics have fallen off to (1/4)^(8/3); those that turn the other way meet the spectrum
    # beyond the frequency, and count less still.
    most = math.ceil(4.0 * frequency / turn)
    met = np.abs(frequency - np.arange(most + 1) * turn)
    decays = field.decay(met, wind_speed)
    shares = [
        _azimuthal(field, np.array([radius]), decay, m if m else 1)[m, 0, 0] for m, decay in enumerate(decays)
    ]
    carried = np.cumsum(shares * field.spectrum(met, wind_speed))
    return int(np.searchsorted(carried, KEPT * carried[-1]))


def harmonic_shares(
    field: Turbulence, radii: Array, wind_speed: float, frequencies: Array, harmonics: int
) -> Array:
    """S_m over the spectrum at a point, (M + 1, F, R, R); of one ring they add up to 1 over all m, of either sign.

    Parameters
    ----------
    field : Turbulence
    radii : (R,) float
        [m]
    wind_speed : float
        [m/s]
    frequencies : (F,) float
        Not negative [Hz].
    harmonics : int
        M.
    """
    decay = field.decay(frequencies, wind_speed)
    if len(decay) <= _node_count(decay):
        return np.stack([_azimuthal(field, radii, each, harmonics) for each in decay], axis=1)
    return np.stack([share(decay) for share in shares_by_decay(field, radii, decay, harmonics)])


def shares_by_decay(
    field: Turbulence, radii: Array, decay: Array, harmonics: int
) -> list[Callable[[Array], Array]]:
    """S_m over the spectrum at a point, of each m from 0 to M a function of decays (F,) [1/m] to (F, R, R).

    They depend on frequency through the decay alone, and smoothly: the spline is good to 1e-4.

    Parameters
    ----------
    field : Turbulence
    radii : (R,) float
        [m]
    decay : (N,) float
        Between the least and the largest of which they hold [1/m].
    harmonics : int
        M.
    """
    from scipy.interpolate import CubicSpline  # half a second to import

    nodes = np.geomspace(decay.min(), decay.max(), _node_count(decay))
    shares = np.stack([_azimuthal(field, radii, node, harmonics) for node in nodes], axis=1)
    first, last = np.log(nodes[0]), np.log(nodes[-1])

    def of(spline: CubicSpline) -> Callable[[Array], Array]:
        # Held between the ends, which round-off may pass.
        return lambda decays: np.asarray(spline(np.clip(np.log(decays), first, last)))

    return [of(CubicSpline(np.log(nodes), each)) for each in shares]


def _node_count(decay: Array) -> int:
    return math.ceil(NODES * math.log(float(decay.max()) / float(decay.min()))) + 4


def _azimuthal(field: Turbulence, radii: Array, decay: float, harmonics: int) -> Array:
    """Fourier coefficients (M + 1, R, R) over the azimuth of the coherence at one decay [1/m]."""
    # Eight points a length of decay on the outermost ring, and many a wave of the highest harmonic: the coherence has
    # a cusp at zero distance, whose harmonics fall off slowly (Kaimal's as m^-2) and fold. That adds a thousandth.
    wanted = max(64 * (harmonics + 1), 8.0 * decay * 2.0 * np.pi * radii.max())
    points = 2 ** math.ceil(math.log2(wanted))
    across = np.sin(np.linspace(0.0, 0.5 * np.pi, points // 2 + 1)) ** 2
    one, other = np.triu_indices(len(radii))
    # In this form two points of one ring that are close lose no digits.
    square = (radii[one] - radii[other])[:, None] ** 2
    distance = np.sqrt(square + 4.0 * (radii[one] * radii[other])[:, None] * across)
    coefficients = dct(field.coherence(decay * distance), type=1, axis=1)[:, : harmonics + 1] / points
    matrix = np.empty((harmonics + 1, len(radii), len(radii)))
    matrix[:, one, other] = matrix[:, other, one] = coefficients.T
    return matrix


@lru_cache(maxsize=8)
def interpolation_weights(coarse: int, highest: float, taps: int) -> Array:
    """Weights (coarse, taps) of the samples around a fine step, for waves of up to `highest` periods a fine step.

    Least squares over those waves; where the steps meet, the sample itself, which is number taps / 2 of them.

    Parameters
    ----------
    coarse : int
        Fine steps from one sample to the next.
    highest : float
        Less than half a period a sample.
    taps : int
        Even.
    """
    around = np.arange(1 - taps // 2, taps // 2 + 1)
    place = np.arange(coarse) / coarse
    phase = 2.0 * np.pi * highest * coarse * np.linspace(-1.0, 1.0, 101)[:, None]
    waves, wanted = np.exp(1j * phase * around), np.exp(1j * phase * place)
    # A wave and its conjugate stand both among them, so the weights are real.
    solution, *_ = np.linalg.lstsq(waves, wanted, rcond=None)
    return np.ascontiguousarray(solution.real.T)
