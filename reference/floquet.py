"""Stability of the turbine over a revolution: Floquet multipliers of its periodic form."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flapgym.model.turbine_model import TurbineModel


def floquet_multipliers(model: TurbineModel) -> NDArray[np.complex128]:
    """Multipliers (n,) of one revolution, largest modulus first; the turbine is stable if all are below one.

    The revolution is taken as the nearest whole number of time steps (734 on the shipped turbine), which changes the
    azimuths by less than half a step. Equal blades: the powers of the constant matrix's eigenvalues.
    """
    steps = round(2.0 * np.pi / (model.rotor_speed * model.time_step))
    A, n = model.turbine.A, model.turbine.order
    if model.periodic is None:
        values = np.linalg.eigvals(A).astype(complex) ** steps
    else:
        left, right = model.periodic.left[:n], model.periodic.right[:, :n]
        product = np.eye(n)
        for core in model.periodic.core_at(2.0 * np.pi * np.arange(steps) / steps):
            product = A @ product + left @ (core @ (right @ product))
        values = np.linalg.eigvals(product).astype(complex)
    return values[np.argsort(-np.abs(values))]
