"""What a life adds up to: how often the wind blows how fast, and damage over wind speeds, seeds and blades."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from flapgym.core.arrays import Array
from flapgym.core.fields import Choice, Numbers, Quantity
from flapgym.core.wording import number, shown
from flapgym.evaluation.bootstrap import CONFIDENCE, RESAMPLES, Estimate
from flapgym.wind.iec import REFERENCE_SPEEDS

WEIBULL_SHAPE = 2.0
"""Of the mean wind over ten minutes: a Rayleigh distribution (IEC 61400-1:2005, equation 8)."""
MEAN_SHARE = 0.2
"""Of the reference wind speed of a turbine class, its yearly mean (the same, equation 9)."""
SINGLE_HALF_WIDTH = 1.0
"""Of the bin of a wind speed that stands alone [m/s]: bins of 2 m/s are fine enough (the same, 7.4)."""
YEAR = 365.25 * 86_400.0
"""[s]"""


@dataclass(frozen=True)
class WindBin:
    """A part of the wind's distribution for which one wind speed stands.

    Attributes
    ----------
    wind_speed, low, high : float
        What stands for it, and its ends [m/s].
    probability : float
        Share of the lifetime with wind between its ends.
    """

    wind_speed: float
    low: float
    high: float
    probability: float


def class_mean(wind_class: str) -> float:
    """Yearly mean wind speed at hub height of a turbine class "I", "II" or "III" [m/s]; refuses any other."""
    Choice(tuple(REFERENCE_SPEEDS)).check(wind_class, "class_mean.wind_class")
    return MEAN_SHARE * REFERENCE_SPEEDS[wind_class]


def wind_bins(wind_speeds: Sequence[float], mean: float) -> tuple[WindBin, ...]:
    """Bins around wind speeds, ends halfway between them, those at either side as wide outwards as inwards.

    Parameters
    ----------
    wind_speeds : sequence of float
        Rising [m/s].
    mean : float
        Of the wind's distribution [m/s].

    Raises
    ------
    ValueError
        If the wind speeds do not rise, or a number is not positive.
    """
    speeds = Numbers(axes=1, above=0.0).check(wind_speeds, "wind_bins.wind_speeds")
    Quantity("speed", above=0.0).check(mean, "wind_bins.mean")
    if not speeds.size or np.any(np.diff(speeds) <= 0.0):
        raise ValueError(
            f"wind_bins.wind_speeds: expected one or more, each above the last, got {shown(speeds.tolist())}"
        )
    inner = 0.5 * (speeds[:-1] + speeds[1:])
    low = speeds[0] - (inner[0] - speeds[0] if inner.size else SINGLE_HALF_WIDTH)
    high = speeds[-1] + (speeds[-1] - inner[-1] if inner.size else SINGLE_HALF_WIDTH)
    ends = [max(0.0, float(low)), *inner.tolist(), float(high)]
    below = [weibull_share(end, mean) for end in ends]
    return tuple(
        WindBin(float(speed), *between, after - before)
        for speed, between, (before, after) in zip(speeds, pairwise(ends), pairwise(below), strict=True)
    )


def weibull_share(wind_speed: float, mean: float, shape: float = WEIBULL_SHAPE) -> float:
    """Share of the time with less wind than a speed: 1 - exp(-(V/A)^k), whose mean is A Gamma(1 + 1/k).

    Raises
    ------
    ValueError
        If the speed is negative, or mean or shape are not positive.
    """
    Quantity("speed", at_least=0.0).check(wind_speed, "weibull_share.wind_speed")
    Quantity("speed", above=0.0).check(mean, "weibull_share.mean")
    Quantity("number", above=0.0).check(shape, "weibull_share.shape")
    scale = mean / math.gamma(1.0 + 1.0 / shape)
    return -math.expm1(-((wind_speed / scale) ** shape))


def lifetime_load(loads: Sequence[Array], probabilities: Sequence[float], slope: float) -> float:
    """Damage-equivalent load of a life: (sum_b p_b mean(L_b^m))^(1/m), the mean over seeds and blades of a bin.

    Its cycles come at the loads' own frequency, 1 Hz, all the life long, also while the turbine stands still.

    Parameters
    ----------
    loads : sequence of (N, P) float
        Of each bin, damage-equivalent loads of N seeds at P places.
    probabilities : sequence of float
        Share of the life of each bin.
    slope : float
        S-N slope m.

    Raises
    ------
    ValueError
        If there are not as many probabilities as bins, or a number is negative.
    """
    parts, largest = bin_damage(loads, probabilities, slope)
    return largest * float(parts.sum()) ** (1.0 / slope)


def bin_damage(loads: Sequence[Array], probabilities: Sequence[float], slope: float) -> tuple[Array, float]:
    """Damage of each bin (bins,) over the m-th power of the largest load, and that load; as `lifetime_load`."""
    Quantity("number", above=0.0).check(slope, "lifetime_load.slope")
    shares = Numbers(axes=1, at_least=0.0, at_most=1.0).check(probabilities, "lifetime_load.probabilities")
    if len(loads) != len(shares) or not len(loads):
        raise ValueError(f"lifetime_load.loads: expected those of {len(shares)} bins, got {len(loads)}")
    checked = [
        Numbers(at_least=0.0).check(each, f"lifetime_load.loads[{place}]") for place, each in enumerate(loads)
    ]
    # Powers of the ratio to the largest: L^10 in N m would waste the exponent.
    largest = max(float(each.max()) for each in checked) or 1.0
    return shares * [np.mean((each / largest) ** slope) for each in checked], largest


def lifetime_change(
    loads: Sequence[Array], reference: Sequence[Array], probabilities: Sequence[float], slope: float
) -> Estimate:
    """Change of the lifetime load against that under open loop, and its interval over resampled seeds.

    Seeds are resampled within each bin, an agent's and open loop's together, blades of a seed together. The interval is
    the percentile one.

    Parameters
    ----------
    loads, reference : sequence of (N, P) float
        As of `lifetime_load`, under an agent and under open loop on the same seeds.
    probabilities, slope
        As of `lifetime_load`.

    Raises
    ------
    ValueError
        As `lifetime_load`, and if the loads are no pairs, or there is nothing to compare them with.
    """
    ours, theirs = (lifetime_load(each, probabilities, slope) for each in (loads, reference))
    if [np.shape(each) for each in loads] != [np.shape(each) for each in reference]:
        raise ValueError("lifetime_change.reference: expected the shapes of the loads, got others")
    if ours > 0.0 and theirs == 0.0:
        raise ValueError(f"lifetime_change.reference: expected a positive load beside {number(ours)}, got 0")
    mean = 0.0 if ours == theirs else ours / theirs - 1.0
    if max(len(each) for each in loads) == 1:
        return Estimate(mean, None, None)
    if all(np.array_equal(one, other) for one, other in zip(loads, reference, strict=True)):
        return Estimate(mean, mean, mean)
    unit, rng = max(float(np.max(each)) for each in reference) or 1.0, np.random.default_rng(0)
    damage = np.zeros((2, RESAMPLES))
    for one, other, share in zip(loads, reference, probabilities, strict=True):
        count = len(one)
        # How often each seed is drawn: all that a sum takes of a draw.
        drawn = rng.multinomial(count, np.full(count, 1.0 / count), size=RESAMPLES) / count
        for row, each in enumerate((one, other)):
            damage[row] += share * (drawn @ np.mean((each / unit) ** slope, axis=1))
    with np.errstate(divide="ignore", invalid="ignore"):
        changes = (damage[0] / damage[1]) ** (1.0 / slope) - 1.0
    low, high = np.quantile(changes, [0.5 * (1.0 - CONFIDENCE), 0.5 * (1.0 + CONFIDENCE)])
    return Estimate(mean, float(low), float(high))
