"""Plants in numpy: whatever gives the samples of an interval becomes a plant here, task and actuators included."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flapgym.core.arrays import Array, FloatArray
from flapgym.model.turbine_model import TurbineModel
from flapgym.plant.actuator import Actuator
from flapgym.plant.interface import Interval, Quick, Setup, Start, Task, told
from flapgym.plant.kernel import fingerprint
from flapgym.plant.layout import (
    ANGLE,
    AZIMUTH,
    COSINE,
    MEAN_SQUARE,
    RATE,
    RBM,
    REWARD,
    REWARD_ANGLE,
    REWARD_RBM,
    REWARD_TOWER,
    ROW,
    SAMPLE_ANGLE,
    SAMPLE_RATE,
    SAMPLE_RBM,
    SAMPLE_TIP,
    SAMPLE_TOWER,
    SAMPLE_WIND,
    SINE,
    STOPPED,
    TIP,
    TOWER,
    TRAVEL,
    WIND,
)

NONFINITE, OVER, WRONG_COUNT, BAD_ACTION = 1, 2, -1, -2
"""What `Plant.step` returns: two bits, or a negative number (BAD_ACTION - i for action i)."""


class SampledPlant(ABC):
    """A plant whose steps give the samples of an interval.

    A subclass gives `begin` and `advance`, and adds to `get_state` and `set_state` what it has of its own.

    Parameters
    ----------
    model : TurbineModel
    count : int
        Number of turbines n.
    setup : Setup
    task : Task
    """

    def __init__(self, model: TurbineModel, count: int, setup: Setup, task: Task) -> None:
        self.model, self.count, self.setup, self.task = model, count, setup, task
        self.fingerprint = plant_fingerprint(model)
        self.actuator = Actuator(
            model.flap_angle_limit,
            model.flap_rate_limit,
            model.time_step,
            setup.steps_per_action,
            setup.faults.lag,
        )
        self.elapsed = np.zeros(count, dtype=np.int64)
        """Intervals done since the turbine's reset."""
        self.start_azimuth = np.zeros(count)
        """Of blade 1 at the reset [rad]."""
        self._turn = model.rotor_speed * model.time_step * setup.steps_per_action
        self._flaps = np.zeros((count, 4, setup.blades))
        """Angle, rate, lagged acceleration, command."""
        self._travel = np.zeros((count, 3))
        self._noise: Array | None = None
        self._moving = ~setup.faults.held[: setup.blades]

    @property
    @abstractmethod
    def noise_count(self) -> int:
        """Standard normal numbers one turbine's realisation takes."""

    @abstractmethod
    def begin(self, turbines: NDArray[np.int64], start: Start) -> Interval:
        """Begin an episode of m turbines; flaps are where `start` says. The outputs at sample 0, as one sample."""

    @abstractmethod
    def advance(self, motion: Array, stopped: NDArray[np.bool_]) -> Interval:
        """Go on under flap motion (n, 2 (k + 1), blades): angle and rate at sample 0, at sample 1, and so on."""

    @property
    def azimuth(self) -> Array:
        """Azimuth of blade 1 of each turbine [rad], (n,)."""
        return np.asarray(self.start_azimuth + self._turn * self.elapsed)

    def reset(self, turbines: NDArray[np.int64], start: Start) -> tuple[NDArray[np.float32], Array]:
        """Begin an episode of m turbines; observations (m, observed) and rows (m, ROW) of sample 0."""
        blades, start = self.setup.blades, start.under(self.setup.faults)
        self.elapsed[turbines] = 0
        self.start_azimuth[turbines] = start.azimuth
        self._flaps[turbines] = 0.0
        self._flaps[turbines, 0] = start.flap_angle[:, :blades]
        self._flaps[turbines, 1] = start.flap_rate[:, :blades]
        self._travel[turbines] = 0.0
        if start.measurement_noise is not None:
            if self._noise is None:
                self._noise = np.zeros((self.count, self.setup.intervals + 1, 3))
            self._noise[turbines] = start.measurement_noise
        rows = np.zeros((len(turbines), ROW))
        fill_instant(rows, self.begin(turbines, start), start.azimuth)
        return self.task.observe(rows, None if self._noise is None else self._noise[turbines, 0]), rows

    def step(
        self,
        actions: FloatArray,
        observation: NDArray[np.float32],
        rows: Array,
        samples: Array | None = None,
    ) -> int:
        """Hold actions (n blades,) for k plant steps; see flapgym.plant.interface.Plant."""
        if not isinstance(actions, np.ndarray) or actions.dtype.kind != "f" or actions.ndim != 1:
            raise TypeError("actions: expected a flat array of floats")
        n, setup, task = self.count, self.setup, self.task
        rows = rows.reshape(n, ROW)
        if actions.size != n * setup.blades:
            return WRONG_COUNT
        finite = np.isfinite(actions)
        if not finite.all():
            return BAD_ACTION - int(np.argmin(finite))
        command = np.clip(actions.reshape(n, setup.blades).astype(float), -1.0, 1.0)
        self._flaps[:, 3] = command * self.model.acceleration_limit * self._moving
        motion, stopped = self.actuator.move(self._flaps)
        interval = self.advance(
            motion, np.zeros((n, setup.blades), dtype=bool) if stopped is None else stopped
        )
        self._flaps[:, 2] = self.actuator.lagged(self._flaps)
        self._flaps[:, :2] = motion[:, -2:]
        self.elapsed += 1
        angle = interval.flap_angle
        self._travel[:, : setup.blades] += np.add.reduce(np.abs(angle[:, 1:] - angle[:, :-1]), axis=1)
        rows[:] = 0.0
        fill_instant(rows, interval, self.azimuth)
        k, blades = setup.steps_per_action, setup.blades
        rows[:, TRAVEL : TRAVEL + 3] = self._travel
        rows[:, STOPPED : STOPPED + blades] = interval.stopped
        mean_square = np.einsum("nkb,nkb->nb", interval.rbm, interval.rbm) / k
        rows[:, MEAN_SQUARE : MEAN_SQUARE + blades] = mean_square
        rows[:, REWARD_RBM] = -task.rbm_weight / blades * mean_square.sum(axis=1)
        if task.angle_weight > 0.0:
            square = np.einsum("nkb,nkb->n", angle[:, 1:], angle[:, 1:])
            rows[:, REWARD_ANGLE] = -task.angle_weight / (k * blades) * square
        if task.tower_weight > 0.0:
            fore_aft = interval.tower[:, :, 0]
            rows[:, REWARD_TOWER] = -task.tower_weight / k * np.einsum("nk,nk->n", fore_aft, fore_aft)
        rows[:, REWARD] = rows[:, REWARD_RBM] + rows[:, REWARD_ANGLE] + rows[:, REWARD_TOWER]
        last = np.minimum(self.elapsed, setup.intervals)
        noise = None if self._noise is None else self._noise[np.arange(n), last]
        observation[:] = task.observe(rows, noise).ravel()
        if samples is not None:
            _fill_samples(samples, interval)
        status = 0 if np.isfinite(rows[:, REWARD]).all() else NONFINITE
        return status | (OVER if (self.elapsed >= setup.intervals).any() else 0)

    @property
    def quick(self) -> Quick:
        """`step` for flat float32 arrays and without samples."""
        return told, self.step

    def get_state(self, turbine: int) -> dict[str, Any]:
        """What changes of a turbine, but for its realisation, as plain values for JSON."""
        return {
            "elapsed": int(self.elapsed[turbine]),
            "flaps": self._flaps[turbine, :3].tolist(),
            "travel": self._travel[turbine].tolist(),
        }

    def set_state(self, turbine: int, state: dict[str, Any]) -> None:
        """Go on from there; `reset` with the same realisation comes before."""
        self.elapsed[turbine] = state["elapsed"]
        self._flaps[turbine, :3] = state["flaps"]
        self._travel[turbine] = state["travel"]


