"""Homogeneous turbulence and given winds over a whole episode, computed at once.

Turbulence filter and turbine are one system driven by white noise; its first state is drawn from the exact stationary
distribution, so an episode has no run-in.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from flapgym.core.arrays import Array, ComplexArray
from flapgym.core.modal import Modal, modal_form
from flapgym.core.state_space import StateSpace, series
from flapgym.model.turbine_model import TurbineModel
from flapgym.plant.frame import OutputRows
from flapgym.plant.wind_response import Blocks, Blowing
from flapgym.wind import von_karman_filter
from flapgym.wind.blade_field import FieldOnDisk

BLOCK_STEPS = 64
"""Steps taken at once, rounded to whole intervals: about where products and recursion cost the same."""


def disturbance_system(model: TurbineModel, length_scale: float) -> StateSpace:
    """White noise to the turbine's outputs and the wind [m/s], at the model's turbulence intensity."""
    shaping = von_karman_filter(model.wind_speed, model.turbulence_intensity, length_scale, model.time_step)
    joint = series(shaping, model.turbine.select(inputs=["wind"]))
    return with_wind(joint, np.hstack([shaping.C, np.zeros((1, model.turbine.order))]), shaping.D)


def with_wind(system: StateSpace, C: Array, D: Array) -> StateSpace:
    """The system with the wind, C (1, n) and D (1, nu), as its last output."""
    return replace(
        system,
        C=np.vstack([system.C, C]),
        D=np.vstack([system.D, D]),
        outputs=(*system.outputs, "wind"),
    )


@dataclass(frozen=True, eq=False)
class Disturbance:
    """Homogeneous turbulence at the model's intensity (`flapgym.plant.wind_response.WindResponse`).

    Attributes
    ----------
    modal : Modal
        White noise to the outputs that have rows, and the wind.
    root : (2 m, n) float
        Normal numbers to stationary modes, real and imaginary parts alternating.
    blocks : Blocks
    turbine_order : int
        Of the states, how many are the turbine's: the last ones.
    """

    modal: Modal
    root: Array
    blocks: Blocks
    turbine_order: int

    @classmethod
    def of(cls, modal: Modal, root: Array, rows: OutputRows, turn: float, turbine_order: int) -> Disturbance:
        """For intervals of `rows`; `turn` is the azimuth [rad] of one step."""
        return cls(modal, root, Blocks.of(modal, rows, turn, BLOCK_STEPS), turbine_order)

    def noise_count(self, intervals: int) -> int:
        """Numbers for the first state, then one a sample."""
        return self.root.shape[1] + intervals * self.blocks.rows.steps + 1

    def respond(self, noise: Array, intervals: int, azimuth: float) -> tuple[Array, Array]:
        """Outputs at sample 0, and rows. The azimuth counts for nothing: the wind is the same everywhere."""
        modes, noisy = self._drawn(noise)
        white = np.zeros((self.blocks.steps(intervals) + 1, 1))
        white[: len(noisy)] = noisy
        first = (self.modal.C @ modes).real + self.modal.D[:, 0] * white[0]
        return first, self.blocks.told(*self.blocks.march(modes, white), intervals)

    def blowing(self, noise: Array, intervals: int, azimuth: float) -> Blowing:
        """The turbulence, and the turbine's stationary motion in it."""
        modes, white = self._drawn(noise)
        wind = replace(self.modal, C=self.modal.C[-1:], D=self.modal.D[-1:]).simulate(white, modes)
        return Blowing((self.modal.expand @ modes).real[-self.turbine_order :], wind, wind[:, 0])

    def on_disk(self, noise: Array, intervals: int) -> FieldOnDisk:
        """There is nothing to show."""
        raise ValueError("field: expected a field around the plant, there is none")

    def _drawn(self, noise: Array) -> tuple[ComplexArray, Array]:
        """Modes (m,) at sample 0 and white noise (T + 1, 1)."""
        known = self.root.shape[1]
        return (self.root @ noise[:known]).view(complex), noise[known:, None]


def wind_response(modal: Modal, wind: Array, before: float | Array) -> Array:
    """Outputs and wind (T, ny + 1) of a turbine to a wind series [m/s] known in advance, such as a gust.

    Parameters
    ----------
    modal : Modal
        From the wind, or from winds by strip.
    wind : (T,) or (T, nu) float
        At samples 0 to T - 1 [m/s], one for each input.
    before : float or (nu,) float
        What has always blown before [m/s]: the turbine starts in equilibrium with it.
    """
    return modal.simulate(wind.reshape(len(wind), -1), modal.equilibrium(np.atleast_1d(before)))


def wind_modes(model: TurbineModel) -> Modal:
    """Wind [m/s] to the turbine's outputs and the wind itself."""
    turbine = model.turbine.select(inputs=["wind"])
    return modal_form(with_wind(turbine, np.zeros((1, turbine.order)), np.ones((1, 1))))
