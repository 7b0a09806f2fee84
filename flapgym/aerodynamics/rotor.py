"""The vortex lattice of a turbine case: planform, operating point and discretisation in, model out (paper IV.B)."""

from __future__ import annotations

import numpy as np

from flapgym.aerodynamics.lattice import Inflow, Lattice, build_lattice
from flapgym.aerodynamics.model import Aerodynamics, WakeEnd, assemble
from flapgym.core.arrays import Array
from flapgym.turbine import Case

MEAN_WAKE_TURN = np.deg2rad(5.0)
"""Turn of the rotor in which a mean wake of its own grows by a row [rad]; half of it moves the thrust by less than a
thousandth."""


def strip_radius(case: Case) -> Array:
    """Radii of the strips' edges along the blade axis [m]: the beam nodes from the first one that carries lattice."""
    grid = case.discretisation
    return case.turbine.blade_sections(grid.blade_elements).radius[grid.first_lattice_node :]


def mid_radius(case: Case) -> Array:
    """Radii of the strips' middles along the blade axis [m]."""
    edge = strip_radius(case)
    return np.asarray(0.5 * (edge[1:] + edge[:-1]))


def root_moment_shares(case: Case) -> Array:
    """Which part of the root moment under a homogeneous gust each strip brings (strips,), by strip theory.

    Lift by a gust goes as chord and speed; its arm is that from the root. They sum to one.
    """
    edge, middle, planform = strip_radius(case), mid_radius(case), case.turbine.planform
    chord = np.interp(middle, planform.radius, planform.chord)
    share = chord * np.diff(edge) * middle * (middle - case.turbine.rotor.hub_radius)
    return np.asarray(share / share.sum())


def elastic_axis(case: Case, radius: Array) -> Array:
    """Where the beam's axis crosses the chords at radii [m], from the leading edge over the chord."""
    chosen, published = case.airloads.elastic_axis, case.turbine.pitch_axis
    if chosen == "published":
        return np.asarray(np.interp(radius, published.radius, published.chord_fraction))
    return np.full_like(radius, float(chosen))


def zero_lift_angles(case: Case) -> Array:
    """Angles of attack (strips,) [rad] at which the strips' sections have no lift."""
    planform = case.turbine.planform
    angle = [case.turbine.airfoil(name).zero_lift_angle_attached for name in planform.airfoil]
    return np.interp(mid_radius(case), planform.radius, angle)


def lift_slopes(case: Case) -> Array | None:
    """Lift slopes (strips,) [1/rad] of the perturbations; None for the flat plate's, which is the lattice's own."""
    if case.airloads.lift_slope == "thin aerofoil":
        return None
    planform = case.turbine.planform
    slope = [case.turbine.airfoil(name).normal_force_slope for name in planform.airfoil]
    return np.interp(mid_radius(case), planform.radius, slope)


def rotor_inflow(case: Case, induction: float) -> Inflow:
    """Mean wind along the shaft on the turning rotor; the wake moves with the wind less the axial induction."""
    wind = np.array([case.operating_point.wind_speed, 0.0, 0.0])
    return Inflow(velocity=wind, rotor_speed=case.rotor_speed, wake_velocity=(1.0 - induction) * wind)


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
    ahead = elastic_axis(case, radius)[:, None]
    return axis_point - ahead * vector, axis_point + (1.0 - ahead) * vector


def blade_rings(case: Case, inflow: Inflow, positions: Array | None, turned: Array | None) -> Lattice:
    """Rings of a case's blade 1, the beam's axis and the sections' turn given as for `build_aerodynamics`."""
    edges = blade_edges(case, strip_radius(case), positions, turned)
    return build_lattice(*edges, case.discretisation.chordwise_panels, inflow, case.discretisation.time_step)


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
    inflow = rotor_inflow(case, case.discretisation.induction)
    return _assembled(
        case, inflow, lift_slopes(case), blades, positions, turned, wake_end, wake_rows(case), None
    )


def build_mean_aerodynamics(
    case: Case,
    induction: float,
    blades: int = 3,
    positions: Array | None = None,
    turned: Array | None = None,
) -> Aerodynamics:
    """The same with the wake that the case asks for behind the mean load, slowed by an induction: for steady flow only.

    Strips have the flat plate's lift slope. The rows of a wake of its own are as long as the rotor takes to turn by
    `MEAN_WAKE_TURN`; the perturbations' wake keeps its own rows and its own induction. Parameters as for
    `build_aerodynamics`.
    """
    if case.airloads.mean_wake == "perturbations":
        inflow = rotor_inflow(case, case.discretisation.induction)
        return _assembled(case, inflow, None, blades, positions, turned, "closed", wake_rows(case), None)
    inflow, step = rotor_inflow(case, induction), MEAN_WAKE_TURN / case.rotor_speed
    length = case.airloads.mean_wake * 2.0 * case.turbine.rotor.radius
    rows = max(1, round(length / (inflow.wake_velocity[0] * step)))
    return _assembled(case, inflow, None, blades, positions, turned, "closed", rows, step)


def mean_is_perturbations(case: Case) -> bool:
    """Whether one lattice serves for both: the same wake, and flat plates' lift slopes."""
    same_wake = case.airloads.mean_wake == "perturbations"
    return same_wake and case.airloads.lift_slope == "thin aerofoil"


def _assembled(
    case: Case,
    inflow: Inflow,
    lift_slope: Array | None,
    blades: int,
    positions: Array | None,
    turned: Array | None,
    wake_end: WakeEnd,
    rows: int,
    wake_step: float | None,
) -> Aerodynamics:
    return assemble(
        blade_rings(case, inflow, positions, turned),
        inflow,
        time_step=case.discretisation.time_step,
        wake_rows=rows,
        air_density=case.operating_point.air_density,
        blades=blades,
        wake_end=wake_end,
        wake_step=wake_step,
        lift_slope=lift_slope,
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


def thrust_load(aero: Aerodynamics) -> Array:
    """Row (1, 3 P) that sums forces, alike on all blades, to the rotor's thrust [N / N]."""
    along_shaft = np.zeros((len(aero.force_point), 3))
    along_shaft[:, 0] = aero.blades
    return along_shaft.reshape(1, -1)
