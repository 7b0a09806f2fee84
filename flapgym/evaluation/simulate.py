"""Run agents through the environment, all of them side by side, and keep every plant sample."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flapgym.control import Agent, OpenLoop
from flapgym.control.agent import check_fit, check_pitch
from flapgym.core.arrays import BLADES, Array
from flapgym.core.fields import Count, Numbers, Quantity
from flapgym.core.wording import shown
from flapgym.envs import FlapVectorEnv
from flapgym.envs.settings import Settings
from flapgym.evaluation import cycles
from flapgym.evaluation.bank import LinearBank, same_kind
from flapgym.evaluation.record import Record
from flapgym.model.turbine_model import TurbineModel

_SAMPLES = ("rbm", "tip_deflection", "flap_angle", "flap_rate", "tower_fore_aft", "tower_side_side", "wind")

Advanced = Callable[[int], Any]
"""Told the samples, of all turbines together, that a step adds to the records."""


def simulate(
    agent: Agent,
    model: TurbineModel,
    seeds: Sequence[int],
    duration: float,
    advanced: Advanced = lambda samples: None,
    **settings: Any,
) -> Record:
    """The record of `agent` on one realisation per seed, from a calm flap: `simulate_together` of one agent."""
    (record,) = simulate_together([agent], model, seeds, duration, advanced, **settings)
    return record


def simulate_together(
    agents: Sequence[Agent],
    model: TurbineModel,
    seeds: Sequence[int],
    duration: float,
    advanced: Advanced = lambda samples: None,
    lasting: float | None = None,
    **settings: Any,
) -> list[Record]:
    """The records of all agents on one realisation per seed, from calm flaps.

    Agents that hold their actions equally long share one vector environment, agents by realisations: a step costs
    hardly more for many turbines than for one.

    Parameters
    ----------
    agents : sequence of Agent
        What acts; their own `observe` and `steps_per_action` make the environments.
    model : TurbineModel
        The turbine.
    seeds : sequence of int
        Seeds of the realisations; agents given the same seeds meet the same wind and azimuth.
    duration : float
        Length of each [s]; a record keeps round(duration / dt) samples.
    advanced : callable
        For a progress bar.
    lasting : float, optional
        Length of the episodes in a field [s], by default the `episode_length` of these agents: that of more agents, so
        that some of them meet the same wind.
    **settings
        Further keywords of the environment, as `sensors`; turbulence is the model's own unless given.
    """
    if isinstance(seeds, Set) or not len(seeds):
        raise ValueError(f"simulate.seeds: expected a list of one or more, got {shown(seeds)}")
    Quantity("time", above=0.0).check(duration, "simulate.duration")
    for agent in agents:
        check_fit(agent, model)
        check_pitch(agent, bool(settings.get("pitch")))
    records: dict[int, Record] = {}
    for steps, places, length in _episodes(agents, model, duration, settings, lasting):
        found = _simulate_group(
            [agents[place] for place in places], steps, length, model, seeds, duration, advanced, settings
        )
        records |= dict(zip(places, found, strict=True))
    return [records[index] for index in range(len(agents))]


def _episodes(
    agents: Sequence[Agent],
    model: TurbineModel,
    duration: float,
    settings: Mapping[str, Any],
    lasting: float | None = None,
) -> list[tuple[int, list[int], float]]:
    """Which agents share an environment: plant steps an action, their places, and how long its episodes last [s]."""
    intervals = _intervals(agents)
    alike = episode_length(agents, model, duration) if lasting is None else lasting
    return [
        (
            steps,
            [place for place, interval in enumerate(intervals) if interval == steps],
            alike if _in_field(settings) else duration + steps * model.time_step,
        )
        for steps in dict.fromkeys(intervals)
    ]


def _intervals(agents: Sequence[Agent]) -> list[int]:
    """Plant steps for which each agent holds its actions here."""
    # Flaps at rest are the same at any interval: they go along with whoever holds actions longest.
    others = [agent.steps_per_action for agent in agents if type(agent) is not OpenLoop]
    return [max(others) if others and type(agent) is OpenLoop else agent.steps_per_action for agent in agents]


def _in_field(settings: Mapping[str, Any]) -> bool:
    """Whether the wind differs over the disk."""
    wind = settings.get("wind")
    return (wind.get("field") if isinstance(wind, Mapping) else getattr(wind, "field", None)) is not None


def longest_duration(
    agents: Sequence[Agent], model: TurbineModel, lasts: float, settings: Mapping[str, Any]
) -> float:
    """Longest duration [s] that `simulate_together` can take from a wind that lasts so long; 0 if there is none."""
    # Preview is played by flaps at rest, and asks for as much more.
    played = [(list(agents), 0)] + [
        ([OpenLoop()], preview) for agent in agents if (preview := getattr(agent, "preview", 0))
    ]
    found = list[int]()
    for some, further in played:
        intervals = _intervals(some)
        if _in_field(settings):
            common = math.lcm(*intervals)
            found.append(_whole(lasts, common * model.time_step) * common - max(intervals) - further)
        else:
            found += [(_whole(lasts, steps * model.time_step) - 1) * steps - further for steps in intervals]
    return max(0, min(found)) * model.time_step


def _whole(length: float, part: float) -> int:
    """How often a part goes into a length, up to rounding."""
    return math.floor(length / part + 1e-9)


def require_settings(
    agents: Sequence[Agent], model: TurbineModel, duration: float, settings: Mapping[str, Any]
) -> None:
    """Refuse, before any simulation, settings of the environment that do not suit the model or the agents' episodes.

    Raises
    ------
    ValueError, FileNotFoundError, ImportError
        Of `flapgym.envs.settings.Settings`.
    """
    for steps, _, lasting in _episodes(agents, model, duration, settings):
        keywords = {**settings, "model": model, "duration": lasting, "steps_per_action": steps}
        chosen = Settings.of(keywords, "FlapVectorEnv")
        chosen.surroundings(model)
        chosen.given_wind(model)


POLICY_STEPS = 5
"""Plant steps for which the shipped policies hold an action."""


def episode_length(agents: Sequence[Agent], model: TurbineModel, duration: float) -> float:
    """Length of the episodes in which agents go through so much of a field together [s].

    A field that lasts longer is another one: all agents take one length, of whole actions of each of them. Those of
    `POLICY_STEPS` always count, so that linear agents meet the same field whether a policy flies beside them or not.
    """
    intervals = [POLICY_STEPS, *_intervals(agents)]
    common = math.lcm(*intervals)
    least = math.ceil(duration / model.time_step + max(intervals) - 1e-9)
    return -(-least // common) * common * model.time_step


def get_ready(model: TurbineModel) -> None:
    """Wait now for code that has to be compiled, which says so in a line of its own, and not under a progress bar."""
    FlapVectorEnv(model=model).close()
    cycles.get_ready()


def coming_wind(model: TurbineModel, seeds: Sequence[int], samples: int, **settings: Any) -> Array:
    """Wind perturbation of each realisation at samples 1 to so many, (N, samples) [m/s]; no agent changes it."""
    return simulate(OpenLoop(), model, seeds, samples * model.time_step, **settings).wind


def steady_loads(model: TurbineModel, azimuth: Array, samples: int, **settings: Any) -> dict[str, Array]:
    """What steady inflow and gravity do to every output, flaps at rest; no agent and no turbulence changes it.

    Parameters
    ----------
    model : TurbineModel
    azimuth : (N,) float
        Of blade 1 one time step before the first sample [rad], as a `Record` has it.
    samples : int
        T.
    **settings
        Further keywords of the environment, as `wind`.

    Returns
    -------
    dict
        By name, about the mean over a revolution: of the blades' outputs (N, T, 3), of the fixed ones (N, T). Empty
        where nothing is steady.

    Raises
    ------
    ValueError
        If the azimuths are no numbers, there is no sample, or the model has no inputs for what the settings ask for.
    """
    begun = Numbers("angle", axes=1).check(azimuth, "steady_loads.azimuth")
    Count(at_least=1).check(samples, "steady_loads.samples")
    # Of samples all outputs are told.
    environment = FlapVectorEnv(
        model=model, record_samples=True, duration=samples * model.time_step, **settings
    )
    turned = model.rotor_speed * model.time_step * np.arange(1, samples + 1)
    # One realisation after another: the phases of all harmonics at every sample take more memory than the loads.
    each = [environment.steady(angle + turned) for angle in begun]
    environment.close()
    return {name: np.stack([one[name] for one in each]) for name in each[0]}


@dataclass(eq=False)
class _Player:
    """An agent, or linear ones together, at turbines of a shared environment.

    Attributes
    ----------
    rows : slice
        The turbines, agent by agent.
    columns : (n,) int
        Of the shared observation, in the order of the agents' own.
    act : callable
        Actions (turbines, 3 F) for observations (turbines, n) after so many samples; each call is the next step.
    """

    rows: slice
    columns: NDArray[np.int64]
    act: Callable[[NDArray[np.float32], int], NDArray[np.float32]]


def _simulate_group(
    agents: Sequence[Agent],
    steps: int,
    lasting: float,
    model: TurbineModel,
    seeds: Sequence[int],
    duration: float,
    advanced: Advanced,
    settings: dict[str, Any],
) -> list[Record]:
    """Records of agents of one interval between actions, so many samples of episodes that last a little longer [s]."""
    kept = round(duration / model.time_step)
    observed = tuple(dict.fromkeys(name for agent in agents for name in agent.observe))
    environment = FlapVectorEnv(
        num_envs=len(agents) * len(seeds),
        model=model,
        task={"observe": observed},
        steps_per_action=steps,
        # Whole intervals that cover the duration: agents of other intervals must not end early.
        duration=lasting,
        record_samples=True,
        autoreset_mode="Disabled",  # nothing ends before its last sample
        **settings,
    )
    # Of one kind side by side, so that linear controllers can act together.
    order = sorted(range(len(agents)), key=lambda index: same_kind(agents[index]) or ())
    shape = environment.action_space.shape or ()
    agents = [agents[index] for index in order]
    players = _players(agents, environment.observed, model, seeds, kept, settings)
    observation, first = environment.reset(seed=list(seeds) * len(agents))
    columns = environment.sampled
    series = np.empty(0)
    for done in range(0, kept, steps):
        with np.errstate(over="ignore", invalid="ignore"):  # an unstable controller grows without end
            actions = np.zeros(shape, dtype=np.float32)  # who does not pitch leaves it where it is
            for player in players:
                acts = player.act(observation[player.rows, player.columns], done)
                actions[player.rows, : acts.shape[1]] = acts
        if not np.isfinite(actions).all():
            name = agents[int(np.argmin(np.isfinite(actions).all(axis=1))) // len(seeds)].name
            raise ValueError(
                f"agent {name}: gave an action that is not finite after {done * model.time_step:.2f} s; "
                "its own state or its layers overflow"
            )
        observation, samples = environment.advance(actions)
        if not np.isfinite(observation).all():
            name = agents[int(np.argmin(np.isfinite(observation).all(axis=1))) // len(seeds)].name
            raise RuntimeError(
                f"agent {name}: loads are not finite after {(done + steps) * model.time_step:.2f} s"
            )
        if not done:
            # Time first: a step then writes one piece of memory, and not one a turbine far from each other.
            series = np.empty((kept, *samples.shape[::2]))
        new = min(steps, kept - done)
        series[done : done + new] = samples.swapaxes(0, 1)[:new]
        advanced(environment.num_envs * new)
    environment.close()
    own_samples = (*_SAMPLES, "pitch_angle") if settings.get("pitch") else _SAMPLES
    further = tuple(name for name in (*model.blade_outputs, *model.fixed_outputs) if name not in _SAMPLES)
    records = list[Record]()
    for place in np.argsort(order):
        rows = slice(place * len(seeds), (place + 1) * len(seeds))
        mine = np.ascontiguousarray(series[:, rows].swapaxes(0, 1))
        told = {name: mine.take(columns[name], axis=2) for name in (*own_samples, *further)}
        more = {name: told.pop(name) for name in further}
        records.append(
            Record(**told, azimuth=first["azimuth"][rows], time_step=model.time_step, further=more)
        )
    return records


def _players(
    agents: Sequence[Agent],
    observed: dict[str, range],
    model: TurbineModel,
    seeds: Sequence[int],
    samples: int,
    settings: dict[str, Any],
) -> list[_Player]:
    """Who acts at which turbines; linear controllers of one kind that follow each other act together."""
    players, first = list[_Player](), 0
    for kind, found in groupby(agents, same_kind):
        for some in [list(found)] if kind else [[agent] for agent in found]:
            rows = slice(first * len(seeds), (first + len(some)) * len(seeds))
            columns = np.concatenate([np.array(observed[name]) for name in some[0].observe])
            act = _alone(some[0], model, seeds, samples, settings) if kind is None else _in_step(some)
            players.append(_Player(rows, columns, act))
            first += len(some)
    return players


def _in_step(agents: Sequence[Agent]) -> Callable[[NDArray[np.float32], int], NDArray[np.float32]]:
    bank = LinearBank(agents)  # type: ignore[arg-type]
    return lambda observation, done: bank.act(observation)


def _alone(
    agent: Agent, model: TurbineModel, seeds: Sequence[int], samples: int, settings: dict[str, Any]
) -> Callable[[NDArray[np.float32], int], NDArray[np.float32]]:
    """One agent's own `predict`; predictive ones may be given the wind before it comes, as a lidar would."""
    preview = getattr(agent, "preview", 0)
    coming = coming_wind(model, seeds, samples + preview, **settings) if preview else None
    state: Array | None = None
    expected = (len(seeds), BLADES * (len(model.flaps) + getattr(agent, "pitches", False)))

    def act(observation: NDArray[np.float32], done: int) -> NDArray[np.float32]:
        nonlocal state
        if coming is not None:
            observation = np.hstack([observation, coming[:, done : done + preview]])
        start = np.full(len(observation), done == 0)
        action, state = agent.predict(observation, state, start)
        # An agent of another's making need not tell for how many flaps it is.
        if np.shape(action) != expected:
            raise ValueError(
                f"agent {agent.name}: expected actions of shape {expected}, {len(model.flaps)} a blade, "
                f"got {np.shape(action)}; make it for the model {model.name}"
            )
        return action

    return act
