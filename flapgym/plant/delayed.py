"""A plant whose observed moments are late: any other plant, with a memory of its moments sample by sample."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flapgym.core.arrays import BLADES, Array, FloatArray
from flapgym.plant.interface import Plant, Quick, Start, Task, told
from flapgym.plant.layout import RBM, ROW, SAMPLE, SAMPLE_RBM


class DelayedPlant:
    """The observation shows the moments of some plant samples ago, with today's noise; rows and reward are on time.

    Before an episode the moments are taken to have been those of its first sample.

    Parameters
    ----------
    plant : Plant
        The one behind.
    task : Task
        Its task.
    delay : int
        Plant samples d >= 1.
    """

    def __init__(self, plant: Plant, task: Task, delay: int) -> None:
        self.plant, self.task, self.delay = plant, task, delay
        self.count, self.setup, self.fingerprint = plant.count, plant.setup, plant.fingerprint
        self._past = np.zeros((self.count, delay, BLADES))
        """Moments of the last d samples, the oldest first [N m]."""
        self._noise: Array | None = None

    @property
    def noise_count(self) -> int:
        """Standard normal numbers one turbine's realisation takes."""
        return self.plant.noise_count

    @property
    def elapsed(self) -> NDArray[np.int64]:
        """Intervals done since each turbine's reset, (n,)."""
        return self.plant.elapsed

    def reset(self, turbines: NDArray[np.int64], start: Start) -> tuple[NDArray[np.float32], Array]:
        """Begin an episode of m turbines; observations (m, observed) and rows (m, ROW) of sample 0."""
        _, rows = self.plant.reset(turbines, replace(start, measurement_noise=None))
        self._past[turbines] = rows[:, None, RBM : RBM + BLADES]
        noise = start.measurement_noise
        if noise is not None:
            if self._noise is None:
                self._noise = np.zeros((self.count, *noise.shape[1:]))
            self._noise[turbines] = noise
        return self.task.observe(rows, None if noise is None else noise[:, 0]), rows

    def step(
        self,
        actions: FloatArray,
        observation: NDArray[np.float32],
        rows: Array,
        samples: Array | None = None,
    ) -> int:
        """Hold actions (n blades,) for k plant steps; see flapgym.plant.interface.Plant."""
        n = self.count
        if samples is None:
            samples = np.empty((n, self.setup.steps_per_action, SAMPLE))
        status = self.plant.step(actions, observation, rows, samples)
        if status < 0:
            return status
        seen = np.concatenate([self._past, samples[:, :, SAMPLE_RBM : SAMPLE_RBM + BLADES]], axis=1)
        late = rows.reshape(n, ROW).copy()
        late[:, RBM : RBM + BLADES] = seen[:, -self.delay - 1]
        self._past = seen[:, -self.delay :]
        at = np.minimum(self.elapsed, self.setup.intervals)
        noise = None if self._noise is None else self._noise[np.arange(n), at]
        observation.reshape(n, -1)[:] = self.task.observe(late, noise)
        return status

    @property
    def quick(self) -> Quick:
        """`step` for flat float32 arrays and without samples."""
        return told, self.step

    def get_state(self, turbine: int) -> dict[str, Any]:
        """What changes of a turbine, but for its realisation, as plain values for JSON."""
        return self.plant.get_state(turbine) | {"past": self._past[turbine].tolist()}

    def set_state(self, turbine: int, state: dict[str, Any]) -> None:
        """Go on from there; `reset` with the same realisation comes before."""
        self.plant.set_state(turbine, state)
        self._past[turbine] = state["past"]
