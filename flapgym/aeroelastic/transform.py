"""One form of the turbine from another: blades' own frames and multi-blade coordinates (Section II.D, design form).

Two changes of coordinates, both exact. ``in_multiblade`` changes the equations of motion, so that Newmark's rule is
then applied to multi-blade coordinates as in the time-invariant form; ``step_in_multiblade`` changes a step that was
made in the blades' frames, so that the discretisation stays what it was. The two differ by the order dt^2 of the rule.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.linalg

from flapgym.aeroelastic.coupling import Equations, LatticeInput, Output, SecondOrder
from flapgym.core.arrays import BLADES, Array
from flapgym.core.multiblade import blade_azimuths, derivative_coupling, on_rotor
from flapgym.core.state_space import StateSpace
from flapgym.model.signals import COMPONENTS, EACH_BLADE, grouped


def in_multiblade(equations: Equations, azimuth: float, rotor_speed: float, modes: int) -> Equations:
    """The turbine's equations at an azimuth [rad], carried from the blades' frames to multi-blade coordinates.

    With d = Q(theta) q the velocities become Q q' + Q' q and the accelerations Q q'' + 2 Q' q' + Q'' q. For equal
    blades the result is ``turbine_equations`` at every azimuth. The lattice it asks for is the one seen from the
    ground, ``multiblade_aerodynamics`` at the rotor's speed.

    Parameters
    ----------
    equations : Equations
        ``PeriodicEquations`` at that azimuth.
    azimuth, rotor_speed : float
        [rad, rad/s].
    modes : int
        Of each blade.
    """
    spread = spread_matrix(azimuth)
    support = equations.structure.mass.shape[0] - BLADES * modes
    Q = _blocks(spread, modes, support)
    turn = _blocks(derivative_coupling(rotor_speed), modes, support, still=True)
    first, second = Q @ turn, Q @ turn @ turn

    structure, asks, read = equations.structure, equations.lattice_input, equations.output
    # Components that turn with the rotor from those in the fixed frame.
    to_rotor = np.linalg.solve(on_rotor(), spread)
    loads = np.kron(to_rotor, np.eye(structure.work.shape[1] // BLADES))
    to_ground = np.kron(np.linalg.inv(to_rotor), np.eye(asks.position.shape[0] // BLADES))
    enter = _change(spread, equations.inputs)
    leave = np.linalg.inv(_change(spread, equations.outputs))

    def moved(mass: Array, damping: Array, stiffness: Array) -> tuple[Array, Array, Array]:
        return (
            mass @ Q,
            damping @ Q + 2.0 * mass @ first,
            stiffness @ Q + damping @ first + mass @ second,
        )

    mass, damping, stiffness = moved(structure.mass, structure.damping, structure.stiffness)
    acceleration, velocity, position = moved(read.acceleration, read.velocity, read.position)
    return Equations(
        SecondOrder(Q.T @ mass, Q.T @ damping, Q.T @ stiffness, Q.T @ structure.work @ loads),
        LatticeInput(
            position=to_ground @ (asks.position @ Q + asks.velocity @ first),
            velocity=to_ground @ asks.velocity @ Q,
            exogenous=to_ground @ asks.exogenous @ enter,
        ),
        Output(
            leave @ acceleration,
            leave @ velocity,
            leave @ position,
            leave @ read.load @ loads,
            None if read.direct is None else leave @ read.direct @ enter,
        ),
        _renamed(equations.inputs),
        _renamed(equations.outputs),
        None if equations.forcing is None else Q.T @ equations.forcing @ enter,
    )


def step_in_multiblade(
    step: StateSpace, azimuth: float, turn: float, modes: int, support: int, collective: int
) -> StateSpace:
    """A step of the blades' frames, in multi-blade coordinates: the same motion to rounding.

    Parameters
    ----------
    step : StateSpace
        From an azimuth [rad] over a ``turn`` [rad], with the states (d, d', xi): positions and rates of the blades'
        modes and of the support, and the lattice on the rotor.
    azimuth, turn : float
        [rad].
    modes, support, collective : int
        Modes of each blade and of the support; states of the lattice's collective component.

    Returns
    -------
    StateSpace
        Its states are the components of the blades' positions and of their rates (not the rates of the components), at
        the azimuth each belongs to, those of the support, and those of the lattice seen from the ground.
    """
    whirl = (step.order - 2 * (BLADES * modes + support) - collective) // 2

    def states(angle: float) -> Array:
        """From multi-blade coordinates to the blades' frames and the rotor."""
        cosine, sine = np.cos(angle), np.sin(angle)
        turned = np.kron([[cosine, -sine], [sine, cosine]], np.eye(whirl))
        blades = np.kron(spread_matrix(angle), np.eye(modes))
        return scipy.linalg.block_diag(*2 * [blades, np.eye(support)], np.eye(collective), turned)

    here, there, spread = states(azimuth), states(azimuth + turn), spread_matrix(azimuth)
    enter, leave = _change(spread, step.inputs), np.linalg.inv(_change(spread, step.outputs))
    back = np.linalg.inv(there)
    return StateSpace(
        back @ step.A @ here,
        back @ step.B @ enter,
        leave @ step.C @ here,
        leave @ step.D @ enter,
        step.time_step,
        _renamed(step.inputs),
        _renamed(step.outputs),
    )


def spread_matrix(azimuth: float) -> Array:
    """Matrix (3, 3) from multi-blade components (0, c, s) to blades at an azimuth [rad]."""
    angle = blade_azimuths(azimuth)
    return np.stack([np.ones(BLADES), np.cos(angle), np.sin(angle)], axis=-1)


def _blocks(blades: Array, modes: int, support: int, still: bool = False) -> Array:
    """One 3 x 3 change for every mode of the blades; the support stays as it is, or does not take part."""
    rest = np.zeros((support, support)) if still else np.eye(support)
    return np.asarray(scipy.linalg.block_diag(np.kron(blades, np.eye(modes)), rest))


def _change(spread: Array, signals: Sequence[str]) -> Array:
    """From multi-blade coordinates to blade by blade; of what is not the blades', the same."""
    return scipy.linalg.block_diag(
        *(spread if of_blades else np.eye(1) for _, of_blades in grouped(signals, EACH_BLADE))
    )


def _renamed(signals: Sequence[str]) -> tuple[str, ...]:
    """Names of the blades' signals in multi-blade coordinates."""
    return tuple(
        name
        for base, of_blades in grouped(signals, EACH_BLADE)
        for name in ([f"{base}_{part}" for part in COMPONENTS] if of_blades else [base])
    )
