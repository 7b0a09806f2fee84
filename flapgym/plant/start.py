"""How episodes begin: winds known in advance, and what a reset gives of each turbine."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from flapgym.core.arrays import Array, IntArray


class GivenWind(NamedTuple):
    """A wind known in advance, such as a gust.

    Attributes
    ----------
    wind : (T + 1,) or (T + 1, 3 R) float
        Perturbation at samples 0 to T [m/s]: one for the disk, or that of R strips, each in components 0, c, s.
    before : float or (3 R,) float
        What has always blown before [m/s]: the turbine starts in equilibrium with it.
    """

    wind: Array
    before: float | Array


@dataclass(frozen=True, eq=False)
class Start:
    """How m turbines begin an episode.

    Attributes
    ----------
    azimuth : (m,) float
        Of blade 1 [rad].
    angle, rate : (m, blades A) float
        Of flaps, and of pitch behind them, within the stops [rad, rad/s]. The turbine's response to them starts from
        rest.
    intensity : (m,) float
        Of the turbulence; none where it is zero.
    noise : (m, noise_count) float or None
        Standard normal numbers that make the realisations.
    realisation : (m,) int or None
        Instead of noise: which realisations of the pool.
    gust : GivenWind or None
        Wind beside the turbulence. Keep the object: its response is computed once.
    """

    azimuth: Array
    angle: Array
    rate: Array
    intensity: Array
    noise: Array | None = None
    realisation: IntArray | None = None
    gust: GivenWind | None = None
