"""The matrices a plant steps with, prepared once per model and shared by every plant that uses it."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from flapgym.aeroelastic.model import TurbineModel
from flapgym.plant.disturbance import Disturbance, disturbance_modes
from flapgym.plant.frame import OutputRows, input_frame
from flapgym.plant.lifted import Lifted, lift
from flapgym.plant.modal import Modal, modal_form
from flapgym.state_space import Array

FLAP_INPUTS = 6
"""The turbine's leading inputs: flap angle and rate, three components each."""


@dataclass(frozen=True, eq=False)
class Kernel:
    """Everything constant in the stepping of a model with k steps an action.

    Attributes
    ----------
    flap : Lifted
        Flap motion components in the frame of the start to rows; the wind's rows are zero.
    direct : (6, 8) float
        Flap inputs of a sample to the outputs of the same sample.
    disturbance : Disturbance
    rows : OutputRows
    turn : float
        Azimuth of one step [rad].
    """

    flap: Lifted
    direct: Array
    disturbance: Disturbance
    rows: OutputRows
    turn: float


def prepare(model: TurbineModel, steps: int, length_scale: float, every_sample: bool) -> Kernel:
    """Kernel of a model; what was prepared for the same numbers before is used again.

    Parameters
    ----------
    model : TurbineModel
    steps : int
        Plant steps k per action.
    length_scale : float
        Of the turbulence [m].
    every_sample : bool
        Keep tip deflection, tower and wind at every sample, not only at the last one of an interval.
    """
    return _kernel(_ByContent(model), OutputRows(steps, steps if every_sample else 1), length_scale)


class _ByContent:
    """A model that equals another when every number the plant uses is the same, wherever it was loaded from."""

    def __init__(self, model: TurbineModel) -> None:
        self.model = model
        system = model.turbine
        digest = hashlib.sha256()
        for matrix in (system.A, system.B, system.C, system.D):
            digest.update(np.ascontiguousarray(matrix).tobytes())
        for number in (model.wind_speed, model.rotor_speed, model.time_step, model.turbulence_intensity):
            digest.update(float(number).hex().encode())
        self._key = digest.digest()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _ByContent) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)


@lru_cache(maxsize=4)
def _flap_modes(content: _ByContent) -> Modal:
    turbine = content.model.turbine
    return modal_form(turbine.select(inputs=turbine.inputs[:FLAP_INPUTS]))


@lru_cache(maxsize=8)
def _disturbance_modes(content: _ByContent, length_scale: float) -> tuple[Modal, Array]:
    return disturbance_modes(content.model, length_scale)


@lru_cache(maxsize=16)
def _kernel(content: _ByContent, rows: OutputRows, length_scale: float) -> Kernel:
    modes = _flap_modes(content)
    wind_modes, root = _disturbance_modes(content, length_scale)
    turn = content.model.rotor_speed * content.model.time_step
    return Kernel(
        flap=lift(_with_wind_row(modes), rows.steps, rows.matrix(turn), input_frame(rows.steps, turn)),
        direct=np.ascontiguousarray(modes.D.T),
        disturbance=Disturbance.of(wind_modes, root, rows, turn),
        rows=rows,
        turn=turn,
    )


def _with_wind_row(flap: Modal) -> Modal:
    """The flap's response with a ninth output, the wind, on which the flap has no effect."""
    empty: dict[str, Any] = {
        "read": np.vstack([flap.read, np.zeros((1, flap.order))]),
        "D": np.vstack([flap.D, np.zeros((1, FLAP_INPUTS))]),
    }
    return replace(flap, **empty, outputs=(*flap.outputs, "wind"))
