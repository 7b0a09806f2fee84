"""The step of one or many turbines as compiled code: flap actuators, modes, loads, reward and observation in one call.

Superposition (flapgym.plant.responses): the flaps' response is stepped by modes, the wind's is read from a table.
A few turbines are stepped one after another with the modes innermost, those of a batch side by side in blocks; the
tests hold the two to each other. flapgym.plant.sampled does the same with numpy; the layout is flapgym.plant.layout.

Numba keeps what it compiled until this very file changes. So the code carries an edition of all files that went into
it, and refuses to serve another.
"""

from __future__ import annotations

import math
import zlib
from pathlib import Path
from typing import Any

from numba import carray, njit, types
from numba.extending import intrinsic

from flapgym.plant.compiled_batch import step_together
from flapgym.plant.compiled_loops import OPTIONS, widest_vectors
from flapgym.plant.compiled_one import step_singly
from flapgym.plant.layout import (
    BLADE_COUNT,
    COUNT,
    FEWEST_IN_BATCH,
    LAYOUT,
    OBSERVED,
    REWARD,
    ROW,
    SAMPLE,
    STEPS,
    WIND,
)

OUTDATED = -(1 << 40)
"""Returned by code that was compiled from other files."""
EDITION = zlib.crc32(
    b"".join(
        Path(__file__).with_name(f"{name}.py").read_bytes()
        for name in ("layout", "compiled_loops", "compiled_modes", "compiled_one", "compiled_batch")
    )
)
"""Of the files that go into the compiled code beside this one."""


def kept(function: Any) -> Any:
    """Compile on demand and keep the code on disk; for this process alone where no folder takes it."""
    try:
        return njit(cache=True, **OPTIONS)(function)
    except RuntimeError:  # numba may write neither beside this file nor in the user's cache folder
        return njit(**OPTIONS)(function)


@intrinsic
def _doubles(typingctx, address):  # type: ignore[no-untyped-def]
    """Pointer to double precision from an address."""
    return _pointer_to(types.float64, address)


@intrinsic
def _singles(typingctx, address):  # type: ignore[no-untyped-def]
    """Pointer to single precision from an address."""
    return _pointer_to(types.float32, address)


@intrinsic
def _integers(typingctx, address):  # type: ignore[no-untyped-def]
    """Pointer to integers from an address."""
    return _pointer_to(types.int64, address)


def _pointer_to(kind: Any, address: Any) -> tuple[Any, Any]:
    signature = types.CPointer(kind)(address)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))

    return signature, generate


@kept
def advance_double(address, actions, observation, rows):  # type: ignore[no-untyped-def]
    """Hold actions for an interval; returns what happened.

    Parameters
    ----------
    address : int
        Address of eight integers, which are address and length of four arrays: constants of the modes, the modes and
        scratch; the doubles (flapgym.plant.layout); the responses to the wind, in the precision of the modes; samples
        (n, k, SAMPLE), of length 0 if they are not wanted. Every array handed over as such would cost 40 ns.
    actions : (n blades,) float32 or float64
        Fractions of the acceleration limit; clipped to +-1.
    observation : (n observed,) float32
        Filled.
    rows : (n ROW,) float64
        Filled.

    Returns
    -------
    int, float, float
        As flapgym.plant.interface.Quick.
    """
    widest_vectors()
    handle = carray(_integers(address), (8,))
    real = carray(_doubles(handle[0]), (handle[1],))
    state = carray(_doubles(handle[2]), (handle[3],))
    pool = carray(_doubles(handle[4]), (handle[5],))
    samples = carray(_doubles(handle[6]), (handle[7],))
    seen = carray(_singles(observation.ctypes.data), (observation.size,))
    row = carray(_doubles(rows.ctypes.data), (rows.size,))
    status = _advance(actions, real, state, pool, samples, seen, row)
    return _told(status, row)


@kept
def advance_single(address, actions, observation, rows):  # type: ignore[no-untyped-def]
    """The same with modes and responses in single precision."""
    widest_vectors()
    handle = carray(_integers(address), (8,))
    real = carray(_singles(handle[0]), (handle[1],))
    state = carray(_doubles(handle[2]), (handle[3],))
    pool = carray(_singles(handle[4]), (handle[5],))
    samples = carray(_doubles(handle[6]), (handle[7],))
    seen = carray(_singles(observation.ctypes.data), (observation.size,))
    row = carray(_doubles(rows.ctypes.data), (rows.size,))
    status = _advance(actions, real, state, pool, samples, seen, row)
    return _told(status, row)


@njit(**OPTIONS)
def _told(status, row):  # type: ignore[no-untyped-def]
    """What of the first row every step of an environment tells: an array's numbers are dear to ask for one by one."""
    if row.size < ROW:
        return status, 0.0, 0.0
    return status, row[REWARD], row[WIND]


@njit(**OPTIONS)
def _advance(actions, real, state, pool, samples, observation, rows):  # type: ignore[no-untyped-def]
    widest_vectors()
    n, k = int(state[COUNT]), int(state[STEPS])
    if state[LAYOUT] != EDITION:
        return OUTDATED
    if actions.size != n * int(state[BLADE_COUNT]):
        return -1
    # Beyond the end of an array lies somebody else's memory.
    if observation.size != n * int(state[OBSERVED]) or rows.size != n * ROW:
        return -1
    if samples.size != 0 and samples.size != n * k * SAMPLE:
        return -1
    for i in range(actions.size):
        if not abs(actions[i]) < math.inf:
            return -2 - i
    if n < FEWEST_IN_BATCH:
        return step_singly(actions, real, state, pool, samples, observation, rows)
    return step_together(actions, real, state, pool, samples, observation, rows)
