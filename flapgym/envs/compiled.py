"""The step of one turbine together with its observation and reward, in one call of compiled code.

An environment of one turbine steps in one or two microseconds; several calls, or one with many arrays, would double it.
Many turbines take `flapgym.plant` and `flapgym.envs.task` as they are.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from flapgym.core.arrays import Array, FloatArray
from flapgym.envs.task import Scoring
from flapgym.plant.backends.numba import (
    EDITION,
    OPTIONS,
    advance,
    first_cause,
    kept,
    own_after,
    packed,
    parameters_in,
    run_kept,
    turbine_in,
    turbine_packed,
    turbine_unpacked,
)
from flapgym.plant.linear import LinearPlant

NOT_FINITE = 1
"""Action, or reward."""


@njit(**OPTIONS)
def score(scoring, loads, noise, at, told, observation):  # type: ignore[no-untyped-def]
    """`flapgym.envs.task.observe` and `rewards` for one turbine: what is told, and the observation."""
    count, entries = scoring[0], scoring[4:].reshape((4, (scoring.size - 4) // 4))
    size, blades = loads.last.shape[1], loads.rbm_square.shape[1]
    told[:size] = loads.last[0]
    total = 0.0
    for b in range(blades):
        told[size + b] = loads.rbm_square[0, b]
        total += loads.rbm_square[0, b]
    size += blades
    of_moments = -scoring[1] * total / blades
    of_angles = -scoring[2] * loads.angle_square[0]
    of_tower = -scoring[3] * loads.fixed_square[0, int(count)] if count >= 0.0 else 0.0
    told[size], told[size + 1] = of_moments + of_angles + of_tower, of_moments
    told[size + 2], told[size + 3] = of_angles, of_tower
    for i in range(observation.size):
        value = told[int(entries[0, i])]
        if noise.size > 0 and entries[3, i] >= 0.0:
            value += noise[at, int(entries[3, i])]
        bound = np.float32(entries[2, i])
        # Rounded before it is bounded: a stop rounded up would leave the space.
        observation[i] = min(max(np.float32(value * entries[1, i]), -bound), bound)


def _entry(edition: int):  # type: ignore[no-untyped-def]
    """The compiled step. What a function closes over is part of what numba looks for on disk."""

    @kept
    def step(matrices, numbers, responses, scoring, noise, own, modes, action):  # type: ignore[no-untyped-def]
        _ = edition
        for i in range(action.size):
            if not abs(action[i]) < math.inf:
                return NOT_FINITE, own, modes, own, np.empty(0, np.float32)
        p = parameters_in(matrices, numbers)
        episode, state = turbine_in(own, modes, responses)
        after, loads = advance(p, episode, state, action.reshape((1, action.size)))
        told = np.empty(loads.last.shape[1] + p.blades + 4)
        observation = np.empty((scoring.size - 4) // 4, np.float32)
        # Past the end of an episode there is no more noise.
        score(scoring, loads, noise, min(after.elapsed[0], p.intervals), told, observation)
        return 0, own_after(own, after), after.modes.reshape(-1), told, observation

    return step


_step = _entry(EDITION)


class CompiledTurbine:
    """The one turbine of a plant, in flat arrays, which are the plant's state while it is stepped here.

    Parameters
    ----------
    plant : LinearPlant
        Of one turbine.
    scoring : Scoring
    """

    def __init__(self, plant: LinearPlant, scoring: Scoring) -> None:
        self._plant = plant
        self._matrices, self._numbers = packed(plant.parameters)
        head = [scoring.fore_aft, scoring.rbm_weight, scoring.angle_weight, scoring.tower_weight]
        table = (scoring.columns, scoring.factors, scoring.bounds, scoring.noisy)
        self._scoring = np.concatenate([head, *table], dtype=float)
        self.load(np.empty((0, 0)))
        # A step that leaves no trace: code is compiled or read now, and no step waits for it.
        still = np.zeros(plant.parameters.angle_limit.size, dtype=np.float32)
        run_kept(
            _step,
            self._matrices,
            self._numbers,
            self._responses,
            self._scoring,
            self._noise,
            self._own,
            self._modes,
            still,
        )

    def load(self, noise: Array) -> None:
        """Take the plant's turbine, and its measurement noise (intervals + 1, blades) [N m], or none of size 0."""
        self._noise = noise
        self._responses = self._plant.episode.responses
        self._own, self._modes = turbine_packed(self._plant.episode, self._plant.state)

    def store(self) -> None:
        """Give the plant its turbine back."""
        self._plant.state = turbine_unpacked(self._own, self._modes)

    def step(self, action: FloatArray) -> tuple[np.ndarray, Array]:
        """Observation (observed,) float32, and what the plant tells.

        Behind that stand the mean square of each moment, the reward and its three terms.

        Parameters
        ----------
        action : (blades F,) float
            Contiguous; clipped to +-1.

        Raises
        ------
        ValueError
            If an action is not finite; nothing has changed then.
        """
        try:
            status, own, modes, told, observation = _step(
                self._matrices,
                self._numbers,
                self._responses,
                self._scoring,
                self._noise,
                self._own,
                self._modes,
                action,
            )
        except SystemError as error:
            raise first_cause(error) from None
        if status:
            raise ValueError("action: expected finite numbers")
        self._own, self._modes = own, modes
        return observation, told
