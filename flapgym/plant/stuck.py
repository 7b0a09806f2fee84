"""Flaps that have been stuck for long: the steady motion of the turbine's modes under them, turning with the rotor."""

from __future__ import annotations

import numpy as np

from flapgym.core.arrays import BLADES, Array, ComplexArray
from flapgym.core.modal import Modal


def stuck_modes(flap: Modal, angle: Array, azimuth: Array, turn: float) -> ComplexArray:
    """Modes (m, order) that flaps held still on the turning blades keep up.

    In multi-blade components a constant angle of one blade is u_0 and u_c + j u_s = G exp(j theta), with theta growing
    by `turn` a step: a constant and two harmonics, each answered by z = d u / (exp(+-j turn) - value).

    Parameters
    ----------
    flap : Modal
        Flap angles, and what else there is behind them, in components to outputs.
    angle : (blades, F) float
        Of each flap [rad], times its effectiveness; of the single blade, one row.
    azimuth : (m,) float
        Of blade 1 [rad].
    turn : float
        Azimuth of one step [rad].
    """
    # A single blade is the mean of three alike.
    each = np.broadcast_to(angle, (BLADES, angle.shape[1]))
    modes = np.zeros((len(azimuth), flap.order), dtype=complex)
    if not each.any():
        return modes
    phase = np.exp(1j * np.asarray(azimuth))[:, None]
    for number, angles in enumerate(each.T):
        mean, cosine, sine = flap.B[:, BLADES * number : BLADES * (number + 1)].T
        turning = 2.0 / BLADES * np.sum(angles * np.exp(2j * np.pi / BLADES * np.arange(BLADES)))
        steady = mean * np.mean(angles) / (1.0 - flap.values)
        along = 0.5 * turning * (cosine - 1j * sine) / (np.exp(1j * turn) - flap.values)
        against = 0.5 * np.conj(turning) * (cosine + 1j * sine) / (np.exp(-1j * turn) - flap.values)
        modes += steady + along * phase + against / phase
    return modes
