"""What a controller does beside the loads it is judged by: the tower, the blades' edgewise motion, its flaps' duty.

The turbine is linear, so what else its flaps and the wind do to it follows from the record of both: no loop is closed
a second time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flapgym.core.arrays import Array
from flapgym.core.multiblade import to_blades, to_components
from flapgym.core.state_space import StateSpace, require_time_step
from flapgym.evaluation import Record, damage_equivalent_load, root_mean_square
from flapgym.evaluation.metrics import FATIGUE_SLOPE
from reference.study import STUDY_OUTPUTS

BLOCK = 64
"""Steps taken at once."""
STEEL = 4.0
"""Slope of the S-N curve of the tower."""


@dataclass(frozen=True, eq=False)
class Effects:
    """Further loads on each realisation, arrays (N,), blades averaged.

    Attributes
    ----------
    fore_aft_rms, fore_aft_del, side_side_rms, side_side_del : moment on the tower's foundation [N m]; slope of steel
    edge_rms, edge_del : edgewise root bending moment [N m]; slope of composites
    """

    fore_aft_rms: Array
    fore_aft_del: Array
    side_side_rms: Array
    side_side_del: Array
    edge_rms: Array
    edge_del: Array


def measure_effects(record: Record, turbine: StateSpace, rotor_speed: float) -> Effects:
    """All of them.

    Parameters
    ----------
    record : Record
        What flaps and wind did.
    turbine : StateSpace
        In multi-blade coordinates, with ``STUDY_OUTPUTS`` among its outputs.
    rotor_speed : float
        [rad/s]
    """
    dt = record.time_step
    require_time_step("measure_effects.turbine.time_step", turbine.time_step, dt, "the record's")
    edge, base = further_loads(record, turbine, rotor_speed)

    def fatigue(series: Array, slope: float) -> Array:
        return np.array([damage_equivalent_load(one, dt, slope) for one in series])

    return Effects(
        fore_aft_rms=root_mean_square(base[:, :, 0]),
        fore_aft_del=fatigue(base[:, :, 0], STEEL),
        side_side_rms=root_mean_square(base[:, :, 1]),
        side_side_del=fatigue(base[:, :, 1], STEEL),
        edge_rms=root_mean_square(edge, axis=1).mean(axis=1),
        edge_del=np.mean([fatigue(edge[:, :, blade], FATIGUE_SLOPE) for blade in range(3)], axis=0),
    )


def further_loads(record: Record, turbine: StateSpace, rotor_speed: float) -> tuple[Array, Array]:
    """Edgewise root bending moments (N, T, 3) and the foundation's moments fore-aft and sideways (N, T, 2) [N m].

    They begin in the balance with the first sample's wind and flaps, as no earlier wind is known: flapwise moments
    asked for in the same way differ from the record's by 2.7 % of their rms after 14 s and 1.1 % after 70 s.
    """
    steps = record.wind.shape[1]
    azimuth = record.azimuth[:, None] + rotor_speed * record.time_step * np.arange(1, steps + 1)
    inputs = np.concatenate(
        [
            to_components(record.flap_angle, azimuth),
            to_components(record.flap_rate, azimuth),
            record.wind[..., None],
        ],
        axis=2,
    )
    found = respond(turbine.select(outputs=STUDY_OUTPUTS), inputs)
    return to_blades(found[..., :3], azimuth), found[..., 3:]


def respond(system: StateSpace, inputs: Array, block: int = BLOCK) -> Array:
    """Outputs (N, T, ny) for inputs (N, T, nu), from the steady state under the first input.

    Blocks of steps are one product each, exact: a tenth of the work of a step at a time.
    """
    n, steps, nu = inputs.shape
    ny, order = len(system.outputs), system.order
    powers = [np.eye(order)]
    for _ in range(block):
        powers.append(system.A @ powers[-1])
    # Markov parameters C A^(k-1) B, and what a block's inputs do to the state after it.
    markov = [system.D, *(system.C @ powers[k] @ system.B for k in range(block - 1))]
    direct = np.zeros((block, ny, block, nu))
    for k in range(block):
        for earlier in range(k + 1):
            direct[k, :, earlier] = markov[k - earlier]
    observe = np.concatenate([system.C @ powers[k] for k in range(block)]).T
    drive = np.concatenate([powers[block - 1 - k] @ system.B for k in range(block)], axis=1).T
    through = direct.reshape(block * ny, block * nu).T
    whole = -(-steps // block) * block
    padded = np.concatenate([inputs, np.zeros((n, whole - steps, nu))], axis=1).reshape(n, -1, block * nu)
    state = np.linalg.solve(np.eye(order) - system.A, system.B @ inputs[:, 0].T).T
    rows = np.empty((n, padded.shape[1], block * ny))
    for index in range(padded.shape[1]):
        rows[:, index] = state @ observe + padded[:, index] @ through
        state = state @ powers[block].T + padded[:, index] @ drive
    return rows.reshape(n, whole, ny)[:, :steps]
