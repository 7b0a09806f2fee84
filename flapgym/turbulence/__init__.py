"""The wind along the shaft: von Karman turbulence and its filter (paper section III), gusts, recorded series."""

from flapgym.turbulence.gusts import Gust, gust_of
from flapgym.turbulence.realisation import realise
from flapgym.turbulence.shaping_filter import von_karman_filter
from flapgym.turbulence.spectrum import von_karman_spectrum

__all__ = ["Gust", "gust_of", "realise", "von_karman_filter", "von_karman_spectrum"]
