"""Structure and reduced aerodynamics coupled implicitly in discrete time (Section II.D).

Newmark's average-acceleration rule (beta = 1/4, gamma = 1/2) advances the structure; the lattice acts at
the same step, n + 1, as in eq. 9, and the coupling is solved exactly since both are linear. Unlike
eq. 9 flap and gust also act at the step they happen; the input's part at n + 1 is moved into the state.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flapgym.aeroelastic.multiblade import WORK_WEIGHTS, derivative_coupling
from flapgym.reduction import ReducedSystem
from flapgym.state_space import Array, StateSpace


@dataclass(frozen=True, eq=False)
class SecondOrder:
    """mass d'' + damping d' + stiffness d = work f: a structure and the lever of the lattice's loads on it.

    Attributes
    ----------
    mass, damping, stiffness : (n, n) float
    work : (n, nf) float
        Generalised force per unit lattice output.
    """

    mass: Array
    damping: Array
    stiffness: Array
    work: Array


@dataclass(frozen=True, eq=False)
class LatticeInput:
    """Lattice inputs s = position d + velocity d' + exogenous e, with e the named model inputs."""

    position: Array
    velocity: Array
    exogenous: Array


@dataclass(frozen=True, eq=False)
class Output:
    """Model outputs y = acceleration d'' + velocity d' + position d + load f, f the lattice outputs."""

    acceleration: Array
    velocity: Array
    position: Array
    load: Array


@dataclass(frozen=True, eq=False)
class Equations:
    """A structure, what it asks of the lattice and what is read off both: all but the lattice itself."""

    structure: SecondOrder
    lattice_input: LatticeInput
    output: Output
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


def multiblade_aerodynamics(
    collective: ReducedSystem, whirl: ReducedSystem, rotor_speed: float, time_step: float
) -> ReducedSystem:
    """The rotor's aerodynamics in the fixed frame, real, from its cyclic components.

    The whirl component lives in the rotor frame with the complex signal (u_c - j u_s) exp(j theta_n). Seen
    from the fixed frame its state turns back by exp(-j Omega dt) a step, exactly. Inputs and outputs are
    the blade's, for the components (0, c, s) in turn.
    """
    turn = np.exp(-1j * rotor_speed * time_step)
    zeros = np.zeros
    n, m = collective.A.shape[0], 2 * whirl.A.shape[0]
    ny, nu = collective.D.shape

    def state(matrix: Array) -> Array:  # acts on (Re, Im)
        return np.block([[matrix.real, -matrix.imag], [matrix.imag, matrix.real]])

    def enter(matrix: Array) -> Array:  # (c, s) means c - j s
        return np.block([[matrix.real, matrix.imag], [matrix.imag, -matrix.real]])

    def leave(matrix: Array) -> Array:  # (c, s) = (Re, -Im)
        return np.block([[matrix.real, -matrix.imag], [-matrix.imag, -matrix.real]])

    def through(matrix: Array) -> Array:
        return np.block([[matrix.real, matrix.imag], [-matrix.imag, matrix.real]])

    return ReducedSystem(
        A=np.block([[collective.A, zeros((n, m))], [zeros((m, n)), state(turn * whirl.A)]]),
        B=np.block([[collective.B, zeros((n, 2 * nu))], [zeros((m, nu)), enter(turn * whirl.B)]]),
        C=np.block([[collective.C, zeros((ny, m))], [zeros((2 * ny, n)), leave(whirl.C)]]),
        D=np.block([[collective.D, zeros((ny, 2 * nu))], [zeros((2 * ny, nu)), through(whirl.D)]]),
        hankel_singular_values=np.sort(
            np.concatenate([collective.hankel_singular_values, *2 * [whirl.hankel_singular_values]])
        )[::-1],
    )


