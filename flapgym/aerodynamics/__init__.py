"""Linear unsteady vortex lattice of the rotor with a prescribed helicoidal wake (paper II.C)."""

from flapgym.aerodynamics.downwash import convected_gust_downwash, flap_downwash, gust_arrival, gust_downwash
from flapgym.aerodynamics.linearisation import (
    MeanFlow,
    SegmentMotion,
    bound_segments,
    cambered,
    cambered_normals,
    full_loads,
    gust_past_segments,
)
from flapgym.aerodynamics.loads import FullLoads
from flapgym.aerodynamics.model import Aerodynamics
from flapgym.aerodynamics.response import (
    RotorWake,
    collective_response,
    march,
    steady_circulation,
    steady_response,
    transfer_function,
)
from flapgym.aerodynamics.rigid import RigidRotor, rigid_rotor
from flapgym.aerodynamics.rotor import build_aerodynamics, build_mean_aerodynamics, root_moment_load
from flapgym.aerodynamics.steady import MeanLoads, mean_loads, momentum_induction
from flapgym.aerodynamics.transport import (
    WakeState,
    WakeTransport,
    moving_wake_response,
    pitch_transport,
    speed_transport,
    wake_transport,
)

__all__ = [
    "Aerodynamics",
    "FullLoads",
    "MeanFlow",
    "MeanLoads",
    "RigidRotor",
    "RotorWake",
    "SegmentMotion",
    "WakeState",
    "WakeTransport",
    "bound_segments",
    "build_aerodynamics",
    "build_mean_aerodynamics",
    "cambered",
    "cambered_normals",
    "collective_response",
    "convected_gust_downwash",
    "flap_downwash",
    "full_loads",
    "gust_arrival",
    "gust_downwash",
    "gust_past_segments",
    "march",
    "mean_loads",
    "momentum_induction",
    "moving_wake_response",
    "pitch_transport",
    "rigid_rotor",
    "root_moment_load",
    "speed_transport",
    "steady_circulation",
    "steady_response",
    "transfer_function",
    "wake_transport",
]
