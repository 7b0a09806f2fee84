"""Frequencies and damping of the turning turbine's modes, from the multi-blade form's eigenvalues.

A pair of eigenvalues bears the name of the motion it takes the largest part in, by participation factors (left times
right eigenvector). Motions that the air damps by more than about a third of critical have no mode of their own: the
wake's modes share them, and the name goes to the first among equals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flapgym.aeroelastic.equations import Parts
from flapgym.core.arrays import Array
from flapgym.core.state_space import StateSpace

_WAYS = ("collective", "forward", "backward")


@dataclass(frozen=True)
class CoupledMode:
    """A mode of the coupled turbine, seen from the ground.

    Attributes
    ----------
    name : str
        Motion it takes the largest part in: "flap 1 backward", "tower fore-aft 1", ...
    frequency : float
        Modulus of the eigenvalue over 2 pi [Hz]. On the blades a whirl of f Hz is felt at f -+ Omega / 2 pi.
    damping : float
        Ratio to critical, -Re / modulus; negative for a growing mode.
    participation : float
        Part of that motion that belongs to this mode: one where they are the same, a few tenths where several share it.
    """

    name: str
    frequency: float
    damping: float
    participation: float


def coupled_modes(
    parts: Parts, turbine: StateSpace, blade_modes: int = 3, tower_modes: int = 3
) -> list[CoupledMode]:
    """Modes of the turning turbine that belong to the lowest motions of its blades and its tower.

    Parameters
    ----------
    parts : Parts
        What the turbine was coupled from.
    turbine : StateSpace
        ``couple(turbine_equations(parts), ...)``.
    blade_modes, tower_modes : int
        Motions looked at: modes of one blade, each collective and whirling both ways, and modes of the support.
    """
    m = parts.lattice.modes
    count = 3 * m + parts.modal_support[1].shape[1]
    values, right = np.linalg.eig(turbine.A)
    left = np.linalg.inv(right)
    change = _whirls(m, count)
    back = np.linalg.inv(change)
    share = np.zeros((len(values), count))
    for first in (0, count):  # positions, then rates
        rows = slice(first, first + count)
        share += np.abs((change @ right[rows]).T * (left[:, rows] @ back))
    rate = np.log(values) / turbine.time_step
    share[rate.imag <= 0.0] = 0.0
    modes = []
    for index, name in [*_blade_names(parts, blade_modes), *_tower_names(parts, tower_modes)]:
        best = int(share[:, index].argmax())
        size = float(np.abs(rate[best]))
        modes.append(
            CoupledMode(name, size / (2.0 * np.pi), -float(rate[best].real) / size, float(share[best, index]))
        )
    return modes


def _whirls(modes: int, count: int) -> Array:
    """Complex change (count, count) of (a_0, a_c, a_s, x_t) to (collective, forward, backward, x_t).

    a_c + j a_s of an eigenvalue with positive frequency turns with the rotor, a_c - j a_s against it.
    """
    change = np.eye(count, dtype=complex)
    mix = np.array([[1.0, 0.0, 0.0], [0.0, 0.5, 0.5j], [0.0, 0.5, -0.5j]])
    change[: 3 * modes, : 3 * modes] = np.kron(mix, np.eye(modes))
    return change


def _blade_names(parts: Parts, modes: int) -> list[tuple[int, str]]:
    """Coordinates and names: flap or edge by where the tip goes, numbered by frequency."""
    cone = parts.case.turbine.rotor.precone
    flapwise = np.abs(np.array([np.cos(cone), 0.0, np.sin(cone)]) @ parts.shape[-6:-3, :modes])
    edgewise = np.abs(parts.shape[-5, :modes])
    kinds = ["flap" if out > along else "edge" for out, along in zip(flapwise, edgewise, strict=True)]
    m = parts.lattice.modes
    return [
        (way * m + i, f"{kind} {kinds[: i + 1].count(kind)} {_WAYS[way]}")
        for i, kind in enumerate(kinds)
        for way in range(3)
    ]


def _tower_names(parts: Parts, modes: int) -> list[tuple[int, str]]:
    """Coordinates and names: by the largest of what the tower top does to the hub, and the shaft to the rotor."""
    _, shape = parts.modal_support
    top, hub = (np.abs(motion @ shape)[:, :modes] for motion in (parts.support.tower_top, parts.support.hub))
    rotor = parts.case.turbine.rotor
    sizes = {
        "tower fore-aft": top[0],
        "tower side-to-side": top[1],
        "tower twist": rotor.overhang * top[5],
        "drivetrain": rotor.radius * (hub[3] - top[3]),
    }
    kinds = [list(sizes)[i] for i in np.stack(list(sizes.values())).argmax(axis=0)]
    start = 3 * parts.lattice.modes
    return [(start + i, f"{kind} {kinds[: i + 1].count(kind)}") for i, kind in enumerate(kinds)]
