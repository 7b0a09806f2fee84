"""Steady mean loads of the rotor: circulation from twist, pitch and zero-lift angles; thrust, torque, root moment.

The circulation is that of the linear lattice with its prescribed wake. The forces take the induced velocity in, so
that the torque holds the induced drag: either Joukowski's force on the bound vortices in the total velocity, or the
lattice's normal force with the leading-edge suction of the paper's eq. 13.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flapgym.aerodynamics.biot_savart import induced_velocity, segment_velocity
from flapgym.aerodynamics.lattice import rotation_about_x, wake_nodes
from flapgym.aerodynamics.loads import leading_segments, side_segments
from flapgym.aerodynamics.model import Aerodynamics
from flapgym.aerodynamics.response import steady_circulation
from flapgym.aerodynamics.rotor import strip_radius
from flapgym.turbine import Case

Array = NDArray[np.float64]


def incidence_downwash(aero: Aerodynamics, zero_lift_angle: Array) -> Array:
    """Downwash (n,) [m/s] of the mean flow on strips whose sections have no lift at angles (strips,) [rad].

    A section that has no lift at a negative angle meets the air as if its chord were turned that much more.
    """
    chord = _unit(aero.lattice.chord_vector)
    velocity = aero.relative_velocity.reshape(aero.lattice.chordwise, -1, 3)
    camber = -np.einsum("csi,si->cs", velocity, chord) * zero_lift_angle
    return np.asarray(np.einsum("ni,ni->n", aero.relative_velocity, aero.normal) + camber.ravel())


def induced_velocity_at(aero: Aerodynamics, point: Array, circulation: Array) -> Array:
    """Velocity (m, 3) [m/s] at points (m, 3) of all blades' bound rings and wakes, all blades carrying (n,) [m^2/s]."""
    bound = circulation.reshape(aero.lattice.chordwise, -1)
    wake = wake_nodes(aero.lattice, aero.inflow, aero.time_step, aero.wake_rows)
    shed = np.broadcast_to(bound[-1], (aero.wake_rows, bound.shape[1]))
    velocity = np.zeros_like(point)
    for blade in range(aero.blades):
        turn = rotation_about_x(2.0 * np.pi * blade / aero.blades).T
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
class MeanLoads:
    """Steady loads of a rotor of equal blades at its operating point, perturbations aside.

    Attributes
    ----------
    circulation : (n,) float
        Bound circulation of a blade [m^2/s].
    force_point, force : (q, 3) float
        Where on blade 1 the mean forces act [m] and the forces [N], in S.
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
    force_point: Array
    force: Array
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


def _by_strip(aero: Aerodynamics, force: Array) -> Array:
    """Forces (q, 3) of leading and side segments gathered on strips (strips, 3), sides shared by their neighbours."""
    nc, ns = aero.lattice.chordwise, aero.lattice.strips
    side = force[nc * ns :].reshape(nc, ns + 1, 3).sum(axis=0)
    share = np.full((ns + 1, 1), 0.5)
    share[[0, -1]] = 1.0
    side = side * share
    return np.asarray(force[: nc * ns].reshape(nc, ns, 3).sum(axis=0) + side[1:] + side[:-1])


def mean_loads(case: Case, aero: Aerodynamics) -> MeanLoads:
    """Mean loads of a case's rotor, rigid and without profile drag."""
    rotor, planform, point = case.turbine.rotor, case.turbine.planform, case.operating_point
    edge = strip_radius(case)
    radius = 0.5 * (edge[1:] + edge[:-1])
    listed = [case.turbine.airfoil(name).zero_lift_angle_attached for name in planform.airfoil]
    zero_lift = np.interp(radius, planform.radius, listed)
    circulation = steady_circulation(aero, incidence_downwash(aero, zero_lift)[:, None])[:, 0]

    lead, side = leading_segments(aero.lattice), side_segments(aero.lattice)
    at = np.concatenate([lead.midpoint, side.midpoint])
    force = joukowski_force(aero, circulation)
    total, moment = force.sum(axis=0), np.cross(at, force).sum(axis=0)
    # Eq. 13: the undisturbed flow's force stands square to the flow, the drag lies along it.
    flow = _unit(aero.inflow.relative_velocity(lead.midpoint))
    drag = suction_drag(aero, circulation)[:, None] * flow
    linear = (aero.force.sum(axis=0) @ circulation).reshape(-1, 3)
    shaft = np.cross(aero.force_point, linear).sum(axis=0) + np.cross(lead.midpoint, drag).sum(axis=0)

    root = rotor.hub_radius * np.array([-np.sin(rotor.precone), 0.0, np.cos(rotor.precone)])
    strip = _by_strip(aero, force) / np.diff(edge)[:, None]
    thrust, torque = aero.blades * float(total[0]), aero.blades * float(moment[0])
    pressure = 0.5 * point.air_density * point.wind_speed**2 * np.pi * rotor.radius**2
    return MeanLoads(
        circulation=circulation,
        force_point=at,
        force=force,
        radius=radius,
        out_of_plane=strip[:, 0],
        in_plane=-strip[:, 1],
        thrust=thrust,
        torque=torque,
        power=torque * case.rotor_speed,
        torque_by_suction=aero.blades * float(shaft[0]),
        root_moment=float(np.cross(at - root, force).sum(axis=0)[1]),
        thrust_coefficient=thrust / float(pressure),
        power_coefficient=torque * case.rotor_speed / (float(pressure) * point.wind_speed),
    )
