"""An environment's state as plain values: written for JSON, and checked whole before any of it is taken."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flapgym.core.arrays import Array
from flapgym.core.wording import number, shown
from flapgym.model.turbine_model import TurbineModel
from flapgym.plant import Stepping

BIT_GENERATORS = ("MT19937", "PCG64", "PCG64DXSM", "Philox", "SFC64")
BUFFERS = {"pos": 624, "buffer_pos": 4}
"""What a generator's place in its own numbers is called, and the last one."""
Reader = Callable[[Any], Any]
"""Makes of a state's entry what it stands for, or raises one of these errors."""
DAMAGE = (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError)

_ROUNDING = 1.0 + 1e-9
"""A flap may be stuck at its stop but for this."""


def checked_state(
    given: Mapping[str, Any], own: Mapping[str, Any], model: TurbineModel, stepping: Stepping
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
    stepping : Stepping
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
    largest = float(np.finfo(stepping.precision).max)
    state: dict[str, Any] = {"elapsed": checked_whole("elapsed", given["elapsed"], stepping.intervals)}
    for name in own:
        if name not in state:
            state[name] = checked_numbers(name, given[name], np.shape(own[name]), largest)
    for row, what, limits in zip(
        (0, 1), ("angles [rad]", "rates [rad/s]"), stepping.limits(model), strict=True
    ):
        beyond = np.flatnonzero(np.abs(state["flaps"][row]) > limits * _ROUNDING)
        if beyond.size:
            raise ValueError(
                f"flaps: expected {what} within +-{number(limits[beyond[0]])}, "
                f"got {shown(float(state['flaps'][row][beyond[0]]))}"
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


def generator_state(generator: np.random.Generator) -> dict[str, Any]:
    """A generator's state as plain values: some kinds of generator keep arrays."""
    return fresh(generator.bit_generator.state)


def fresh(value: Any) -> Any:
    """A copy of nested plain values, with lists for arrays."""
    if isinstance(value, dict):
        return {name: fresh(entry) for name, entry in value.items()}
    if isinstance(value, list):
        return list(value)
    return value.tolist() if isinstance(value, np.ndarray) else value


def generator_of(state: Mapping[str, Any]) -> np.random.Generator:
    """A generator in such a state, of a kind that NumPy has."""
    kind = state["bit_generator"]
    if kind not in BIT_GENERATORS:
        raise ValueError(f"bit_generator: expected one of {', '.join(BIT_GENERATORS)}, got {shown(kind)}")
    bits = getattr(np.random, kind)()
    bits.state = _like(bits.state, state)
    return np.random.Generator(bits)


def _like(own: Any, given: Any, name: str = "generator") -> Any:
    """An entry of a generator's state, with arrays where its own has some; NumPy trusts the places in them."""
    if isinstance(own, dict):
        return {name: _like(value, given[name], name) for name, value in own.items()}
    if name in BUFFERS:
        return checked_whole(name, given, BUFFERS[name])
    if isinstance(own, np.ndarray):
        if len(given) != own.size or not all(type(each) is int for each in given):
            raise ValueError(f"{name}: expected {own.size} whole numbers, got {shown(given)}")
        return np.array(given, dtype=own.dtype)
    if type(given) is not type(own):
        raise ValueError(f"{name}: expected {type(own).__name__}, got {shown(given)}")
    return given


def read_entry(state: Mapping[str, Any], name: str, reader: Reader) -> Any:
    """An entry of a state, read; whatever is wrong with it, the error names it."""
    if not isinstance(state, Mapping) or name not in state:
        raise ValueError(f"state: expected what get_state of such an environment returned, it has no {name}")
    try:
        return reader(state[name])
    except DAMAGE as error:
        raise ValueError(f"state: {name}: damaged ({reason(error)}); take it from get_state") from None


def reason(error: Exception) -> str:
    """What is wrong with an entry, in words."""
    return str(error) if isinstance(error, ValueError) else f"{type(error).__name__}: {error}"


def each_of(count: int, reader: Reader) -> Reader:
    """Reads a list of one entry an environment."""

    def read(entries: Any) -> list[Any]:
        if not isinstance(entries, (list, tuple)) or len(entries) != count:
            raise ValueError(f"expected a list of {count}, got {shown(entries)}")
        return [reader(entry) for entry in entries]

    return read


def true_or_false(given: Any) -> bool:
    """A truth value of a state."""
    if not isinstance(given, (bool, np.bool_)):
        raise ValueError(f"expected True or False, got {shown(given)}")
    return bool(given)


def whole_seed(given: Any) -> int:
    """A seed, whichever library's whole number it is."""
    try:
        seed = -1 if isinstance(given, (bool, np.bool_)) else operator.index(given)
    except TypeError:
        seed = -1
    if seed < 0:
        raise ValueError(f"seed: expected a whole number of at least 0, got {shown(given)}")
    return seed


def seed_number(given: Any) -> int:
    """A seed of a state; -1 stands for a generator that was set."""
    if isinstance(given, bool) or not isinstance(given, (int, np.integer)) or given < -1:
        raise ValueError(f"expected a whole number, got {shown(given)}")
    return int(given)
