"""Linear controllers of one kind side by side: their steps are one product, where one after the other costs calls."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flapgym.control import BladeController, RotorController
from flapgym.control.agent import by_blade
from flapgym.control.blade_controller import OBSERVED, step_matrix
from flapgym.control.channels import controller_channels
from flapgym.core.arrays import BLADES, Array
from flapgym.model.multiblade import to_blades, to_components

Linear = BladeController | RotorController


class LinearBank:
    """The controllers of several agents, each at N turbines, from the start of an episode on.

    Actions are those of the agents' own `predict`, to round-off. Smaller controllers are filled up with states that
    stay zero.

    Parameters
    ----------
    agents : sequence of BladeController, or of RotorController in one frame
        Of `same_kind`.
    """

    def __init__(self, agents: Sequence[Linear]) -> None:
        self._count, first = len(agents), agents[0].system
        self._alone = isinstance(agents[0], BladeController)
        channels = controller_channels(first.inputs)
        self._turned, self._flaps = channels.multiblade, channels.flaps
        self._order = order = max(agent.system.order for agent in agents)
        size = order + len(first.inputs), order + len(first.outputs)
        self._step = np.zeros((self._count, *size))
        self._start = np.zeros((self._count, len(first.inputs), order))
        for index, agent in enumerate(agents):
            unit = np.repeat(agent.acceleration_limits, channels.count)
            own, product = agent.system.order, step_matrix(agent.system, unit)
            rows = np.r_[:own, order : size[0]]
            columns = np.r_[:own, order : size[1]]
            self._step[index][np.ix_(rows, columns)] = product
            self._start[index, :, :own] = agent.start.T
        self._state: Array | None = None
        """State and input of every controller (agents, copies, order + inputs): what the product acts on."""

    def act(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """Actions (agents N, 3 F) for observations (agents N, n), agent by agent; each call is the next step."""
        values = observation.reshape(self._count, -1, observation.shape[-1])
        signals, flaps = BLADES * (1 + 2 * self._flaps), self._flaps
        blades, azimuth = by_blade(values[..., :signals], OBSERVED, flaps), np.empty(0)
        if not self._alone:
            blades = np.swapaxes(blades, -1, -2)
        if self._turned:
            azimuth = np.arctan2(values[..., signals + 1], values[..., signals]).astype(float)[..., None]
            blades = to_components(blades, azimuth)
        measured = blades.reshape(self._count, -1, self._start.shape[1])
        if self._state is None:
            self._state = np.concatenate([measured @ self._start, measured], axis=-1)
        else:
            self._state[..., self._order :] = measured
        after = self._state @ self._step
        self._state[..., : self._order] = after[..., : self._order]
        demand = after[..., self._order :]
        if not self._alone:
            # Signal by signal there, blade by blade in an action.
            demand = demand.reshape(*values.shape[:-1], flaps, BLADES)
            demand = np.swapaxes(to_blades(demand, azimuth) if self._turned else demand, -1, -2)
        return np.clip(demand, -1.0, 1.0).astype(np.float32).reshape(-1, BLADES * flaps)


def same_kind(agent: object) -> tuple[str, ...] | None:
    """What agents of one bank share, their controllers' inputs; None if an agent is no linear controller."""
    # Not of a subclass, which may act otherwise.
    return agent.system.inputs if type(agent) in (BladeController, RotorController) else None  # type: ignore[attr-defined]
