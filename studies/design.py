"""Further models of the same turbine that the paper designs controllers on (Section IV.C).

The clamped single blade is part of every model file. Rotor and frozen turbine see all three blades, in their own
frames, with the inputs and outputs of eq. 14 blade by blade; a single blade may also have its root move.
Without the states of a moving wake: `build.slow_wake` goes before, where a case has it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.linalg

from flapgym.aeroelastic.coupling import Equations, LatticeInput, couple
from flapgym.aeroelastic.equations import (
    Parts,
    blade_equations,
    modal_blade_matrices,
    periodic_equations,
    root_moment,
)
from flapgym.core.state_space import StateSpace
from flapgym.reduction import ReducedSystem

SWAY = ("hub_velocity", "hub_acceleration")


def clamped_rotor(parts: Parts, aerodynamics: ReducedSystem) -> StateSpace:
    """Three blades clamped at the hub: they feel each other through the air alone.

    Parameters
    ----------
    parts : Parts
    aerodynamics : ReducedSystem
        The rotor's lattice seen on the rotor: ``multiblade_aerodynamics`` at rotor speed zero.

    Returns
    -------
    StateSpace
        Inputs and outputs of ``periodic``, the tower's displacements being zero.
    """
    equations = periodic_equations(parts)
    held = np.zeros((0, 0)), np.zeros((0, 0)), np.zeros((0, 0))
    clamped = replace(equations, support=held, hub=np.zeros((6, 0)), tower_top=np.zeros((2, 0)))
    return couple(clamped(0.0), aerodynamics, parts.case.discretisation.time_step)


def frozen_turbine(parts: Parts, aerodynamics: ReducedSystem, azimuth: float) -> StateSpace:
    """The whole turbine with its joint frozen at an azimuth [rad], while inflow and wake rotate.

    It is what the paper calls stationary in its frequency responses. Its eigenvalues are not those of the turning
    turbine: a whirl of the blades couples with the tower at the wrong frequency.
    """
    return couple(periodic_equations(parts)(azimuth), aerodynamics, parts.case.discretisation.time_step)


def moving_root_blade(parts: Parts, aerodynamics: ReducedSystem) -> StateSpace:
    """One blade whose hub moves fore and aft, as on a swaying tower, with the motion as a further input.

    The motion is given, the blade does not push back on it: what drives it is the business of ``hub_sway``.

    Parameters
    ----------
    parts : Parts
    aerodynamics : ReducedSystem
        The lattice of one blade alone, ``reduce_component`` of component zero.

    Returns
    -------
    StateSpace
        Inputs those of the clamped blade, then the hub's velocity [m/s] and acceleration [m/s^2] downwind along the
        shaft; outputs those of the clamped blade.
    """
    equations, m = blade_equations(parts), parts.lattice.modes
    mass = modal_blade_matrices(parts)[0][:, m]  # loads of a fore-aft acceleration on the modes and the hub
    asks, structure, output = equations.lattice_input, equations.structure, equations.output
    nu = asks.exogenous.shape[0]
    # The acceleration loads the structure, not the lattice: it passes by the lattice as one more input and output.
    r, ny = aerodynamics.A.shape[0], aerodynamics.D.shape[0]
    beside = replace(
        aerodynamics,
        B=np.hstack([aerodynamics.B, np.zeros((r, 1))]),
        C=np.vstack([aerodynamics.C, np.zeros((1, r))]),
        D=np.block([[aerodynamics.D, np.zeros((ny, 1))], [np.zeros((1, nu)), np.ones((1, 1))]]),
    )
    still = np.zeros((1, m))
    velocity = parts.lattice.select("hub_velocity")[:, :1]
    exogenous = np.block([[asks.exogenous, velocity, np.zeros((nu, 1))], [np.zeros((1, 4)), np.ones((1, 1))]])
    root = root_moment(parts.blade, m)
    moving = Equations(
        replace(structure, work=np.hstack([structure.work, -mass[:m, None]])),
        LatticeInput(np.vstack([asks.position, still]), np.vstack([asks.velocity, still]), exogenous),
        replace(output, load=np.hstack([output.load, np.vstack([-root @ mass[:, None], np.zeros((1, 1))])])),
        (*equations.inputs, *SWAY),
        equations.outputs,
    )
    return couple(moving, beside, parts.case.discretisation.time_step)


def hub_sway(frequency: float, damping: float, velocity: float, time_step: float) -> StateSpace:
    """White noise shaped into the fore-aft motion of the hub: an oscillator, sampled without error in its covariance.

    Parameters
    ----------
    frequency, damping : float
        Of the oscillator [Hz], [-], the first tower mode's.
    velocity : float
        Rms of the hub's velocity [m/s].
    time_step : float
        [s].

    Returns
    -------
    StateSpace
        Inputs two independent unit noises, outputs ``SWAY``; the acceleration is that of spring and damper.
    """
    omega = 2.0 * np.pi * frequency
    continuous = np.array([[0.0, 1.0], [-(omega**2), -2.0 * damping * omega]])
    step = scipy.linalg.expm(continuous * time_step)
    stationary = velocity**2 * np.diag([1.0 / omega**2, 1.0])
    noise = np.linalg.cholesky(stationary - step @ stationary @ step.T)
    return StateSpace(
        step,
        noise,
        np.vstack([[0.0, 1.0], continuous[1]]),
        np.zeros((2, 2)),
        time_step,
        ("white_sway_1", "white_sway_2"),
        SWAY,
    )
