"""One turbine or many, stepped fast: flap actuator, flap response, precomputed response to the wind (paper eq. 14).

What is stepped is small because the plant is linear up to the flap's stops: the response to the turbulence is
added, not simulated again (superposition). Every turbine has its own azimuth, realisation and turbulence intensity.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flapgym.aeroelastic.model import TurbineModel
from flapgym.aeroelastic.multiblade import BLADES, blade_azimuths, to_blades, to_components
from flapgym.plant.actuator import Actuator
from flapgym.plant.kernel import Kernel, prepare
from flapgym.state_space import Array

RESET_BATCH = 64
"""Turbines whose disturbance response is computed at once: more would leave the processor's cache."""


class Interval(NamedTuple):
    """What n turbines did during one action; arrays are fresh.

    Attributes
    ----------
    rbm : (n, k, 3) float
        Flapwise root bending moment at samples 1 to k [N m].
    tip_deflection : (n, kept, 3) float
        Tip deflection at the samples kept (all k, or the last) [m].
    tower : (n, kept, 2) float
        Tower-top displacement downwind and sideways [m].
    wind : (n, kept) float
        Wind perturbation [m/s].
    flap_angle, flap_rate : (n, k + 1, 3) float
        Flap motion at samples 0 to k [rad, rad/s].
    stopped : (n, 3) bool
        Flaps that met a stop.
    """

    rbm: Array
    tip_deflection: Array
    tower: Array
    wind: Array
    flap_angle: Array
    flap_rate: Array
    stopped: NDArray[np.bool_]


