"""The wind along the shaft: von Karman turbulence and its filter (paper section III), gusts, fields over the disk."""

from flapgym.wind.field import disk_turbulence
from flapgym.wind.gusts import Gust, gust_of
from flapgym.wind.realisation import realise
from flapgym.wind.shaping_filter import von_karman_filter
from flapgym.wind.spectrum import von_karman_spectrum
from flapgym.wind.turbulence import Kaimal, VonKarman, turbulence_of
from flapgym.wind.wind import Wind

__all__ = [
    "Gust",
    "Kaimal",
    "VonKarman",
    "Wind",
    "disk_turbulence",
    "gust_of",
    "realise",
    "turbulence_of",
    "von_karman_filter",
    "von_karman_spectrum",
]
