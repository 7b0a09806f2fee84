"""What the wind turbine is: geometry, masses, section properties and aerofoils (paper Section IV.A, Table 2)."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Annotated

import numpy as np

from flapgym.core.arrays import Array
from flapgym.core.fields import Column, Count, Quantity, Text, TextColumn, check_fields, to_plain
from flapgym.core.units import DEGREE

_Length = Annotated[float, Quantity("length", above=0.0)]
_Mass = Annotated[float, Quantity("mass", at_least=0.0)]
_Inertia = Annotated[float, Quantity("inertia", at_least=0.0)]
_Angle = Annotated[float, Quantity("angle", above=-45 * DEGREE, below=45 * DEGREE)]
_Ratio = Annotated[float, Quantity("number", at_least=0.0, below=1.0)]

_Station = Annotated[Array, Column("length", at_least=0.0, increasing=True)]
_Twist = Annotated[Array, Column("angle", above=-90 * DEGREE, below=90 * DEGREE)]
_MassDensity = Annotated[Array, Column("mass per length", at_least=0.0)]
_Stiffness = Annotated[Array, Column("bending stiffness", above=0.0)]
_AxialStiffness = Annotated[Array, Column("force", above=0.0)]
_InertiaDensity = Annotated[Array, Column("inertia per length", at_least=0.0)]


@dataclass(frozen=True)
class Rotor:
    """Geometry of the rotor and its place on the tower; lengths [m], angles [rad].

    Attributes
    ----------
    blade_count : int
        Number of equal blades.
    hub_radius, radius : float
        Distance from the rotor apex to the blade root and to the tip, along the blade.
    precone : float
        Angle by which the blades lean upwind out of the rotor plane.
    tilt : float
        Angle of the shaft to the horizontal, its rotor end up.
    overhang : float
        Distance from the yaw axis to the rotor apex along the shaft.
    tower_top_to_shaft : float
        Vertical distance from the tower top to the shaft's axis, on the yaw axis.
    """

    blade_count: Annotated[int, Count(at_least=1)]
    hub_radius: _Length
    radius: _Length
    precone: _Angle
    tilt: _Angle
    overhang: _Length
    tower_top_to_shaft: Annotated[float, Quantity("length", at_least=0.0)]

    def __post_init__(self) -> None:
        check_fields(self, "rotor")
        if not self.hub_radius < self.radius:
            raise ValueError(
                f"rotor.hub_radius: expected less than rotor.radius ({self.radius} m), got {self.hub_radius} m"
            )

    def height_on(self, tower_height: float) -> float:
        """Height of the rotor apex above the base of a tower so high [m]."""
        return tower_height + self.tower_top_to_shaft + self.overhang * math.sin(self.tilt)


@dataclass(frozen=True)
class Hub:
    """The hub, a point mass at the rotor apex: mass [kg] and inertia about the shaft's axis [kg m^2]."""

    mass: _Mass
    inertia_about_shaft: _Inertia

    def __post_init__(self) -> None:
        check_fields(self, "hub")


@dataclass(frozen=True)
class Nacelle:
    """The nacelle.

    Attributes
    ----------
    mass : float
        [kg]
    downwind, above : float
        Place of its centre of mass from the tower top [m].
    yaw_inertia : float
        About the yaw axis [kg m^2].
    roll_inertia : float
        About the downwind axis through its centre of mass [kg m^2].
    """

    mass: _Mass
    downwind: Annotated[float, Quantity("length")]
    above: Annotated[float, Quantity("length")]
    yaw_inertia: _Inertia
    roll_inertia: _Inertia

    def __post_init__(self) -> None:
        check_fields(self, "nacelle")


@dataclass(frozen=True)
class Drivetrain:
    """The low-speed shaft as one torsion spring, and the generator behind the gearbox.

    Attributes
    ----------
    torsion_spring : float
        Twisting stiffness of the shaft between the locked generator and the hub [N m/rad].
    torsion_damper : float
        Its damping [N m s/rad].
    gearbox_ratio : float
        Generator speed over rotor speed.
    generator_inertia : float
        About the high-speed shaft [kg m^2].
    shaft_bending_stiffness : float
        Bending stiffness of the shaft as a beam over the overhang [N m^2].
    """

    torsion_spring: Annotated[float, Quantity("torsion spring", above=0.0)]
    torsion_damper: Annotated[float, Quantity("torsion damper", at_least=0.0)]
    gearbox_ratio: Annotated[float, Quantity("number", above=0.0)]
    generator_inertia: _Inertia
    shaft_bending_stiffness: Annotated[float, Quantity("bending stiffness", above=0.0)]

    def __post_init__(self) -> None:
        check_fields(self, "drivetrain")


