"""Run agents through the environment, all of them side by side, and keep every plant sample."""

from __future__ import annotations

from collections.abc import Callable, Sequence, Set
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flapgym.control import Agent, OpenLoop
from flapgym.control.agent import check_time_step
from flapgym.core.arrays import Array
from flapgym.core.fields import Quantity
from flapgym.core.wording import shown
from flapgym.envs import FlapVectorEnv
from flapgym.envs.observation import QUANTITIES
from flapgym.evaluation.metrics import Record
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
    **settings
        Further keywords of the environment, as `measurement_noise`; turbulence is the model's own unless given.
    """
    if isinstance(seeds, Set) or not len(seeds):
        raise ValueError(f"simulate.seeds: expected a list of one or more, got {shown(seeds)}")
    Quantity("time", above=0.0).check(duration, "simulate.duration")
    for agent in agents:
        check_time_step(agent, model.time_step)
    records: dict[int, Record] = {}
    for steps in dict.fromkeys(agent.steps_per_action for agent in agents):
        group = [index for index, agent in enumerate(agents) if agent.steps_per_action == steps]
        found = _simulate_group([agents[i] for i in group], model, seeds, duration, advanced, settings)
        records |= dict(zip(group, found, strict=True))
    return [records[index] for index in range(len(agents))]


def coming_wind(model: TurbineModel, seeds: Sequence[int], samples: int, **settings: Any) -> Array:
    """Wind perturbation of each realisation at samples 1 to so many, (N, samples) [m/s]; no agent changes it."""
    return simulate(OpenLoop(), model, seeds, samples * model.time_step, **settings).wind


@dataclass(eq=False)
class _Player:
    """An agent at its turbines of a shared environment.

    Attributes
    ----------
    agent : Agent
    rows : slice
        Its turbines.
    columns : (n,) int
        Of the shared observation, in the order of the agent's own.
    coming : (N, samples) float or None
        The wind before it comes, as a lidar would tell a predictive controller [m/s].
    state : array or None
        Of the agent.
    """

    agent: Agent
    rows: slice
    columns: NDArray[np.int64]
    coming: Array | None
    state: Array | None = None

    def act(
        self, observations: NDArray[np.float32], start: NDArray[np.bool_], done: int
    ) -> NDArray[np.float32]:
        """Actions (N, 3) for what all turbines show after so many samples."""
        observation = observations[self.rows, self.columns]
        if self.coming is not None:
            ahead = self.coming[:, done : done + getattr(self.agent, "preview", 0)]
            observation = np.hstack([observation, ahead])
        action, self.state = self.agent.predict(observation, self.state, start[self.rows])
        return action


def _simulate_group(
    agents: Sequence[Agent],
    model: TurbineModel,
    seeds: Sequence[int],
    duration: float,
    advanced: Advanced,
    settings: dict[str, Any],
) -> list[Record]:
    """Records of agents of one interval between actions."""
    steps, kept = agents[0].steps_per_action, round(duration / model.time_step)
    observed = tuple(dict.fromkeys(name for agent in agents for name in agent.observe))
    environment = FlapVectorEnv(
        num_envs=len(agents) * len(seeds),
        model=model,
        observe=observed,
        steps_per_action=steps,
        # Whole intervals that cover the duration: agents of other intervals must not end early.
        duration=duration + steps * model.time_step,
        record_samples=True,
        **settings,
    )
    players = _players(agents, observed, model, seeds, kept, settings)
    observation, first = environment.reset(seed=list(seeds) * len(agents))
    start, series = np.ones(environment.num_envs, dtype=bool), dict[str, Array]()
    for done in range(0, kept, steps):
        with np.errstate(over="ignore", invalid="ignore"):  # an unstable controller grows without end
            actions = np.concatenate([player.act(observation, start, done) for player in players])
        if not np.isfinite(actions).all():
            name = _name_of(players, ~np.isfinite(actions).all(axis=1))
            raise ValueError(
                f"agent {name}: gave an action that is not finite after {done * model.time_step:.2f} s; "
                "its own state or its layers overflow"
            )
        observation, _, terminated, truncated, info = environment.step(actions)
        new = min(steps, kept - done)
        for name in _SAMPLES:
            samples = info["samples"][name]
            if not done:
                series[name] = np.empty((len(samples), kept, *samples.shape[2:]))
            series[name][:, done : done + new] = samples[:, :new]
        start = terminated | truncated
        advanced(environment.num_envs * new)
        if done + steps < kept and start.any():
            name = _name_of(players, start)
            raise RuntimeError(f"agent {name}: the episode ended after {done + steps} of {kept} samples")
    environment.close()
    return [
        Record(
            **{name: values[player.rows] for name, values in series.items()},
            azimuth=first["azimuth"][player.rows],
            time_step=model.time_step,
        )
        for player in players
    ]


def _players(
    agents: Sequence[Agent],
    observed: Sequence[str],
    model: TurbineModel,
    seeds: Sequence[int],
    samples: int,
    settings: dict[str, Any],
) -> list[_Player]:
    """The agents at their turbines, one after the other, each with one turbine a seed."""
    ends = np.cumsum([0, *(QUANTITIES[name].size for name in observed)])
    places = {name: np.arange(ends[i], ends[i + 1]) for i, name in enumerate(observed)}
    players = []
    for index, agent in enumerate(agents):
        preview = getattr(agent, "preview", 0)
        players.append(
            _Player(
                agent,
                slice(index * len(seeds), (index + 1) * len(seeds)),
                np.concatenate([places[name] for name in agent.observe]),
                coming_wind(model, seeds, samples + preview, **settings) if preview else None,
            )
        )
    return players


def _name_of(players: Sequence[_Player], turbines: NDArray[np.bool_]) -> str:
    """The first agent that one of these turbines is of."""
    return next(player.agent.name for player in players if turbines[player.rows].any())