def couple(equations: Equations, aerodynamics: ReducedSystem, time_step: float) -> StateSpace:
    """One discrete state space with the states (d, d', xi), d the structure's and xi the lattice's.

    The acceleration follows from the equation of motion at each step, so it is no state.
    """
    dt = time_step
    structure, lattice_input, output = equations.structure, equations.lattice_input, equations.output
    n, r = structure.mass.shape[0], aerodynamics.A.shape[0]
    s_d, s_v, s_e = lattice_input.position, lattice_input.velocity, lattice_input.exogenous
    a_d, a_e = aerodynamics.D @ s_d, aerodynamics.D @ s_e
    a_v = aerodynamics.D @ s_v
    # Rows that give, from x = (d, v, xi) and e: the lattice's load f and the acceleration a.
    load_x, load_e = np.hstack([a_d, a_v, aerodynamics.C]), a_e
    elastic = np.hstack([structure.stiffness, structure.damping, np.zeros((n, r))])
    acceleration_x = np.linalg.solve(structure.mass, structure.work @ load_x - elastic)
    acceleration_e = np.linalg.solve(structure.mass, structure.work @ load_e)

    half = 0.5 * dt
    eye = np.eye(2 * n + r)
    position, velocity = eye[:n], eye[n : 2 * n]
    left = eye.copy()
    left[:n] -= half * velocity
    left[n : 2 * n] -= half * acceleration_x
    right = np.vstack(
        [
            position + half * velocity,
            velocity + half * acceleration_x,
            np.hstack([aerodynamics.B @ s_d, aerodynamics.B @ s_v, aerodynamics.A]),
        ]
    )
    now = np.vstack([np.zeros_like(acceleration_e), half * acceleration_e, aerodynamics.B @ s_e])
    ahead = np.vstack(
        [np.zeros_like(acceleration_e), half * acceleration_e, np.zeros((r, len(equations.inputs)))]
    )

    A = np.linalg.solve(left, right)
    jump = np.linalg.solve(left, ahead)  # x = state + jump e: the input's part at n + 1
    B = np.linalg.solve(left, now) + A @ jump
    read = (
        output.acceleration @ acceleration_x
        + output.load @ load_x
        + output.velocity @ velocity
        + output.position @ position
    )
    direct = output.acceleration @ acceleration_e + output.load @ load_e
    return StateSpace(A, B, read, direct + read @ jump, dt, equations.inputs, equations.outputs)


def turbine_structure(
    blade: tuple[Array, Array, Array],
    support: tuple[Array, Array, Array],
    components: Array,
    rotor_speed: float,
) -> tuple[SecondOrder, Array, Array]:
    """Equations of the whole turbine in multi-blade coordinates d = (a_0, a_c, a_s, x_t).

    Parameters
    ----------
    blade : mass, damping, stiffness (k, k)
        Of one blade in its modes a and the six hub motions h, in the rotating frame (eq. 2).
    support : mass, damping, stiffness (t, t)
        Of tower, nacelle, shaft and hub in their modes x_t, in the fixed frame.
    components : (3, k, nd)
        Multi-blade components of (a, h) per unit d.
    rotor_speed : float
        Omega [rad/s].

    Returns
    -------
    structure : SecondOrder
        ``work`` takes the components of the blade loads conjugate to (a, h), shape (nd, 3 k).
    velocity_of_position, acceleration_of : (3 k, nd), (2, 3 k, nd)
        In the rotating frame the rate of a blade's modes is T d' + (first) d, its acceleration
        T d'' + (second[0]) d' + (second[1]) d; the hub's motion h is given by its velocity, so that only
        its acceleration turns.
    """
    k, nd = components.shape[1:]
    turn = np.kron(derivative_coupling(rotor_speed), np.eye(k))
    elastic = np.kron(np.eye(3), np.diag((np.arange(k) < k - 6).astype(float)))
    T = components.reshape(3 * k, nd)
    rate = turn @ elastic @ T
    acceleration = np.stack([turn @ T + turn @ elastic @ T, turn @ turn @ elastic @ T])
    mass, damping, stiffness = (np.kron(np.eye(3), matrix) for matrix in blade)
    work = T.T * np.repeat(WORK_WEIGHTS, k)
    t = support[0].shape[0]
    own = [np.zeros((nd, nd)) for _ in range(3)]
    for matrix, part in zip(own, support, strict=True):
        matrix[nd - t :, nd - t :] = part
    return (
        SecondOrder(
            mass=work @ mass @ T + own[0],
            damping=work @ (mass @ acceleration[0] + damping @ T) + own[1],
            stiffness=work @ (mass @ acceleration[1] + damping @ rate + stiffness @ T) + own[2],
            work=work,
        ),
        rate,
        acceleration,
    )