def plant_fingerprint(model: TurbineModel) -> str:
    """Of every number of a model that decides how a plant moves."""
    matrices = [
        getattr(system, name) for system in (model.turbine, model.blade) for name in ("A", "B", "C", "D")
    ]
    if model.periodic is not None:
        matrices += [getattr(model.periodic, name) for name in ("left", "core", "right", "forcing")]
    numbers = (
        model.wind_speed,
        model.rotor_speed,
        model.time_step,
        model.turbulence_intensity,
        model.flap_angle_limit,
        model.flap_rate_limit,
        model.acceleration_limit,
        model.rbm_rms,
    )
    return fingerprint(matrices, numbers)


def fill_instant(rows: Array, interval: Interval, azimuth: Array) -> None:
    """The last sample of an interval into the rows."""
    blades = interval.rbm.shape[2]
    for column, values in (
        (RBM, interval.rbm),
        (TIP, interval.tip_deflection),
        (ANGLE, interval.flap_angle),
        (RATE, interval.flap_rate),
    ):
        rows[:, column : column + blades] = values[:, -1]
    rows[:, TOWER : TOWER + 2] = interval.tower[:, -1]
    rows[:, WIND] = interval.wind[:, -1]
    rows[:, AZIMUTH] = azimuth % (2.0 * np.pi)
    rows[:, COSINE], rows[:, SINE] = np.cos(azimuth), np.sin(azimuth)


def _fill_samples(samples: Array, interval: Interval) -> None:
    """Samples 1 to k of an interval."""
    blades = interval.rbm.shape[2]
    samples[:] = 0.0
    samples[:, :, SAMPLE_RBM : SAMPLE_RBM + blades] = interval.rbm
    samples[:, :, SAMPLE_TIP : SAMPLE_TIP + blades] = interval.tip_deflection
    samples[:, :, SAMPLE_TOWER : SAMPLE_TOWER + 2] = interval.tower
    samples[:, :, SAMPLE_WIND] = interval.wind
    samples[:, :, SAMPLE_ANGLE : SAMPLE_ANGLE + blades] = interval.flap_angle[:, 1:]
    samples[:, :, SAMPLE_RATE : SAMPLE_RATE + blades] = interval.flap_rate[:, 1:]