@dataclass(frozen=True, eq=False)
class BladeSections:
    """Section properties of a blade over its stations, arrays of shape (n,).

    Attributes
    ----------
    radius : distance from the rotor apex along the blade [m]
    twist : structural twist [rad], positive with the leading edge upwind
    mass_density : [kg/m]
    flap_stiffness, edge_stiffness : bending out of and in the chord's plane [N m^2]
    torsion_stiffness : [N m^2]
    axial_stiffness : [N]
    flap_inertia, edge_inertia : section's mass moments per length in flapwise and edgewise rotation [kg m]
    centre_of_gravity_offset : of the mass from the beam's axis, positive towards the trailing edge [m]
    """

    radius: _Station
    twist: _Twist
    mass_density: _MassDensity
    flap_stiffness: _Stiffness
    edge_stiffness: _Stiffness
    torsion_stiffness: _Stiffness
    axial_stiffness: _AxialStiffness
    flap_inertia: _InertiaDensity
    edge_inertia: _InertiaDensity
    centre_of_gravity_offset: Annotated[Array, Column("length")]

    def __post_init__(self) -> None:
        check_fields(self, "blade_sections")


@dataclass(frozen=True, eq=False)
class TowerSections:
    """Section properties of the axisymmetric tower over its stations, arrays of shape (n,).

    Attributes
    ----------
    height : above the clamped base [m]
    mass_density : [kg/m]
    bending_stiffness : fore-aft and side-to-side alike [N m^2]
    torsion_stiffness : [N m^2]
    axial_stiffness : [N]
    inertia : section's mass moment per length about a diameter [kg m]
    """

    height: _Station
    mass_density: _MassDensity
    bending_stiffness: _Stiffness
    torsion_stiffness: _Stiffness
    axial_stiffness: _AxialStiffness
    inertia: _InertiaDensity

    def __post_init__(self) -> None:
        check_fields(self, "tower")
        if self.height[0] != 0.0:
            raise ValueError(f"tower.height: expected 0 m at the first station, got {self.height[0]} m")


@dataclass(frozen=True, eq=False)
class Planform:
    """Aerodynamic shape of a blade over its stations: arrays of shape (n,) and one aerofoil's name a station.

    Attributes
    ----------
    radius : distance from the rotor apex along the blade [m]
    twist : [rad], positive with the leading edge upwind
    chord : [m]
    airfoil : names, keys of `Turbine.airfoil`
    """

    radius: _Station
    twist: _Twist
    chord: Annotated[Array, Column("length", above=0.0)]
    airfoil: Annotated[tuple[str, ...], TextColumn()]

    def __post_init__(self) -> None:
        check_fields(self, "planform")


@dataclass(frozen=True, eq=False)
class PitchAxis:
    """Where the pitch axis, taken for the elastic axis too, crosses the chords of the blade; arrays (n,).

    Attributes
    ----------
    radius : distance from the rotor apex along the blade [m]
    chord_fraction : distance behind the leading edge over the chord
    """

    radius: _Station
    chord_fraction: Annotated[Array, Column("number", at_least=0.0, at_most=1.0)]

    def __post_init__(self) -> None:
        check_fields(self, "pitch_axis")


@dataclass(frozen=True, eq=False)
class Polar:
    """A section's published coefficients in attached flow; arrays (n,) over the angle of attack.

    Attributes
    ----------
    angle : angle of attack [rad]
    lift, drag : coefficients over the chord
    moment : coefficient about the aerodynamic centre over the chord squared, positive nose up
    """

    angle: Annotated[Array, Column("angle", above=-90 * DEGREE, below=90 * DEGREE, increasing=True)]
    lift: Annotated[Array, Column("number")]
    drag: Annotated[Array, Column("number", at_least=0.0)]
    moment: Annotated[Array, Column("number")]

    def __post_init__(self) -> None:
        check_fields(self, "airfoils.polar")

    def at(self, angle: Array) -> tuple[Array, Array]:
        """Drag and moment at angles [rad]; beyond the table its last values."""
        return (
            np.interp(angle, self.angle, self.drag),
            np.interp(angle, self.angle, self.moment),
        )


@dataclass(frozen=True, eq=False)
class Airfoil:
    """An aerofoil's lift at small angles of attack, and its polar.

    Attributes
    ----------
    name : str
    zero_lift_angle_attached : float
        Angle at which the straight line through the attached flow (0 to 4 deg) has no lift [rad].
    zero_lift_angle_listed : float
        The one the polar's file lists [rad].
    lift_slope : float
        Of that line [1/rad]; zero for a section that carries no lift.
    normal_force_slope : float
        The slope of the normal force in attached flow that the polar's file lists [1/rad].
    polar : Polar
    """

    name: Annotated[str, Text()]
    zero_lift_angle_attached: _Angle
    zero_lift_angle_listed: _Angle
    lift_slope: Annotated[float, Quantity("slope", at_least=0.0)]
    normal_force_slope: Annotated[float, Quantity("slope", at_least=0.0)]
    polar: Polar

    def __post_init__(self) -> None:
        check_fields(self, "airfoils")


