"""An interval under held accelerations, in coordinates that nothing but the flaps' accelerations drives.

A flap moves as a double integrator, so the turbine's answer to it splits: what a flap that goes on at its angle and
rate would keep up follows the motion m = (angle, rate) at once, and only the rest has a memory of its own. With modes z
and z^{n+1} = values z^n + B m^n, m^{n+1} = F m^n + f a^n, the shifted modes s = z + G m, where G = B (values - F)^-1,
obey s^{n+1} = values s^n + G f a^n: three accelerations drive them instead of six inputs. Where a stop makes the
angles jump by d, s jumps by the angles' part of G times d.

All exact, but G grows as a mode comes near to what a flap at rest excites: 1, and exp(+-j turn) seen from the fixed
frame. What G adds is taken off again, so digits are lost. The nearest mode of the paper's turbine is 5e-3 away and
loses none, the corrected one's, the slow state of its wake, 8e-4. A tower mode at the rotor's own speed with 0.1 % of
damping, 1e-5 away, errs by 4e-9 in double precision and, in single, by a third of the tower's motion. Nearer than
`NEAREST` the shift is refused.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flapgym.core.arrays import BLADES, Array, ComplexArray
from flapgym.plant.frame import turned
from flapgym.plant.layout import FLAP_INPUTS
from flapgym.plant.modal import Modal

NEAREST = 5e-4
"""Least distance of a mode from what a flap at rest excites: of the loads, 4e-6 is lost in single precision."""


def distance(modal: Modal, turn: float) -> float:
    """Of the nearest mode from what a flap at rest excites."""
    excited = np.exp(1j * turn * np.arange(-1, 2))
    return float(np.abs(modal.values[:, None] - excited).min())


@dataclass(frozen=True, eq=False)
class Held:
    """One interval of k steps in shifted modes.

    What the flaps do comes in multi-blade components: at the start in the frame of the start, in a step in the frame
    of the sample at its end. Rows are in the frame of the start.

    Attributes
    ----------
    shift : (m, 6) complex
        G: flap angle and rate to what they add to the modes.
    step : (m, 6) complex
        Acceleration over a step and jump of the angle behind it to the shifted modes.
    push : (m, 3) complex
        Accelerations held for the interval to the shifted modes at its end.
    decay : (m,) complex
        What an interval leaves of each shifted mode.
    read : (2 m, rows) float
        Shifted modes at the start, real and imaginary parts alternating, to the rows.
    feed : (6 + 6 k, rows) float
        To the rows: angle and rate at the start, then acceleration and jump of every step.
    held_feed, pushed : (3, rows) float
        To the rows: accelerations held for the interval; of that, what they do to the last sample by way of the modes.
    """

    shift: ComplexArray
    step: ComplexArray
    push: ComplexArray
    decay: ComplexArray
    read: Array
    feed: Array
    held_feed: Array
    pushed: Array


def held(modal: Modal, steps: int, rows: Array, turn: float) -> Held:
    """Prepare an interval.

    Parameters
    ----------
    modal : Modal
        Flap angle and rate in components to the outputs.
    steps : int
        Steps k.
    rows : (r, k ny) float
        Rows wanted, as combinations of (y^1, ..., y^k).
    turn : float
        Azimuth Omega dt [rad] of one step.
    """
    dt, values = modal.time_step, modal.values
    # From one sample to the next, in components, which turn meanwhile.
    going = np.kron([[1.0, dt], [0.0, 1.0]], turned(turn))
    gap = values[:, None, None] * np.eye(FLAP_INPUTS) - going.T
    shift: ComplexArray = np.linalg.solve(gap, modal.drive[:, :, None])[:, :, 0].astype(complex)
    # What a step does to the motion: an acceleration in it, a jump of the angle behind it.
    done = np.kron([[0.5 * dt**2, 1.0], [dt, 0.0]], np.eye(BLADES))
    step = shift @ done
    powers = values ** np.arange(steps + 1)[:, None]
    direct = modal.D - (modal.read @ shift).real
    # Outputs i samples behind a change of the motion: by its place, and by way of the modes.
    moved = np.stack([direct @ np.linalg.matrix_power(going, i) for i in range(steps + 1)])
    behind = moved[:-1] @ done + np.einsum("ym,im,mu->iyu", modal.read, powers[:-1], step).real
    lag = np.arange(steps)[:, None] - np.arange(steps)
    stepped = np.where((lag >= 0)[:, :, None, None], behind[np.maximum(lag, 0)], 0.0)
    by_step = stepped.transpose(1, 3, 0, 2).reshape(steps, FLAP_INPUTS, -1) @ rows.T
    at_start = moved[1:].transpose(2, 0, 1).reshape(FLAP_INPUTS, -1) @ rows.T
    turns = np.stack([turned((sample + 1) * turn) for sample in range(steps)])
    push = np.einsum("im,mu,iuv->mv", powers[steps - 1 :: -1], step[:, :BLADES], turns)
    last = rows.reshape(len(rows), steps, -1)[:, -1]
    read = rows @ (powers[1:, None, :] * modal.read).reshape(-1, modal.order)
    return Held(
        shift=shift,
        step=step,
        push=push,
        decay=powers[steps].copy(),
        read=np.stack([read.real, -read.imag], axis=-1).reshape(len(rows), -1).T,
        feed=np.vstack([at_start, by_step.reshape(steps * FLAP_INPUTS, -1)]),
        held_feed=np.einsum("iuv,iur->vr", turns, by_step[:, :BLADES]),
        pushed=(last @ (modal.read @ push).real).T,
    )
