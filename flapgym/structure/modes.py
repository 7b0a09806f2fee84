"""Natural modes of the whole turbine, named by their shape, beside Table 1 of the paper.

A mode is known by where its elastic energy sits: in the tower's bending or twist, in the shaft, or in a mode of
the clamped blade taken collectively or across the rotor. Labels by frequency alone would swap with azimuth.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg

from flapgym.core.arrays import AnyArray
from flapgym.structure.assembly import parked_modes
from flapgym.structure.beam import tangent
from flapgym.structure.blade import linear_blade
from flapgym.structure.body import LinearBlade
from flapgym.structure.rotating import component_weights, rotating_modes
from flapgym.structure.support import linear_support, tower_beam
from flapgym.turbine import Turbine, load_turbine

COUNT = 20
"""Modes computed; Table 1 ends with the 14th."""


@dataclass(frozen=True)
class TableRow:
    """One line of the paper's Table 1: natural frequencies of the parked turbine [Hz]."""

    mode: str
    fast: float
    adams: float
    paper_48: float
    paper_12: float


TABLE_1 = (
    TableRow("1st tower fore-aft", 0.324, 0.320, 0.320, 0.321),
    TableRow("1st tower side-to-side", 0.312, 0.316, 0.315, 0.316),
    TableRow("1st drivetrain torsion", 0.621, 0.609, 0.611, 0.617),
    TableRow("1st blade asymmetric flapwise yaw", 0.667, 0.630, 0.641, 0.662),
    TableRow("1st blade asymmetric flapwise pitch", 0.668, 0.669, 0.670, 0.693),
    TableRow("1st blade collective flap", 0.699, 0.701, 0.703, 0.726),
    TableRow("1st blade asymmetric edgewise pitch", 1.080, 1.074, 1.082, 1.091),
    TableRow("1st blade asymmetric edgewise yaw", 1.090, 1.090, 1.096, 1.105),
    TableRow("2nd blade asymmetric flapwise yaw", 1.933, 1.651, 1.729, 1.793),
    TableRow("2nd blade asymmetric flapwise pitch", 1.922, 1.856, 1.878, 1.955),
    TableRow("2nd blade collective flap", 2.021, 1.960, 1.973, 2.061),
    TableRow("2nd tower fore-aft", 2.900, 2.860, 2.913, 2.931),
    TableRow("2nd tower side-to-side", 2.936, 2.941, 3.029, 3.040),
)
NO_MATTER = frozenset(
    (
        "gravity",
        "rated_wind_speed",
        "blade_damping_ratio",
        "tower_damping_ratio",
        "planform",
        "pitch_axis",
        "airfoils",
    )
)
"""Fields of a turbine on which its undamped modes without wind do not depend."""
SECOND_DRIVETRAIN = "2nd drivetrain torsion"
"""Not in Table 1; Figure 9 labels it 2.316 Hz for 48 elements."""

# Names of the pairs across the rotor: flapwise and edgewise, for the second (sine) and first (cosine) component.
# With blade 1 up, the lower two blades moving out of plane against each other yaw the rotor, and the upper against the
# lower pitches it; in the plane of the rotor it is the other way round.
ACROSS = (
    "asymmetric flapwise yaw",
    "asymmetric flapwise pitch",
    "asymmetric edgewise pitch",
    "asymmetric edgewise yaw",
)
WHIRLS = (
    "flapwise forward whirl",
    "flapwise backward whirl",
    "edgewise forward whirl",
    "edgewise backward whirl",
)


@dataclass(frozen=True, eq=False)
class Mode:
    """A named natural mode: frequency [Hz] and shape (N,) over the unknowns of `assemble` at azimuth zero.

    Of a rotating turbine the shape is complex and over multi-blade coordinates (`multi_blade_matrices`).
    """

    name: str
    frequency: float
    shape: AnyArray


@dataclass(frozen=True, eq=False)
class _Shares:
    """Share of each mode's elastic energy (count,) by part; blade modes (3, count) by component across the rotor."""

    fore_aft: AnyArray
    side_to_side: AnyArray
    shaft: AnyArray
    flap_1: AnyArray
    edge_1: AnyArray
    flap_2: AnyArray


def named_modes(turbine: Turbine, elements: int = 12, rotor_speed: float = 0.0) -> list[Mode]:
    """Modes of Table 1, in its order, and the second drivetrain torsion, named by shape.

    Parameters
    ----------
    turbine : Turbine
        The machine.
    elements : int
        Beam elements a blade, 12 or 48.
    rotor_speed : float
        Omega [rad/s]. Zero is the parked turbine with blade 1 up; otherwise the modes are those seen from the
        fixed frame, undamped and without wind, and pairs across the rotor turn into whirls, backward or
        forward against the rotation.
    """
    blade = linear_blade(turbine, elements)
    if rotor_speed == 0.0:
        frequencies, shapes = parked_modes(turbine, elements, COUNT)
        blades = shapes[: 18 * elements].reshape(3, 6 * elements, COUNT)
        components = np.einsum("bc,bik->cik", component_weights(0.0), blades)
    else:
        frequencies, shapes = rotating_modes(turbine, elements, rotor_speed)
        collective, cosine, sine = shapes[: 18 * elements].reshape(3, 6 * elements, -1)
        whirls = np.stack([cosine - 1j * sine, cosine + 1j * sine]) / np.sqrt(2.0)
        components = np.concatenate([collective[None], whirls])
    shares = _energy_shares(turbine, blade, components, shapes[18 * elements :])
    names = _assign(shares, WHIRLS if rotor_speed else ACROSS)
    return [Mode(name, float(frequencies[k]), shapes[:, k]) for name, k in names.items()]


