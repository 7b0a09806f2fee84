"""Frequency response of the coupled turbine with every circulation of the lattice: what reductions are judged by.

The lattice enters with its own transfer function instead of reduced states, so that a frequency costs a few small
solves however long the wake is.
Without the states of a moving wake: `build.slow_wake` goes before, where a case has it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from flapgym.aerodynamics import Aerodynamics
from flapgym.aeroelastic.blade_lattice import BladeLattice, lattice_response
from flapgym.aeroelastic.coupling import Equations
from flapgym.core.arrays import ComplexArray


def harmonic_response(
    equations: Equations,
    aero: Aerodynamics,
    lattice: BladeLattice,
    frequency: ArrayLike,
    rotor_speed: float = 0.0,
) -> ComplexArray:
    """Outputs per unit harmonic input, without a reduced state.

    Parameters
    ----------
    equations : Equations
        Of the whole turbine in multi-blade coordinates, or by azimuth with its joint frozen.
    aero : Aerodynamics
        The rotor's lattice.
    lattice : BladeLattice
        One blade's inputs and outputs, in the modes of the equations.
    frequency : (nf,) float
        [Hz].
    rotor_speed : float
        Of the rotor relative to the components (0, c, s) the equations use [rad/s]: the rotor's speed for
        multi-blade coordinates, zero for a frozen joint, whose components turn with the rotor.

    Returns
    -------
    (nf, ny, nu) complex
        Of the time-discrete system (Newmark's rule), as ``couple`` would give it with all aerodynamic states.
    """
    dt = aero.time_step
    structure, asks, read = equations.structure, equations.lattice_input, equations.output
    z = np.exp(2j * np.pi * np.atleast_1d(np.asarray(frequency, dtype=float)) * dt)
    response = []
    for point, full in zip(z, _rotor_response(aero, lattice, z, rotor_speed * dt), strict=True):
        s = 2.0 / dt * (point - 1.0) / (point + 1.0)  # Newmark's average acceleration
        drive = asks.position + s * asks.velocity
        dynamic = structure.mass * s**2 + structure.damping * s + structure.stiffness
        work = structure.work @ full
        d = np.linalg.solve(dynamic - work @ drive, work @ asks.exogenous)
        load = full @ (drive @ d + asks.exogenous)
        motion = read.acceleration * s**2 + read.velocity * s + read.position
        response.append(motion @ d + read.load @ load)
    return np.stack(response)


def _rotor_response(aero: Aerodynamics, lattice: BladeLattice, z: ComplexArray, turn: float) -> ComplexArray:
    """Lattice loads per input in the components (0, c, s) at points z, (nz, 3 ny, 3 nu); `turn` [rad] per step."""
    # c - j s is the whirl component carried back by the rotor's turn, c + j s its conjugate.
    whirl = np.stack(
        [
            lattice_response(aero, lattice, 1, z * np.exp(1j * turn)),
            lattice_response(aero, lattice, 1, (z * np.exp(-1j * turn)).conj()).conj(),
        ]
    )
    to_whirl = np.array([[1.0, -1j], [1.0, 1j]])
    collective = lattice_response(aero, lattice, 0, z)
    _, ny, nu = collective.shape
    full = np.zeros((len(z), 3 * ny, 3 * nu), dtype=complex)
    full[:, :ny, :nu] = collective
    pairs = np.einsum("ai,izyu,ib->zaybu", np.linalg.inv(to_whirl), whirl, to_whirl)
    full[:, ny:, nu:] = pairs.reshape(len(z), 2 * ny, 2 * nu)
    return full
