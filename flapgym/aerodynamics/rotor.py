"""The vortex lattice of a turbine case: planform, operating point and discretisation in, model out (paper IV.B)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flapgym.aerodynamics.lattice import Inflow, build_lattice
from flapgym.aerodynamics.model import Aerodynamics, WakeEnd, assemble
from flapgym.turbine import Case

Array = NDArray[np.float64]

# The blade's beam axis runs through the aerofoils' quarter chords.
PITCH_AXIS = 0.25


def strip_radius(case: Case) -> Array:
    """Radii of the strips' edges along the blade axis [m]: the beam nodes from the first one that carries lattice."""
    grid = case.discretisation
    return case.turbine.blade_sections(grid.blade_elements).radius[grid.first_lattice_node :]


def rotor_inflow(case: Case) -> Inflow:
    """Mean wind along the shaft on the turning rotor; the wake moves with the wind less the axial induction."""
    point = case.operating_point
    wind = np.array([point.wind_speed, 0.0, 0.0])
    return Inflow(
        velocity=wind,
        rotor_speed=case.rotor_speed,
        wake_velocity=(1.0 - case.discretisation.induction) * wind,
    )


def wake_rows(case: Case) -> int:
    """Rows that make the wake as long as the case asks: 409 for a quarter diameter at 11 m/s and 0.007 s."""
    grid = case.discretisation
    row = (1.0 - grid.induction) * case.operating_point.wind_speed * grid.time_step
    return max(1, round(grid.wake_length * 2.0 * case.turbine.rotor.radius / row))


def chord_direction(angle: Array, precone: float) -> Array:
    """Unit vectors (..., 3) from leading to trailing edge in S for angles [rad] of the chord to the rotor plane.

    A positive angle (twist, pitch) moves the leading edge upwind. Blade 1 at azimuth zero travels towards -y.
    """
    sine, zero = np.sin(angle), np.zeros_like(angle)
    return np.stack([sine * np.cos(precone), np.cos(angle) + zero, sine * np.sin(precone)], axis=-1)


def blade_edges(
    case: Case, radius: Array, axis_point: Array | None = None, turned: Array | None = None
) -> tuple[Array, Array]:
    """Leading and trailing edge of blade 1 at the strips' edges, each (strips + 1, 3) in S at azimuth zero [m].

    Parameters
    ----------
    radius : (strips + 1,) float
        The strips' edges along the blade axis [m].
    axis_point : (strips + 1, 3) float, optional
        Where the beam axis is at the strips' edges; by default the undeformed, coned straight line.
    turned : (strips + 1, 3, 3) float, optional
        Rotation of the sections there from their undeformed attitude; default none.
    """
    turbine = case.turbine
    precone, planform = turbine.rotor.precone, turbine.planform
    if axis_point is None:
        axis_point = radius[:, None] * np.array([-np.sin(precone), 0.0, np.cos(precone)])
    chord = np.interp(radius, planform.radius, planform.chord)
    angle = np.interp(radius, planform.radius, planform.twist) + case.operating_point.pitch
    vector = chord[:, None] * chord_direction(angle, precone)
    if turned is not None:
        vector = np.einsum("sij,sj->si", turned, vector)
    return axis_point - PITCH_AXIS * vector, axis_point + (1.0 - PITCH_AXIS) * vector


def build_aerodynamics(
    case: Case,
    blades: int = 3,
    positions: Array | None = None,
    turned: Array | None = None,
    wake_end: WakeEnd = "closed",
) -> Aerodynamics:
    """Aerodynamics of a case's rotor, or of one of its blades alone.

    Parameters
    ----------
    case : Case
        Turbine, operating point, discretisation.
    blades : int
        3 for the rotor, 1 for a single blade that turns alone in its own wake.
    positions : (strips + 1, 3) float, optional
        Beam axis at the strips' edges in S [m], from node `first_lattice_node` outwards; default undeformed.
    turned : (strips + 1, 3, 3) float, optional
        Rotation of the sections there from their undeformed attitude; default none.
    wake_end : "closed" or "open"
        Whether the wake ends with its last ring's rear vortex, see `assemble`.
    """
    inflow, grid = rotor_inflow(case), case.discretisation
    edges = blade_edges(case, strip_radius(case), positions, turned)
    lattice = build_lattice(*edges, grid.chordwise_panels, inflow, grid.time_step)
    return assemble(
        lattice,
        inflow,
        time_step=grid.time_step,
        wake_rows=wake_rows(case),
        air_density=case.operating_point.air_density,
        blades=blades,
        wake_end=wake_end,
    )


def root_moment_load(aero: Aerodynamics, case: Case) -> Array:
    """Row (1, 3 P) that sums forces to the flapwise moment about the blade root, positive downwind [N m / N].

    The moment about +y of the coned, untwisted blade at the hub radius: RBM by force summation on the undeformed blade.
    """
    precone = case.turbine.rotor.precone
    root = case.turbine.rotor.hub_radius * np.array([-np.sin(precone), 0.0, np.cos(precone)])
    arm = aero.force_point - root
    # (arm x F) . e_y = arm_z F_x - arm_x F_z
    return np.asarray(np.stack([arm[:, 2], np.zeros(arm.shape[0]), -arm[:, 0]], axis=-1).reshape(1, -1))
