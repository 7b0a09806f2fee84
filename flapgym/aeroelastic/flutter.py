"""Flutter of the rotating blade: the rotor speed at which its clamped, reduced model stops being stable.

Classical flutter as in overspeed: wind and rotor speed rise together, the blade carries its centrifugal load but no
mean air load and turns alone in its own wake. At one tip-speed ratio the wake's helix and the lattice stay what they
are: forces and the downwash by a held deflection grow with the speed, and so does the number of steps a second.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from flapgym.aerodynamics import build_aerodynamics
from flapgym.aeroelastic.blade_lattice import blade_lattice, reduce_component
from flapgym.aeroelastic.coupling import Equations, LatticeInput, Output, SecondOrder, couple
from flapgym.aeroelastic.equations import Parts, modal_blade_matrices
from flapgym.core.state_space import StateSpace
from flapgym.model.record import Flutter
from flapgym.reduction import normal_modes
from flapgym.structure import EquilibriumError, linear_blade, linear_support
from flapgym.turbine import Case, Signals

HIGHEST = 2.5
"""Rotor speed up to which flutter is looked for, over the operating one."""

STEP = 0.25
"""Distance of the speeds tried, over the operating one: an unstable range narrower than this may be missed."""

ACCURACY = 0.01
"""To which a flutter speed is found, over the operating one."""

_PANELS, _STATES = 5, 30  # along the chord; of the lattice


def find_flutter(case: Case, highest: float = HIGHEST) -> Flutter:
    """Search upwards from the operating speed for flutter of a case's blade.

    Parameters
    ----------
    case : Case
        Of equal blades.
    highest : float
        Speed to go up to, over the operating rotor speed.
    """
    blade = speeding_blade(case)
    stable = 0.0
    for speed in np.linspace(1.0, highest, 1 + round((highest - 1.0) / STEP)).tolist():
        try:
            system = blade(speed)
        except EquilibriumError:
            break
        if system.spectral_radius() >= 1.0:
            onset = crossing(lambda s: blade(s).spectral_radius(), stable, speed) if stable else speed
            return Flutter(highest, onset, growing_frequency(blade(onset)))
        stable = speed
    return Flutter(stable)


def crossing(radius: Callable[[float], float], stable: float, unstable: float) -> float:
    """Lowest unstable speed found by bisection between a stable and an unstable one."""
    while unstable - stable > ACCURACY:
        middle = 0.5 * (stable + unstable)
        stable, unstable = (middle, unstable) if radius(middle) < 1.0 else (stable, middle)
    return unstable


def growing_frequency(system: StateSpace) -> float:
    """Frequency [Hz] of the eigenvalue of largest modulus."""
    values = np.linalg.eigvals(system.A)
    return float(np.abs(np.angle(values[np.abs(values).argmax()])) / (2.0 * np.pi * system.time_step))


def speeding_blade(case: Case) -> Callable[[float], StateSpace]:
    """The unloaded, clamped blade, without inputs and outputs, by rotor speed over the operating one.

    In its own modes at each speed: those of another speed strain the blade's axis once its equilibrium has moved. Five
    panels along the chord at most, wake rows as long beside a panel as the case's, thirty states of the lattice.
    """
    case, grid = replace(case.alike(), signals=Signals(), speed_control=None), case.discretisation
    panels = min(_PANELS, grid.chordwise_panels)
    grid = replace(grid, chordwise_panels=panels, time_step=grid.time_step * grid.chordwise_panels / panels)
    case = replace(case, discretisation=grid)
    aero, support = build_aerodynamics(case, blades=1), linear_support(case.turbine, case.rotor_speed)
    m, states = case.reduction.blade_modes, min(_STATES, case.reduction.aerodynamic_states)
    clamp, none = np.eye(m, m + 6), np.zeros((0, m))

    def at(speed: float) -> StateSpace:
        blade = linear_blade(
            case.turbine, grid.blade_elements, speed * case.rotor_speed, case.operating_point.pitch
        )
        frequency, shape = normal_modes(blade.mass, blade.stiffness, m)
        lattice = blade_lattice(case, aero, blade, shape)
        parts = Parts(case, blade, support, frequency, shape, lattice)
        mass, damping, stiffness = (matrix[:m, :m] for matrix in modal_blade_matrices(parts))
        equations = Equations(
            SecondOrder(mass, damping, stiffness, work=speed * clamp),
            LatticeInput(
                position=speed * lattice.select("mode"),
                velocity=lattice.select("mode_rate"),
                exogenous=np.zeros((lattice.downwash.shape[1], 0)),
            ),
            Output(none, none, none, np.zeros((0, m + 6))),
            (),
            (),
        )
        return couple(equations, reduce_component(aero, lattice, 0, states), grid.time_step / speed)

    return at
