"""Our side of what has no series: the mean state of a case, and its rigid rotor's answer to wind and flap."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flapgym.aerodynamics import rigid_rotor, root_moment_load, wake_transport
from flapgym.aeroelastic.trim import trim
from flapgym.core.arrays import Array
from flapgym.structure import blade_beam
from flapgym.turbine import Case

EARLY = 0.2
"""When a rigid step is first looked at [s]: at the step itself the lattice's added mass answers with a spike."""
LONG = 20.0
"""[s]; the prescribed wake of a quarter diameter is through after three."""


@dataclass(frozen=True)
class Means:
    """Steady state at the operating point: of the rigid rotor, and of the elastic blade in its trim.

    Attributes
    ----------
    thrust, torque, aerodynamic_moment : float
        Of the rigid, undeflected rotor [N, N m]; of a blade about its root, flapwise [N m].
    bent_thrust, bent_torque : float
        Of the rotor in its trim [N, N m].
    root_reaction : float
        Flapwise moment at the root of the elastic blade [N m].
    tip : float
        Tip deflection normal to the coned blade [m].
    twist : float
        Turn of the tip's chord about the local span, nose up [rad].
    """

    thrust: float
    torque: float
    aerodynamic_moment: float
    bent_thrust: float
    bent_torque: float
    root_reaction: float
    tip: float
    twist: float


def means(case: Case) -> Means:
    """The means of a case."""
    rigid = rigid_rotor(case).loads
    balance = trim(case)
    blade = balance.blade
    straight = blade_beam(
        case.turbine, case.discretisation.blade_elements, case.operating_point.pitch
    ).reference
    cone = case.turbine.rotor.precone
    moved = blade.position[-1] - straight.position[-1]
    return Means(
        thrust=rigid.thrust,
        torque=rigid.torque,
        aerodynamic_moment=rigid.root_moment,
        bent_thrust=balance.loads.thrust,
        bent_torque=balance.loads.torque,
        root_reaction=-float(blade.root_load[4]),  # of the hub on the blade, against the load
        tip=float(moved @ [np.cos(cone), 0.0, np.sin(cone)]),
        twist=nose_up(blade.orientation[-1]) - nose_up(straight.orientation[-1]),
    )


def nose_up(section: Array) -> float:
    """Angle [rad] of a section's chord to the rotor plane, about its own span; axes (3, 3) span, normal, chord.

    Bending turns the section, too; about the local span what is left is what changes the incidence.
    """
    span, chord = section[:, 0], section[:, 2]
    in_plane = np.array([0.0, 1.0, 0.0])  # against the blade's travel
    in_plane = in_plane - (in_plane @ span) * span
    downwind = np.cross(in_plane, span)
    # The chord points to the trailing edge, which stands upwind where the nose is up.
    return float(np.arctan2(-chord @ downwind, chord @ in_plane))


@dataclass(frozen=True)
class RigidAnswer:
    """What wind and flap do to the rigid, undeflected rotor.

    Attributes
    ----------
    gain, early, peak, end : float
        Root moment per m/s [N m per m/s]: steady, and in a step after EARLY, at most from then on, after LONG.
    torque : float
        Steady torque of the rotor per m/s [N m per m/s].
    flap : float
        Steady root moment per angle of all flaps [N m per rad].
    """

    gain: float
    early: float
    peak: float
    end: float
    torque: float
    flap: float


def rigid_answer(case: Case) -> RigidAnswer:
    """The answer of a case's lattice, behind the states of its moving wake where it has them."""
    rotor = rigid_rotor(case)
    load, step = root_moment_load(rotor.aero, case), rotor.aero.time_step
    gain, flap = rotor.steady(load)[0]
    torque = rotor.aero.blades * float(rotor.steady(shaft_moment(rotor.aero.force_point))[0, 0])
    moment = rotor.step(LONG, load)[:, 0]
    if case.airloads.slow_wake == "moving":
        states = wake_transport(case, rotor.flow.shed)
        gain, torque = ((1.0 + states.wind.gain) * steady for steady in (gain, torque))
        flap = (1.0 + states.flaps[0].gain) * flap
        moment = states.wind.state_space(step, "wind").simulate(moment[:, None])[:, 0]
    early = round(EARLY / step)
    return RigidAnswer(
        gain=float(gain),
        early=float(moment[early]),
        peak=float(moment[early:].max()),
        end=float(moment[-1]),
        torque=float(torque),
        flap=float(flap),
    )


def shaft_moment(point: Array) -> Array:
    """Row (1, 3 P) that sums forces at points (P, 3) to the moment about the shaft."""
    # (r x F) . e_x = y F_z - z F_y
    return np.stack([np.zeros(len(point)), -point[:, 2], point[:, 1]], axis=-1).reshape(1, -1)
