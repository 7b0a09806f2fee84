"""What every controller does on the scored realisations, in batches that an interrupt leaves on disk."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields

import numpy as np

from baselines.paper.cache import Cache, fingerprint
from baselines.tuning import LinearController
from flapgym.aeroelastic.model import TurbineModel
from flapgym.control import OpenLoop
from flapgym.evaluation import SCORED_SEED, Estimate, Metrics, measure, paired_change, simulate

BATCH = 25
"""Realisations simulated side by side; 0.3 GB."""

CHANGES = {"rbm_rms": "RBM rms", "tip_rms": "tip rms", "rbm_del": "RBM DEL", "tower_rms": "tower rms"}


@dataclass(frozen=True)
class Score:
    """A controller against open loop on the same realisations.

    Attributes
    ----------
    changes : dict of str to Estimate
        Paired change of each metric of ``CHANGES``, a fraction.
    flap_angle_max : float
        Over all realisations [rad].
    touching : float
        Share of the realisations in which a flap meets the stop of its angle.
    flap_rate_max, flap_travel : float
        Largest rate, and path of a flap per second [rad/s].
    """

    changes: dict[str, Estimate]
    flap_angle_max: float
    touching: float
    flap_rate_max: float
    flap_travel: float


def batches(realisations: int) -> list[range]:
    """Seeds of the scored realisations, a batch at a time."""
    last = SCORED_SEED + realisations
    return [range(first, min(first + BATCH, last)) for first in range(SCORED_SEED, last, BATCH)]


def metrics(
    agent: LinearController | OpenLoop,
    model: TurbineModel,
    realisations: int,
    duration: float,
    cache: Cache,
    advanced: Callable[[str], None],
) -> Metrics:
    """Metrics of an agent on so many realisations of a duration [s]; `advanced` is told of every batch."""
    mark = "open" if isinstance(agent, OpenLoop) else fingerprint(agent.system.A, agent.system.B, agent.system.C,
                                                                  agent.system.D, agent.start)  # fmt: skip
    parts = []
    for seeds in batches(realisations):
        settings = {"agent": mark, "first": seeds[0], "count": len(seeds), "duration": duration}

        def make(seeds: Sequence[int] = seeds) -> dict[str, np.ndarray]:
            found = measure(simulate(agent, model, seeds, duration))
            return {each.name: getattr(found, each.name) for each in fields(Metrics)}

        parts.append(cache.arrays(f"score-{agent.name}", settings, make))
        advanced(agent.name)
    return Metrics(
        **{each.name: np.concatenate([part[each.name] for part in parts]) for each in fields(Metrics)}
    )


def score(ours: Metrics, open_loop: Metrics, model: TurbineModel) -> Score:
    """The agent's score."""
    stop = model.flap_angle_limit * (1.0 - 1e-6)
    return Score(
        changes={name: paired_change(getattr(ours, name), getattr(open_loop, name)) for name in CHANGES},
        flap_angle_max=float(ours.flap_angle_max.max()),
        touching=float((ours.flap_angle_max >= stop).mean()),
        flap_rate_max=float(ours.flap_rate_max.max()),
        flap_travel=float(ours.flap_travel.mean()),
    )
