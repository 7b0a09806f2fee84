"""Further models of the same turbine that the paper designs controllers on (Section IV.C).

The clamped single blade is part of every model file. These two see all three blades, in their own frames, with
the inputs and outputs of eq. 14 blade by blade.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flapgym.aeroelastic.coupling import couple
from flapgym.aeroelastic.equations import Parts, periodic_equations
from flapgym.reduction import ReducedSystem
from flapgym.state_space import StateSpace


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
