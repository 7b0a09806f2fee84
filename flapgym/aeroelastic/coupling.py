"""Structure and reduced aerodynamics coupled implicitly in discrete time (Section II.D).

Newmark's average-acceleration rule (beta = 1/4, gamma = 1/2) advances the structure; the lattice acts at
the same step, n + 1, as in eq. 9, and the coupling is solved exactly since both are linear. Unlike
eq. 9 flap and gust also act at the step they happen; the input's part at n + 1 is moved into the state.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flapgym.core.arrays import Array
from flapgym.core.multiblade import WORK_WEIGHTS, derivative_coupling
from flapgym.core.state_space import StateSpace
from flapgym.reduction import ReducedSystem


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
    """Model outputs y = acceleration d'' + velocity d' + position d + load f + direct e.

    f are the lattice's outputs, e the inputs; ``direct`` (ny, nu) is what inputs add past the lattice, none by default.
    """

    acceleration: Array
    velocity: Array
    position: Array
    load: Array
    direct: Array | None = None


@dataclass(frozen=True, eq=False)
class Equations:
    """A structure, what it asks of the lattice and what is read off both: all but the lattice itself.

    ``forcing`` (n, nu) is the generalised force that inputs exert past the lattice, none by default.
    """

    structure: SecondOrder
    lattice_input: LatticeInput
    output: Output
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    forcing: Array | None = None


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


@dataclass(frozen=True, eq=False)
class Instant:
    """Lattice load f and acceleration d'' at one instant, read off the state x = (d, d', xi) and the inputs e.

    Attributes
    ----------
    load_x : (nf, nx), load_e : (nf, nu) float
    acceleration_x : (n, nx), acceleration_e : (n, nu) float
    drive_x : (r, nx), drive_e : (r, nu) float
        The lattice's next state.
    """

    load_x: Array
    load_e: Array
    acceleration_x: Array
    acceleration_e: Array
    drive_x: Array
    drive_e: Array


def instant(equations: Equations, aerodynamics: ReducedSystem) -> Instant:
    """Solve the equation of motion and the lattice for one instant."""
    structure, asks = equations.structure, equations.lattice_input
    r = aerodynamics.A.shape[0]
    load_x = np.hstack([aerodynamics.D @ asks.position, aerodynamics.D @ asks.velocity, aerodynamics.C])
    load_e = aerodynamics.D @ asks.exogenous
    elastic = np.hstack([structure.stiffness, structure.damping, np.zeros((structure.mass.shape[0], r))])
    force_e = structure.work @ load_e
    if equations.forcing is not None:
        force_e = force_e + equations.forcing
    return Instant(
        load_x=load_x,
        load_e=load_e,
        acceleration_x=np.linalg.solve(structure.mass, structure.work @ load_x - elastic),
        acceleration_e=np.asarray(np.linalg.solve(structure.mass, force_e)),
        drive_x=np.hstack([aerodynamics.B @ asks.position, aerodynamics.B @ asks.velocity, aerodynamics.A]),
        drive_e=aerodynamics.B @ asks.exogenous,
    )


def implicit_part(there: Instant, time_step: float) -> tuple[Array, Array]:
    """What Newmark's rule asks of the state at the end of a step: left x^{n+1} = (start's part) + ahead e^{n+1}."""
    half, n = 0.5 * time_step, there.acceleration_x.shape[0]
    left = np.eye(there.acceleration_x.shape[1])
    velocity = left[n : 2 * n].copy()
    left[:n] -= half * velocity
    left[n : 2 * n] -= half * there.acceleration_x
    ahead = np.zeros((left.shape[0], there.acceleration_e.shape[1]))
    ahead[n : 2 * n] = half * there.acceleration_e
    return left, ahead


def explicit_part(here: Instant, time_step: float) -> tuple[Array, Array]:
    """What the start of a step contributes: right x^n + now e^n."""
    half, n = 0.5 * time_step, here.acceleration_x.shape[0]
    eye = np.eye(here.acceleration_x.shape[1])
    position, velocity = eye[:n], eye[n : 2 * n]
    right = np.vstack([position + half * velocity, velocity + half * here.acceleration_x, here.drive_x])
    now = np.vstack([np.zeros_like(here.acceleration_e), half * here.acceleration_e, here.drive_e])
    return right, now


def reading(output: Output, at: Instant) -> tuple[Array, Array]:
    """The outputs read off the state and the inputs of one instant: (ny, nx) and (ny, nu)."""
    n = at.acceleration_x.shape[0]
    eye = np.eye(at.acceleration_x.shape[1])
    states = (
        output.acceleration @ at.acceleration_x
        + output.load @ at.load_x
        + output.velocity @ eye[n : 2 * n]
        + output.position @ eye[:n]
    )
    inputs = output.acceleration @ at.acceleration_e + output.load @ at.load_e
    return states, inputs if output.direct is None else inputs + output.direct


def couple(equations: Equations, aerodynamics: ReducedSystem, time_step: float) -> StateSpace:
    """One discrete state space with the states (d, d', xi), d the structure's and xi the lattice's.

    The acceleration follows from the equation of motion at each step, so it is no state.
    """
    at = instant(equations, aerodynamics)
    left, ahead = implicit_part(at, time_step)
    right, now = explicit_part(at, time_step)
    A = np.linalg.solve(left, right)
    jump = np.linalg.solve(left, ahead)  # x = state + jump e: the input's part at n + 1
    B = np.linalg.solve(left, now) + A @ jump
    C, direct = reading(equations.output, at)
    D = direct + C @ jump
    return StateSpace(np.asarray(A), np.asarray(B), C, D, time_step, equations.inputs, equations.outputs)


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
