"""Loads over a turbine's life: agents in the normal turbulence of every wind speed, IEC 61400-1 design load case 1.2.

The wind speeds are those that a set of models was built for. At each, all agents meet the same realisations; damage is
weighted with how often the wind blows that fast, and added.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, is_dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from flapgym.control import AGENT_NAMES, INDIVIDUAL_PITCH, Agent, IndividualPitch, OpenLoop, made_for
from flapgym.control.agent import check_fit
from flapgym.core.arrays import Array
from flapgym.core.fields import Choice, Count, Quantity, TupleOf
from flapgym.core.progress import ProgressBar
from flapgym.core.wording import number
from flapgym.envs.linear_range import LINEAR_SHARE, LinearRangeWarning
from flapgym.envs.wind_speeds import chosen_set
from flapgym.evaluation.bootstrap import Estimate
from flapgym.evaluation.channels import SLOPES, channel_loads
from flapgym.evaluation.comparison import LARGEST_SEED, LONGEST, SCORED_SEED, contestants
from flapgym.evaluation.lifetime_loads import (
    YEAR,
    WindBin,
    bin_damage,
    class_mean,
    lifetime_change,
    lifetime_load,
    wind_bins,
)
from flapgym.evaluation.lifetime_store import FOLDER, BinLoads, Duty, Store, joined_bins, key_of
from flapgym.evaluation.metrics import measure
from flapgym.evaluation.record import Record
from flapgym.evaluation.series import check_series_folder, write_realisations
from flapgym.evaluation.simulate import episode_length, get_ready, require_settings, simulate_together
from flapgym.model import builtin_models, load_model
from flapgym.model.model_set import ModelSet
from flapgym.model.turbine_model import TurbineModel
from flapgym.wind.iec import REFERENCE_INTENSITIES, REFERENCE_SPEEDS

DEFAULT_MODELS = "nrel5mw-range"
"""The set of models meant where none is named."""
SEEDS = 6
"""Realisations of ten minutes at a wind speed (IEC 61400-1:2005, 7.5)."""
DURATION = 600.0
"""Of each [s] (the same)."""
YEARS = 20.0
"""Of a design life, at least (the same, 6.2)."""
SHEAR_EXPONENT = 0.2
"""Of the normal wind profile (the same, 6.3.1.2)."""
MOST_SEEDS = 40
"""At a wind speed; the seeds of one speed begin so far behind those of the one before it in the set."""
LONGEST_LIFE = 100.0
"""[years]"""
TOGETHER = 20_000.0
"""Seconds of wind simulated side by side, all agents counted: about 1.5 GB of samples and responses."""
COLLECTIVE_PITCH = "collective_pitch"
"""Output of a model with a loop for the rotor's speed [rad]."""


@dataclass(frozen=True, eq=False)
class LifetimePlan:
    """A study whose every input has been read and checked; `run_lifetime` does the work.

    Attributes
    ----------
    models : tuple of TurbineModel
        By rising wind speed.
    agents : tuple of tuples of Agent
        Of each model, open loop first; the same names in all.
    bins : tuple of WindBin
    seeds : tuple of range
        Of the realisations in each bin.
    duration : float
        Of each [s].
    wind_class, turbulence_class : str
        Of IEC 61400-1.
    years : float
        The life.
    settings : mapping
        Keywords of the environments.
    series : path or None
        Folder for the series.
    """

    models: tuple[TurbineModel, ...]
    agents: tuple[tuple[Agent, ...], ...]
    bins: tuple[WindBin, ...]
    seeds: tuple[range, ...]
    duration: float
    wind_class: str
    turbulence_class: str
    years: float
    settings: Mapping[str, Any]
    series: Path | None


@dataclass(frozen=True)
class LifetimeLoad:
    """A channel's damage-equivalent load over the life at one S-N slope.

    Attributes
    ----------
    channel, unit : str
    slope : float
    equivalent_load : float
        Range whose cycles, one a second all the life long, do the damage of the life, mean over places (blades).
    change : Estimate
        Against open loop, a fraction; interval over resampled seeds.
    damage : tuple of float
        Of each bin, over all that of open loop: they add up to (1 + change)^slope.
    """

    channel: str
    unit: str
    slope: float
    equivalent_load: float
    change: Estimate
    damage: tuple[float, ...]


