"""Steady mean loads of the rotor: circulation from twist, pitch and zero-lift angles; thrust, torque, root moment.

The circulation is that of the linear lattice with its prescribed wake. The forces take the induced velocity in, so
that the torque holds the induced drag: either Joukowski's force on the bound vortices in the total velocity, or the
lattice's normal force with the leading-edge suction of the paper's eq. 13. Where the case asks for it, the sections'
drag and pitching moment are read from their polars at the incidence that the circulation tells.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flapgym.aerodynamics.biot_savart import induced_velocity, segment_velocity
from flapgym.aerodynamics.lattice import wake_nodes
from flapgym.aerodynamics.loads import leading_segments, side_segments
from flapgym.aerodynamics.model import Aerodynamics, blade_turns
from flapgym.aerodynamics.response import steady_circulation
from flapgym.aerodynamics.rotor import mid_radius, strip_radius, zero_lift_angles
from flapgym.core.arrays import Array
from flapgym.turbine import Case


def incidence_downwash(aero: Aerodynamics, zero_lift_angle: Array) -> Array:
    """Downwash (n,) [m/s] of the mean flow on strips whose sections have no lift at angles (strips,) [rad].

    A section that has no lift at a negative angle meets the air as if its chord were turned that much more.
    """
    return _downwash_of(aero, aero.relative_velocity, zero_lift_angle)


def _downwash_of(aero: Aerodynamics, velocity: Array, zero_lift_angle: Array) -> Array:
    """The same (n,) of a velocity (n, 3) past the collocation points."""
    chord = _unit(aero.lattice.chord_vector)
    by_row = velocity.reshape(aero.lattice.chordwise, -1, 3)
    camber = -np.einsum("csi,si->cs", by_row, chord) * zero_lift_angle
    return np.asarray(np.einsum("ni,ni->n", velocity, aero.normal) + camber.ravel())


def pitch_downwash(aero: Aerodynamics) -> Array:
    """Downwash (n,) [m/s] per radian by which straight blades are pitched, their leading edges upwind.

    A chord that is turned away from the wind meets the air as if its section had no lift at so much larger an angle.
    """
    angle = np.ones(aero.lattice.strips)
    return incidence_downwash(aero, angle) - incidence_downwash(aero, np.zeros_like(angle))


def spin_downwash(aero: Aerodynamics, zero_lift_angle: Array) -> Array:
    """Downwash (n,) [m/s] per rad/s by which the rotor turns faster; angles (strips,) as for `incidence_downwash`."""
    return _downwash_of(aero, aero.inflow.per_rotor_speed(aero.collocation), zero_lift_angle)


def induced_velocity_at(aero: Aerodynamics, point: Array, circulation: Array) -> Array:
    """Velocity (m, 3) [m/s] at points (m, 3) of all blades' bound rings and wakes, all blades carrying (n,) [m^2/s]."""
    bound = circulation.reshape(aero.lattice.chordwise, -1)
    wake = wake_nodes(aero.lattice, aero.inflow, aero.wake_age)
    shed = np.broadcast_to(bound[-1], (aero.wake_rows, bound.shape[1]))
    velocity = np.zeros_like(point)
    for turn in blade_turns(aero.blades):
        velocity += induced_velocity(point, aero.lattice.node @ turn, bound)
        velocity += induced_velocity(point, wake @ turn, shed)
    return velocity


def joukowski_force(aero: Aerodynamics, circulation: Array) -> Array:
    """Forces (q, 3) [N] of a steady circulation (n,) on blade 1's leading, then side segments, in the total velocity.

    The velocity induced on the side segments is left out: its force lies along the span.
    """
    lead, side = leading_segments(aero.lattice), side_segments(aero.lattice)
    relative = aero.inflow.relative_velocity
    velocity = relative(lead.midpoint) + induced_velocity_at(aero, lead.midpoint, circulation)
    force = lead.force(aero.air_density, velocity), side.force(aero.air_density, relative(side.midpoint))
    return np.concatenate(force) @ circulation


def suction_drag(aero: Aerodynamics, circulation: Array) -> Array:
    """Steady drag (n,) [N] of the rings, leading-edge suction taken off, by the paper's eq. 13 (Katz).

    D = -rho (n . u) Gamma_net b: u is induced at the collocation point by everything but the blade's own spanwise
    segments, b is the segment's width across the flow. Where the quarter chords lie on a straight line, as on the
    turbine's blade, it tends to Joukowski's drag as one over the chordwise panels (7, 3, 0.8 % above it at 5, 10, 20
    panels on an elliptic wing of aspect ratio 10). It neglects the sweep of the vortices: with straight mid-chords it
    falls 10 % short.
    """
    lead, point = leading_segments(aero.lattice), aero.lattice.collocation
    net = lead.net @ circulation
    start, end = lead.midpoint - 0.5 * lead.vector, lead.midpoint + 0.5 * lead.vector
    spanwise = np.einsum("mqi,q->mi", segment_velocity(point[:, None], start, end), net)
    induced = induced_velocity_at(aero, point, circulation) - spanwise
    along_normal = np.einsum("mi,mi->m", induced, aero.lattice.normal)
    flow = _unit(aero.inflow.relative_velocity(lead.midpoint))
    width = np.linalg.norm(np.cross(flow, lead.vector), axis=1)
    return np.asarray(-aero.air_density * along_normal * net * width)


