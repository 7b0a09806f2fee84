"""Linear unsteady vortex lattice of the rotor with a prescribed helicoidal wake (paper II.C)."""

from flapgym.aerodynamics.downwash import convected_gust_downwash, flap_downwash, gust_downwash
from flapgym.aerodynamics.model import Aerodynamics
from flapgym.aerodynamics.response import (
    RotorWake,
    collective_response,
    march,
    steady_circulation,
    transfer_function,
)
from flapgym.aerodynamics.rotor import build_aerodynamics, root_moment_load
from flapgym.aerodynamics.steady import MeanLoads, mean_loads

__all__ = [
    "Aerodynamics",
    "MeanLoads",
    "RotorWake",
    "build_aerodynamics",
    "collective_response",
    "convected_gust_downwash",
    "flap_downwash",
    "gust_downwash",
    "march",
    "mean_loads",
    "root_moment_load",
    "steady_circulation",
    "transfer_function",
]
