"""A blade pitched about its axis: a rigid turn of the whole bent blade, which is one more motion of its root.

Seen from axes that turn with the blade nothing about it has changed but that it turns with the rotor about an axis
turned back, in a wind turned back: motions of its hub and a wind askew, which beam and lattice know already, so that
pitch asks nothing new of the lattice and its reduction stays as it is. What wakes and other blades induce is taken to
turn along with the blade: against the trim at another pitch, all else alike, that takes 1.7 % from the static flapwise
moment and thrust and 3.3 % from edgewise moment and torque.

Loads at the root are told in axes that do not pitch, as OpenFAST's of the coned blade (RootMxc, RootMyc, RootMzc):
the blade's steady loads, carried along, turn in them.
"""

from __future__ import annotations

import numpy as np

from flapgym.aerodynamics import MeanFlow
from flapgym.aeroelastic.interaction import turned_forces
from flapgym.aeroelastic.stations import cuts
from flapgym.core.arrays import Array
from flapgym.structure import LinearBlade
from flapgym.turbine import Case


def along(case: Case) -> Array:
    """Axis (3,) of the coned, straight blade from its root to its tip: the beam's own, and through the apex."""
    cone = case.turbine.rotor.precone
    return np.array([-np.sin(cone), 0.0, np.cos(cone)])


def pitch_axis(case: Case) -> Array:
    """Axis (3,) about which pitch turns a blade positively, its leading edge upwind."""
    return -along(case)


def pitch_motion(case: Case) -> tuple[Array, Array]:
    """Velocity (6,) of a blade's own axes per angle held, and per rate of pitch: of the apex, then of turning [rad/s].

    Turned by psi, the axes see the rotor's speed as Omega - psi x Omega.
    """
    axis, spin = pitch_axis(case), np.array([case.rotor_speed, 0.0, 0.0])
    still = np.zeros(3)
    return np.concatenate([still, -np.cross(axis, spin)]), np.concatenate([still, axis])


def turned_steady_loads(case: Case, blade: LinearBlade, shape: Array, flow: MeanFlow | None) -> Array:
    """Loads (m + 6 + k,) per radian of pitch that the blade's steady ones bring; rows as ``BladeLattice.load``.

    Those on the modes are in the blade's own axes, force and moment on the hub and moments at stations in axes that do
    not pitch.
    """
    axis, modes, told = pitch_axis(case), shape.shape[1], cuts(case, blade)
    virtual = np.array([cut.work for cut in told]).reshape(-1, len(shape)).T
    out = np.zeros(modes + 6 + len(told))
    out[modes : modes + 6] = np.cross(axis, blade.on_hub.reshape(2, 3)).ravel()
    for k, cut in enumerate(told):
        out[modes + 6 + k] = np.cross(axis, cut.steady)[1]  # about the flapwise axis
    if flow is not None:
        # Forces that stay where the air has them turn back in the blade's axes: the sections' drag, along a wind that
        # pitch leaves alone. What lift does the full loads know; the paper's leave it as it was, like drag.
        loads = flow.loads
        drag = len(loads.force) - len(loads.couple)
        dead = slice(drag, None) if case.airloads.linearisation == "full" else slice(None)
        out -= turned_forces(blade, loads.force_point[dead], loads.force[dead], axis, shape, virtual)
    return out