@dataclass(frozen=True)
class LifetimeDuty:
    """What the actuators of one agent do over the life.

    Attributes
    ----------
    flap_travel, pitch_travel : float
        Mean path of a flap, and of a blade's pitch with the collective one, while the turbine runs [rad/s].
    flap_cycles, pitch_cycles : float
        Paths from stop to stop and back over the life.
    flap_rate_max, pitch_rate_max : float
        Largest in all realisations [rad/s].
    flap_power : float
        Mean power that speeds a flap up, over its moment of inertia about the hinge, while the turbine runs
        [W/(kg m^2)].
    """

    flap_travel: float
    flap_cycles: float
    flap_rate_max: float
    flap_power: float
    pitch_travel: float
    pitch_cycles: float
    pitch_rate_max: float


@dataclass(frozen=True, eq=False)
class Lifetime:
    """Loads of a life by agent, and what they rest on.

    Attributes
    ----------
    loads : dict of str to tuple of LifetimeLoad
        Every channel at every slope, by agent name, open loop first.
    duties : dict of str to LifetimeDuty
    designed : dict of str to str
        What each agent was designed for, in words.
    bins : tuple of WindBin
    seeds : tuple of range
    duration, years : float
        Of a realisation [s], of the life [years].
    wind_class, turbulence_class : str
    mean_wind : float
        Of the site [m/s].
    model_names, model_hashes : tuple of str
        Of each bin.
    gravity : bool
        Whether blades weigh something: not if the models have no such input.
    speed_loop : bool
        Whether the models tell a collective pitch, and so have a loop for the rotor's speed.
    beyond : int
        Realisations of open loop in which the wind departs from its mean by more than `LINEAR_SHARE` of it.
    taken_up, not_kept : tuple of str
        Agents of which results of an earlier run were taken up, and those whose results cannot be kept.
    """

    loads: dict[str, tuple[LifetimeLoad, ...]]
    duties: dict[str, LifetimeDuty]
    designed: dict[str, str]
    bins: tuple[WindBin, ...]
    seeds: tuple[range, ...]
    duration: float
    years: float
    wind_class: str
    turbulence_class: str
    mean_wind: float
    model_names: tuple[str, ...]
    model_hashes: tuple[str, ...]
    gravity: bool
    speed_loop: bool
    beyond: int
    taken_up: tuple[str, ...]
    not_kept: tuple[str, ...]

    @property
    def running(self) -> float:
        """Share of the life with wind of the bins, while the turbine runs."""
        return sum(each.probability for each in self.bins)


def plan_lifetime(
    agents: Sequence[str | os.PathLike[str] | Agent] | None = None,
    models: ModelSet | str | os.PathLike[str] = DEFAULT_MODELS,
    wind_speeds: Sequence[float] | None = None,
    seeds: int = SEEDS,
    seed: int = SCORED_SEED,
    duration: float = DURATION,
    turbulence_class: str = "B",
    wind_class: str = "II",
    years: float = YEARS,
    save_series: str | os.PathLike[str] | None = None,
) -> LifetimePlan:
    """Read and check all that `lifetime` needs, before any work.

    Raises
    ------
    ValueError, FileNotFoundError, ImportError
        Naming the agent, the models or the option at fault.
    """
    seeds = Count(at_least=1, at_most=MOST_SEEDS).check(seeds, "seeds")
    seed = Count(at_least=0, at_most=LARGEST_SEED).check(seed, "seed")
    Quantity("time", at_least=10.0, at_most=LONGEST).check(duration, "duration")
    Choice(tuple(REFERENCE_INTENSITIES)).check(turbulence_class, "turbulence_class")
    Choice(tuple(REFERENCE_SPEEDS)).check(wind_class, "wind_class")
    Quantity("number", above=0.0, at_most=LONGEST_LIFE).check(years, "years")
    models = chosen_set(models)
    places = _places(models, wind_speeds)
    chosen = tuple(models.at(models.wind_speeds[place]) for place in places)
    gravity = "gravity" in chosen[0].turbine.inputs
    if agents is None:
        pitching = (
            ()
            if chosen[0].pitch_actuator is None
            else (INDIVIDUAL_PITCH, f"{INDIVIDUAL_PITCH}+lqg_saturating")
        )
        agents = (*AGENT_NAMES, *pitching)
    ready = tuple(_at_wind_speed(contestants(agents, model), model) for model in chosen)
    _check_same_names(ready)
    settings: dict[str, Any] = {
        "wind": {
            "field": {"kind": "kaimal", "turbulence_class": turbulence_class},
            "inflow": {"shear_exponent": SHEAR_EXPONENT, "tower_shadow": True},
        },
        "gravity": gravity,
    }
    moving = [agent.name for agent in ready[0] if getattr(agent, "pitches", False)]
    if moving:
        if chosen[0].pitch_actuator is None:
            raise ValueError(
                f"agent {moving[0]}: moves the blades' pitch, which is no input of the model {chosen[0].name}; "
                "see [signals] in the case file"
            )
        settings["pitch"] = True
    require_settings(ready[0], chosen[0], duration, settings)
    numbers = tuple(range(seed + place * MOST_SEEDS, seed + place * MOST_SEEDS + seeds) for place in places)
    return LifetimePlan(
        models=chosen,
        agents=ready,
        bins=wind_bins(tuple(model.wind_speed for model in chosen), class_mean(wind_class)),
        seeds=numbers,
        duration=duration,
        wind_class=wind_class,
        turbulence_class=turbulence_class,
        years=years,
        settings=settings,
        series=None if save_series is None else check_series_folder(save_series, numbers[-1]),
    )


