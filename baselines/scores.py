"""What every controller does on the scored realisations, in batches that an interrupt leaves on disk."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from typing import Any, TypeVar

import numpy as np
from scipy.stats import bootstrap

from baselines.cache import Cache, fingerprint
from baselines.tuning import LinearController
from flapgym.control import Agent, Policy, PredictiveController
from flapgym.core.arrays import Array
from flapgym.evaluation import (
    SCORED_SEED,
    Estimate,
    Metrics,
    Record,
    paired_change,
    simulate,
    simulate_together,
)
from flapgym.evaluation.bootstrap import CONFIDENCE, SMALLEST_CORRECTED
from flapgym.model.turbine_model import TurbineModel

Data = TypeVar("Data")

TOGETHER = 6700.0
"""Seconds of wind simulated side by side, 25 realisations of 20 L/U; 0.3 GB."""

SIDE_BY_SIDE = 4
"""Agents simulated together: so many times the memory."""

CHANGES = {"rbm_rms": "RBM rms", "tip_rms": "tip rms", "rbm_del": "RBM DEL", "tower_rms": "tower rms"}


@dataclass(frozen=True)
class Trial:
    """Realisations to run an agent on.

    Attributes
    ----------
    name : str
        Begins the names of its files in the cache.
    realisations : int
    duration : float
        Of each [s].
    settings : mapping
        Further keywords of the environment.
    """

    name: str
    realisations: int
    duration: float
    settings: Mapping[str, Any] = field(default_factory=dict)

    def settled(self, inputs: Mapping[str, Any], seeds: Sequence[int]) -> dict[str, Any]:
        """All that decides what a batch of it gives, the inputs beside the trial's own."""
        own = {
            "first": seeds[0],
            "count": len(seeds),
            "duration": self.duration,
            "settings": dict(self.settings),
        }
        return {**inputs, **own}


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
    against_base : Estimate
        How much more the RBM rms falls than in the base case, a fraction of its fall; negative is worse.
    """

    changes: dict[str, Estimate]
    flap_angle_max: float
    touching: float
    flap_rate_max: float
    flap_travel: float
    against_base: Estimate


def batches(realisations: int, duration: float) -> list[range]:
    """Seeds of the scored realisations of a duration [s], a batch at a time."""
    last, size = SCORED_SEED + realisations, max(1, int(TOGETHER / duration))
    return [range(first, min(first + size, last)) for first in range(SCORED_SEED, last, size)]


def measured(
    agent: Agent,
    model: TurbineModel,
    trial: Trial,
    cache: Cache,
    advanced: Callable[[str], None],
    take: Callable[[Record], Mapping[str, Array]],
) -> dict[str, Array]:
    """What `take` finds in the records of an agent, all realisations joined; `advanced` is told of every batch."""
    (found,) = measured_together([agent], model, trial, cache, advanced, take)
    return found


def measured_together(
    agents: Sequence[Agent],
    model: TurbineModel,
    trial: Trial,
    cache: Cache,
    advanced: Callable[[str], None],
    take: Callable[[Record], Mapping[str, Array]],
) -> list[dict[str, Array]]:
    """The same of several agents, side by side in the simulations that are not done yet."""
    inputs = [{"agent": mark(agent), "model": model.hash} for agent in agents]
    for seeds in batches(trial.realisations, trial.duration):
        lost = [
            (agent, each)
            for agent, each in zip(agents, inputs, strict=True)
            if not cache.path(part_of(agent.name, trial), trial.settled(each, seeds)).exists()
        ]
        for first in range(0, len(lost), SIDE_BY_SIDE):
            some = lost[first : first + SIDE_BY_SIDE]
            flyers = [agent for agent, _ in some]
            records = simulate_together(flyers, model, seeds, trial.duration, **trial.settings)
            for (agent, each), record in zip(some, records, strict=True):
                settings = trial.settled(each, seeds)
                cache.arrays(part_of(agent.name, trial), settings, lambda record=record: take(record))  # type: ignore[misc]

    def alone(agent: Agent) -> Callable[[Sequence[int]], Mapping[str, Array]]:
        # Asked only where a file that was there turns out damaged.
        return lambda seeds: take(simulate(agent, model, seeds, trial.duration, **trial.settings))

    return [
        joined(agent.name, each, trial, cache, advanced, alone(agent))
        for agent, each in zip(agents, inputs, strict=True)
    ]


def part_of(name: str, trial: Trial) -> str:
    """What a trial of an agent is called in the cache."""
    return f"{trial.name}-{name}"


def joined(
    name: str,
    inputs: Mapping[str, Any],
    trial: Trial,
    cache: Cache,
    advanced: Callable[[str], None],
    make: Callable[[Sequence[int]], Mapping[str, Array]],
) -> dict[str, Array]:
    """What `make` finds for the seeds of each batch, joined; `inputs` is all else it depends on."""
    parts = []
    for seeds in batches(trial.realisations, trial.duration):
        settings = trial.settled(inputs, seeds)
        parts.append(cache.arrays(part_of(name, trial), settings, lambda seeds=seeds: make(seeds)))  # type: ignore[misc]
        advanced(name)
    return {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}


def mark(agent: Agent) -> str:
    """Short hash of what an agent does."""
    if isinstance(agent, LinearController):
        return fingerprint(agent.system.A, agent.system.B, agent.system.C, agent.system.D, agent.start)
    if isinstance(agent, Policy):
        return fingerprint(agent.offset, agent.scale, *agent.weights, *agent.biases)
    if isinstance(agent, PredictiveController):
        linear, ahead = agent.unconstrained, agent.horizon
        matrices = (ahead.gain, ahead.preview_gain, ahead.from_state, ahead.from_wind, ahead.from_offsets)
        return fingerprint(linear.A, linear.B, linear.C, linear.D, *matrices)
    return agent.name


def named(**parts: Any) -> dict[str, Array]:
    """Arrays of dataclasses by name: the keyword, an underscore and the field's."""
    return {f"{part}_{key}": value for part, data in parts.items() for key, value in asdict(data).items()}