def _unit(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector, axis=-1, keepdims=True))


@dataclass(frozen=True, eq=False)
class Sections:
    """What the strips' aerofoils say of a steady state, arrays (strips,).

    Attributes
    ----------
    incidence : angle of attack that the circulation tells [rad]
    drag, moment : coefficients of the polars there, the moment about the aerodynamic centre, nose up
    """

    incidence: Array
    drag: Array
    moment: Array


def sections(case: Case, aero: Aerodynamics, circulation: Array) -> Sections:
    """Read the polars at the incidence that flat plates' circulation (n,) tells; no induced velocity is needed.

    Between stations of the planform the coefficients of their aerofoils are interpolated along the blade.
    """
    planform, radius = case.turbine.planform, mid_radius(case)
    speed, chord, _ = _strip_flow(aero)
    around = circulation.reshape(aero.lattice.chordwise, -1)[-1]
    incidence = zero_lift_angles(case) + around / (np.pi * speed * chord)
    by_station = np.array([case.turbine.airfoil(name).polar.at(incidence) for name in planform.airfoil])
    # (station, coefficient, strip): each strip between its own two stations.
    drag, moment = (
        np.array([np.interp(r, planform.radius, by_station[:, k, s]) for s, r in enumerate(radius)])
        for k in range(2)
    )
    return Sections(incidence, drag, moment)


def _strip_flow(aero: Aerodynamics) -> tuple[Array, Array, Array]:
    """Undisturbed relative speed (strips,) [m/s], chord [m] and span vectors (strips, 3) [m] at the quarter chords."""
    quarter = aero.lattice.on_surface(np.array([0.25]))[0]
    velocity = aero.inflow.relative_velocity(0.5 * (quarter[1:] + quarter[:-1]))
    span = np.diff(quarter, axis=0)
    # Along the span the air loads nothing.
    along = _unit(span)
    across = velocity - np.einsum("si,si->s", velocity, along)[:, None] * along
    return np.linalg.norm(across, axis=1), np.linalg.norm(aero.lattice.chord_vector, axis=1), span


def profile_loads(aero: Aerodynamics, found: Sections) -> tuple[Array, Array, Array]:
    """Quarter chords (strips, 3) [m], the sections' drag [N] there and pitching moment [N m], both (strips, 3).

    The drag lies along the undisturbed flow past the section; nose up is positive from root to tip along the span.
    """
    quarter = aero.lattice.on_surface(np.array([0.25]))[0]
    point = 0.5 * (quarter[1:] + quarter[:-1])
    speed, chord, span = _strip_flow(aero)
    along = _unit(span)
    velocity = aero.inflow.relative_velocity(point)
    flow = _unit(velocity - np.einsum("si,si->s", velocity, along)[:, None] * along)
    area = chord * np.linalg.norm(span, axis=1)
    pressure = 0.5 * aero.air_density * speed**2
    drag = (pressure * area * found.drag)[:, None] * flow
    moment = (pressure * area * chord * found.moment)[:, None] * along
    return point, drag, moment


def momentum_induction(thrust_coefficient: float) -> float:
    """Axial induction at the disc for a thrust coefficient: C_T = 4 a (1 - a), with Buhl's (2005) line above 0.96."""
    if thrust_coefficient < 0.96:
        return float(0.5 * (1.0 - np.sqrt(1.0 - max(thrust_coefficient, 0.0))))
    return float((2.0 + 3.0 * np.sqrt(14.0 * thrust_coefficient - 12.0)) / 14.0)


def momentum_slope(thrust_coefficient: float) -> float:
    """Change of that induction per change of a positive thrust coefficient."""
    if thrust_coefficient < 0.96:
        return float(0.25 / np.sqrt(1.0 - thrust_coefficient))
    return float(1.5 / np.sqrt(14.0 * thrust_coefficient - 12.0))


