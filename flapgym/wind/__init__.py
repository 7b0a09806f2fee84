"""The wind along the shaft: von Karman turbulence and its filter (paper section III), gusts, recorded series."""

from flapgym.wind.gusts import Gust, gust_of
from flapgym.wind.realisation import realise
from flapgym.wind.shaping_filter import von_karman_filter
from flapgym.wind.spectrum import von_karman_spectrum
from flapgym.wind.wind import Wind

__all__ = ["Gust", "Wind", "gust_of", "realise", "von_karman_filter", "von_karman_spectrum"]
