"""Seeded realisations of a shaping filter, stationary from their first sample (paper section IV.C)."""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from flapgym.core.fields import Count
from flapgym.core.state_space import StateSpace
from flapgym.core.wording import shown


def realise(
    shaping_filter: StateSpace, steps: int, rng: np.random.Generator, count: int = 1
) -> NDArray[np.float64]:
    """`count` independent signals of `steps` samples, shape (count, steps), in the unit of the filter's output.

    The first state is drawn from the stationary distribution, so there is no burn-in. Each signal takes its
    random numbers in one piece: the first of three is the one that count = 1 gives for the same generator.

    Parameters
    ----------
    shaping_filter : StateSpace
        One white input, one output, distinct eigenvalues, as `von_karman_filter` returns.
    steps, count : int
        Samples per signal and number of signals.
    rng : numpy.random.Generator
        Source of the noise.
    """
    from scipy.signal import lfilter  # half a second to import, and an environment does without this function

    for name, value in (("steps", steps), ("count", count)):
        Count(at_least=1).check(value, f"realise.{name}")
    if len(shaping_filter.inputs) != 1 or len(shaping_filter.outputs) != 1:
        raise ValueError(
            "realise.shaping_filter: expected one input and one output, got "
            f"{len(shaping_filter.inputs)} and {len(shaping_filter.outputs)}"
        )
    if not isinstance(rng, np.random.Generator):
        raise ValueError(f"realise.rng: expected a numpy.random.Generator, got {shown(rng)}")
    order = shaping_filter.order
    white = rng.standard_normal((count, order + steps))
    values, vectors = np.linalg.eig(shaping_filter.A)
    root = _square_root(shaping_filter.stationary_covariance())
    start = np.linalg.solve(vectors, root @ white[:, :order].T)
    noise_gain = np.linalg.solve(vectors, shaping_filter.B[:, 0])
    output = shaping_filter.C[0] @ vectors
    wind = shaping_filter.D[0, 0] * white[:, order:].astype(values.dtype)
    for mode, value in enumerate(values):
        past = np.hstack([start[mode][:, None], noise_gain[mode] * white[:, order:-1]])
        wind = wind + output[mode] * lfilter([1.0], [1.0, -value], past, axis=1)
    return np.ascontiguousarray(wind.real)


def _square_root(covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """A factor F with F F' = covariance; eigenvalues lost to round-off count as zero."""
    values, vectors = scipy.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.clip(values, 0.0, None)))
