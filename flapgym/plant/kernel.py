"""The matrices a plant steps with, prepared once per model and shared by every plant that uses it."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from flapgym.core.arrays import Array
from flapgym.core.state_space import StateSpace
from flapgym.model.turbine_model import BLADE_OUTPUTS, TURBINE_INPUTS, TURBINE_OUTPUTS, TurbineModel
from flapgym.plant.disturbance import Disturbance, disturbance_modes, wind_modes
from flapgym.plant.frame import OutputRows, input_frame
from flapgym.plant.held import Held, held
from flapgym.plant.layout import FLAP_INPUTS
from flapgym.plant.lifted import Lifted, lift
from flapgym.plant.modal import Modal, modal_form


@dataclass(frozen=True, eq=False)
class Kernel:
    """Everything constant in the stepping of a model with k steps an action.

    Attributes
    ----------
    flap : Modal
        Flap angle and rate in components to the turbine's eight outputs.
    wind : Modal
        Wind to the eight outputs and the wind, for a wind known in advance.
    disturbance : Disturbance
        White noise to rows in the frame of the interval's start.
    rows : OutputRows
    turn : float
        Azimuth of one step [rad].
    """

    flap: Modal
    wind: Modal
    disturbance: Disturbance
    rows: OutputRows
    turn: float

    @cached_property
    def direct(self) -> Array:
        """(6, 8) flap inputs of a sample to the outputs of the same sample."""
        return np.ascontiguousarray(self.flap.D.T)

    @cached_property
    def lifted(self) -> Lifted:
        """Flap motion components over an interval to its rows, both in the frame of the interval's start."""
        return lift(
            _with_wind_row(self.flap),
            self.rows.steps,
            self.rows.matrix(self.turn),
            input_frame(self.rows.steps, self.turn),
        )

    @cached_property
    def held(self) -> Held:
        """Flaps under held accelerations, as the compiled step takes them."""
        return held(_with_wind_row(self.flap), self.rows.steps, self.rows.matrix(self.turn), self.turn)

    def packed(self, outputs: Array) -> Array:
        """Rows (intervals, count) from outputs (intervals k, 9)."""
        flat = outputs.reshape(-1, self.rows.steps * outputs.shape[1])
        return np.asarray(flat @ self.rows.matrix(self.turn).T)


def prepare(
    model: TurbineModel, steps: int, length_scale: float, every_sample: bool, single_blade: bool = False
) -> Kernel:
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
    single_blade : bool
        Of the model's clamped single blade.
    """
    if single_blade:
        model = replace(model, turbine=blade_as_turbine(model.blade))
    return _kernel(_ByContent(model), OutputRows(steps, steps if every_sample else 1), length_scale)


def blade_as_turbine(blade: StateSpace) -> StateSpace:
    """The clamped blade in the place of a turbine's collective component; the other components and the tower rest."""
    inputs = [TURBINE_INPUTS.index(name) for name in ("flap_angle_0", "flap_rate_0", "wind")]
    outputs = [TURBINE_OUTPUTS.index(f"{name}_0") for name in BLADE_OUTPUTS]
    B = np.zeros((blade.order, len(TURBINE_INPUTS)))
    C, D = (
        np.zeros((len(TURBINE_OUTPUTS), blade.order)),
        np.zeros((len(TURBINE_OUTPUTS), len(TURBINE_INPUTS))),
    )
    B[:, inputs], C[outputs], D[np.ix_(outputs, inputs)] = blade.B, blade.C, blade.D
    return StateSpace(blade.A, B, C, D, blade.time_step, TURBINE_INPUTS, TURBINE_OUTPUTS)


def fingerprint(matrices: Iterable[Array], numbers: Iterable[float]) -> str:
    """SHA-256 of numbers, to the last bit."""
    digest = hashlib.sha256()
    for matrix in matrices:
        digest.update(np.ascontiguousarray(matrix).tobytes())
    for number in numbers:
        digest.update(float(number).hex().encode())
    return digest.hexdigest()


class _ByContent:
    """A model that equals another when every number the plant uses is the same, wherever it was loaded from."""

    def __init__(self, model: TurbineModel) -> None:
        self.model = model
        system = model.turbine
        numbers = (model.wind_speed, model.rotor_speed, model.time_step, model.turbulence_intensity)
        self._key = fingerprint((system.A, system.B, system.C, system.D), numbers)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _ByContent) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)


@lru_cache(maxsize=4)
def _flap_modes(content: _ByContent) -> Modal:
    turbine = content.model.turbine
    return modal_form(turbine.select(inputs=turbine.inputs[:FLAP_INPUTS]))


@lru_cache(maxsize=4)
def _wind_modes(content: _ByContent) -> Modal:
    return wind_modes(content.model)


@lru_cache(maxsize=8)
def _disturbance_modes(content: _ByContent, length_scale: float) -> tuple[Modal, Array]:
    return disturbance_modes(content.model, length_scale)


@lru_cache(maxsize=16)
def _kernel(content: _ByContent, rows: OutputRows, length_scale: float) -> Kernel:
    noise_modes, root = _disturbance_modes(content, length_scale)
    turn = content.model.rotor_speed * content.model.time_step
    return Kernel(
        flap=_flap_modes(content),
        wind=_wind_modes(content),
        disturbance=Disturbance.of(noise_modes, root, rows, turn),
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
