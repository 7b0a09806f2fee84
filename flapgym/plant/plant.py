"""What an environment asks of whatever stands for n turbines, and what all that do have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from flapgym.core.arrays import Array, FloatArray, IntArray
from flapgym.model.steady import Steady
from flapgym.model.turbine_model import TurbineModel
from flapgym.plant.fingerprint import plant_fingerprint
from flapgym.plant.kernel import Kernel, parameters_of
from flapgym.plant.parameters import Loads, Stepping
from flapgym.plant.responses import realisation_noise
from flapgym.plant.start import Start
from flapgym.plant.upwind import known_ahead, measured_upwind
from flapgym.wind import Lidar
from flapgym.wind.blade_field import FieldOnDisk
from flapgym.wind.box_field import BoxOnDisk


class Plant(ABC):
    """n turbines of one model that are advanced by actions.

    Attributes
    ----------
    model : TurbineModel
    count : int
        Turbines n.
    stepping : Stepping
    quantities : Quantities
        What it tells.
    fingerprint : str
        Of every number that decides how the plant moves.
    parameters : Parameters
    """

    def __init__(
        self, model: TurbineModel, count: int, stepping: Stepping, kernel: Kernel, steady: Steady | None
    ) -> None:
        self.model, self.count, self.stepping = model, count, stepping
        self.quantities = stepping.quantities(model)
        self.fingerprint = plant_fingerprint(model)
        self.parameters = parameters_of(model, stepping, kernel)
        self._kernel, self._steady = kernel, steady
        _, stuck = stepping.faults.on(stepping.blades, len(model.flaps))
        # Pitch does not stick.
        stuck = np.pad(stuck, (0, self.parameters.angle_limit.size - stuck.size), constant_values=np.nan)
        self._held, self._stuck = ~np.isnan(stuck), np.nan_to_num(stuck, nan=0.0)

    @property
    def noise_count(self) -> int:
        """Standard normal numbers one turbine's realisation takes."""
        return self._kernel.disturbance.noise_count(self.stepping.intervals)

    def field(self, start: Start) -> FieldOnDisk | BoxOnDisk:
        """The wind over the disk while the one turbine of a start goes through its episode, for a picture.

        Raises
        ------
        ValueError
            If there is no field around this plant.
        """
        noise = start.noise
        if start.realisation is not None:
            noise = realisation_noise(int(start.realisation[0]), self.noise_count)[None]
        disturbance = self._kernel.disturbance
        return disturbance.on_disk(np.zeros(0) if noise is None else noise[0], self.stepping.intervals)

    @property
    def known_ahead(self) -> float:
        """Time beyond an episode up to which its wind can be told ahead [s]."""
        return known_ahead(self._kernel.disturbance, self.stepping.intervals)

    def upwind(self, lidar: Lidar, start: Start, arrival: Array) -> Array:
        """Speeds along a lidar's beams (m, S, N) [m/s], see `flapgym.plant.upwind.measured_upwind`."""
        return measured_upwind(self._kernel.disturbance, self.model, self.stepping, lidar, start, arrival)

    def steady(self, azimuth: Array) -> dict[str, Array]:
        """What steady inflow and gravity do to the outputs at azimuths of blade 1 (n,) [rad], about its mean.

        Of the blades' outputs (n, blades), of the fixed ones (n,). What a rotor's imbalance does is no part of it.

        Raises
        ------
        ValueError
            If nothing is steady around this plant.
        """
        if self._steady is None:
            raise ValueError("steady: expected steady inflow or gravity around the plant, there is none")
        return self._steady.told(azimuth)

    def _flaps_at(self, start: Start) -> Array:
        """Flaps of the state (4, blades A, m) at a start; the stuck ones where they are stuck."""
        flaps = np.zeros((4, self._held.size, len(start.azimuth)))
        flaps[0] = np.where(self._held, self._stuck, start.angle).T
        flaps[1] = np.where(self._held, 0.0, start.rate).T
        return flaps

    def _stuck_angles(self) -> Array:
        """Angle times effectiveness of every flap that is stuck (blades, F), zero of those that move."""
        p = self.parameters
        return (self._stuck * p.effectiveness)[: p.all_flaps].reshape(p.sizes.blades, p.sizes.flaps)

    @property
    @abstractmethod
    def strongest_wind(self) -> Array:
        """Largest modulus of the wind, mean over the rotor, in each turbine's episode, (n,) [m/s]."""

    @property
    @abstractmethod
    def elapsed(self) -> IntArray:
        """Actions since each turbine's reset, (n,)."""

    @abstractmethod
    def reset(self, turbines: IntArray, start: Start) -> Loads:
        """Begin an episode of m turbines; their loads at sample 0."""

    @abstractmethod
    def step(self, actions: FloatArray) -> Loads:
        """Hold actions (n, blades A), finite fractions of what they command, for k plant steps."""

    @abstractmethod
    def flap_motion(self) -> tuple[Array, Array]:
        """Angle and rate of every flap, (n, blades F) each [rad, rad/s]."""

    @abstractmethod
    def get_state(self, turbine: int) -> dict[str, Any]:
        """What changes of a turbine, but for its realisation, as plain values for JSON."""

    @abstractmethod
    def set_state(self, turbine: int, state: dict[str, Any]) -> None:
        """Go on from there; `reset` with the same realisation comes before."""
