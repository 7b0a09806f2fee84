"""Paired comparison of two agents on the same realisations, with a bootstrap confidence interval."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import bootstrap

from flapgym.core.arrays import Array
from flapgym.core.fields import Numbers
from flapgym.core.wording import number
from flapgym.evaluation.metrics import FATIGUE_SLOPE, summed_damage_load

CONFIDENCE = 0.95
RESAMPLES = 9999
SMALLEST_CORRECTED = 10
"""Fewer realisations than this get the percentile interval: the bias correction then rests on too few points."""

Statistic = Callable[..., Array]
"""Of paired samples along `axis`, as `scipy.stats.bootstrap` takes it."""


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

    Raises
    ------
    ValueError
        If they are no pairs, or an entry is negative, not finite, or has nothing to be compared with.
    """
    ours, theirs = _pairs("paired_change", values, reference)
    with np.errstate(divide="ignore", invalid="ignore"):
        # No wind loads nothing: nought against nought is no change.
        ratio = np.where(ours == theirs, 1.0, ours / theirs)
    return _estimate(
        (ratio.mean(axis=1) - 1.0,), lambda change, axis=-1: np.asarray(np.mean(change, axis=axis))
    )


def summed_damage_change(values: ArrayLike, reference: ArrayLike, slope: float = FATIGUE_SLOPE) -> Estimate:
    """Change of the damage-equivalent load of all realisations together, and its interval over resampled ones.

    A lifetime sums damage, not ratios: (sum L_i^m / sum L_ref,i^m)^(1/m) - 1 over realisations and blades, in which
    the realisations of the largest loads decide. `paired_change` gives each the same weight.

    Parameters
    ----------
    values, reference : (N,) or (N, blades) array_like
        Damage-equivalent loads of histories of one length.
    slope : float
        S-N slope m.

    Raises
    ------
    ValueError
        As `paired_change`.
    """
    ours, theirs = _pairs("summed_damage_change", values, reference)
    # Of the blades first, so that a realisation is resampled whole.
    loads = tuple(summed_damage_load(each, slope, axis=1) for each in (ours, theirs))

    def change(agent: Array, still: Array, axis: int = -1) -> Array:
        above, below = (summed_damage_load(each, slope, axis=axis) for each in (agent, still))
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(above == below, 0.0, above / below - 1.0)

    return _estimate(loads, change)


def _pairs(name: str, values: ArrayLike, reference: ArrayLike) -> tuple[Array, Array]:
    """Both as (N, blades), or an error that names what is wrong."""
    metric = Numbers(at_least=0.0)
    ours, theirs = metric.check(values, f"{name}: values"), metric.check(reference, f"{name}: reference")
    if ours.shape != theirs.shape or ours.ndim not in (1, 2):
        raise ValueError(
            f"{name}: shapes {ours.shape} and {theirs.shape} are no pairs of (N,) or (N, blades)"
        )
    lost = (theirs == 0.0) & (ours > 0.0)
    if lost.any():
        raise ValueError(
            f"{name}: reference: expected a positive number beside a value above 0, got 0 beside "
            f"{number(ours[lost][0])}"
        )
    count = len(ours)
    return ours.reshape(count, -1), theirs.reshape(count, -1)


def _estimate(samples: tuple[Array, ...], statistic: Statistic) -> Estimate:
    """The statistic of paired samples of N realisations, and its interval."""
    mean, count = float(statistic(*samples)), samples[0].size
    if count == 1:
        return Estimate(mean, None, None)
    each = statistic(*(sample[:, None] for sample in samples))
    if np.ptp(each) <= 1e-12 * max(1.0, abs(mean)):
        return Estimate(mean, mean, mean)
    interval = bootstrap(
        samples,
        statistic,
        paired=True,
        confidence_level=CONFIDENCE,
        n_resamples=RESAMPLES,
        method="BCa" if count >= SMALLEST_CORRECTED else "percentile",
        rng=np.random.default_rng(0),
    ).confidence_interval
    return Estimate(mean, float(interval.low), float(interval.high))