def _energy_shares(
    turbine: Turbine, blade: LinearBlade, components: AnyArray, support_shapes: AnyArray
) -> _Shares:
    """Elastic energy by part; each blade's motion is measured by the modes of the clamped, parked blade."""
    support, tower = linear_support(turbine), tower_beam(turbine)
    stiffness = tangent(tower, tower.reference)[6:, 6:]
    motion = support_shapes[: 6 * tower.elements]
    direction = np.arange(6 * tower.elements) % 6

    def tower_energy(kinds: tuple[int, ...]) -> AnyArray:
        part = np.where(np.isin(direction, kinds)[:, None], motion, 0.0)
        return np.einsum("ik,ij,jk->k", part.conj(), stiffness, part).real

    hub = support.hub @ support_shapes
    top = support.shaft_axes.T @ (support.tower_top @ support_shapes)[3:]
    shaft = turbine.drivetrain.torsion_spring * np.abs(hub[3] - top[0]) ** 2
    squared, clamped = scipy.linalg.eigh(blade.stiffness, blade.mass)
    amplitudes = np.einsum("im,cik->mck", blade.mass @ clamped, components)
    in_blades = squared[:, None, None] * np.abs(amplitudes) ** 2
    tower_parts = [tower_energy(kinds) for kinds in ((0, 4), (1, 3), (2, 5))]
    total = sum(tower_parts) + shaft + in_blades.sum(axis=(0, 1))
    flap_1, edge_1, flap_2 = in_blades[:3] / total
    return _Shares(tower_parts[0] / total, tower_parts[1] / total, shaft / total, flap_1, edge_1, flap_2)


def _assign(shares: _Shares, across: tuple[str, str, str, str]) -> dict[str, int]:
    """Number of the mode that bears each name: the one with the largest share of the energy that names it."""
    flap_a, flap_b, edge_a, edge_b = across
    fore_aft, side = (np.sort(np.argsort(part)[-2:]) for part in (shares.fore_aft, shares.side_to_side))
    torsion = int(np.argmax(shares.shaft))
    others = shares.edge_1[0].copy()
    others[[torsion, *fore_aft, *side]] = 0.0
    return {
        "1st tower fore-aft": int(fore_aft[0]),
        "1st tower side-to-side": int(side[0]),
        "1st drivetrain torsion": torsion,
        f"1st blade {flap_a}": int(np.argmax(shares.flap_1[2])),
        f"1st blade {flap_b}": int(np.argmax(shares.flap_1[1])),
        "1st blade collective flap": int(np.argmax(shares.flap_1[0])),
        f"1st blade {edge_a}": int(np.argmax(shares.edge_1[2])),
        f"1st blade {edge_b}": int(np.argmax(shares.edge_1[1])),
        f"2nd blade {flap_a}": int(np.argmax(shares.flap_2[2])),
        f"2nd blade {flap_b}": int(np.argmax(shares.flap_2[1])),
        "2nd blade collective flap": int(np.argmax(shares.flap_2[0])),
        "2nd tower fore-aft": int(fore_aft[1]),
        "2nd tower side-to-side": int(side[1]),
        SECOND_DRIVETRAIN: int(np.argmax(others)),
    }


def is_published(turbine: Turbine) -> bool:
    """Whether Table 1 is of this turbine's structure: the built-in NREL 5 MW's, whatever it is called."""
    return NO_MATTER.issuperset(turbine.differing(load_turbine("nrel5mw")))


def modes_table(turbine: Turbine, elements: int = 12, rotor_speed: float = 0.0) -> list[dict[str, Any]]:
    """Table 1: a list of {"mode", "frequency", "paper", "fast", "adams"}, frequencies in Hz.

    The published columns are for the parked NREL 5 MW: None when it turns, and for another turbine.
    """
    published = {row.mode: row for row in TABLE_1}
    parked, known = rotor_speed == 0.0, is_published(turbine)
    rows: list[dict[str, Any]] = []
    for mode in named_modes(turbine, elements, rotor_speed):
        if parked and mode.name not in published:
            continue
        row = published[mode.name] if parked and known else None
        paper = None if row is None else (row.paper_48 if elements == 48 else row.paper_12)
        rows.append(
            {
                "mode": mode.name,
                "frequency": mode.frequency,
                "paper": paper,
                "fast": None if row is None else row.fast,
                "adams": None if row is None else row.adams,
            }
        )
    return rows
