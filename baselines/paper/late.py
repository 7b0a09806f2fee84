"""Shipped agents whose measured moments arrive late, their flaps' own motion in time."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flapgym.control import Agent, BladeController, Policy
from flapgym.control.agent import BLADES, Array, Floats
from flapgym.control.margins import late_measurement


@dataclass(frozen=True, eq=False)
class LatePolicy:
    """A policy that acts as often as ever but reads moments of some plant steps ago.

    Its state holds the moments not yet read, the action held and the steps left to hold it.
    """

    policy: Policy
    steps: int
    steps_per_action: int = 1

    @property
    def name(self) -> str:
        """What tables call it."""
        return self.policy.name

    @property
    def observe(self) -> tuple[str, ...]:
        """What it observes."""
        return self.policy.observe

    @property
    def model_hash(self) -> str | None:
        """Of the model the policy was trained on."""
        return self.policy.model_hash

    def predict(
        self,
        observation: Floats,
        state: Array | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], Array | None]:
        """Action (..., 3) and next state for an observation (..., 3 n)."""
        at = slice(BLADES * self.observe.index("rbm"), BLADES * (self.observe.index("rbm") + 1))
        seen = np.array(observation, dtype=float)
        moments = seen[..., at].copy()
        fresh = np.concatenate(
            [np.tile(moments, self.steps), np.zeros_like(moments), np.zeros_like(moments[..., :1])], axis=-1
        )
        if state is None:
            state = fresh
        elif episode_start is not None and np.any(episode_start):
            state = np.where(np.asarray(episode_start)[..., None], fresh, state)
        queue, held, left = np.split(state, [BLADES * self.steps, BLADES * (self.steps + 1)], axis=-1)
        seen[..., at] = queue[..., :BLADES]
        due = left == 0.0
        action = np.where(due, self.policy.predict(seen)[0], held) if due.any() else held
        left = np.where(due, self.policy.steps_per_action, left) - 1.0
        after = np.concatenate([queue[..., BLADES:], moments, action, left], axis=-1)
        return action.astype(np.float32), after


def late(agent: Agent, steps: int, rotor_speed: float) -> Agent:
    """The agent with its moments so many plant steps late."""
    if steps == 0:
        return agent
    if isinstance(agent, Policy):
        return LatePolicy(agent, steps)
    if isinstance(agent, BladeController):
        # At an episode's start all moments on their way are the first one.
        start = np.vstack([agent.start, np.tile([1.0, 0.0, 0.0], (steps, 1))])
        return replace(agent, system=late_measurement(agent.system, steps, rotor_speed), start=start)
    raise ValueError(f"agent {agent.name}: expected a controller of single blades or a policy")
