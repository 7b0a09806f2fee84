"""How much of a series lies around each multiple of the rotor's frequency."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from flapgym.core.arrays import Array
from flapgym.core.fields import Numbers, Quantity

EDGES = (0.5, 1.5, 2.5, 3.5)
"""Between the bands, in multiples of the rotor's frequency P; each belongs to the band above it."""


@dataclass(frozen=True, eq=False)
class Bands:
    """Rms by band, in the unit of the series; the squares add up to the variance.

    Attributes
    ----------
    slow : (...) float
        Below 0.5 P, without the mean.
    once, twice, thrice : (...) float
        Around 1 P, 2 P and 3 P, half of P to either side.
    fast : (...) float
        From 3.5 P on.
    """

    slow: Array
    once: Array
    twice: Array
    thrice: Array
    fast: Array


def bands(series: ArrayLike, time_step: float, rotor_speed: float) -> Bands:
    """Rms in bands of a series' whole revolutions, what is left at the end cut off.

    Over whole revolutions every multiple of P is a line of the discrete spectrum, and loads periodic in the azimuth
    leak into no other. A window would do without the cut, but its bands add up to the variance of a weighted series.
    They are whole to half a time step, and so much over the length of the series is what still leaks, as a share of
    the amplitude.

    Parameters
    ----------
    series : (..., T) array_like
        One revolution or more.
    time_step : float
        Sampling time [s].
    rotor_speed : float
        [rad/s].

    Raises
    ------
    ValueError
        If the series is shorter than a revolution or holds what is no finite number, or another argument is not
        positive.
    """
    values = Numbers().check(series, "bands.series")
    Quantity("time", above=0.0).check(time_step, "bands.time_step")
    Quantity("angular rate", above=0.0).check(rotor_speed, "bands.rotor_speed")
    revolution = 2.0 * np.pi / (rotor_speed * time_step)
    # A series of whole revolutions may be half a sample short of them.
    revolutions = int((values.shape[-1] + 0.5) / revolution)
    if revolutions < 1:
        raise ValueError(
            f"bands.series: expected a revolution of {revolution:.1f} samples or more, got {values.shape[-1]}"
        )
    count = min(values.shape[-1], round(revolutions * revolution))
    lines = np.fft.rfft(values[..., :count])
    power = np.square(np.abs(lines)) / count**2
    # Each line stands for its conjugate, too, but for the mean and, of an even count, the last.
    power[..., 1 : (count + 1) // 2] *= 2.0
    power[..., 0] = 0.0
    # By whole numbers, so that no rounding moves a line on an edge.
    edges = [int(np.ceil(edge * revolutions)) for edge in EDGES]
    parts = np.split(power, edges, axis=-1)
    return Bands(*(np.sqrt(part.sum(axis=-1)) for part in parts))
