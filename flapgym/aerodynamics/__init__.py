"""Linear unsteady vortex lattice of the rotor with a prescribed helicoidal wake (paper II.C)."""

from flapgym.aerodynamics.downwash import flap_downwash, gust_downwash
from flapgym.aerodynamics.model import Aerodynamics
from flapgym.aerodynamics.response import march, steady_circulation, transfer_function
from flapgym.aerodynamics.rotor import build_aerodynamics, root_moment_load

__all__ = [
    "Aerodynamics",
    "build_aerodynamics",
    "flap_downwash",
    "gust_downwash",
    "march",
    "root_moment_load",
    "steady_circulation",
    "transfer_function",
]
