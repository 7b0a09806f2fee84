"""What a model's case tells of the machine behind its matrices: turbine, size, flaps, airloads.

A model may hold a case of an older flapgym, or of none: each part is read by itself, and what is not there is None.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, TypeVar

import numpy as np

from flapgym.core.arrays import Array
from flapgym.core.fields import Text, from_plain
from flapgym.turbine import Airloads, BladeSections, Discretisation, Flap, Rotor, TowerSections
from flapgym.wind.disk import Disk

T = TypeVar("T")

UNTOLD = "not told by the model's case"


@dataclass(frozen=True)
class Nameplate:
    """The machine a model was built of.

    Attributes
    ----------
    turbine : str or None
        Its name.
    rotor_radius, hub_height : float or None
        [m]
    flap_spans : tuple of pairs of floats
        Ends of each flap of a blade along its axis, from the apex, over the rotor radius; empty where not told.
    airloads : Airloads or None
        How the loads were read.
    disk : Disk or None
        Geometry of rotor and tower that the wind over the disk needs.
    strip_radii : (strips,) float
        Middle of each strip of the lattice along a blade, from the apex [m]; empty where not told.
    """

    turbine: str | None = None
    rotor_radius: float | None = None
    hub_height: float | None = None
    flap_spans: tuple[tuple[float, float], ...] = ()
    airloads: Airloads | None = None
    disk: Disk | None = field(default=None, compare=False)  # of the same rotor and tower
    strip_radii: Array = field(default_factory=lambda: np.empty(0), compare=False)

    @property
    def size(self) -> str:
        """Turbine, rotor radius and, where it is told, hub height in a line."""
        if self.turbine is None or self.rotor_radius is None:
            return UNTOLD
        height = "" if self.hub_height is None else f", hub height {self.hub_height:.4g} m"
        return f"{self.turbine}, rotor radius {self.rotor_radius:.4g} m{height}"

    @property
    def loads(self) -> str:
        """The reading of the airloads in a line, in the case's own words."""
        if self.airloads is None:
            return UNTOLD
        told = ((f.name.replace("_", " "), getattr(self.airloads, f.name)) for f in fields(self.airloads))
        return ", ".join(
            f"{name} {value if isinstance(value, str) else f'{value:g}'}" for name, value in told
        )


def nameplate(case: Mapping[str, Any]) -> Nameplate:
    """Read the case that a model holds (`TurbineModel.case`)."""
    turbine = case.get("turbine")
    machine = turbine if isinstance(turbine, Mapping) else {}
    rotor, tower = _part(Rotor, machine, "rotor"), _part(TowerSections, machine, "tower")
    return Nameplate(
        turbine=_name(machine),
        rotor_radius=None if rotor is None else rotor.radius,
        hub_height=None if rotor is None or tower is None else rotor.height_on(float(tower.height[-1])),
        flap_spans=_flap_spans(case, machine, rotor),
        airloads=_part(Airloads, case, "airloads"),
        disk=None if rotor is None or tower is None else _disk(rotor, tower),
        strip_radii=_strip_radii(case, machine),
    )


def disk_of(rotor: Rotor, tower: TowerSections) -> Disk:
    """The geometry for the wind over the disk.

    A turbine's data have no radius of the tower, but its mass and its mass moment about a diameter. Of a round wall,
    thin beside its radius, the moment is the mass times half the square of the radius at the wall's middle; half a wall
    (0.6 % of the radius for the NREL 5 MW) is left out.

    Raises
    ------
    ValueError
        If a station of the tower has no mass or no moment, or the rotor reaches the ground.
    """
    for name in ("mass_density", "inertia"):
        empty = np.flatnonzero(getattr(tower, name) == 0.0)
        if empty.size:
            raise ValueError(
                f"tower.{name}: expected more than 0 at every station, to tell the tower's radius, got 0 at station "
                f"{empty[0] + 1}"
            )
    return Disk(
        radius=rotor.radius,
        hub_height=rotor.height_on(float(tower.height[-1])),
        overhang=rotor.overhang,
        tilt=rotor.tilt,
        precone=rotor.precone,
        tower_height=tower.height,
        tower_radius=np.sqrt(2.0 * tower.inertia / tower.mass_density),
    )


def _disk(rotor: Rotor, tower: TowerSections) -> Disk | None:
    try:
        return disk_of(rotor, tower)
    except ValueError:
        return None


def _part(kind: type[T], content: Mapping[str, Any], key: str) -> T | None:
    """A section of a case, or None where it is missing or not as this flapgym knows it."""
    return _read(kind, content.get(key), key)


def _read(kind: type[T], section: object, key: str) -> T | None:
    if not isinstance(section, Mapping):
        return None
    try:
        return from_plain(kind, section, key)
    except (KeyError, TypeError, ValueError):
        return None


def _name(machine: Mapping[str, Any]) -> str | None:
    try:
        return Text().check(machine.get("name"), "turbine.name")
    except ValueError:
        return None


def _lattice_edges(case: Mapping[str, Any], machine: Mapping[str, Any]) -> Array:
    """Edges of the lattice's strips along a blade [m]; empty where not told."""
    grid = _part(Discretisation, case, "discretisation")
    if grid is None:
        return np.empty(0)
    nodes = "blade_sections_12" if grid.blade_elements == 12 else "blade_sections_documented"
    sections = _part(BladeSections, machine, nodes)
    if sections is None or len(sections.radius) != grid.blade_elements + 1:
        return np.empty(0)
    return sections.radius[grid.first_lattice_node :]


def _strip_radii(case: Mapping[str, Any], machine: Mapping[str, Any]) -> Array:
    edges = _lattice_edges(case, machine)
    return np.asarray(0.5 * (edges[1:] + edges[:-1]))


def _flap_spans(
    case: Mapping[str, Any], machine: Mapping[str, Any], rotor: Rotor | None
) -> tuple[tuple[float, float], ...]:
    told, edges = case.get("flap"), _lattice_edges(case, machine)
    # One flap a blade is a section by itself, several are a list.
    flaps = [_read(Flap, each, "flap") for each in (told if isinstance(told, list) else [told])]
    if rotor is None or not edges.size:
        return ()
    # The flaps' ends are fractions of the lattice's span, which begins outside the blade's root.
    first, last = float(edges[0]), float(edges[-1])
    spans = [
        (first + flap.span_start * (last - first), first + flap.span_end * (last - first))
        for flap in flaps
        if flap is not None
    ]
    if len(spans) < len(flaps):
        return ()
    return tuple((inner / rotor.radius, outer / rotor.radius) for inner, outer in spans)
