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
from flapgym.control.linear_loop import LinearLoop, linear_loop
from flapgym.core.arrays import Array
from flapgym.core.fields import Choice, Count, Flag, Quantity
from flapgym.core.progress import ProgressBar
from flapgym.core.wording import number, one_line, shown
from flapgym.envs.registration import ENVIRONMENTS
from flapgym.envs.task import OBSERVABLES
from flapgym.evaluation.bootstrap import Estimate, paired_change, summed_damage_change
from flapgym.evaluation.channels import ChannelLoads, ChannelScore, channel_loads, joined, score_channel
from flapgym.evaluation.conditions import chosen_model, chosen_wind, lasts
from flapgym.evaluation.metrics import FATIGUE_SLOPE, Metrics, measure, summed_damage_load
from flapgym.evaluation.published import Bound, bounds_for
from flapgym.evaluation.record import Record, first_realisation, joined_records
from flapgym.evaluation.simulate import (
    get_ready,
    longest_duration,
    require_settings,
    simulate_together,
    steady_loads,
)
from flapgym.model.nameplate import Nameplate, nameplate
from flapgym.model.turbine_model import DEFAULT_MODEL, TurbineModel

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
STEEPEST = 30.0
"""Of the S-N curves of materials; beyond, only the largest cycle would count."""


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
    loops : dict of str to LinearLoop
        Stability and margin of the linear loop with the model, by name of those agents of which one is known; what
        grows there the stops bound in the scores.
    bounds : dict of str to Bound
        What no controller can pass, by metric; empty for realisations of which none is published.
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
    settings : mapping
        Keywords of the environment as they were, without the model.
    wind_speed : float
        [m/s]
    slope : float
        S-N slope of the scored damage-equivalent loads.
    series : dict of str to Record
        All realisations by agent name; empty unless the plan asks for them.
    """

    scores: dict[str, Score]
    records: dict[str, Record]
    loops: dict[str, LinearLoop]
    bounds: dict[str, Bound]
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
    settings: Mapping[str, Any]
    wind_speed: float
    slope: float
    series: dict[str, Record]


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
        Its keywords, without the model, with what was asked for in their place.
    slope : float
        S-N slope of the scored damage-equivalent loads.
    series : bool
        Whether all series are kept.
    bounds : dict of str to Bound
        Published of these realisations, by metric.
    """

    agents: tuple[Agent, ...]
    model: TurbineModel
    seeds: range
    duration: float
    channels: bool
    environment: str | None
    settings: Mapping[str, Any]
    slope: float
    series: bool
    bounds: dict[str, Bound]


def plan(
    agents: Sequence[str | os.PathLike[str] | Agent] = AGENT_NAMES,
    model: TurbineModel | str | os.PathLike[str] | None = None,
    realisations: int = PAPER_REALISATIONS,
    seed: int = SCORED_SEED,
    duration: float | None = None,
    channels: bool = False,
    environment: str | None = None,
    *,
    wind_speed: float | None = None,
    turbulence_intensity: float | None = None,
    length_scale: float | None = None,
    wind: str | os.PathLike[str] | None = None,
    box_shape: Sequence[int] | None = None,
    box_spacing: Sequence[float] | None = None,
    slope: float = FATIGUE_SLOPE,
    series: bool = False,
) -> Plan:
    """Read and check all that `compare` needs, before any work.

    Raises
    ------
    ValueError, FileNotFoundError, ImportError
        Naming the agent, model, file or option at fault.
    """
    realisations = Count(at_least=1, at_most=MOST_REALISATIONS).check(realisations, "realisations")
    seed = Count(at_least=0, at_most=LARGEST_SEED).check(seed, "seed")
    if duration is not None:
        Quantity("time", at_least=1.0, at_most=LONGEST).check(duration, "duration")
    channels = Flag().check(channels, "channels")
    series = Flag().check(series, "series")
    Quantity("number", at_least=1.0, at_most=STEEPEST).check(slope, "slope")
    settings = {} if environment is None else _settings_of(environment)
    own = settings.pop("model", DEFAULT_MODEL)
    chosen = chosen_model(own if model is None else model, wind_speed)
    blowing = chosen_wind(
        settings.get("wind", {}),
        turbulence_intensity=turbulence_intensity,
        length_scale=length_scale,
        wind=wind,
        box_shape=box_shape,
        box_spacing=box_spacing,
    )
    published = environment if environment is not None or blowing else _environment_of(chosen.name)
    if blowing != settings.get("wind", {}):
        settings, published = {**settings, "wind": blowing}, None
    ready = contestants(agents, chosen)
    for agent in ready:
        check_pitch(agent, bool(settings.get("pitch")))
    duration = _duration(duration, ready, chosen, settings, wind)
    require_settings(ready, chosen, duration, settings)
    seeds = range(seed, seed + realisations)
    bounds = bounds_for(published, chosen, seeds, duration)
    if slope != FATIGUE_SLOPE:
        bounds.pop("rbm_del", None)
    return Plan(ready, chosen, seeds, duration, channels, environment, settings, slope, series, bounds)


