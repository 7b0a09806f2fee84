"""Linear controllers of one kind side by side: what goes before and behind their products is done once for all."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flapgym.control import BladeController, RotorController
from flapgym.control.agent import by_blade
from flapgym.control.blade_controller import OBSERVED, step_matrix
from flapgym.control.channels import controller_channels
from flapgym.core.arrays import BLADES, Array
from flapgym.core.multiblade import blade_azimuths

Linear = BladeController | RotorController
_SHARES = np.array([1.0, 2.0, 2.0]) / BLADES
"""Of blade signals in components: a mean, and a cosine and a sine whose squares sum to half the blades."""


class LinearBank:
    """The controllers of several agents, each at N turbines, from the start of an episode on.

    Actions are those of the agents' own `predict`, to round-off.

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
        self._inputs, self._outputs = len(first.inputs), len(first.outputs)
        self._largest = max(agent.system.order for agent in agents)
        self._steps, self._starts = list[Array](), list[Array]()
        for agent in agents:
            unit = np.repeat(agent.acceleration_limits, channels.count)
            # Signals before states, so that what a controller smaller than others has stands together.
            product = np.roll(step_matrix(agent.system, unit), (self._inputs, self._outputs), axis=(0, 1))
            self._steps.append(np.ascontiguousarray(product))
            self._starts.append(agent.start.T)
        self._before: Array | None = None
        """Input and state of every controller (agents, copies, inputs + largest order): what the products act on."""
        self._after = np.empty(0)
        """Demand and state after it (agents, copies, outputs + largest order)."""

    def act(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """Actions (agents N, 3 F) for observations (agents N, n), agent by agent; each call is the next step."""
        values = observation.reshape(self._count, -1, observation.shape[-1])
        signals, flaps = BLADES * (1 + 2 * self._flaps), self._flaps
        blades, turn = by_blade(values[..., :signals], OBSERVED, flaps), np.empty(0)
        if not self._alone:
            blades = np.swapaxes(blades, -1, -2)
        if self._turned:
            # Once for both ways: `to_components` and `to_blades` take the cosines and sines of each anew.
            turn = _to_blades(np.arctan2(values[..., signals + 1], values[..., signals]).astype(float))
            blades = blades @ (np.swapaxes(turn, -1, -2) * _SHARES)
        measured = blades.reshape(self._count, -1, self._inputs)
        if self._before is None:
            copies = measured.shape[1]
            self._before = np.zeros((self._count, copies, self._inputs + self._largest))
            self._after = np.zeros((self._count, copies, self._outputs + self._largest))
            for index, start in enumerate(self._starts):
                self._after[index, :, self._outputs : self._outputs + start.shape[1]] = (
                    measured[index] @ start
                )
        self._before[..., : self._inputs] = measured
        self._before[..., self._inputs :] = self._after[..., self._outputs :]
        for index, step in enumerate(self._steps):
            rows, columns = step.shape
            np.matmul(self._before[index, :, :rows], step, out=self._after[index, :, :columns])
        demand = self._after[..., : self._outputs]
        if not self._alone:
            # Signal by signal there, blade by blade in an action.
            demand = demand.reshape(*values.shape[:-1], flaps, BLADES)
            demand = np.swapaxes(demand @ turn if self._turned else demand, -1, -2)
        return np.clip(demand, -1.0, 1.0).astype(np.float32).reshape(-1, BLADES * flaps)


def _to_blades(azimuth: Array) -> Array:
    """(..., 3 components, 3 blades) at rotor azimuth (...) [rad]: one, cosine and sine of each blade's azimuth."""
    angle = blade_azimuths(azimuth)
    return np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle)], axis=-2)


def same_kind(agent: object) -> tuple[str, ...] | None:
    """What agents of one bank share, their controllers' inputs; None if an agent is no linear controller."""
    # Not of a subclass, which may act otherwise.
    return agent.system.inputs if type(agent) in (BladeController, RotorController) else None  # type: ignore[attr-defined]
