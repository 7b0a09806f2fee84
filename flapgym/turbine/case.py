"""A case: the turbine, its operating point, its flaps and the discretisation (paper Sections II and IV)."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Annotated, Any, Literal

import numpy as np

from flapgym.core.fields import (
    Choice,
    Count,
    Flag,
    OrNone,
    PerBlade,
    Quantity,
    Text,
    Words,
    check_fields,
    from_plain,
    one_or_more,
    to_plain,
)
from flapgym.core.units import DEGREE
from flapgym.core.wording import number
from flapgym.turbine.machine import Turbine
from flapgym.turbine.speed_control import Schedule, SpeedControl

_Limit = 1000 * DEGREE


@dataclass(frozen=True)
class OperatingPoint:
    """The steady state about which the turbine is linearised.

    Attributes
    ----------
    wind_speed : float
        Mean wind along the shaft [m/s]; at least 5 m/s, and above the turbine's rated wind speed with a pitch.
    tip_speed_ratio : float
        Speed of the blade tip over the wind speed.
    pitch : float
        Collective blade pitch, positive with the leading edge upwind [rad].
    air_density : float
        [kg/m^3]
    """

    wind_speed: Annotated[float, Quantity("speed", at_least=5.0, at_most=60.0)]
    tip_speed_ratio: Annotated[float, Quantity("number", above=0.0, at_most=20.0)]
    pitch: Annotated[float, Quantity("angle", above=-90 * DEGREE, below=90 * DEGREE)]
    air_density: Annotated[float, Quantity("density", above=0.0)]

    def __post_init__(self) -> None:
        check_fields(self, "operating_point")


@dataclass(frozen=True)
class Discretisation:
    """Beam elements, vortex lattice, wake and time step.

    Attributes
    ----------
    blade_elements, tower_elements : int
        Beam elements of a blade and of the tower.
    first_lattice_node : int
        Blade node, counted from zero at the root, at which the lattice begins; its spanwise edges lie on the nodes.
    chordwise_panels : int
        Panels along the chord.
    time_step : float
        [s]
    wake_length : float
        Length of the wake downwind of the rotor, in rotor diameters.
    induction : float
        Axial induction factor by which the wake's transport is slowed; zero for a wake carried at the wind speed.
    gust : "at once" or "convected"
        Whether a gust strikes all panels of a section at once (the paper's eq. 9) or travels along the chord.
    input_delay : int
        Time steps by which flap and gust act late: 0, or 1 as in the paper's eq. 9.
    """

    blade_elements: Annotated[int, Count(at_least=1)]
    tower_elements: Annotated[int, Count(at_least=1)]
    first_lattice_node: Annotated[int, Count(at_least=0)]
    chordwise_panels: Annotated[int, Count(at_least=1)]
    time_step: Annotated[float, Quantity("time", above=0.0, at_most=1.0)]
    wake_length: Annotated[float, Quantity("length in rotor diameters", above=0.0)]
    induction: Annotated[float, Quantity("number", at_least=0.0, below=0.5)]
    gust: Annotated[Literal["at once", "convected"], Choice(("at once", "convected"))]
    input_delay: Annotated[int, Count(at_least=0, at_most=1)]

    def __post_init__(self) -> None:
        check_fields(self, "discretisation")
        if not self.first_lattice_node < self.blade_elements:
            raise ValueError(
                f"discretisation.first_lattice_node: expected less than discretisation.blade_elements "
                f"({self.blade_elements}), got {self.first_lattice_node}"
            )


@dataclass(frozen=True)
class Airloads:
    """How the lattice is laid on the blade, and what its loads take in.

    Attributes
    ----------
    elastic_axis : float or "published"
        Where the beam's axis crosses the chords, from the leading edge over the chord: "published" for the turbine's
        own pitch axis by station, or one fraction for the whole blade.
    lift_slope : "thin aerofoil" or "sections"
        Whether the strips have the lift slope of a flat plate in the perturbations, or those listed with the polars. In
        the mean load they have the flat plate's, from the polars' angles without lift.
    profile : "none" or "mean"
        Whether the sections' drag and pitching moment about their aerodynamic centres enter the mean load. The
        perturbations leave them out either way.
    mean_wake : float or "perturbations"
        Length of the wake behind the mean load, in rotor diameters; "perturbations" for the lattice's own wake.
    mean_induction : float or "momentum"
        Axial induction that slows a mean wake of its own: a factor, or the one that momentum theory finds for its
        thrust. Without effect where the mean load has the perturbations' wake, which `discretisation.induction` slows.
    linearisation : "mean flow" or "full"
        Forces of the perturbed circulation in the mean flow, as in the paper, or also those of the mean
        circulation in the perturbed flow.
    slow_wake : "frozen" or "moving"
        Whether slow wind and flaps meet the lattice's own wake, a fixed helix, alone, or what a long wake that moves
        with the wind adds to it: a collective state each.
    """

    elastic_axis: Annotated[
        float | Literal["published"], Quantity("number", words=("published",), at_least=0.0, at_most=1.0)
    ]
    lift_slope: Annotated[Literal["thin aerofoil", "sections"], Choice(("thin aerofoil", "sections"))]
    profile: Annotated[Literal["none", "mean"], Choice(("none", "mean"))]
    mean_wake: Annotated[
        float | Literal["perturbations"],
        Quantity("length in rotor diameters", words=("perturbations",), above=0.0, at_most=10.0),
    ]
    mean_induction: Annotated[
        float | Literal["momentum"], Quantity("number", words=("momentum",), at_least=0.0, below=0.5)
    ]
    linearisation: Annotated[Literal["mean flow", "full"], Choice(("mean flow", "full"))]
    slow_wake: Annotated[Literal["frozen", "moving"], Choice(("frozen", "moving"))]

    def __post_init__(self) -> None:
        check_fields(self, "airloads")


@dataclass(frozen=True)
class Flap:
    """A trailing-edge flap that each blade has, and the limits of its actuator.

    Attributes
    ----------
    span_start, span_end : float
        Ends of the flap as fractions of the lattice's span.
    chord_fraction : float
        Flap chord over local chord.
    effectiveness : float or "glauert"
        Factor on the downwash of the flap's panels: "glauert" for the one that gives thin-aerofoil theory's lift
        (see `flapgym.aerodynamics`), 1 for the lattice's own.
    angle_limit, rate_limit, acceleration_limit : float
        Largest angle [rad], rate [rad/s] and commanded acceleration [rad/s^2], to either side.
    """

    span_start: Annotated[float, Quantity("number", at_least=0.0, below=1.0)]
    span_end: Annotated[float, Quantity("number", above=0.0, at_most=1.0)]
    chord_fraction: Annotated[float, Quantity("number", above=0.0, at_most=1.0)]
    effectiveness: Annotated[
        float | Literal["glauert"], Quantity("number", words=("glauert",), above=0.0, at_most=10.0)
    ]
    angle_limit: Annotated[float, Quantity("angle", above=0.0, at_most=30 * DEGREE)]
    rate_limit: Annotated[float, Quantity("angular rate", above=0.0, at_most=_Limit)]
    acceleration_limit: Annotated[float, Quantity("angular acceleration", above=0.0, at_most=1000 * _Limit)]

    def __post_init__(self) -> None:
        check_fields(self, "flap")
        if not self.span_start < self.span_end:
            raise ValueError(
                f"flap.span_end: expected more than flap.span_start ({self.span_start}), got {self.span_end}"
            )


@dataclass(frozen=True)
class Pitch:
    """The actuator that pitches a blade, the same on every blade: of second order, behind stops.

    Attributes
    ----------
    angle_limit, rate_limit : float
        Largest angle from the operating point's [rad] and largest rate [rad/s], to either side.
    natural_frequency : float
        Of the undamped actuator [Hz].
    damping : float
        Over critical.
    """

    angle_limit: Annotated[float, Quantity("angle", above=0.0, at_most=90 * DEGREE)]
    rate_limit: Annotated[float, Quantity("angular rate", above=0.0, at_most=_Limit)]
    natural_frequency: Annotated[float, Quantity("frequency", above=0.0, at_most=100.0)]
    damping: Annotated[float, Quantity("number", above=0.0, at_most=10.0)]

    def __post_init__(self) -> None:
        check_fields(self, "pitch")


@dataclass(frozen=True)
class Blades:
    """What sets each of the three blades apart from the turbine's blade; blade 1 first.

    Attributes
    ----------
    mass_factor, stiffness_factor : three floats
        On all masses and inertias, and on all stiffnesses, of a blade's sections.
    flap_effectiveness : three floats
        On what a blade's flaps do, beside `flap.effectiveness`; zero for dead flaps.
    pitch_offset : three floats
        Added to the collective pitch [rad].
    """

    mass_factor: Annotated[tuple[float, float, float], PerBlade("number", at_least=0.5, at_most=2.0)]
    stiffness_factor: Annotated[tuple[float, float, float], PerBlade("number", at_least=0.5, at_most=2.0)]
    flap_effectiveness: Annotated[tuple[float, float, float], PerBlade("number", at_least=0.0, at_most=2.0)]
    pitch_offset: Annotated[
        tuple[float, float, float], PerBlade("angle", at_least=-5 * DEGREE, at_most=5 * DEGREE)
    ]

    def __post_init__(self) -> None:
        check_fields(self, "blades")

    @property
    def unequal(self) -> tuple[str, ...]:
        """Names of the fields in which the blades differ from each other."""
        return tuple(f.name for f in fields(self) if len(set(getattr(self, f.name))) > 1)


@dataclass(frozen=True)
class Reduction:
    """Sizes of the reduced model.

    Attributes
    ----------
    blade_modes, tower_modes : int
        Structural modes kept for each blade, and for tower, nacelle and shaft together.
    aerodynamic_states : int
        Balanced states kept for each cyclic component of the aerodynamics, at most.
    aerodynamic_tolerance : float
        States whose Hankel singular value is below this share of the largest are dropped; zero keeps the number.
    coupled_tolerance : float
        Largest rms error, over the rms of the output, at which the coupled turbine is reduced once more as a
        whole; zero leaves it as coupled.
    """

    blade_modes: Annotated[int, Count(at_least=1)]
    tower_modes: Annotated[int, Count(at_least=1)]
    aerodynamic_states: Annotated[int, Count(at_least=1, at_most=300)]
    aerodynamic_tolerance: Annotated[float, Quantity("number", at_least=0.0, below=1.0)]
    coupled_tolerance: Annotated[float, Quantity("number", at_least=0.0, below=1.0)]

    def __post_init__(self) -> None:
        check_fields(self, "reduction")


@dataclass(frozen=True)
class Turbulence:
    """The reference turbulence: standard deviation over mean wind, and von Karman length scale [m]."""

    intensity: Annotated[float, Quantity("number", above=0.0, at_most=1.0)]
    length_scale: Annotated[float, Quantity("length", above=0.0)]

    def __post_init__(self) -> None:
        check_fields(self, "turbulence")


BLADE_LOADS = ("rbm_edge", "root_torsion")
"""Further loads of each blade that a model may tell, and the axes of its root that they turn about."""
BLADE_MOTIONS = ("tip_in_plane",)
TOWER_LOADS = ("tower_base_fore_aft", "tower_base_side_side")
"""Further loads of the tower."""
TOWER_MOTIONS = ("tower_top_acceleration_fore_aft", "tower_top_acceleration_side_side")
HUB_LOADS = ("rotor_thrust", "shaft_torque", "tilt_moment", "yaw_moment")
"""What hub and blades exert on the shaft's end, in its axes that do not turn with the rotor."""
SPEED_SIGNALS = ("rotor_speed", "collective_pitch", "generator_torque", "wind_speed_estimate")
"""What a rotor whose speed is controlled tells, about the operating point; torque on the low-speed side."""
FIXED = (*TOWER_LOADS, *TOWER_MOTIONS, *HUB_LOADS, *SPEED_SIGNALS)
"""Of the further outputs, those that are not the blades'."""
NAMED = (*BLADE_LOADS, *BLADE_MOTIONS, *FIXED)
STATION = r"(deflection_(\d|[1-9]\d|100)|flapwise_moment_(\d|[1-9]\d))"
"""Deflection and moment of each blade at a station, whole percent of its length from the root."""


@dataclass(frozen=True)
class Signals:
    """Inputs and outputs that the model has after those of every model.

    Attributes
    ----------
    wind : "homogeneous" or "by strip"
        Whether the wind in each strip of each blade is an input, too, for a wind that differs over the rotor.
    gravity : bool
        Whether gravity is an input.
    pitch : bool
        Whether the pitch of each blade is an input; it takes a table `[pitch]`, too.
    outputs : tuple of str
        Of ``BLADE_LOADS``, ``BLADE_MOTIONS``, ``FIXED`` and those by ``STATION``: in this order after the others.
    """

    wind: Annotated[Literal["homogeneous", "by strip"], Choice(("homogeneous", "by strip"))] = "homogeneous"
    outputs: Annotated[
        tuple[str, ...],
        Words(
            (*NAMED, STATION),
            f"{', '.join(NAMED)}, deflection_N or flapwise_moment_N at N percent of the blade",
        ),
    ] = ()
    gravity: Annotated[bool, Flag()] = False
    pitch: Annotated[bool, Flag()] = False

    def __post_init__(self) -> None:
        check_fields(self, "signals")

    @property
    def further_inputs(self) -> tuple[str, ...]:
        """Names of the settings that ask for inputs which no spectrum weighs."""
        return tuple(f"signals.{name}" for name in ("pitch", "gravity") if getattr(self, name))

    @property
    def further(self) -> tuple[tuple[str, bool], ...]:
        """The outputs, each with whether it is the blades'."""
        return tuple((name, name not in FIXED) for name in self.outputs)


@dataclass(frozen=True, eq=False)
class Case:
    """Everything a model is built from; SI units and radians throughout.

    ``flaps`` are those of each blade, in files `[flap]` or several `[[flap]]`: from root to tip, none over another.
    """

    name: Annotated[str, Text()]
    turbine: Turbine
    operating_point: OperatingPoint
    discretisation: Discretisation
    airloads: Airloads
    flaps: tuple[Flap, ...] = field(metadata=one_or_more("flap"))
    reduction: Reduction
    turbulence: Turbulence
    blades: Blades
    signals: Signals = Signals()
    pitch: Annotated[Pitch | None, OrNone(Pitch)] = None
    schedule: Annotated[Schedule | None, OrNone(Schedule)] = None
    speed_control: Annotated[SpeedControl | None, OrNone(SpeedControl)] = None

    def __post_init__(self) -> None:
        check_fields(self)
        self.turbine.blade_sections(self.discretisation.blade_elements)
        self._check_flaps()
        self._check_pitch()
        if self.signals.pitch and self.pitch is None:
            raise ValueError(
                f"pitch: expected a table [pitch] with signals.pitch, of {', '.join(f.name for f in fields(Pitch))}"
            )
        self._check_speed()
        self._check_structure()
        self._check_lattice()

    def _check_speed(self) -> None:
        """Refuse a control of the rotor's speed by blades that do not pitch, and its outputs without it."""
        if self.speed_control is not None and not self.signals.pitch:
            raise ValueError(
                "signals.pitch: expected true with a table [speed_control], whose pitch is collective, got false"
            )
        for name in self.signals.outputs:
            if name in SPEED_SIGNALS and self.speed_control is None:
                raise ValueError(
                    f"signals.outputs: expected no {name} of a rotor whose speed is prescribed; give a table "
                    "[speed_control], or leave it out"
                )

    def _check_flaps(self) -> None:
        """Refuse flaps that are not in order: a model numbers them from root to tip."""
        if not self.flaps:
            raise ValueError(
                "flap: expected one or more flaps, got none; a dead one has an effectiveness near zero"
            )
        for i, (inner, outer) in enumerate(zip(self.flaps, self.flaps[1:], strict=False)):
            if outer.span_start < inner.span_end:
                raise ValueError(
                    f"flap[{i + 1}].span_start: expected at least flap[{i}].span_end ({inner.span_end}), got "
                    f"{outer.span_start}; list the flaps from root to tip, none over another"
                )

    def _check_pitch(self) -> None:
        """Refuse wind above rated with unpitched blades, on which the flow is not attached."""
        point, rated = self.operating_point, self.turbine.rated_wind_speed
        if point.wind_speed > rated and point.pitch == 0.0:
            raise ValueError(
                f"operating_point.pitch: expected the blades pitched above rated wind ({number(rated)} m/s), got "
                f"0 deg at a wind_speed of {number(point.wind_speed)} m/s; give pitch and tip_speed_ratio for that "
                "wind, or less wind"
            )

    def _check_structure(self) -> None:
        grid, keep, turbine = self.discretisation, self.reduction, self.turbine
        if turbine.rotor.blade_count != 3:
            raise ValueError(f"rotor.blade_count: expected 3, got {turbine.rotor.blade_count}")
        stations = len(turbine.tower.height)
        if grid.tower_elements != stations - 1:
            raise ValueError(
                f"discretisation.tower_elements: expected {stations - 1}, one between the tower's {stations} stations, "
                f"got {grid.tower_elements}"
            )
        for name, most in (
            ("blade_modes", 6 * grid.blade_elements),
            ("tower_modes", 6 * grid.tower_elements + 6),
        ):
            if getattr(keep, name) > most:
                raise ValueError(
                    f"reduction.{name}: expected at most {most}, the unknowns of its beams, got {getattr(keep, name)}"
                )

    def _check_lattice(self) -> None:
        """Refuse a lattice on sections without lift."""
        grid, planform = self.discretisation, self.turbine.planform
        radius = self.turbine.blade_sections(grid.blade_elements).radius
        nearest = np.abs(planform.radius[None] - radius[:, None]).argmin(axis=1)
        foils = [self.turbine.airfoil(planform.airfoil[station]) for station in nearest]
        listed = self.airloads.lift_slope == "sections"
        lifts = [(foil.normal_force_slope if listed else foil.lift_slope) > 0.0 for foil in foils]
        lowest = len(lifts) - lifts[::-1].index(False) if False in lifts else 0
        if lowest == len(lifts):
            field = "normal_force_slope" if listed else "lift_slope"
            raise ValueError(
                f"airfoils.{field}: expected sections with lift out to the blade's tip, got 0 1/rad there"
            )
        if grid.first_lattice_node < lowest:
            raise ValueError(
                f"discretisation.first_lattice_node: expected at least {lowest} (r = {radius[lowest]:.2f} m), "
                f"where the sections have lift, got {grid.first_lattice_node}"
            )

    @property
    def rotor_speed(self) -> float:
        """Angular speed of the rotor, tip-speed ratio times wind speed over radius [rad/s]."""
        point = self.operating_point
        return point.tip_speed_ratio * point.wind_speed / self.turbine.rotor.radius

    def at_wind_speed(self, wind_speed: float) -> Case:
        """The case at another wind speed [m/s] of its schedule, with rotor speed and pitch as listed there.

        Raises
        ------
        ValueError
            If it has no schedule, or that does not reach so far.
        """
        if self.schedule is None:
            raise ValueError(
                f"schedule: expected a table [schedule] of wind_speed, rotor_speed and pitch in case {self.name!r}, "
                "got none"
            )
        rotor_speed, pitch = self.schedule.at(wind_speed)
        ratio = rotor_speed * self.turbine.rotor.radius / wind_speed
        point = replace(self.operating_point, wind_speed=wind_speed, tip_speed_ratio=ratio, pitch=pitch)
        return replace(self, name=f"{self.name}-{number(wind_speed)}", operating_point=point)

    def of_blade(self, blade: int) -> Case:
        """The case whose three blades are all like blade 0, 1 or 2 of this one."""
        return self._alike(*(getattr(self.blades, f.name)[blade] for f in fields(self.blades)))

    def of_mean_blade(self) -> Case:
        """The case whose three blades are all like the mean of the blades of this one."""
        return self._alike(*(float(np.mean(getattr(self.blades, f.name))) for f in fields(self.blades)))

    def alike(self) -> Case:
        """The same case, what its blades have in common worked into turbine and pitch.

        Raises
        ------
        ValueError
            If its blades differ.
        """
        if self.blades.unequal:
            name = self.blades.unequal[0]
            raise ValueError(
                f"blades.{name}: expected equal blades here, got {getattr(self.blades, name)}; "
                "unequal blades are for `flapgym build`"
            )
        return self.of_blade(0)

    def _alike(self, mass: float, stiffness: float, flap: float, offset: float) -> Case:
        point, ones, zeros = self.operating_point, (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
        plain = (mass, stiffness) == (1.0, 1.0)
        return replace(
            self,
            turbine=self.turbine if plain else self.turbine.with_blade(mass, stiffness),
            operating_point=replace(point, pitch=point.pitch + offset),
            blades=Blades(ones, ones, (flap, flap, flap), zeros),
        )

    def to_dict(self) -> dict[str, Any]:
        """Return every value of the case and its turbine as nested dictionaries, lists and numbers, in SI."""
        plain: dict[str, Any] = to_plain(self)
        return plain

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Case:
        """Make the case again that `to_dict` wrote, such as the one a model file holds; raises ValueError."""
        return from_plain(cls, values)

    def hash(self) -> str:
        """SHA-256 (hexadecimal) over every value of the case and its turbine but their two names."""
        content = self.to_dict()
        del content["name"], content["turbine"]["name"]
        canonical = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
        return hashlib.sha256(canonical.encode()).hexdigest()
