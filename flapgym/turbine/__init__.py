"""The machine and the case: frozen data read from TOML files with units, refused where they are not understood."""

from flapgym.turbine.case import (
    Airloads,
    Blades,
    Case,
    Discretisation,
    Flap,
    OperatingPoint,
    Pitch,
    Reduction,
    Signals,
    Turbulence,
)
from flapgym.turbine.files import BUILT_IN, DEFAULT_CASE, load_case, load_turbine
from flapgym.turbine.machine import (
    Airfoil,
    BladeSections,
    Drivetrain,
    Hub,
    Nacelle,
    PitchAxis,
    Planform,
    Polar,
    Rotor,
    TowerSections,
    Turbine,
)
from flapgym.turbine.speed_control import Schedule, SpeedControl

__all__ = [
    "BUILT_IN",
    "DEFAULT_CASE",
    "Airfoil",
    "Airloads",
    "BladeSections",
    "Blades",
    "Case",
    "Discretisation",
    "Drivetrain",
    "Flap",
    "Hub",
    "Nacelle",
    "OperatingPoint",
    "Pitch",
    "PitchAxis",
    "Planform",
    "Polar",
    "Reduction",
    "Rotor",
    "Schedule",
    "Signals",
    "SpeedControl",
    "TowerSections",
    "Turbine",
    "Turbulence",
    "load_case",
    "load_turbine",
]
