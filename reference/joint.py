"""Tower and rotor joined by six Lagrange multipliers on velocities (paper Section II.B, eq. 3 to 7).

The rotor frame S keeps its own velocities nu; the constraint Lambda q_t' - A_CC(theta) nu = 0 ties them to the motion
of the support's hub end, in H axes, and the multipliers lambda are the force and moment the rotor exerts on the
support there. A_CC depends on the azimuth, so the constraint's derivative in time has a term in A_CC'.
`assemble` eliminates the same joint; the two must agree.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from flapgym.core.arrays import AnyArray
from flapgym.structure.body import LinearBlade
from flapgym.structure.rotation import about_x, hat
from flapgym.structure.support import LinearSupport


@dataclass(frozen=True, eq=False)
class JointedTurbine:
    """Matrices of eq. 7 at one azimuth for unknowns (q_r, q_t, nu) and multipliers lambda.

    M (q_r'', q_t'', nu') + C (q_r', q_t', nu) + K (q_r, q_t) + constraint' (force balance) lambda = loads and
    constraint (q_r', q_t', nu) = 0. q_r are the blades' unknowns in their own frames, q_t the support's.

    Attributes
    ----------
    mass, damping : (n + 6, n + 6) float
    stiffness : (n + 6, n) float
    constraint : (6, n + 6) float
        (0, Lambda, -A_CC) in H axes.
    constraint_rate : (6, n + 6) float
        Its derivative in time under the prescribed rotation.
    """

    mass: AnyArray
    damping: AnyArray
    stiffness: AnyArray
    constraint: AnyArray
    constraint_rate: AnyArray

    @property
    def size(self) -> int:
        """Number n of displacement unknowns."""
        return int(self.stiffness.shape[1])


def join(blades: Sequence[LinearBlade], support: LinearSupport, azimuth: float = 0.0) -> JointedTurbine:
    """Eq. 7 for equally spaced blades at an azimuth [rad] of the first."""
    size = sum(blade.mass.shape[0] for blade in blades)
    rest = support.mass.shape[0]
    total = size + rest
    mass, damping = np.zeros((total + 6, total + 6)), np.zeros((total + 6, total + 6))
    stiffness = np.zeros((total + 6, total))
    tower, rigid = slice(size, total), slice(total, total + 6)
    mass[tower, tower], damping[tower, tower] = support.mass, support.damping
    stiffness[tower, tower] = support.stiffness
    start = 0
    for index, blade in enumerate(blades):
        own = slice(start, start + blade.mass.shape[0])
        turn = np.kron(np.eye(2), about_x(-2.0 * np.pi * index / len(blades)))
        mass[own, own], damping[own, own], stiffness[own, own] = blade.mass, blade.damping, blade.stiffness
        mass[own, rigid], mass[rigid, own] = blade.mass_sr @ turn, turn.T @ blade.mass_rs
        damping[own, rigid], damping[rigid, own] = blade.damping_sr @ turn, turn.T @ blade.damping_rs
        stiffness[rigid, own] = turn.T @ blade.stiffness_rs
        mass[rigid, rigid] += turn.T @ blade.mass_rr @ turn
        damping[rigid, rigid] += turn.T @ blade.damping_rr @ turn
        start = own.stop
    turn = about_x(azimuth)
    rate = blades[0].rotor_speed * hat(np.array([1.0, 0.0, 0.0])) @ turn
    constraint, constraint_rate = np.zeros((6, total + 6)), np.zeros((6, total + 6))
    constraint[:, tower], constraint[:, rigid] = support.hub, -np.kron(np.eye(2), turn)
    constraint_rate[:, rigid] = -np.kron(np.eye(2), rate)
    return JointedTurbine(mass, damping, stiffness, constraint, constraint_rate)


def accelerations(
    turbine: JointedTurbine, displacement: AnyArray, velocity: AnyArray, load: AnyArray
) -> tuple[AnyArray, AnyArray]:
    """Accelerations (n + 6,) of (q_r, q_t, nu) and multipliers (6,) for a motion that meets the constraint.

    displacement (n,) holds (q_r, q_t), velocity (n + 6,) their rates and nu, load (n + 6,) the forces on all;
    on nu acts the resultant about the apex of the loads on the blades, in S axes.
    """
    force = load - turbine.damping @ velocity - turbine.stiffness @ displacement
    scale = np.abs(turbine.mass).max()
    saddle = np.block(
        [[turbine.mass, scale * turbine.constraint.T], [scale * turbine.constraint, np.zeros((6, 6))]]
    )
    right = np.concatenate([force, -scale * turbine.constraint_rate @ velocity])
    solution = np.linalg.solve(saddle, right)
    return solution[:-6], -scale * solution[-6:]


def static_response(turbine: JointedTurbine, load: AnyArray) -> tuple[AnyArray, AnyArray]:
    """Displacements (n,) of (q_r, q_t) and multipliers (6,) under static loads (n + 6,) as above, parked."""
    scale = np.abs(turbine.stiffness).max()
    system = np.hstack([turbine.stiffness, scale * turbine.constraint.T])
    solution = np.linalg.solve(system, load)
    return solution[:-6], -scale * solution[-6:]


def frozen_frequencies(turbine: JointedTurbine, count: int) -> AnyArray:
    """Lowest natural frequencies (count,) [Hz] at the frozen azimuth; natural only of a parked turbine.

    The index-2 pencil E x' = A x of x = (q, q', nu, lambda) is badly scaled: it is equilibrated to a unit diagonal
    of the stiffness, to unit constraints and to a time of 1 / (2 pi Hz); shift and invert picks out the finite
    eigenvalues.
    """
    size, unit = turbine.size, 2.0 * np.pi
    own = np.concatenate([np.diag(turbine.stiffness[:size]), unit**2 * np.diag(turbine.mass)[size:]])
    weights = 1.0 / np.sqrt(own)
    mass = unit**2 * weights[:, None] * turbine.mass * weights
    damping = unit * weights[:, None] * turbine.damping * weights
    stiffness = weights[:, None] * turbine.stiffness * weights[:size]
    constraint = turbine.constraint * weights
    constraint /= np.linalg.norm(constraint, axis=1, keepdims=True)

    total = 2 * size + 12
    derivative, state = np.zeros((total, total)), np.zeros((total, total))
    position, velocity, force = slice(0, size), slice(size, 2 * size + 6), slice(2 * size + 6, total)
    derivative[position, position] = np.eye(size)
    state[position, size : 2 * size] = np.eye(size)
    derivative[velocity, velocity] = mass
    state[velocity, velocity] = -damping
    state[velocity, position] = -stiffness
    state[velocity, force] = -constraint.T
    state[force, velocity] = constraint
    shift = 0.5j
    inverted = scipy.linalg.eigvals(np.linalg.solve(state - shift * derivative, derivative))
    eigenvalues = shift + 1.0 / inverted[np.abs(inverted) > 1e-6]
    return np.sort(eigenvalues.imag[eigenvalues.imag > 1e-3])[:count] * unit / (2.0 * np.pi)


def steady_load_tangent(support: LinearSupport, load: AnyArray) -> AnyArray:
    """Stiffness (N, N) of the steady multipliers, the paper's J: `load` (6,) in H turns with the hub.

    A steady force and moment of the rotor on the support are fixed in the rotor's frame, so a rotation of the hub turns
    them. Centrifugal loads of equal blades cancel and leave J = 0.
    """
    turning = np.concatenate([hat(load[:3]), hat(load[3:])])
    return support.hub.T @ turning @ support.hub[3:]
