"""The von Karman spectrum of the longitudinal wind component (paper section III)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def check_wind(wind_speed: float, intensity: float, length_scale: float) -> None:
    """Refuse a wind that has no spectrum; each message names the quantity."""
    for name, value, unit in (("wind_speed", wind_speed, "m/s"), ("length_scale", length_scale, "m")):
        if not (np.isfinite(value) and value > 0.0):
            raise ValueError(f"turbulence.{name}: expected a positive number [{unit}], got {value}")
    if not (np.isfinite(intensity) and 0.0 <= intensity < 1.0):
        raise ValueError(f"turbulence.intensity: expected 0 <= intensity < 1, got {intensity}")


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
    reduced = np.asarray(frequency, dtype=float) * time_scale
    return np.asarray(4.0 * variance * time_scale / (1.0 + 70.8 * reduced**2) ** (5.0 / 6.0))
