"""One form of the turbine from another: blades' own frames and multi-blade coordinates (Section II.D, design form).

Two changes of coordinates, both exact. ``in_multiblade`` changes the equations of motion, so that Newmark's rule is
then applied to multi-blade coordinates as in the time-invariant form; ``step_in_multiblade`` changes a step that was
made in the blades' frames, so that the discretisation stays what it was. The two differ by the order dt^2 of the rule.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg

from flapgym.aeroelastic.coupling import Equations, LatticeInput, Output, SecondOrder
from flapgym.aeroelastic.periodic import PERIODIC_INPUTS
from flapgym.core.arrays import BLADES, Array
from flapgym.model.multiblade import blade_azimuths, derivative_coupling, on_rotor
from flapgym.model.turbine_model import TURBINE_INPUTS, TURBINE_OUTPUTS

Step = tuple[Array, Array, Array, Array]


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
    enter, leave = _input_change(spread, len(equations.inputs)), _output_change(spread)

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
        Output(leave @ acceleration, leave @ velocity, leave @ position, leave @ read.load @ loads),
        (*TURBINE_INPUTS, *equations.inputs[len(PERIODIC_INPUTS) :]),
        TURBINE_OUTPUTS,
        None if equations.forcing is None else Q.T @ equations.forcing @ enter,
    )


def step_in_multiblade(
    step: Step, azimuth: float, turn: float, modes: int, support: int, collective: int
) -> Step:
    """A step of the blades' frames, in multi-blade coordinates: the same motion to rounding.

    Parameters
    ----------
    step : A, B, C, D
        From an azimuth [rad] over a ``turn`` [rad], with the states (d, d', xi): positions and rates of the blades'
        modes and of the support, and the lattice on the rotor.
    azimuth, turn : float
        [rad].
    modes, support, collective : int
        Modes of each blade and of the support; states of the lattice's collective component.

    Returns
    -------
    A, B, C, D
        Its states are the components of the blades' positions and of their rates (not the rates of the components), at
        the azimuth each belongs to, those of the support, and those of the lattice seen from the ground.
    """
    A, B, C, D = step
    whirl = (A.shape[0] - 2 * (BLADES * modes + support) - collective) // 2

    def states(angle: float) -> Array:
        """From multi-blade coordinates to the blades' frames and the rotor."""
        cosine, sine = np.cos(angle), np.sin(angle)
        turned = np.kron([[cosine, -sine], [sine, cosine]], np.eye(whirl))
        blades = np.kron(spread_matrix(angle), np.eye(modes))
        return scipy.linalg.block_diag(*2 * [blades, np.eye(support)], np.eye(collective), turned)

    here, there, spread = states(azimuth), states(azimuth + turn), spread_matrix(azimuth)
    enter, leave = _input_change(spread, B.shape[1]), _output_change(spread)
    back = np.linalg.inv(there)
    return back @ A @ here, back @ B @ enter, leave @ C @ here, leave @ D @ enter


def spread_matrix(azimuth: float) -> Array:
    """Matrix (3, 3) from multi-blade components (0, c, s) to blades at an azimuth [rad]."""
    angle = blade_azimuths(azimuth)
    return np.stack([np.ones(BLADES), np.cos(angle), np.sin(angle)], axis=-1)


def _blocks(blades: Array, modes: int, support: int, still: bool = False) -> Array:
    """One 3 x 3 change for every mode of the blades; the support stays as it is, or does not take part."""
    rest = np.zeros((support, support)) if still else np.eye(support)
    return np.asarray(scipy.linalg.block_diag(np.kron(blades, np.eye(modes)), rest))


def _input_change(spread: Array, inputs: int) -> Array:
    """From multi-blade inputs to blade by blade; wind and what follows are the same."""
    return scipy.linalg.block_diag(spread, spread, np.eye(inputs - 2 * BLADES))


def _output_change(spread: Array) -> Array:
    back = np.linalg.inv(spread)
    return scipy.linalg.block_diag(back, back, np.eye(len(TURBINE_OUTPUTS) - 2 * BLADES))