def rebuilt(kind: type[Data], part: str, found: Mapping[str, Array]) -> Data:
    """The dataclass `named` took apart."""
    return kind(**{each.name: found[f"{part}_{each.name}"] for each in fields(kind)})  # type: ignore[arg-type]


def metrics_of(found: Mapping[str, Array]) -> Metrics:
    """The metrics among arrays of `named`."""
    return rebuilt(Metrics, "metrics", found)


def score(ours: Metrics, open_loop: Metrics, base: Metrics, model: TurbineModel) -> Score:
    """The agent's score beside open loop and the base case on the same realisations."""
    stop = model.flaps[0].angle_limit * (1.0 - 1e-6)
    return Score(
        changes={name: paired_change(getattr(ours, name), getattr(open_loop, name)) for name in CHANGES},
        flap_angle_max=float(ours.flap_angle_max.max()),
        touching=float((ours.flap_angle_max >= stop).mean()),
        flap_rate_max=float(ours.flap_rate_max.max()),
        flap_travel=float(ours.flap_travel.mean()),
        against_base=against(ours, base, open_loop),
    )


def against(ours: Metrics, base: Metrics, open_loop: Metrics) -> Estimate:
    """How much more the RBM rms falls than in the base case, with the paired bootstrap interval of that ratio."""

    def ratio(fall: Array, of: Array, axis: int = -1) -> Array:
        return np.asarray(fall.mean(axis=axis) / of.mean(axis=axis) - 1.0)

    falls = tuple(1.0 - (each.rbm_rms / open_loop.rbm_rms).mean(axis=1) for each in (ours, base))
    mean = float(ratio(*falls))
    if np.ptp(falls[0] / falls[1]) <= 1e-12:
        return Estimate(mean, mean, mean)
    found = bootstrap(
        falls,
        ratio,
        paired=True,
        confidence_level=CONFIDENCE,
        method="BCa" if len(falls[0]) >= SMALLEST_CORRECTED else "percentile",
        rng=np.random.default_rng(0),
    ).confidence_interval
    return Estimate(mean, float(found.low), float(found.high))


def first(metrics: Metrics, realisations: int) -> Metrics:
    """The metrics of the first realisations alone."""
    return Metrics(**{each.name: getattr(metrics, each.name)[:realisations] for each in fields(Metrics)})