def _at_wind_speed(agents: Sequence[Agent], model: TurbineModel) -> tuple[Agent, ...]:
    """Agents in the wind of a model: of a gain-scheduled one that which it takes there, under its own name."""
    found = list[Agent]()
    for agent in agents:
        scheduled = getattr(agent, "at", None)
        own: Any = agent if scheduled is None else scheduled(model.wind_speed)
        if own.name != agent.name and is_dataclass(own) and not isinstance(own, type):
            own = replace(own, name=agent.name)
        check_fit(own, model)
        found.append(own)
    return tuple(found)


def _check_same_names(agents: Sequence[Sequence[Agent]]) -> None:
    """Refuse agents of which a row of a table could not be made."""
    names = [[agent.name for agent in each] for each in agents]
    for each in names:
        if each != names[0]:
            raise ValueError(
                f"agents: expected the same names at every wind speed, got {', '.join(names[0])} and "
                f"{', '.join(each)}"
            )


def _places(models: ModelSet, wind_speeds: Sequence[float] | None) -> list[int]:
    """Of the wind speeds asked for in a set, by rising wind speed; all by default."""
    if wind_speeds is None:
        return list(range(len(models)))
    asked = TupleOf(Quantity("speed"), distinct=True).check(wind_speeds, "wind_speeds")
    there = np.array(models.wind_speeds)
    places = [int(np.abs(there - speed).argmin()) for speed in asked]
    for speed, place in zip(asked, places, strict=True):
        if not np.isclose(there[place], speed, rtol=1e-9, atol=0.0):
            listed = ", ".join(number(each) for each in there)
            raise ValueError(
                f"wind_speeds: expected some of {listed} m/s, for which there are models, got {number(speed)} m/s"
            )
    return sorted(places)


