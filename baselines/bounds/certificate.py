"""How low a convex metric of the moments can be, whatever the motion within its stops: weak duality, no solver's word.

A convex metric lies above its tangent at any moments, and what motion can do to a tangent is a linear programme, one
for each actuator. All that moves in it has stops, so that its value is bounded by the stops times the moduli of
whatever slope is left when the laws of motion are added with multipliers: by any multipliers. Those of an
interior-point solver are as good as they are; the bound holds for whatever they are.
"""

from __future__ import annotations

import numpy as np

from baselines.bounds.chain import solve_chain
from baselines.bounds.metrics import Metric
from baselines.bounds.optimum import padded
from baselines.bounds.response import Actuator, Response
from flapgym.core.arrays import Array


def least(metric: Metric, moments: Array, free: Array, response: Response) -> float:
    """A number that a convex metric of free + response(motion) is never below.

    Parameters
    ----------
    metric : callable
    moments : (T, 3) float
        Where the tangent is taken: the nearer to the least, the sharper the bound [N m].
    free : (T, 3) float
        Moments with actuators at rest [N m].
    response : Response
        Its intervals are those over which commands may be held: of one step, whatever a controller can do.
    """
    value, slope = metric(moments)
    pull = response.pull(padded(slope, response))
    found = value + float(np.sum(slope * (free - moments)))
    for index, each in enumerate(response.actuators):
        for blade in range(pull.shape[2]):
            found += linear_bound(pull[..., blade, index], each)
    return found


def linear_bound(pull: Array, actuator: Actuator) -> float:
    """A lower bound of the sum of pull (K, 3) times command, angle and rate, from rest and within the stops."""
    return value_of(multipliers(pull, actuator), pull, actuator)


def value_of(multiplier: Array, pull: Array, actuator: Actuator) -> float:
    """The bound that multipliers (K - 1, 2) of the laws of motion give: of angle and rate at the starts but the first.

    next state = march state + drive command, times the multipliers, adds nothing to any motion.
    """
    left = pull.copy()
    left[:-1, 0] += multiplier @ actuator.drive
    left[:-1, 1:] += multiplier @ actuator.march
    left[1:, 1:] -= multiplier
    # At the first start all is at rest.
    left[0, 1:] = 0.0
    return -float(np.sum(np.abs(left) @ actuator.limits))


def multipliers(pull: Array, actuator: Actuator) -> Array:
    """Multipliers (K - 1, 2) of the linear programme of `linear_bound`."""
    cost = pull * actuator.limits
    scale = np.abs(cost).max() or 1.0
    _, found = solve_chain(actuator, cost / scale)
    return scale * found / actuator.limits[1:]
