"""All agents on the same realisations, against open loop, with confidence intervals (paper section IV.C)."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from flapgym.control import AGENT_NAMES, Agent, OpenLoop, load_agent, made_for
from flapgym.control.agent import check_fit, check_pitch
from flapgym.control.agent_checks import check_agent
from flapgym.control.growth import Growth, agent_growth
from flapgym.core.arrays import Array
from flapgym.core.fields import Choice, Count, Flag, Quantity
from flapgym.core.progress import ProgressBar
from flapgym.core.wording import shown
from flapgym.envs.registration import ENVIRONMENTS
from flapgym.envs.task import OBSERVABLES
from flapgym.evaluation.bootstrap import Estimate, paired_change, summed_damage_change
from flapgym.evaluation.channels import ChannelLoads, ChannelScore, channel_loads, joined, score_channel
from flapgym.evaluation.metrics import Metrics, Record, measure, summed_damage_load
from flapgym.evaluation.simulate import get_ready, simulate_together, steady_loads
from flapgym.model.nameplate import Nameplate, nameplate
from flapgym.model.turbine_model import DEFAULT_MODEL, TurbineModel, load_model

SCORED_SEED = 1_000_000
"""First seed of the scored realisations: tuning and training keep away from this and the next thousand."""

PAPER_REALISATIONS = 5
MOST_REALISATIONS = 1000
"""As many seeds as are kept for scoring."""
LARGEST_SEED = 2**63
LONGEST = 3600.0
"""Longest realisation [s]: its samples under all agents are held in memory."""
TOGETHER = 15_000.0
"""Seconds of wind simulated side by side, all agents counted: 0.3 GB of samples."""
PAPER_LENGTH = 20.0
"""Length of a realisation in length scales over wind speed."""


@dataclass(frozen=True)
class Score:
    """What the table says of one agent.

    Attributes
    ----------
    rbm_rms_change, tip_rms_change, rbm_del_change, tower_rms_change : Estimate
        Paired change against open loop, a fraction, negative is a reduction: mean of the realisations' ratios.
    rbm_del_summed_change : Estimate
        The same of `rbm_del`, the damage summed over all realisations: those of the largest loads decide.
    rbm_rms : float
        Mean over blades and realisations [N m].
    rbm_del : float
        Damage-equivalent load of all blades and realisations together, from their summed damage [N m].
    flap_angle_max, flap_rate_max : float
        Over everything [rad, rad/s].
    flap_travel, pitch_travel : float
        Mean path of a flap, and of a blade's pitch, per second [rad/s].
    made_for_this_model : bool
        False if the agent was designed or trained on another model.
    """

    rbm_rms_change: Estimate
    tip_rms_change: Estimate
    rbm_del_change: Estimate
    rbm_del_summed_change: Estimate
    tower_rms_change: Estimate
    rbm_rms: float
    rbm_del: float
    flap_angle_max: float
    flap_rate_max: float
    flap_travel: float
    pitch_travel: float
    made_for_this_model: bool


@dataclass(frozen=True, eq=False)
class Comparison:
    """Scores by agent in the table's order, what they were measured on, and one realisation to look at.

    Attributes
    ----------
    scores : dict of str to Score
        By agent name, open loop first.
    records : dict of str to Record
        Blade signals of the first realisation, by agent name.
    growths : dict of str to Growth
        What grows in the linear loop, by name of those agents in whose loop something does; the stops, left out there,
        bound it in the scores.
    model_name, model_hash : str
    nameplate : Nameplate
        Of the model's turbine.
    realisations : int
    seed : int
        Of the first realisation; the next have the next.
    duration : float
        Of each realisation [s].
    rotor_speed : float
        [rad/s].
    flap_angle_limit : float
        Of a blade's first flap [rad].
    channels : dict of str to tuple of ChannelScore
        Every load channel at several slopes, by agent name; empty unless the plan asks for it.
    environment : str or None
        Id of the environment whose wind, sensors and actuators they were; None for the model's own turbulence.
    """

    scores: dict[str, Score]
    records: dict[str, Record]
    growths: dict[str, Growth]
    model_name: str
    model_hash: str
    nameplate: Nameplate
    realisations: int
    seed: int
    duration: float
    rotor_speed: float
    flap_angle_limit: float
    channels: dict[str, tuple[ChannelScore, ...]]
    environment: str | None


@dataclass(frozen=True, eq=False)
class Plan:
    """A comparison whose every input has been read and checked; `run` does the work.

    Attributes
    ----------
    agents : tuple of Agent
        Open loop first.
    model : TurbineModel
    seeds : range
        Of the realisations.
    duration : float
        Of each [s].
    channels : bool
        Whether every load channel is scored, at several slopes.
    environment : str or None
        Id of an environment.
    settings : mapping
        Its keywords, without the model.
    """

    agents: tuple[Agent, ...]
    model: TurbineModel
    seeds: range
    duration: float
    channels: bool
    environment: str | None
    settings: Mapping[str, Any]


def plan(
    agents: Sequence[str | os.PathLike[str] | Agent] = AGENT_NAMES,
    model: TurbineModel | str | os.PathLike[str] = DEFAULT_MODEL,
    realisations: int = PAPER_REALISATIONS,
    seed: int = SCORED_SEED,
    duration: float | None = None,
    channels: bool = False,
    environment: str | None = None,
) -> Plan:
    """Read and check all that `compare` needs, before any work.

    Raises
    ------
    ValueError, FileNotFoundError
        Naming the agent, model or option at fault.
    """
    realisations = Count(at_least=1, at_most=MOST_REALISATIONS).check(realisations, "realisations")
    seed = Count(at_least=0, at_most=LARGEST_SEED).check(seed, "seed")
    if duration is not None:
        Quantity("time", at_least=1.0, at_most=LONGEST).check(duration, "duration")
    channels = Flag().check(channels, "channels")
    settings: dict[str, Any] = {}
    if environment is not None:
        settings = _settings_of(environment)
        if model != DEFAULT_MODEL:
            raise ValueError(
                f"model: expected none beside an environment, which has its own, got {shown(model)}"
            )
        model = settings.pop("model", DEFAULT_MODEL)
    if not isinstance(model, TurbineModel):
        model = load_model(model)
    if duration is None:
        duration = PAPER_LENGTH * model.length_scale / model.wind_speed
    seeds = range(seed, seed + realisations)
    ready = contestants(agents, model)
    for agent in ready:
        check_pitch(agent, bool(settings.get("pitch")))
    return Plan(ready, model, seeds, duration, channels, environment, settings)


def _settings_of(environment: str) -> dict[str, Any]:
    """Keywords of a registered turbine of this package."""
    known = {each.id: dict(each.keywords) for each in ENVIRONMENTS if not each.keywords.get("single_blade")}
    return known[Choice(tuple(known)).check(environment, "environment")]


def run(comparison: Plan, progress: bool = False) -> Comparison:
    """Simulate every agent of a plan and score it; `progress` shows a bar on standard error."""
    model, seeds, duration = comparison.model, comparison.seeds, comparison.duration
    agents = comparison.agents
    parts: dict[str, list[Metrics]] = {agent.name: [] for agent in agents}
    loads: dict[str, list[tuple[ChannelLoads, ...]]] = {agent.name: [] for agent in agents}
    records: dict[str, Record] = {}
    samples = len(agents) * len(seeds) * round(duration / model.time_step)
    get_ready(model)
    with ProgressBar(
        total=samples, disable=not progress, unit=" steps", unit_scale=True, mininterval=0.5
    ) as bar:
        for some in _batches(seeds, len(agents), duration):
            found = simulate_together(agents, model, some, duration, bar.update, **comparison.settings)
            steady = dict[str, Array]()
            if comparison.channels:
                # Agents begin at the same azimuths, so that it is the same for all.
                first = found[0]
                steady = steady_loads(model, first.azimuth, first.rbm.shape[1], **comparison.settings)
            for agent, record in zip(agents, found, strict=True):
                parts[agent.name].append(measure(record))
                if comparison.channels:
                    loads[agent.name].append(channel_loads(record, steady=steady))
                records.setdefault(agent.name, _first(record))
    _require_one_wind(records)
    metrics = {name: _joined(each) for name, each in parts.items()}
    # Channel by channel of all realisations, where each part has all channels.
    by_channel = {name: [joined(parts) for parts in zip(*each, strict=True)] for name, each in loads.items()}
    growths = {agent.name: agent_growth(agent, model) for agent in comparison.agents}
    return Comparison(
        scores={agent.name: _score(agent, model, metrics) for agent in comparison.agents},
        records=records,
        growths={name: grows for name, grows in growths.items() if grows is not None},
        model_name=model.name,
        model_hash=model.hash,
        nameplate=nameplate(model.case),
        realisations=len(seeds),
        seed=seeds[0],
        duration=duration,
        rotor_speed=model.rotor_speed,
        flap_angle_limit=model.flaps[0].angle_limit,
        channels={
            name: tuple(map(score_channel, ours, by_channel[OpenLoop.name]))
            for name, ours in by_channel.items()
            if ours
        },
        environment=comparison.environment,
    )


_PARTS = ("name", "observe", "steps_per_action", "model_hash", "predict")
"""What an agent has."""


def contestants(agents: Sequence[str | os.PathLike[str] | Agent], model: TurbineModel) -> tuple[Agent, ...]:
    """Agents ready to run, open loop first; two of one name would share a row."""
    if not isinstance(agents, Sequence) or isinstance(agents, str | bytes):
        raise ValueError(
            f"agents: expected a list of names, files or agents, in the table's order, got {shown(agents)}"
        )
    found = [load_agent(a, model) if isinstance(a, str | os.PathLike) else a for a in agents]
    for agent in found:
        lacking = [part for part in _PARTS if not hasattr(agent, part)]
        if lacking or isinstance(agent, type):
            what = "a class; make an object of it" if isinstance(agent, type) else f"it has no {lacking[0]}"
            raise ValueError(
                f"agents: expected names, files or agents (flapgym.control.Agent), got {shown(agent)}: {what}"
            )
        check_agent(agent, OBSERVABLES)
    ordered: tuple[Agent, ...] = (OpenLoop(), *(agent for agent in found if not isinstance(agent, OpenLoop)))
    for agent in ordered:
        check_fit(agent, model)
    names = [agent.name for agent in ordered]
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"agents: two are called {name}; give each its own name")
    return ordered


def _batches(seeds: range, agents: int, duration: float) -> list[range]:
    """The realisations in parts whose samples fit into memory together."""
    size = max(1, int(TOGETHER / (agents * duration)))
    return [seeds[begin : begin + size] for begin in range(0, len(seeds), size)]


def _first(record: Record) -> Record:
    """The first realisation alone, in arrays of its own: a view would keep the others alive."""
    arrays = {each.name: getattr(record, each.name) for each in fields(record)}
    time_step, further = arrays.pop("time_step"), arrays.pop("further")
    return Record(
        **{name: array[:1].copy() for name, array in arrays.items()},
        time_step=time_step,
        further={name: array[:1].copy() for name, array in further.items()},
    )


def _joined(parts: Sequence[Metrics]) -> Metrics:
    """Metrics of realisations that were measured in parts."""
    return Metrics(
        **{f.name: np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(Metrics)}
    )


def _require_one_wind(records: dict[str, Record]) -> None:
    """Pairs are pairs only if every agent met the same wind."""
    reference = records[OpenLoop.name].wind
    for name, record in records.items():
        if not np.allclose(record.wind, reference, rtol=0.0, atol=1e-6):
            raise RuntimeError(
                f"agent {name}: met another wind than open loop; the comparison would mean nothing"
            )


def _score(agent: Agent, model: TurbineModel, metrics: dict[str, Metrics]) -> Score:
    ours, reference = metrics[agent.name], metrics[OpenLoop.name]
    return Score(
        rbm_rms_change=paired_change(ours.rbm_rms, reference.rbm_rms),
        tip_rms_change=paired_change(ours.tip_rms, reference.tip_rms),
        rbm_del_change=paired_change(ours.rbm_del, reference.rbm_del),
        rbm_del_summed_change=summed_damage_change(ours.rbm_del, reference.rbm_del),
        tower_rms_change=paired_change(ours.tower_rms, reference.tower_rms),
        rbm_rms=float(ours.rbm_rms.mean()),
        rbm_del=float(summed_damage_load(ours.rbm_del)),
        flap_angle_max=float(ours.flap_angle_max.max()),
        flap_rate_max=float(ours.flap_rate_max.max()),
        flap_travel=float(ours.flap_travel.mean()),
        pitch_travel=float(ours.pitch_travel.mean()),
        made_for_this_model=made_for(agent, model),
    )
