"""Linear controllers of one kind side by side: their steps are one product, where one after the other costs calls."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flapgym.control import BladeController, RotorController
from flapgym.control.agent import by_blade
from flapgym.control.blade_controller import CONTROLLER_INPUTS, step_matrix
from flapgym.control.channels import MULTIBLADE
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
        self._turned = first.inputs == MULTIBLADE.inputs
        self._order = order = max(agent.system.order for agent in agents)
        size = order + len(first.inputs), order + len(first.outputs)
        self._step = np.zeros((self._count, *size))
        self._start = np.zeros((self._count, len(first.inputs), order))
        for index, agent in enumerate(agents):
            own, product = agent.system.order, step_matrix(agent.system, agent.acceleration_limit)
            rows = np.r_[:own, order : size[0]]
            columns = np.r_[:own, order : size[1]]
            self._step[index][np.ix_(rows, columns)] = product
            self._start[index, :, :own] = agent.start.T
        self._state: Array | None = None
        """State and input of every controller (agents, copies, order + inputs): what the product acts on."""

    def act(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """Actions (agents N, 3) for observations (agents N, n), agent by agent; each call is the next step."""
        values = observation.reshape(self._count, -1, observation.shape[-1])
        signals = len(CONTROLLER_INPUTS) * BLADES
        blades, azimuth = by_blade(values[..., :signals], CONTROLLER_INPUTS), np.empty(0)
        if not self._alone:
            blades = np.swapaxes(blades, -1, -2)
        if self._turned:
            azimuth = np.arctan2(values[..., signals + 1], values[..., signals]).astype(float)
            blades = to_components(blades, azimuth[..., None])
        measured = blades.reshape(self._count, -1, self._start.shape[1])
        if self._state is None:
            self._state = np.concatenate([measured @ self._start, measured], axis=-1)
        else:
            self._state[..., self._order :] = measured
        after = self._state @ self._step
        self._state[..., : self._order] = after[..., : self._order]
        demand = after[..., self._order :].reshape(*values.shape[:-1], BLADES)
        if self._turned:
            demand = to_blades(demand, azimuth)
        return np.clip(demand, -1.0, 1.0).astype(np.float32).reshape(-1, BLADES)


def same_kind(agent: object) -> tuple[str, ...] | None:
    """What agents of one bank share, their controllers' inputs; None if an agent is no linear controller."""
    # Not of a subclass, which may act otherwise.
    return agent.system.inputs if type(agent) in (BladeController, RotorController) else None  # type: ignore[attr-defined]
