"""Longitudinal turbulence: von Karman spectrum, its rational filter, stationary realisations (paper section III)."""

from flapgym.turbulence.realisation import realise
from flapgym.turbulence.shaping_filter import von_karman_filter
from flapgym.turbulence.spectrum import von_karman_spectrum

__all__ = ["realise", "von_karman_filter", "von_karman_spectrum"]
