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
from flapgym.aerodynamics.transport import WakeTransport, moving_wake_response, wake_transport

__all__ = [
    "Aerodynamics",
    "MeanLoads",
    "RotorWake",
    "WakeTransport",
    "build_aerodynamics",
    "collective_response",
    "convected_gust_downwash",
    "flap_downwash",
    "gust_downwash",
    "march",
    "mean_loads",
    "moving_wake_response",
    "root_moment_load",
    "steady_circulation",
    "transfer_function",
    "wake_transport",
]
