"""What comes in as an action: real numbers of the right shape, or one line that says what is wrong with them."""

from __future__ import annotations

from numbers import Real

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flapgym.core.arrays import Array, FloatArray
from flapgym.core.wording import shown

FLOAT32, FLOAT64 = np.dtype(np.float32), np.dtype(np.float64)
UNREADABLE = (TypeError, ValueError, OverflowError, RuntimeError)
"""What others' arrays raise that NumPy cannot read: ragged, too large, or a tensor that keeps gradients."""


def numbers(actions: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float32] | Array:
    """Actions as contiguous floats of the right shape, or an error that says what is wrong with them."""
    if actions.__class__ is np.ndarray and (actions.dtype is FLOAT32 or actions.dtype is FLOAT64):
        values: NDArray[np.float32] | Array = actions.copy()
    else:
        try:
            values = _as_floats(actions)
        except UNREADABLE:
            raise ValueError(
                f"action: expected real numbers of shape {shape}, got {shown(actions)}"
            ) from None
    if values.shape != shape:
        raise ValueError(f"action: expected shape {shape}, got {values.shape}")
    return values


def _as_floats(actions: ArrayLike) -> NDArray[np.float32] | Array:
    """Whatever holds real numbers, each of them; else one of the errors above."""
    given = np.asarray(actions)
    if not (given.dtype.kind in "iufb" or (given.dtype.kind == "O" and _all_real(given))):
        raise TypeError
    if isinstance(actions, np.ma.MaskedArray) and np.ma.is_masked(actions):
        raise TypeError
    # Copied into an array of NumPy's own type: one that was pickled, as on its way to another process, has a type that
    # equals it and is another object.
    values = np.empty(given.shape, FLOAT32 if given.dtype == FLOAT32 else FLOAT64)
    if given.dtype.itemsize > FLOAT64.itemsize:
        with np.errstate(over="ignore"):  # what no double holds becomes infinite, which the plant refuses
            given = given.astype(FLOAT64)
    values[...] = given
    return values


def _all_real(given: NDArray[np.object_]) -> bool:
    return all(isinstance(each, Real) for each in given.flat)


def refuse_not_finite(values: FloatArray, *, blades: int, flaps: int) -> None:
    """Refuse actions (blades A,) or (n, blades A) that are not finite: flaps blade by blade, then pitch."""
    finite = np.isfinite(values)
    # Twice as fast as `all`, in every step.
    if np.count_nonzero(finite) == finite.size:
        return
    first = int(np.argmin(finite))
    environment, place = divmod(first, values.shape[-1])
    of_pitch = place - blades * flaps
    blade, number = divmod(place, flaps) if of_pitch < 0 else (of_pitch, 0)
    raise ValueError(
        f"action: expected finite numbers in [-1, 1], got {values.ravel()[first]} for blade {blade + 1}"
        + (", pitch" if of_pitch >= 0 else f", flap {number + 1}" if flaps > 1 else "")
        + (f" of environment {environment}" if values.ndim > 1 and len(values) > 1 else "")
    )
