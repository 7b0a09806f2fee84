"""What a turbine's state must be: checked here for every plant, before any of it is taken."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flapgym.core.arrays import Array
from flapgym.core.wording import number, shown
from flapgym.model.turbine_model import TurbineModel
from flapgym.plant.interface import Setup

_ROUNDING = 1.0 + 1e-9
"""A flap may be stuck at its stop but for this."""


def checked_state(
    given: Mapping[str, Any], own: Mapping[str, Any], model: TurbineModel, setup: Setup
) -> dict[str, Any]:
    """A state of one turbine that a plant can take: compiled code trusts it.

    Parameters
    ----------
    given : mapping
        What `Plant.get_state` gave.
    own : mapping
        What it gives for the plant that is to take it: the entries there have to be, and their shapes.
    model : TurbineModel
        Its stops bound the flaps.
    setup : Setup
        Its intervals bound the time, its precision every number.

    Raises
    ------
    ValueError
        If an entry is missing or is not what it must be; the message names it.
    """
    if not isinstance(given, Mapping):
        raise ValueError(f"expected the entries {', '.join(own)}, got {shown(given)}")
    missing = [name for name in own if name not in given]
    if missing:
        raise ValueError(f"{missing[0]}: expected the entries {', '.join(own)}, it is missing")
    largest = float(np.finfo(setup.precision).max)
    state: dict[str, Any] = {"elapsed": checked_whole("elapsed", given["elapsed"], setup.intervals)}
    for name in own:
        if name not in state:
            state[name] = checked_numbers(name, given[name], np.shape(own[name]), largest)
    for row, what, limit in (
        (0, "angles [rad]", model.flap_angle_limit),
        (1, "rates [rad/s]", model.flap_rate_limit),
    ):
        if np.abs(state["flaps"][row]).max() > limit * _ROUNDING:
            raise ValueError(
                f"flaps: expected {what} within +-{number(limit)}, got {shown(state['flaps'][row].tolist())}"
            )
    return state


def checked_whole(name: str, given: Any, largest: int) -> int:
    """A whole number from 0 to the largest."""
    if isinstance(given, bool) or not isinstance(given, (int, np.integer)) or not 0 <= given <= largest:
        raise ValueError(f"{name}: expected a whole number from 0 to {largest}, got {shown(given)}")
    return int(given)


def checked_observation(given: Any, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """An environment's observation, kept as plain numbers."""
    largest = float(np.finfo(np.float32).max)
    return checked_numbers("observation", given, shape, largest).astype(np.float32)


def checked_numbers(name: str, given: Any, shape: tuple[int, ...], largest: float = np.inf) -> Array:
    """Finite numbers of a shape, float64: no texts, no truth values, nothing stretched to fit."""
    try:
        values = np.asarray(given)
    except ValueError:  # rows of unequal lengths
        values = np.empty(0, dtype=object)
    if values.dtype.kind not in "iuf" or values.shape != shape:
        raise ValueError(f"{name}: expected numbers of shape {shape}, got {shown(given)}")
    if not (np.isfinite(values).all() and np.all(np.abs(values) <= largest)):
        raise ValueError(f"{name}: expected finite numbers, got {shown(given)}")
    return values.astype(float)
