"""The von Karman spectrum of the longitudinal wind component (paper section III)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flapgym.core.fields import Numbers, Quantity


def check_wind(wind_speed: float, intensity: float, length_scale: float) -> None:
    """Refuse a wind that has no spectrum; each message names the quantity."""
    Quantity("speed", above=0.0).check(wind_speed, "turbulence.wind_speed")
    Quantity("length", above=0.0).check(length_scale, "turbulence.length_scale")
    Quantity("number", at_least=0.0, below=1.0).check(intensity, "turbulence.intensity")


def von_karman_spectrum(
    frequency: ArrayLike, wind_speed: float, intensity: float, length_scale: float
) -> NDArray[np.float64]:
    """One-sided power spectral density of the longitudinal wind [m^2/s^2/Hz], shape of `frequency`.

    S(f) = 4 sigma^2 (L/U) / (1 + 70.8 (f L/U)^2)^(5/6), sigma = intensity times wind speed. Its integral is
    0.99986 sigma^2, because 70.8 is rounded.

    Parameters
    ----------
    frequency : array_like
        Frequencies [Hz].
    wind_speed, intensity, length_scale : float
        Mean wind U [m/s], sigma / U [-] and integral length L [m].
    """
    check_wind(wind_speed, intensity, length_scale)
    time_scale = length_scale / wind_speed
    variance = (intensity * wind_speed) ** 2
    reduced = (
        Numbers(dimension="frequency", at_least=0.0).check(frequency, "turbulence.frequency") * time_scale
    )
    return np.asarray(4.0 * variance * time_scale / (1.0 + 70.8 * reduced**2) ** (5.0 / 6.0))
