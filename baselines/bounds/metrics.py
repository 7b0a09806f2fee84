"""The scored metrics as functions of the moments, with their slopes; and what bounds fatigue from below and is convex.

Rainflow counting knows, for every pair of levels, how often a history swings from one to the other (Rychlik, Int. J.
Fatigue 9 (1987) 119): a cycle it takes out is a swing and the swing back, and in ASTM's count what does not come back
is half a cycle. A range's m-th power, m > 1, is a sum of positive shares of the pairs of levels within it. Between
instants chosen in advance, a history swings at least as often across a pair of levels as there are differences of
successive instants that span it: two that span it alike have a swing back between them. So half a cycle for each
difference is never more than the rainflow damage, whatever the instants and the history. The equivalent load of such a
chain is a norm of differences: convex, which rainflow counting is not. So is that of any mixture of chains.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import rainflow

from flapgym.core.arrays import Array, IntArray
from flapgym.evaluation.metrics import EQUIVALENT_FREQUENCY, FATIGUE_SLOPE

Metric = Callable[[Array], tuple[float, Array]]
"""Value and slope (T, 3) at moments (T, 3) of three blades [N m]."""


def rms(reference: Array) -> Metric:
    """Mean over blades of the rms over that of the reference moments (T, 3)."""
    still = np.sqrt(np.mean(reference**2, axis=0))

    def of(moments: Array) -> tuple[float, Array]:
        value = np.sqrt(np.mean(moments**2, axis=0))
        safe = np.where(value > 0.0, value, 1.0)
        return float(np.mean(value / still)), moments / (moments.size * safe * still)

    return of


def equivalent_load(reference: Array, time_step: float) -> Metric:
    """Mean over blades of the damage-equivalent load over that of the reference moments (T, 3)."""
    still = [_rainflow(each, time_step)[0] for each in reference.T]

    def of(moments: Array) -> tuple[float, Array]:
        found = [_rainflow(each, time_step) for each in moments.T]
        slopes = [slope / load for (_, slope), load in zip(found, still, strict=True)]
        values = [value / load for (value, _), load in zip(found, still, strict=True)]
        return float(np.mean(values)), np.stack(slopes, axis=1) / len(still)

    return of


@dataclass(frozen=True, eq=False)
class Swings:
    """Weighted pairs of instants of one blade: a flow of at most one through time, halved (`swing_load`).

    Attributes
    ----------
    first, second : (n,) int
        Samples.
    weight : (n,) float
    """

    first: IntArray
    second: IntArray
    weight: Array

    def mixed(self, other: Swings, share: float) -> Swings:
        """So large a share of others with the rest of these."""
        first = np.concatenate([self.first, other.first])
        second = np.concatenate([self.second, other.second])
        weight = np.concatenate([(1.0 - share) * self.weight, share * other.weight])
        (first, second), place = np.unique(np.stack([first, second]), axis=1, return_inverse=True)
        return Swings(first, second, np.bincount(place.ravel(), weight).astype(float))


def swing_load(reference: Array, time_step: float, swings: Sequence[Swings]) -> Metric:
    """Mean over blades of the equivalent load of weighted swings between fixed instants, over the reference's DEL.

    Never more than `equivalent_load`, and convex.
    """
    still = [_rainflow(each, time_step)[0] for each in reference.T]

    def of(moments: Array) -> tuple[float, Array]:
        found = [
            _equivalent(history, each.first, each.second, each.weight, time_step)
            for history, each in zip(moments.T, swings, strict=True)
        ]
        values = [value / load for (value, _), load in zip(found, still, strict=True)]
        slopes = [slope / load for (_, slope), load in zip(found, still, strict=True)]
        return float(np.mean(values)), np.stack(slopes, axis=1) / len(still)

    return of


def worst_chain(history: Array) -> Swings:
    """The chain of half cycles that does most damage in a history (T,)."""
    places = _turning_places(history)
    values = history[places]
    scale = np.ptp(values) or 1.0
    # The most damage of a chain that ends at each turning point; the two ends need not be in it.
    most, before = np.zeros(values.size), np.full(values.size, -1)
    for end in range(1, values.size):
        candidates = most[:end] + 0.5 * (np.abs(values[:end] - values[end]) / scale) ** FATIGUE_SLOPE
        before[end] = int(np.argmax(candidates))
        most[end] = candidates[before[end]]
    chain = [int(np.argmax(most))]
    while before[chain[-1]] >= 0:
        chain.append(int(before[chain[-1]]))
    instants = places[chain[::-1]]
    return Swings(instants[:-1], instants[1:], np.full(instants.size - 1, 0.5))


def _rainflow(history: Array, time_step: float) -> tuple[float, Array]:
    """Damage-equivalent load of a history (T,) and its slope there."""
    places = _turning_places(history)
    cycles = [(start, end, count) for _, _, count, start, end in rainflow.extract_cycles(history[places])]
    if places.size == 2:  # the library counts only what turns back
        cycles = [(0, 1, 0.5)]
    if not cycles:
        return 0.0, np.zeros_like(history)
    starts, ends, counts = (np.array(each) for each in zip(*cycles, strict=True))
    return _equivalent(history, places[starts], places[ends], counts, time_step)


def _equivalent(
    history: Array, first: IntArray, second: IntArray, counts: Array, time_step: float
) -> tuple[float, Array]:
    """(sum of counts |y_first - y_second|^m / periods)^(1/m) of a history, and its slope (T,)."""
    slope, span = np.zeros_like(history), history[first] - history[second]
    largest = np.abs(span).max(initial=0.0)
    if largest == 0.0:
        return 0.0, slope
    m, share = FATIGUE_SLOPE, np.abs(span) / largest
    damage = float(np.sum(counts * share**m))
    value = largest * (damage / (EQUIVALENT_FREQUENCY * history.size * time_step)) ** (1.0 / m)
    # dL/dy = L (counts |span|^(m - 1) sign) / sum: powers of the share, as S^10 in N m would waste the exponent.
    pull = value / (damage * largest) * counts * share ** (m - 1.0) * np.sign(span)
    np.add.at(slope, first, pull)
    np.add.at(slope, second, -pull)
    return float(value), slope


def _turning_places(history: Array) -> IntArray:
    """Indices of the first and last value and of the extremes between; of equal neighbours the first."""
    distinct = np.flatnonzero(np.concatenate([[True], np.diff(history) != 0.0]))
    if distinct.size < 3:
        return distinct
    direction = np.sign(np.diff(history[distinct]))
    inner = direction[:-1] != direction[1:]
    return distinct[np.concatenate([[True], inner, [True]])]
