"""Disk margin of a controller in the blades' own frames on the turning turbine, whose loop is periodic.

A signal at one frequency comes back at others, whole revolutions per second apart. The loop is lifted: one matrix a
frequency relates the harmonics to each other (Wereley 1991), and its largest singular value is the gain over all
signals, as that of a time-invariant loop is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flapgym.aeroelastic.model import TurbineModel
from flapgym.aeroelastic.multiblade import blade_azimuths
from flapgym.control.channels import MULTIBLADE, ROTOR
from flapgym.control.closed_loop import flaps_loop, require_model_step
from flapgym.control.margins import DiskMargin
from flapgym.state_space import StateSpace

Response = NDArray[np.complex128]
Indices = NDArray[np.int64]

HARMONICS = 1
"""To either side of a frequency; two change the margin of the design on a frozen turbine by less than 1e-5."""
RESOLUTION = 128
"""Frequencies per revolution a second: 1.5 mHz. Four times as many lower the margins by up to 1 %."""
LAST = 12.0
"""Frequency [Hz] beyond which the flap's own dynamics leave the loop no gain."""
TURNS = np.array([0, 1, -1])
"""Revolutions a second by which the rotating frame sees the components 0, + and - faster."""


def periodic_disk_margin(
    model: TurbineModel, controller: StateSpace, harmonics: int = HARMONICS
) -> DiskMargin:
    """The disk margin of `flapgym.control.margins` for a controller of the rotor in the blades' own frames.

    It guarantees the same: stability for all complex factors on the three measurements within the disk, the gain of the
    periodic S - T taken over all signals. Each blade's signal is the sum of three components that turn with the rotor,
    e^(i k theta_b) a_k / sqrt 3 with k = 0, 1, -1, in which the turbine is time-invariant.

    Parameters
    ----------
    model : TurbineModel
    controller : StateSpace
        Three moments, angles and rates to three accelerations; the loop must decay (`growth_per_turn`).
    harmonics : int
        Kept to either side of each frequency.
    """
    if controller.inputs != ROTOR.inputs:
        raise ValueError(
            f"periodic_disk_margin: expected a controller of {', '.join(ROTOR.named('rbm'))}, got one of "
            f"{', '.join(controller.inputs)}"
        )
    require_model_step("periodic_disk_margin.controller", controller, model)
    turn = model.rotor_speed / (2.0 * np.pi)
    centres = np.arange(round(LAST / turn * RESOLUTION))
    reach = centres.size + (harmonics + 1) * RESOLUTION
    grid = np.linspace(0.0, reach * turn / RESOLUTION, reach, endpoint=False)
    measured = _lifted(_turbine_response(model, grid), _flap_response(controller, grid), centres, harmonics)
    # Of noise on the measurement the loop sees S n: S - T = 2 S - 1.
    unit = np.eye(measured.shape[-1])
    response = 2.0 * np.linalg.inv(unit - measured) - unit
    size = np.linalg.norm(response, ord=2, axis=(1, 2))
    worst = int(size.argmax())
    # Of the harmonics the one that takes most part.
    share = np.abs(np.linalg.svd(response[worst])[2][0]).argmax() // 3 - harmonics
    return DiskMargin(float(2.0 / size[worst]), float(turn * abs(worst / RESOLUTION + share)))


def _turbine_response(model: TurbineModel, frequency: NDArray[np.float64]) -> Response:
    """From components of angle and rate to those of the moment, (nf, 3, 6)."""
    plant = model.turbine.select(MULTIBLADE.inputs[3:], MULTIBLADE.named("rbm"))
    to_components = np.sqrt(3.0) * np.array([[1.0, 0.0, 0.0], [0.0, 0.5, -0.5j], [0.0, 0.5, 0.5j]])
    back = np.kron(np.eye(2), np.linalg.inv(to_components))
    return np.asarray(to_components @ plant.frequency_response(frequency) @ back)


def _flap_response(controller: StateSpace, frequency: NDArray[np.float64]) -> Response:
    """From components of the moment, seen from the rotor, to those of angle and rate, (nf, 6, 3)."""
    flaps = flaps_loop(controller, np.eye(3))
    blades = np.exp(1j * np.outer(blade_azimuths(0.0), TURNS)) / np.sqrt(3.0)
    back = np.kron(np.eye(2), blades.conj().T)
    motion = flaps.select(outputs=ROTOR.inputs[3:]).frequency_response(frequency)
    return np.asarray(back @ motion @ blades)


def _lifted(turbine: Response, flaps: Response, centres: Indices, harmonics: int) -> Response:
    """Moments answered to moments (nc, m, m), harmonic by harmonic, three components each, about each centre."""
    count = 2 * harmonics + 1
    orders = np.arange(-harmonics, harmonics + 1)
    asked = np.zeros((centres.size, 2, 3 * count, 3 * count), dtype=complex)
    for seen in range(orders[0] - 1, orders[-1] + 2):
        # What the rotor sees at one frequency are components at three frequencies of the tower's frame.
        row = seen - TURNS - orders[0]
        kept = np.flatnonzero((row >= 0) & (row < count))
        place = 3 * row[kept] + kept
        one = _at(flaps, centres + seen * RESOLUTION).reshape(-1, 2, 3, 3)
        asked[:, :, place[:, None], place] = one[:, :, kept[:, None], kept]
    measured = np.empty((centres.size, 3 * count, 3 * count), dtype=complex)
    for row, order in enumerate(orders):
        here = slice(3 * row, 3 * row + 3)
        answer = _at(turbine, centres + order * RESOLUTION)
        measured[:, here] = answer[..., :3] @ asked[:, 0, here] + answer[..., 3:] @ asked[:, 1, here]
    return measured


def _at(response: Response, index: Indices) -> Response:
    """The response at indices of the grid; below zero, as signals are real, the conjugate with + and - exchanged."""
    rows, columns = (np.arange(size).reshape(-1, 3)[:, [0, 2, 1]].ravel() for size in response.shape[1:])
    mirrored = response[np.abs(index)].conj()[:, rows[:, None], columns]
    return np.where((index < 0)[:, None, None], mirrored, response[np.abs(index)])
