"""Our side of what has no series: the mean state of a case, and its rigid rotor's answer to wind and flap."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.validation.reference import Array
from flapgym.aerodynamics import (
    Aerodynamics,
    build_aerodynamics,
    collective_response,
    mean_loads,
    root_moment_load,
    steady_circulation,
)
from flapgym.aerodynamics.report import root_moment_inputs, steady_gains
from flapgym.aeroelastic.trim import trim
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
    rigid = mean_loads(case, build_aerodynamics(case))
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
    """The answer of a case's lattice."""
    aero = build_aerodynamics(case)
    gust = root_moment_inputs(case, aero)[:, :1]
    gain, flap = steady_gains(case, aero)
    signal = np.ones((round(LONG / aero.time_step), 1))
    moment = collective_response(aero, signal, gust, root_moment_load(aero, case))[:, 0]
    early = round(EARLY / aero.time_step)
    return RigidAnswer(
        gain=float(gain),
        early=float(moment[early]),
        peak=float(moment[early:].max()),
        end=float(moment[-1]),
        torque=steady_torque(aero, gust),
        flap=float(flap),
    )


def steady_torque(aero: Aerodynamics, gust: Array) -> float:
    """Torque of the rotor [N m per m/s] under the downwash (n, 1) of a steady homogeneous gust."""
    force = (aero.force.sum(axis=0) @ steady_circulation(aero, gust)).reshape(-1, 3)
    return aero.blades * float(np.cross(aero.force_point, force)[:, 0].sum())
