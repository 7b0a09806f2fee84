"""Another turbine: the NREL 5 MW with every length longer and every load in proportion, and a flap of its own.

By the cubic law: the same wind, tip-speed ratio and materials, so masses grow with the cube of the lengths, time and
periods with the length, and a model in units of its own is the same. No number of the NREL 5 MW is right for it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, TypeVar

from flapgym.turbine import Case, Turbine, load_case, load_turbine

T = TypeVar("T")

FACTOR = 120.0 / 63.0
"""Radius 120 m, as the IEA 15 MW's."""

POWERS = {
    "hub_radius": 1,
    "radius": 1,
    "overhang": 1,
    "tower_top_to_shaft": 1,
    "mass": 3,
    "inertia_about_shaft": 5,
    "downwind": 1,
    "above": 1,
    "yaw_inertia": 5,
    "roll_inertia": 5,
    "torsion_spring": 3,
    "torsion_damper": 4,
    "generator_inertia": 5,
    "shaft_bending_stiffness": 4,
    "mass_density": 2,
    "flap_stiffness": 4,
    "edge_stiffness": 4,
    "bending_stiffness": 4,
    "torsion_stiffness": 4,
    "axial_stiffness": 2,
    "flap_inertia": 4,
    "edge_inertia": 4,
    "inertia": 4,
    "centre_of_gravity_offset": 1,
    "height": 1,
    "chord": 1,
}
"""Power of the length with which each field grows; angles and ratios do not."""


def scaled_turbine(factor: float = FACTOR, name: str = "scaled15mw") -> Turbine:
    """The turbine with all lengths so many times as long."""
    turbine = load_turbine()
    parts = (
        "rotor",
        "hub",
        "nacelle",
        "drivetrain",
        "blade_sections_documented",
        "blade_sections_12",
        "tower",
        "planform",
        "pitch_axis",
    )
    return replace(turbine, name=name, **{part: _grown(getattr(turbine, part), factor) for part in parts})


def _grown(part: T, factor: float) -> T:
    own: dict[str, Any] = vars(part)
    return replace(part, **{key: own[key] * factor**power for key, power in POWERS.items() if key in own})  # type: ignore[type-var]


def small_case(factor: float = 1.0, name: str = "small") -> Case:
    """A case of few panels, modes and states on the turbine so many times as long, in its own measure of time.

    Flap and wind are not the shipped case's: stops at 6 deg and 45 deg/s, from 40 to 65 % of the lattice's span.
    """
    case, turbine = load_case(), scaled_turbine(factor)
    return replace(
        case,
        name=name,
        turbine=turbine,
        operating_point=replace(case.operating_point, wind_speed=9.5, tip_speed_ratio=7.5),
        discretisation=replace(
            case.discretisation, chordwise_panels=2, wake_length=0.05, time_step=0.03 * factor
        ),
        flaps=(
            replace(
                case.flaps[0],
                span_start=0.4,
                span_end=0.65,
                chord_fraction=0.3,
                angle_limit=0.105,
                rate_limit=0.785 / factor,
                acceleration_limit=6.0 / factor**2,
            ),
        ),
        reduction=replace(case.reduction, blade_modes=3, tower_modes=3, aerodynamic_states=6),
        turbulence=replace(case.turbulence, intensity=0.14, length_scale=105.0 * factor),
    )
