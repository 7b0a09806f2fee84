"""What tells two models apart, to the last bit: checksums of every number that decides how a plant moves."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from flapgym.core.arrays import Array
from flapgym.model.turbine_model import TurbineModel


def fingerprint(matrices: Iterable[Array], numbers: Iterable[float]) -> str:
    """SHA-256 of numbers, to the last bit."""
    digest = hashlib.sha256()
    for matrix in matrices:
        digest.update(np.ascontiguousarray(matrix).tobytes())
    for number in numbers:
        digest.update(float(number).hex().encode())
    return digest.hexdigest()


def plant_fingerprint(model: TurbineModel) -> str:
    """Of a model as a plant sees it."""
    systems = (model.turbine, model.blade)
    matrices = [getattr(system, name) for system in systems for name in ("A", "B", "C", "D")]
    if model.periodic is not None:
        matrices += [getattr(model.periodic, name) for name in ("left", "core", "right", "forcing")]
    numbers = [
        model.wind_speed,
        model.rotor_speed,
        model.time_step,
        model.turbulence_intensity,
        model.rbm_rms,
    ]
    for flap in model.flaps:
        numbers += [flap.angle_limit, flap.rate_limit, flap.acceleration_limit]
    return fingerprint(matrices, numbers)


@dataclass(frozen=True)
class Numbers:
    """A model that equals another when every number a plant uses is the same, wherever it was loaded from."""

    model: TurbineModel = field(compare=False)
    fingerprint: str
    signals: tuple[tuple[str, ...], tuple[str, ...]]

    @classmethod
    def of(cls, model: TurbineModel) -> Numbers:
        """Of a model."""
        return cls(model, plant_fingerprint(model), (model.turbine.inputs, model.turbine.outputs))
