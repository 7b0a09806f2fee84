"""Paired comparison of two agents on the same realisations, with a bootstrap confidence interval."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import bootstrap

CONFIDENCE = 0.95
RESAMPLES = 9999
SMALLEST_CORRECTED = 10
"""Fewer realisations than this get the percentile interval: the bias correction then rests on too few points."""


@dataclass(frozen=True)
class Estimate:
    """A mean and its 95 % interval; None where one realisation gives no interval."""

    mean: float
    low: float | None
    high: float | None


def paired_change(values: ArrayLike, reference: ArrayLike) -> Estimate:
    """Mean over realisations of values / reference - 1, and its interval over resampled realisations.

    Blades of one realisation share the wind, so they are averaged first and only realisations are resampled.
    The interval is the bias-corrected one (BCa) from ten realisations on and the percentile one below; five
    realisations cover the truth in clearly less than 95 % of cases, so theirs is indicative.

    Parameters
    ----------
    values, reference : (N,) or (N, blades) array_like
        A positive metric of each realisation under the agent and under the reference.
    """
    values, reference = np.asarray(values, dtype=float), np.asarray(reference, dtype=float)
    if values.shape != reference.shape or values.size == 0:
        raise ValueError(f"paired_change: shapes {values.shape} and {reference.shape} are no pairs")
    with np.errstate(divide="ignore", invalid="ignore"):
        # No wind loads nothing: nought against nought is no change.
        ratio = np.where(values == reference, 1.0, values / reference)
    change = ratio.reshape(ratio.shape[0], -1).mean(axis=1) - 1.0
    mean = float(change.mean())
    if change.size == 1:
        return Estimate(mean, None, None)
    if np.ptp(change) <= 1e-12 * max(1.0, abs(mean)):
        return Estimate(mean, mean, mean)
    interval = bootstrap(
        (change,),
        np.mean,
        confidence_level=CONFIDENCE,
        n_resamples=RESAMPLES,
        method="BCa" if change.size >= SMALLEST_CORRECTED else "percentile",
        rng=np.random.default_rng(0),
    ).confidence_interval
    return Estimate(mean, float(interval.low), float(interval.high))
