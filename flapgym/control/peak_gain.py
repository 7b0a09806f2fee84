"""The largest gain a discrete system has at any frequency (its H-infinity norm), found and not looked for on a grid.

A gain is reached at a frequency exactly where a Hamiltonian matrix made of the system and that gain has an imaginary
eigenvalue (Boyd, Balakrishnan and Kabamba 1989). So a gain a little above the largest one seen so far either is reached
nowhere, and the search is over, or its eigenvalues say where more is to be seen (Bruinsma and Steinbuch 1990).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import minimize_scalar

from flapgym.core.arrays import Array
from flapgym.core.state_space import StateSpace, TransferFunction

TOLERANCE = 1e-6
"""Of the peak, relative: no frequency has a gain larger than the one returned by more than that."""
NEAR_AXIS = 0.05
"""Damping ratio below which an eigenvalue is tried as an imaginary one: round-off moves those, and a trial is cheap."""
RESONANT = 0.5
"""Damping ratio below which a mode is looked at before the first level is set."""
ROUNDS = 50


def peak_gain(system: StateSpace) -> tuple[float, float]:
    """Largest singular value of the frequency response, and the frequency [Hz] where it stands.

    The system has the value at that frequency; nowhere is it larger by more than `TOLERANCE`, relative. Tried on loops
    of 500 states with modes a millihertz wide.

    Raises
    ------
    ValueError
        If the system is not stable: its response to a signal that lasts is then no gain.
    """
    transfer = TransferFunction(system.A, system.B, system.C, system.D)
    poles = transfer.poles
    if np.abs(poles).max(initial=0.0) >= 1.0:
        raise ValueError(
            f"peak_gain: expected a stable system, got spectral radius {np.abs(poles).max():.9f}"
        )

    def gain(angle: float) -> float:
        return float(np.linalg.norm(transfer(np.exp(1j * angle)), ord=2))

    hamiltonian = _Hamiltonian(system)
    modes = np.log(poles[poles.imag > 0.0])
    modes = modes[-modes.real < RESONANT * np.abs(modes)]
    # At both ends, and at one radian, no whole share of a turn, where no comb of zeros stands.
    best, best_angle = _local_maximum(gain, np.concatenate([[0.0, 1.0, np.pi], modes.imag]))
    if best == 0.0:
        return 0.0, 0.0
    for _ in range(ROUNDS):
        crossings = hamiltonian.crossings((1.0 + TOLERANCE) * best)
        between = 0.5 * (crossings[1:] + crossings[:-1])
        higher, there = _local_maximum(gain, np.concatenate([crossings, between, [best_angle]]))
        if higher <= (1.0 + TOLERANCE) * best:
            return best, best_angle / (2.0 * np.pi * system.time_step)
        best, best_angle = higher, there
    raise RuntimeError(f"peak_gain: no end after {ROUNDS} levels, the last {best:.9g}")


def _local_maximum(gain: Callable[[float], float], angles: Array) -> tuple[float, float]:
    """The largest gain at the angles, and from there up to the top of its hill, no farther than to the next angles."""
    angles = np.unique(angles)
    values = np.array([gain(angle) for angle in angles])
    top = int(values.argmax())
    low, high = angles[max(top - 1, 0)], angles[min(top + 1, angles.size - 1)]
    found = minimize_scalar(
        lambda angle: -gain(angle), bounds=(low, high), method="bounded", options={"xatol": 1e-9}
    )
    if -found.fun > values[top]:
        return -float(found.fun), float(found.x)
    return float(values[top]), float(angles[top])


class _Hamiltonian:
    """The system seen through s = (z - 1) / (z + 1), which keeps every gain: e^(i angle) becomes i tan(angle / 2)."""

    def __init__(self, system: StateSpace) -> None:
        eye = np.eye(system.order)
        to_s = np.linalg.inv(system.A + eye)
        self.a = to_s @ (system.A - eye)
        self.b = np.sqrt(2.0) * to_s @ system.B
        self.c = np.sqrt(2.0) * system.C @ to_s
        self.d = system.D - system.C @ to_s @ system.B

    def crossings(self, level: float) -> Array:
        """Angles, 0 to pi, where a singular value may be the level; more than there are, but none is missing."""
        a, b, c, d = self.a, self.b, self.c, self.d
        # Never singular: d holds the gain at an angle of pi, which was tried first, and the level lies above it.
        inputs = level**2 * np.eye(d.shape[1]) - d.T @ d
        feedback = np.linalg.solve(inputs, np.hstack([d.T @ c, b.T]))
        n = a.shape[0]
        forward = a + b @ feedback[:, :n]
        matrix = np.block([[forward, b @ feedback[:, n:]], [-c.T @ (c + d @ feedback[:, :n]), -forward.T]])
        values = np.linalg.eigvals(matrix)
        values = values[(values.imag > 0.0) & (np.abs(values.real) < NEAR_AXIS * np.abs(values))]
        return np.sort(2.0 * np.arctan(values.imag))
