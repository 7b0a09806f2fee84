"""Gain scheduling: one agent a wind speed, chosen at the beginning of an episode by the wind that it seems to be."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flapgym.control.agent import Agent, Floats
from flapgym.control.agent_files import load_agent
from flapgym.model.model_set import ModelSet

SCHEDULED_BY = "wind_speed"
"""What it observes behind all that its agents do: the slow estimate of the mean wind [m/s]."""


@dataclass(frozen=True, eq=False)
class ScheduledAgent:
    """Agents of one design at several wind speeds.

    Each turbine's is chosen as its episode begins, by the wind speed nearest to the one observed, and kept: the mean
    wind of an episode does not change, and controllers that take turns within one would have to hand over their states.

    Parameters
    ----------
    name : str
        What tables call it.
    wind_speeds : tuple of float
        For which the agents were made, ascending [m/s].
    agents : tuple of Agent
        All with the same observations, flaps and interval between actions.

    Raises
    ------
    ValueError
        If there is none, there are not as many of both, or the agents do not go together.
    """

    name: str
    wind_speeds: tuple[float, ...]
    agents: tuple[Agent, ...]
    model_hash: None = None
    """Its agents are each of another model."""

    def __post_init__(self) -> None:
        if not isinstance(self.agents, tuple) or not isinstance(self.wind_speeds, tuple):
            kinds = type(self.wind_speeds).__name__, type(self.agents).__name__
            raise ValueError(
                f"scheduled: expected tuples of wind speeds and of agents, got {kinds[0]}, {kinds[1]}"
            )
        if not self.agents or len(self.agents) != len(self.wind_speeds):
            raise ValueError(
                f"scheduled.agents: expected one for each of {len(self.wind_speeds)} wind speeds, at least one, "
                f"got {len(self.agents)}"
            )
        if list(self.wind_speeds) != sorted(set(self.wind_speeds)):
            raise ValueError(
                f"scheduled.wind_speeds: expected them ascending, each once, got {self.wind_speeds}"
            )
        for trait in ("observe", "steps_per_action", "time_step", "flaps", "pitches"):
            first, *others = (getattr(agent, trait, None) for agent in self.agents)
            if any(other != first for other in others):
                raise ValueError(
                    f"scheduled.agents: expected the same {trait} of all, got {[first, *others]}"
                )

    @property
    def observe(self) -> tuple[str, ...]:
        """What its agents observe, then the wind speed."""
        return (*self.agents[0].observe, SCHEDULED_BY)

    @property
    def steps_per_action(self) -> int:
        """Plant steps for which an action is held."""
        return self.agents[0].steps_per_action

    def __getattr__(self, trait: str) -> Any:
        """Time step, number of flaps and whether blades pitch, where its agents say so."""
        if trait in ("time_step", "flaps", "pitches"):
            return getattr(self.agents[0], trait)
        raise AttributeError(trait)

    def at(self, wind_speed: float) -> Agent:
        """The agent for the wind speed nearest to one [m/s]."""
        return self.agents[int(np.abs(np.array(self.wind_speeds) - wind_speed).argmin())]

    def predict(
        self,
        observation: Floats,
        state: Any = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], Any]:
        """As any agent; the state holds each turbine's choice, and its agents' own states one after another."""
        values = np.asarray(observation)
        batch = values.shape[:-1]
        rows = values.reshape(-1, values.shape[-1])
        begins = np.full(len(rows), state is None)
        if state is not None and episode_start is not None:
            begins = np.broadcast_to(np.reshape(episode_start, batch), batch).ravel()
        chosen = np.abs(rows[:, -1:] - np.array(self.wind_speeds)).argmin(axis=1)
        own: list[Any] = [None] * len(rows)
        if state is not None:
            chosen = np.where(begins, chosen, state[0])
            own = list(state[1])
        actions: NDArray[np.float32] | None = None
        for place in np.unique(chosen):
            mine = np.flatnonzero(chosen == place)
            for fresh in (True, False):
                some = mine[begins[mine] == fresh]
                if not some.size:
                    continue
                before = None if fresh or own[some[0]] is None else np.stack([own[row] for row in some])
                action, after = self.agents[place].predict(
                    rows[some, :-1], before, np.full(some.size, fresh), deterministic
                )
                if actions is None:
                    actions = np.empty((len(rows), action.shape[-1]), dtype=np.float32)
                actions[some] = action
                for row, number in enumerate(some):
                    own[number] = None if after is None else after[row]
        assert actions is not None
        return actions.reshape(*batch, -1), (chosen, own)


def scheduled_agent(name: str, models: ModelSet) -> ScheduledAgent:
    """The agent of a name at every wind speed of a set, each as `load_agent` gives it for that model.

    Raises
    ------
    ValueError
        As `load_agent`, or if the agents do not go together.
    """
    agents = tuple(load_agent(name, model) for model in models)
    return ScheduledAgent(name, models.wind_speeds, agents)
