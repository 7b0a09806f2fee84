"""Rational filter from white noise to von Karman turbulence, sampled without error in the covariance.

The spectrum goes as (1 + x^2)^(-5/6), x = sqrt(70.8) f L/U: no rational function has it. Real poles and zeros that
alternate on the frequency axis follow it closely; they are fitted in decibels, once per bandwidth and order.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import scipy.linalg
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.special import beta

from flapgym.core.arrays import Array
from flapgym.core.fields import Count, Quantity
from flapgym.core.state_space import StateSpace
from flapgym.wind.spectrum import check_wind

FIT_FREQUENCY = 10.0
"""Upper end of the fit [Hz]; above it the filter falls with slope -2 instead of -5/3."""


def von_karman_filter(
    wind_speed: float, intensity: float, length_scale: float, time_step: float, order: int = 5
) -> StateSpace:
    """Filter with input "white" (unit variance a step) and output "wind" [m/s].

    The stationary variance is sigma^2 and the autocorrelation is that of the continuous filter at every multiple
    of the time step: the single white input drives the innovations of the sampled process, so nothing is lost to a
    hold. The output has no feedthrough. A is diagonal.

    Against the von Karman spectrum from 0 to 10 Hz, at U = 11 m/s and L = 147 m: 0.35 dB (order 3), 0.11 dB (4),
    0.03 dB (5) in continuous time; folding at a time step of 0.007 s adds 0.05 dB near 10 Hz.

    Parameters
    ----------
    wind_speed, intensity, length_scale : float
        Mean wind U [m/s], sigma / U [-] and integral length L [m].
    time_step : float
        Sampling time [s].
    order : int
        Number of poles, 2 to 6.
    """
    check_wind(wind_speed, intensity, length_scale)
    Count(at_least=2, at_most=6).check(order, "turbulence.order")
    Quantity("time", above=0.0).check(time_step, "turbulence.time_step")
    poles, zeros = fit_poles_and_zeros(order, FIT_FREQUENCY * length_scale / wind_speed)
    corner = 2.0 * np.pi * wind_speed / (np.sqrt(70.8) * length_scale)
    return sampled_low_pass(
        corner * poles / (2.0 * np.pi), corner * zeros / (2.0 * np.pi), intensity * wind_speed, time_step
    )


def sampled_low_pass(
    poles: NDArray[np.float64], zeros: NDArray[np.float64], deviation: float, time_step: float
) -> StateSpace:
    """Input "white" (unit variance a step) to output "wind" of a standard deviation; A is diagonal.

    The autocorrelation is that of the continuous filter prod(1 + s/zeros) / prod(1 + s/poles) at every multiple of the
    time step.

    Parameters
    ----------
    poles : (n,) float
        Distinct and real, positive for what decays [Hz].
    zeros : (k,) float
        k < n [Hz].
    deviation : float
        Of the output.
    time_step : float
        [s]
    """
    a, covariance, c = _unit_variance_modes(2.0 * np.pi * poles, 2.0 * np.pi * zeros, time_step)
    b = _innovation_input(a, covariance, c)
    return StateSpace(
        A=np.diag(a),
        B=b[:, None],
        C=deviation * c[None, :],
        D=np.zeros((1, 1)),
        time_step=time_step,
        inputs=("white",),
        outputs=("wind",),
    )


def filtered(shaping: StateSpace, first: Array, white: Array) -> Array:
    """Wind (m, T) of a diagonal filter from its first states (m, n or more) and white noise (m, T)."""
    from scipy.signal import lfilter  # half a second to import

    wind = shaping.D[0, 0] * white
    for mode, decay in enumerate(np.diag(shaping.A)):
        # Of the state before each sample: x' = decay x + B w, read by C.
        states, _ = lfilter([0.0, shaping.B[mode, 0]], [1.0, -decay], white, zi=first[:, mode : mode + 1])
        wind += shaping.C[0, mode] * states
    return np.asarray(wind)


@lru_cache(maxsize=64)
def fit_poles_and_zeros(order: int, reach: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Corner values x of the poles (order,) and zeros (order - 1,) for x up to sqrt(70.8) times `reach` = f L/U.

    Least squares of the cubed error in decibels, which levels its peaks, at equal variance: the gain is not free.
    Deterministic; 0.1 s.
    """
    x_end = np.sqrt(70.8) * reach
    x = np.concatenate([[0.0], np.geomspace(1e-2, x_end, 400)])
    exact = -50.0 / 6.0 * np.log10(1.0 + x**2)
    exact_variance = 0.5 * beta(0.5, 1.0 / 3.0)

    def error(log_corners: NDArray[np.float64]) -> NDArray[np.float64]:
        poles, zeros = np.exp(log_corners[:order]), np.exp(log_corners[order:])
        residue = residues(poles, zeros)
        variance = np.pi * (residue @ (1.0 / np.add.outer(poles, poles)) @ residue)
        level = 10.0 * (
            np.log10(1.0 + (x[:, None] / zeros) ** 2).sum(axis=1)
            - np.log10(1.0 + (x[:, None] / poles) ** 2).sum(axis=1)
        )
        return np.asarray((level - 10.0 * np.log10(variance / exact_variance) - exact) ** 3)

    corners = np.geomspace(1.2, x_end, 2 * order - 1)
    start = np.log(np.concatenate([corners[0::2], corners[1::2]]))
    solution = np.exp(least_squares(error, start, xtol=1e-12, ftol=1e-12).x)
    poles, zeros = np.sort(solution[:order]), np.sort(solution[order:])
    poles.flags.writeable = zeros.flags.writeable = False
    return poles, zeros


def residues(poles: NDArray[np.float64], zeros: NDArray[np.float64]) -> NDArray[np.float64]:
    """Residues r of prod(1 + s/zeros) / prod(1 + s/poles) = sum r / (s + poles)."""
    numerator = np.prod(1.0 - poles[:, None] / zeros, axis=1)
    ratio = 1.0 - poles[:, None] / poles
    np.fill_diagonal(ratio, 1.0)
    return np.asarray(poles * numerator / np.prod(ratio, axis=1))


def _unit_variance_modes(
    poles: NDArray[np.float64], zeros: NDArray[np.float64], time_step: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Sampled modes (n,), their stationary covariance (n, n) and the output row (n,) that gives unit variance.

    Each mode is scaled to unit variance; the covariance is the closed form 1 / (p_i + p_j) of a common white input.
    """
    scale = np.sqrt(2.0 * poles)
    covariance = np.outer(scale, scale) / np.add.outer(poles, poles)
    c = residues(poles, zeros) / scale
    return np.exp(-poles * time_step), covariance, c / np.sqrt(c @ covariance @ c)


def _innovation_input(
    a: NDArray[np.float64], covariance: NDArray[np.float64], c: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Input column b (n,) for which x+ = a x + b w, y = c x has the sampled process's autocorrelation.

    It is the Kalman gain of the noise-free sampled process times the standard deviation of its innovation; c K = 1
    makes the output free of feedthrough.
    """
    noise = covariance * (1.0 - np.outer(a, a))
    ca = c * a
    x = scipy.linalg.solve_discrete_are(
        np.diag(a), ca[:, None], noise, np.array([[c @ noise @ c]]), s=(noise @ c)[:, None]
    )
    variance = ca @ x @ ca + c @ noise @ c
    return np.asarray((a * (x @ ca) + noise @ c) / np.sqrt(variance))