@dataclass(frozen=True, eq=False)
class Turbine:
    """A three-bladed (or other) horizontal-axis wind turbine; SI units and radians throughout.

    Attributes
    ----------
    gravity : float
        [m/s^2]
    rated_wind_speed : float
        Above which the blades are pitched [m/s].
    blade_damping_ratio, tower_damping_ratio : float
        Structural damping as a fraction of critical.
    mass_factor : float
        By which the documented mass densities of the blade are multiplied.
    blade_sections_documented : BladeSections
        The stations of the turbine's definition, mass as printed there (without `mass_factor`).
    blade_sections_12 : BladeSections
        The thirteen nodes of the paper's Table 2, as printed (nodes 2 to 12 carry the mass factor).
    """

    name: Annotated[str, Text()]
    gravity: Annotated[float, Quantity("acceleration", at_least=0.0)]
    rated_wind_speed: Annotated[float, Quantity("speed", above=0.0)]
    blade_damping_ratio: _Ratio
    tower_damping_ratio: _Ratio
    mass_factor: Annotated[float, Quantity("number", above=0.0)]
    rotor: Rotor
    hub: Hub
    nacelle: Nacelle
    drivetrain: Drivetrain
    blade_sections_documented: BladeSections
    blade_sections_12: BladeSections
    tower: TowerSections
    planform: Planform
    pitch_axis: PitchAxis
    airfoils: tuple[Airfoil, ...]

    def __post_init__(self) -> None:
        check_fields(self)
        for section in ("blade_sections_documented", "blade_sections_12", "planform", "pitch_axis"):
            radius = getattr(self, section).radius
            ends = (self.rotor.hub_radius, self.rotor.radius)
            if not all(
                math.isclose(r, end, abs_tol=1e-6) for r, end in zip(radius[[0, -1]], ends, strict=True)
            ):
                raise ValueError(
                    f"{section}.radius: expected stations from rotor.hub_radius to rotor.radius "
                    f"({ends[0]} to {ends[1]} m), got {radius[0]} to {radius[-1]} m"
                )
        if len(self.blade_sections_12.radius) != 13:
            given = len(self.blade_sections_12.radius)
            raise ValueError(f"blade_sections_12.stations: expected 13 nodes of 12 elements, got {given}")
        names = [airfoil.name for airfoil in self.airfoils]
        for name in self.planform.airfoil:
            if names.count(name) != 1:
                raise ValueError(
                    f"planform.airfoil: expected one entry of airfoils named {name!r}, got {names}"
                )

    @property
    def hub_height(self) -> float:
        """Height of the rotor apex above the tower's base [m]."""
        return self.rotor.height_on(float(self.tower.height[-1]))

    def differing(self, other: Turbine) -> tuple[str, ...]:
        """Names of the fields in which another turbine differs; what they are called does not count."""
        names = (f.name for f in fields(self) if f.name != "name")
        return tuple(
            name for name in names if to_plain(getattr(self, name)) != to_plain(getattr(other, name))
        )

    def require(self, expected: Turbine) -> None:
        """Refuse, with a ValueError, to be another turbine than the expected one."""
        differing = self.differing(expected)
        if differing:
            raise ValueError(
                f"turbine: expected {expected.name}, got {self.name}, which differs in {', '.join(differing)}"
            )

    def airfoil(self, name: str) -> Airfoil:
        """Return the aerofoil of that name."""
        return next(airfoil for airfoil in self.airfoils if airfoil.name == name)

    def with_blade(self, mass_factor: float, stiffness_factor: float) -> Turbine:
        """The turbine whose blades have so many times the mass (and inertia) and so many times the stiffness."""

        def scaled(sections: BladeSections) -> BladeSections:
            mass = ("mass_density", "flap_inertia", "edge_inertia")
            stiffness = ("flap_stiffness", "edge_stiffness", "torsion_stiffness", "axial_stiffness")
            changed = {name: mass_factor * getattr(sections, name) for name in mass}
            changed |= {name: stiffness_factor * getattr(sections, name) for name in stiffness}
            return replace(sections, **changed)

        return replace(
            self,
            blade_sections_documented=scaled(self.blade_sections_documented),
            blade_sections_12=scaled(self.blade_sections_12),
        )

    def blade_sections(self, elements: int) -> BladeSections:
        """Section properties at the nodes of a blade of so many elements, mass factor included.

        Parameters
        ----------
        elements : int
            12 for the paper's Table 2, or one less than the documented stations (48 for the NREL 5 MW).
        """
        documented = self.blade_sections_documented
        if elements == 12:
            return self.blade_sections_12
        if elements == len(documented.radius) - 1:
            return replace(documented, mass_density=documented.mass_density * self.mass_factor)
        raise ValueError(
            f"discretisation.blade_elements: expected 12 or {len(documented.radius) - 1}, got {elements}"
        )
