"""Checks of every agent, wherever it comes from: its header and its numbers.

Each check returns the value in its canonical type, or raises a ValueError that begins with the field.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, nullcontext
from typing import Any

import numpy as np

from flapgym.control.agent import Agent, OpenLoop
from flapgym.core.arrays import Array
from flapgym.core.wording import shown

BLADE_QUANTITIES = ("rbm", "flap_angle", "flap_rate", "tip_deflection")
"""Observations of which each blade has one."""
LONGEST_HOLD = 100
"""Plant steps for which an action may be held."""
# Tables, spreadsheets, terminals and file names take these as they are.
_NAME = re.compile(r"\w(?:[\w +\-.,()%=]{0,58}[\w)%])?")


@contextmanager
def error_prefix(name: str) -> Iterator[None]:
    """Put an agent's name, once, before what is wrong with it or with what it is given."""
    try:
        yield
    except ValueError as error:
        prefix = f"agent {name}: "
        raise ValueError(str(error) if str(error).startswith(prefix) else f"{prefix}{error}") from None


@contextmanager
def named_errors(name: object) -> Iterator[None]:
    """Check an agent's name, and put it before what is wrong with the rest of it."""
    try:
        own = check_name(name)
    except ValueError as error:
        raise ValueError(f"agent: {error}") from None
    with error_prefix(own):
        yield


def check_name(name: object) -> str:
    """Refuse what no table, spreadsheet, terminal or file name takes for an agent's name."""
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise ValueError(
            "name: expected letters, digits, spaces and any of _ + - . , ( ) % =, a letter or digit first, at most "
            f"60 in all, got {shown(name)}"
        )
    if name == OpenLoop.name:
        raise ValueError(f"name: expected another than {name}, the flaps at rest")
    return name


def check_steps_per_action(steps: object) -> int:
    """Refuse what is no whole number of plant steps, at most ``LONGEST_HOLD``."""
    if isinstance(steps, bool) or not isinstance(steps, int | np.integer) or not 1 <= steps <= LONGEST_HOLD:
        raise ValueError(
            f"steps_per_action: expected a whole number from 1 to {LONGEST_HOLD}, got {shown(steps)}"
        )
    return int(steps)


def check_names(names: object, known: Iterable[str], field: str) -> tuple[str, ...]:
    """Refuse what is no list of known names, each once."""
    listed = ", ".join(known := tuple(known))
    if not isinstance(names, list | tuple) or not names:
        raise ValueError(f"{field}: expected a list of some of {listed}, got {shown(names)}")
    for name in names:
        if not isinstance(name, str) or name not in known:
            raise ValueError(f"{field}: expected some of {listed}, got {shown(name)}")
    if len(set(names)) < len(names):
        raise ValueError(f"{field}: expected each name once, got {', '.join(names)}")
    return tuple(names)


def check_hash(model_hash: object) -> str | None:
    """Refuse what is neither a text nor None."""
    if model_hash is not None and not isinstance(model_hash, str):
        raise ValueError(f"model_hash: expected a text or none, got {shown(model_hash)}")
    return model_hash


def check_numbers(value: Any, field: str, dimensions: int) -> Array:
    """The finite numbers of a vector or matrix in double precision."""
    try:
        array = np.asarray(value)
    except ValueError:  # rows of different lengths
        array = np.empty(0, dtype=object)
    if array.dtype.kind not in "fiu" or array.ndim != dimensions:
        kind = "a row" if dimensions == 1 else "rows"
        raise ValueError(f"{field}: expected {kind} of numbers, got {shown(value)}")
    if not np.isfinite(array).all():
        raise ValueError(f"{field}: expected finite numbers, got NaN or infinity")
    return array.astype(float)


def check_agent(agent: Agent, observable: Iterable[str]) -> None:
    """Refuse an agent of whatever class that no comparison could run."""
    with named_errors(agent.name) if not isinstance(agent, OpenLoop) else nullcontext():
        check_names(agent.observe, observable, "observe")
        check_steps_per_action(agent.steps_per_action)
        check_hash(agent.model_hash)
