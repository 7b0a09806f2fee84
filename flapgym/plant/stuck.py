"""Flaps that have been stuck for long: the steady motion of the turbine's modes under them, turning with the rotor."""

from __future__ import annotations

import numpy as np

from flapgym.core.arrays import BLADES, Array, ComplexArray
from flapgym.plant.interface import Setup
from flapgym.plant.modal import Modal


def first_modes(flap: Modal, setup: Setup, azimuth: Array, turn: float) -> ComplexArray:
    """Modes (m, order) at the start of an episode: at rest, but for what stuck flaps keep up.

    Parameters
    ----------
    flap : Modal
        Flap angle and rate in components to outputs.
    setup : Setup
    azimuth : (m,) float
        Of blade 1 [rad].
    turn : float
        Azimuth of one step [rad].
    """
    angle = setup.faults.held_angle * setup.faults.effectiveness
    if setup.single_blade:
        angle = np.full(BLADES, angle[0])
    if not angle.any():
        return np.zeros((len(azimuth), flap.order), dtype=complex)
    return stuck_modes(flap, angle, azimuth, turn)


def stuck_modes(flap: Modal, angle: Array, azimuth: Array, turn: float) -> ComplexArray:
    """Modes (m, order) that flaps held still on the turning blades keep up.

    In multi-blade components a constant angle of one blade is u_0 and u_c + j u_s = G exp(j theta), with theta growing
    by `turn` a step: a constant and two harmonics, each answered by z = d u / (exp(+-j turn) - value).

    Parameters
    ----------
    flap : Modal
        Flap angle and rate in components to outputs.
    angle : (3,) float
        Of each blade's flap [rad], times its effectiveness.
    azimuth : (m,) float
        Of blade 1 [rad].
    turn : float
        Azimuth of one step [rad].
    """
    mean, cosine, sine = flap.drive[:, :BLADES].T
    turning = 2.0 / BLADES * np.sum(angle * np.exp(2j * np.pi / BLADES * np.arange(BLADES)))
    steady = mean * np.mean(angle) / (1.0 - flap.values)
    along = 0.5 * turning * (cosine - 1j * sine) / (np.exp(1j * turn) - flap.values)
    against = 0.5 * np.conj(turning) * (cosine + 1j * sine) / (np.exp(-1j * turn) - flap.values)
    phase = np.exp(1j * np.asarray(azimuth))[:, None]
    return np.asarray(steady + along * phase + against / phase)