class Plant:
    """The state of n turbines and the step that advances them by one action.

    Parameters
    ----------
    model : TurbineModel
    count : int
        Number of turbines n.
    steps_per_action : int
        Plant steps k for which an action is held.
    intervals : int
        Actions per episode.
    length_scale : float
        Of the turbulence [m].
    every_sample : bool
        Give tip deflection, tower and wind at every sample instead of the last of an interval.
    """

    def __init__(
        self,
        model: TurbineModel,
        count: int,
        steps_per_action: int,
        intervals: int,
        length_scale: float,
        every_sample: bool = False,
    ) -> None:
        kernel: Kernel = prepare(model, steps_per_action, length_scale, every_sample)
        self.model = model
        self.count = count
        self.steps_per_action = steps_per_action
        self.intervals = intervals
        self.actuator = Actuator(
            model.flap_angle_limit, model.flap_rate_limit, model.time_step, steps_per_action
        )
        self.elapsed = np.zeros(count, dtype=np.int64)
        """Intervals done since the turbine's reset."""
        self._kernel = kernel
        # Modes and flap components side by side, so that one product reads both.
        self._state = np.zeros((count, kernel.flap.read.shape[0] + kernel.flap.feed.shape[0]))
        self._output = np.vstack([kernel.flap.read, kernel.flap.feed])
        self._command = np.zeros((count, 3, BLADES))
        self._phase = np.zeros((count, BLADES))
        self._response = np.zeros((count, intervals, kernel.rows.count))
        self._index = np.arange(count)
        self._blades = np.ones((count, 3, BLADES))
        self._weights = np.array([[1.0], [2.0], [2.0]]) / BLADES
        self._turn = kernel.turn * steps_per_action

    @property
    def noise_count(self) -> int:
        """Standard normal numbers one turbine's realisation takes."""
        return self._kernel.disturbance.noise_count(self.intervals)

    @property
    def azimuth(self) -> Array:
        """Azimuth of blade 1 of each turbine [rad], (n,), in [0, 2 pi)."""
        return (self._phase[:, 0] + self._turn * self.elapsed) % (2.0 * np.pi)

    @property
    def flap_angle(self) -> Array:
        """Flap angles [rad], (n, 3)."""
        return self._command[:, 0].copy()

    @property
    def flap_rate(self) -> Array:
        """Flap rates [rad/s], (n, 3)."""
        return self._command[:, 1].copy()

    def reset(
        self,
        turbines: NDArray[np.int64],
        noise: Array,
        intensity: Array,
        azimuth: Array,
        flap_angle: Array,
        flap_rate: Array,
    ) -> Interval:
        """Begin an episode of m turbines.

        Parameters
        ----------
        turbines : (m,) int
            Which ones.
        noise : (m, noise_count) float
            Standard normal numbers that make the realisations.
        intensity : (m,) float
            Turbulence intensities.
        azimuth : (m,) float
            Of blade 1 [rad].
        flap_angle, flap_rate : (m, 3) float
            Within the stops [rad, rad/s]. The turbine's response to the flaps starts from rest.

        Returns
        -------
        Interval
            The outputs at sample 0, as an interval of one sample.
        """
        level = (np.asarray(intensity) / self.model.turbulence_intensity)[:, None]
        first = np.empty((len(turbines), 9))
        for begin in range(0, len(turbines), RESET_BATCH):
            some = slice(begin, begin + RESET_BATCH)
            first[some], rows = self._kernel.disturbance.respond(noise[some], self.intervals)
            self._response[turbines[some]] = rows * level[some, None]
        self._state[turbines] = 0.0
        self._phase[turbines] = blade_azimuths(azimuth)
        self.elapsed[turbines] = 0
        self._command[turbines] = np.stack([flap_angle, flap_rate, np.zeros_like(flap_rate)], axis=1)
        flap = np.concatenate([to_components(flap_angle, azimuth), to_components(flap_rate, azimuth)], axis=1)
        first = first * level
        first[:, :8] += flap @ self._kernel.direct
        return Interval(
            rbm=to_blades(first[:, 0:3], azimuth)[:, None],
            tip_deflection=to_blades(first[:, 3:6], azimuth)[:, None],
            tower=first[:, None, 6:8],
            wind=first[:, 8:],
            flap_angle=np.array(flap_angle)[:, None],
            flap_rate=np.array(flap_rate)[:, None],
            stopped=np.zeros(np.shape(flap_angle), dtype=bool),
        )

    def advance(self, acceleration: Array) -> Interval:
        """Hold flap accelerations (n, 3) [rad/s^2] for k steps.

        Every turbine must have an interval of its episode left.
        """
        kernel, k, n = self._kernel, self.steps_per_action, self.count
        self._command[:, 2] = acceleration
        motion, stopped = self.actuator.move(self._command)
        self._command[:, :2] = motion[:, -2:]
        blades = self._components_to_blades()
        # Views are taken here and not kept: a copied or pickled plant would lose them.
        size = 2 * kernel.flap.decay.size
        modes, components = self._state[:, :size].view(complex), self._state[:, size:]
        components[:] = (motion @ (blades * self._weights).transpose(0, 2, 1)).reshape(n, -1)
        rows = self._state @ self._output
        rows += self._response[self._index, self.elapsed]
        modes *= kernel.flap.decay
        modes += (components[:, : kernel.flap.drive.shape[0]] @ kernel.flap.drive).view(complex)
        self.elapsed += 1
        loads = rows[:, : kernel.rows.blade_rows].reshape(n, -1, 3) @ blades
        flat = rows[:, kernel.rows.blade_rows :].reshape(n, kernel.rows.kept, 3)
        return Interval(
            rbm=loads[:, :k],
            tip_deflection=loads[:, k:],
            tower=flat[:, :, :2],
            wind=flat[:, :, 2],
            flap_angle=motion[:, 0::2],
            flap_rate=motion[:, 1::2],
            stopped=np.zeros((n, BLADES), dtype=bool) if stopped is None else stopped,
        )

    def _components_to_blades(self) -> Array:
        """(n, 3 components, 3 blades): one, cosine and sine of each blade's azimuth."""
        azimuths = self._phase + (self._turn * self.elapsed)[:, None]
        np.cos(azimuths, out=self._blades[:, 1])
        np.sin(azimuths, out=self._blades[:, 2])
        return self._blades