@dataclass(frozen=True, eq=False)
class MeanLoads:
    """Steady loads of a rotor of equal blades at its operating point, perturbations aside.

    Attributes
    ----------
    circulation : (n,) float
        Bound circulation of a blade [m^2/s].
    zero_lift_angle : (strips,) float
        Angle of attack at which the straight lines of lift that the circulation stands on have none [rad].
    incidence : (strips,) float
        Angle of attack that the circulation tells [rad].
    force_point, force : (q, 3) float
        Where on blade 1 the mean forces act [m] and the forces [N], in S: Joukowski's, then the sections' drag.
    couple_point, couple : (k, 3) float
        Where the sections' pitching moments act [m] and the moments [N m], in S; none unless the case has them.
    radius : (strips,) float
        Mid-strip distance from the apex along the blade [m].
    out_of_plane, in_plane : (strips,) float
        Force per length of blade [N/m], downwind and in the direction of rotation.
    thrust, torque, power : float
        Of all blades: along the shaft [N], about it in the direction of rotation [N m], torque times speed [W].
    torque_by_suction : float
        The torque when the induced drag is that of eq. 13 [N m].
    root_moment : float
        Flapwise moment of a blade about its root, positive downwind [N m].
    thrust_coefficient, power_coefficient : float
        Over the dynamic pressure of the wind times the swept disc; the latter times the wind speed.
    """

    circulation: Array
    zero_lift_angle: Array
    incidence: Array
    force_point: Array
    force: Array
    couple_point: Array
    couple: Array
    radius: Array
    out_of_plane: Array
    in_plane: Array
    thrust: float
    torque: float
    power: float
    torque_by_suction: float
    root_moment: float
    thrust_coefficient: float
    power_coefficient: float


def _by_strip(aero: Aerodynamics, force: Array, drag: Array) -> Array:
    """Forces of bound segments (q, 3) and drag gathered on strips (strips, 3), sides shared by neighbours."""
    nc, ns = aero.lattice.chordwise, aero.lattice.strips
    side = force[nc * ns :].reshape(nc, ns + 1, 3).sum(axis=0)
    share = np.full((ns + 1, 1), 0.5)
    share[[0, -1]] = 1.0
    side = side * share
    return np.asarray(force[: nc * ns].reshape(nc, ns, 3).sum(axis=0) + side[1:] + side[:-1] + drag)


def mean_loads(case: Case, aero: Aerodynamics) -> MeanLoads:
    """Mean loads of a case's rotor, on blades shaped as the lattice is."""
    rotor, point = case.turbine.rotor, case.operating_point
    edge = strip_radius(case)
    zero_lift = zero_lift_angles(case)
    circulation = steady_circulation(aero, incidence_downwash(aero, zero_lift)[:, None])[:, 0]

    lead, side = leading_segments(aero.lattice), side_segments(aero.lattice)
    lifting, at = joukowski_force(aero, circulation), np.concatenate([lead.midpoint, side.midpoint])
    found = sections(case, aero, circulation)
    drag_point, drag, couple = profile_loads(aero, found)
    if case.airloads.profile == "none":
        drag_point, drag, couple = drag_point[:0], drag[:0], couple[:0]
    points, force = np.concatenate([at, drag_point]), np.concatenate([lifting, drag])
    total = force.sum(axis=0)
    moment = np.cross(points, force).sum(axis=0) + couple.sum(axis=0)
    # Eq. 13: the undisturbed flow's force stands square to the flow, the induced drag lies along it.
    flow = _unit(aero.inflow.relative_velocity(lead.midpoint))
    induced_drag = suction_drag(aero, circulation)[:, None] * flow
    linear = (aero.force.sum(axis=0) @ circulation).reshape(-1, 3)
    shaft = np.cross(aero.force_point, linear).sum(axis=0) + np.cross(lead.midpoint, induced_drag).sum(axis=0)

    root = rotor.hub_radius * np.array([-np.sin(rotor.precone), 0.0, np.cos(rotor.precone)])
    strip = _by_strip(aero, lifting, drag if len(drag) else np.zeros(3)) / np.diff(edge)[:, None]
    thrust, torque = aero.blades * float(total[0]), aero.blades * float(moment[0])
    pressure = 0.5 * point.air_density * point.wind_speed**2 * np.pi * rotor.radius**2
    return MeanLoads(
        circulation=circulation,
        zero_lift_angle=zero_lift,
        incidence=found.incidence,
        force_point=points,
        force=force,
        couple_point=drag_point,
        couple=couple,
        radius=mid_radius(case),
        out_of_plane=strip[:, 0],
        in_plane=-strip[:, 1],
        thrust=thrust,
        torque=torque,
        power=torque * case.rotor_speed,
        torque_by_suction=aero.blades * float(shaft[0]),
        root_moment=float(np.cross(points - root, force).sum(axis=0)[1] + couple.sum(axis=0)[1]),
        thrust_coefficient=thrust / float(pressure),
        power_coefficient=torque * case.rotor_speed / (float(pressure) * point.wind_speed),
    )