def run_lifetime(study: LifetimePlan, progress: bool = False, folder: Path | None = None) -> Lifetime:
    """Simulate what an earlier run in the same folder has not left, and add up the damage.

    Parameters
    ----------
    study : LifetimePlan
    progress : bool
        Show a bar on standard error.
    folder : path, optional
        Where results of each agent at each wind speed are kept as they come.
    """
    store = Store(None if folder is None else folder / FOLDER)
    keys = [_keys(study, place) for place in range(len(study.bins))]
    found = [
        {
            agent.name: None
            if study.series is not None
            else store.read(keys[place][agent.name], agent.name, model.wind_speed)
            for agent in study.agents[place]
        }
        for place, model in enumerate(study.models)
    ]
    missing = [
        [agent for agent in each if loads[agent.name] is None]
        for each, loads in zip(study.agents, found, strict=True)
    ]
    samples = sum(
        len(agents) * len(seeds) * round(study.duration / model.time_step)
        for agents, seeds, model in zip(missing, study.seeds, study.models, strict=True)
    )
    if samples:
        get_ready(study.models[0])
    # The mean rate since the beginning: a batch ends with counting cycles, and the next begins with its wind.
    with (
        ProgressBar(
            total=samples,
            disable=not progress or not samples,
            unit=" steps",
            unit_scale=True,
            mininterval=0.5,
            smoothing=0.0,
        ) as bar,
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore", LinearRangeWarning)  # the report says how often
        for place, agents in enumerate(missing):
            if agents:
                bar.set_description(f"{number(study.bins[place].wind_speed)} m/s")
            for name, loads in _simulated(study, place, agents, bar).items():
                found[place][name] = loads
                store.write(keys[place][name], name, study.models[place].wind_speed, loads)
    complete = [{name: loads for name, loads in each.items() if loads is not None} for each in found]
    names = [agent.name for agent in study.agents[0]]
    simulated = {(place, agent.name) for place, agents in enumerate(missing) for agent in agents}
    return _summed(
        study,
        complete,
        taken_up=tuple(
            name for name in names if any((place, name) not in simulated for place in range(len(missing)))
        ),
        not_kept=tuple(name for name in names if keys[0][name] is None) if folder is not None else (),
    )


def _keys(study: LifetimePlan, place: int) -> dict[str, str | None]:
    """Under which the results of each agent in a bin are kept."""
    model = study.models[place]
    conditions = {
        "model": model.hash,
        "wind": study.settings["wind"],
        "gravity": study.settings["gravity"],
        "seeds": list(study.seeds[place]),
        "duration": study.duration,
        # Whoever goes through a field with others takes their length, and a longer field is another one.
        "length": episode_length(study.agents[place], model, study.duration),
        "slopes": SLOPES,
    }
    return {agent.name: key_of(agent, conditions) for agent in study.agents[place]}


def _simulated(
    study: LifetimePlan, place: int, agents: Sequence[Agent], bar: ProgressBar
) -> dict[str, BinLoads]:
    """Loads of some of a bin's agents, all of them side by side in as many realisations as fit into memory."""
    if not agents:
        return {}
    model, seeds = study.models[place], study.seeds[place]
    together = max(1, int(TOGETHER / (len(agents) * study.duration)))
    length = episode_length(study.agents[place], model, study.duration)
    parts: dict[str, list[BinLoads]] = {agent.name: [] for agent in agents}
    for first in range(0, len(seeds), together):
        some = seeds[first : first + together]
        records = simulate_together(
            agents, model, some, study.duration, bar.update, lasting=length, **study.settings
        )
        for agent, record in zip(agents, records, strict=True):
            parts[agent.name].append(BinLoads(channel_loads(record), duty(record, model)))
            if study.series is not None:
                write_realisations(study.series, record, model, agent.name, some)
    return {name: joined_bins(each) for name, each in parts.items()}


def duty(record: Record, model: TurbineModel) -> Duty:
    """What the actuators did in a record."""
    metrics, seconds = measure(record), record.flap_angle.shape[1] * record.time_step
    stops = np.tile(
        [flap.angle_limit for flap in model.flaps], record.flap_angle.shape[2] // len(model.flaps)
    )
    way = np.abs(np.diff(record.flap_angle, axis=1)).sum(axis=1)
    # Of half the rate squared, what it gains: braking gives nothing back.
    gained = np.maximum(0.0, np.diff(0.5 * np.square(record.flap_rate), axis=1)).sum(axis=1)
    pitch = pitch_of(record)
    pitched = np.abs(np.diff(pitch, axis=1))
    travel = pitched.sum(axis=1).mean(axis=1) / seconds
    stop = np.inf if model.pitch_actuator is None else model.pitch_actuator.angle_limit
    return Duty(
        flap_travel=metrics.flap_travel,
        flap_cycles=(way / (4.0 * stops)).mean(axis=1) / seconds,
        flap_rate_max=metrics.flap_rate_max,
        flap_power=gained.mean(axis=1) / seconds,
        pitch_travel=travel,
        pitch_cycles=travel / (4.0 * stop),
        pitch_rate_max=pitched.max(axis=(1, 2)) / record.time_step,
        wind_max=np.abs(record.wind).max(axis=1),
    )


def pitch_of(record: Record) -> Array:
    """Pitch of each blade (N, T, 3) from the operating point's [rad]: its own and the collective one."""
    pitch = np.zeros(record.rbm.shape)
    if record.pitch_angle.size:
        pitch += record.pitch_angle
    if COLLECTIVE_PITCH in record.further:
        pitch += record.further[COLLECTIVE_PITCH][..., None]
    return pitch


def _summed(
    study: LifetimePlan,
    found: Sequence[Mapping[str, BinLoads]],
    taken_up: tuple[str, ...],
    not_kept: tuple[str, ...],
) -> Lifetime:
    """The bins' loads added up."""
    reference = [each[OpenLoop.name] for each in found]
    shares = [each.probability for each in study.bins]
    loads, duties = dict[str, tuple[LifetimeLoad, ...]](), dict[str, LifetimeDuty]()
    for name in (agent.name for agent in study.agents[0]):
        ours = [each[name] for each in found]
        for one, other in zip(ours, reference, strict=True):
            # Pairs are pairs only in the same wind.
            if not np.allclose(one.duty.wind_max, other.duty.wind_max, rtol=1e-6, atol=0.0):
                raise RuntimeError(
                    f"agent {name}: met another wind than open loop; the study would mean nothing"
                )
        loads[name] = tuple(
            _load(ours, reference, shares, channel, place)
            for channel in range(len(ours[0].channels))
            for place in range(len(ours[0].channels[channel].slopes))
        )
        duties[name] = _duty([each.duty for each in ours], shares, study.years * YEAR)
    return Lifetime(
        loads=loads,
        duties=duties,
        designed={
            agent.name: designed_for([each[place] for each in study.agents], study.models)
            for place, agent in enumerate(study.agents[0])
        },
        bins=study.bins,
        seeds=study.seeds,
        duration=study.duration,
        years=study.years,
        wind_class=study.wind_class,
        turbulence_class=study.turbulence_class,
        mean_wind=class_mean(study.wind_class),
        model_names=tuple(model.name for model in study.models),
        model_hashes=tuple(model.hash for model in study.models),
        gravity=bool(study.settings["gravity"]),
        speed_loop=any(COLLECTIVE_PITCH in model.fixed_outputs for model in study.models),
        beyond=sum(
            int(np.sum(each.duty.wind_max > LINEAR_SHARE * bin_.wind_speed))
            for each, bin_ in zip(reference, study.bins, strict=True)
        ),
        taken_up=taken_up,
        not_kept=not_kept,
    )


def _load(
    ours: Sequence[BinLoads], reference: Sequence[BinLoads], shares: Sequence[float], channel: int, place: int
) -> LifetimeLoad:
    first = ours[0].channels[channel]
    slope = first.slopes[place]
    loads, theirs = (
        [each.channels[channel].equivalent[place] for each in some] for some in (ours, reference)
    )
    whole = lifetime_load(theirs, shares, slope) or 1.0
    parts, unit = bin_damage(loads, shares, slope)
    return LifetimeLoad(
        channel=first.channel,
        unit=first.unit,
        slope=slope,
        equivalent_load=lifetime_load(loads, shares, slope),
        change=lifetime_change(loads, theirs, shares, slope),
        damage=tuple((parts * (unit / whole) ** slope).tolist()),
    )


def _duty(duties: Sequence[Duty], shares: Sequence[float], life: float) -> LifetimeDuty:
    weights, running = np.array(shares), sum(shares)

    def mean(name: str) -> float:
        return float(weights @ [getattr(each, name).mean() for each in duties])

    def largest(name: str) -> float:
        return max(float(getattr(each, name).max()) for each in duties)

    return LifetimeDuty(
        flap_travel=mean("flap_travel") / running,
        flap_cycles=mean("flap_cycles") * life,
        flap_rate_max=largest("flap_rate_max"),
        flap_power=mean("flap_power") / running,
        pitch_travel=mean("pitch_travel") / running,
        pitch_cycles=mean("pitch_cycles") * life,
        pitch_rate_max=largest("pitch_rate_max"),
    )


def designed_for(agents: Sequence[Agent], models: Sequence[TurbineModel]) -> str:
    """What an agent, as it acts at each wind speed, was designed or trained for, in words."""
    if all(isinstance(agent, IndividualPitch) for agent in agents):
        beside = [agent.beside for agent in agents if isinstance(agent, IndividualPitch)]
        if any(each.model_hash is not None for each in beside):
            return f"pitch: {_designed_for(agents, models)}; flaps: {_designed_for(beside, models)}"
    return _designed_for(agents, models)


def _designed_for(agents: Sequence[Agent], models: Sequence[TurbineModel]) -> str:
    if all(agent.model_hash is None for agent in agents):
        return "any"
    if all(made_for(agent, model) for agent, model in zip(agents, models, strict=True)):
        return "each speed" if len(models) > 1 else f"{number(models[0].wind_speed)} m/s"
    hashes = {agent.model_hash for agent in agents}
    if len(hashes) == 1:
        known = {model.hash: f"{number(model.wind_speed)} m/s" for model in models}
        (own,) = hashes
        return known.get(own or "") or _shipped_speeds().get(own or "", "another model")
    return "other models"


@cache
def _shipped_speeds() -> dict[str, str]:
    """Wind speed and name of each single model of the package, by hash."""
    speeds = dict[str, str]()
    for name in builtin_models():
        model = load_model(name)
        speeds[model.hash] = f"{number(model.wind_speed)} m/s, {name}"
    return speeds