def _settings_of(environment: str) -> dict[str, Any]:
    """Keywords of a registered turbine of this package."""
    known = {each.id: dict(each.keywords) for each in ENVIRONMENTS if not each.keywords.get("single_blade")}
    return known[Choice(tuple(known)).check(environment, "environment")]


def _environment_of(model: str) -> str | None:
    """The id that differs in nothing but the model from a comparison without an environment."""
    return next(
        (
            each.id
            for each in ENVIRONMENTS
            if not each.keywords.keys() - {"model"} and each.keywords.get("model", DEFAULT_MODEL) == model
        ),
        None,
    )


def _duration(
    asked: float | None,
    agents: Sequence[Agent],
    model: TurbineModel,
    settings: Mapping[str, Any],
    wind: str | os.PathLike[str] | None,
) -> float:
    """Length of a realisation [s]: what is asked for, else the paper's; no longer than a file's wind lasts."""
    usual = PAPER_LENGTH * model.length_scale / model.wind_speed if asked is None else asked
    there = lasts(settings.get("wind", {}), model)
    if not np.isfinite(there):
        return usual
    longest = longest_duration(agents, model, there, settings)
    if longest < 1.0 or (asked is not None and asked > longest):
        given = "none" if asked is None else f"{number(asked)} s"
        wanted = f"from 1 to {number(longest)} s" if longest >= 1.0 else "another file"
        raise ValueError(
            f"duration: expected {wanted}, as {one_line(os.fspath(wind or ''))} lasts {number(there)} s and an episode "
            f"is an action longer than a realisation, got {given}"
        )
    return min(usual, longest)


def run(comparison: Plan, progress: bool = False) -> Comparison:
    """Simulate every agent of a plan and score it; `progress` shows a bar on standard error."""
    model, seeds, duration = comparison.model, comparison.seeds, comparison.duration
    agents = comparison.agents
    parts: dict[str, list[Metrics]] = {agent.name: [] for agent in agents}
    loads: dict[str, list[tuple[ChannelLoads, ...]]] = {agent.name: [] for agent in agents}
    records: dict[str, Record] = {}
    series: dict[str, list[Record]] = {agent.name: [] for agent in agents}
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
                parts[agent.name].append(measure(record, comparison.slope))
                if comparison.channels:
                    loads[agent.name].append(channel_loads(record, steady=steady))
                if comparison.series:
                    series[agent.name].append(record)
                records.setdefault(agent.name, first_realisation(record))
    _require_one_wind(records)
    metrics = {name: _joined(each) for name, each in parts.items()}
    # Channel by channel of all realisations, where each part has all channels.
    by_channel = {name: [joined(parts) for parts in zip(*each, strict=True)] for name, each in loads.items()}
    loops = {agent.name: linear_loop(agent, model) for agent in agents}
    return Comparison(
        scores={agent.name: _score(agent, model, metrics, comparison.slope) for agent in agents},
        records=records,
        loops={name: loop for name, loop in loops.items() if loop is not None},
        bounds=comparison.bounds,
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
        settings=comparison.settings,
        wind_speed=model.wind_speed,
        slope=comparison.slope,
        series={name: joined_records(each) for name, each in series.items() if each},
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


def _score(agent: Agent, model: TurbineModel, metrics: dict[str, Metrics], slope: float) -> Score:
    ours, reference = metrics[agent.name], metrics[OpenLoop.name]
    return Score(
        rbm_rms_change=paired_change(ours.rbm_rms, reference.rbm_rms),
        tip_rms_change=paired_change(ours.tip_rms, reference.tip_rms),
        rbm_del_change=paired_change(ours.rbm_del, reference.rbm_del),
        rbm_del_summed_change=summed_damage_change(ours.rbm_del, reference.rbm_del, slope),
        tower_rms_change=paired_change(ours.tower_rms, reference.tower_rms),
        rbm_rms=float(ours.rbm_rms.mean()),
        rbm_del=float(summed_damage_load(ours.rbm_del, slope)),
        flap_angle_max=float(ours.flap_angle_max.max()),
        flap_rate_max=float(ours.flap_rate_max.max()),
        flap_travel=float(ours.flap_travel.mean()),
        pitch_travel=float(ours.pitch_travel.mean()),
        made_for_this_model=made_for(agent, model),
    )
