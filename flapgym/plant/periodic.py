"""The turbine of unequal blades, whose matrices follow the azimuth: stepped sample by sample, wind and flaps together.

In multi-blade coordinates the matrices are their mean over a revolution and a small part of low rank that turns
(`flapgym.model.harmonics`). That part forbids modes, but costs little; a plant step is one product with the mean.
What is steady over the disk and gravity are no inputs here: the response to them is added
(`flapgym.model.steady.unequal_steady_response`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from flapgym.core.arrays import BLADES, Array, BoolArray, ComplexArray, FloatArray, IntArray
from flapgym.core.multiblade import to_blades
from flapgym.model.nameplate import nameplate
from flapgym.model.signals import COMPONENTS, turbine_inputs
from flapgym.model.steady import Steady, imbalance_motion, unequal_steady_response
from flapgym.model.turbine_model import TurbineModel
from flapgym.plant.backends.numpy import blade_transform, components, flaps_after, move
from flapgym.plant.fingerprint import Numbers
from flapgym.plant.kernel import prepare
from flapgym.plant.parameters import Loads, Stepping
from flapgym.plant.plant import Plant
from flapgym.plant.responses import realisation_noise
from flapgym.plant.start import GivenWind, Start
from flapgym.plant.stuck import stuck_modes
from flapgym.plant.surroundings import Surroundings
from flapgym.plant.telling import tell
from flapgym.wind.disk import annulus_weights

_SMALLEST = 1e-8
"""Of harmonics, over the largest: what is smaller is left out."""


@dataclass(frozen=True, eq=False)
class Constants:
    """What is constant in the stepping of a model; prepared once and shared by its plants.

    Attributes
    ----------
    matrix : (n + nu, n + ny + s) float
        From state and inputs, flaps' and winds': the mean's answer and, behind it, what the turning part is applied to.
    core : (s, 2 K r) float
        From there to r numbers for the cosine and the sine of each of K harmonics.
    left : (r, n + ny) float
        From their sum to next state and outputs.
    forcing : (2 F, n + ny) float
        For cosine and sine of the harmonics from 0 on.
    steady : (harmonics, n) complex
        States that the imbalance keeps up.
    under_wind : (n, 1 + 3 R) float
        States under a steady wind of 1 m/s, homogeneous or in a component of one of R strips.
    """

    matrix: Array
    core: Array
    left: Array
    forcing: Array
    steady: ComplexArray
    under_wind: Array


@lru_cache(maxsize=4)
def _constants(numbers: Numbers) -> Constants:
    model, part = numbers.model, numbers.model.periodic
    assert part is not None
    # Flaps and winds stand before all other inputs.
    turbine = model.turbine.select(inputs=turbine_inputs(len(model.flaps), model.strips))
    mean = np.block([[turbine.A, turbine.B], [turbine.C, turbine.D]])
    size = np.abs(part.core).max(axis=(1, 2))
    core = part.core[: 1 + int(np.flatnonzero(size >= _SMALLEST * size.max()).max())]
    winds = turbine.B[:, turbine.inputs.index("wind") :]
    return Constants(
        matrix=np.ascontiguousarray(np.vstack([mean, part.right[:, : mean.shape[1]]]).T),
        core=np.ascontiguousarray(np.concatenate([core.real, -core.imag]).reshape(-1, core.shape[2]).T),
        left=np.ascontiguousarray(part.left.T),
        forcing=np.vstack([part.forcing.real, -part.forcing.imag]),
        steady=imbalance_motion(model),
        under_wind=np.asarray(np.linalg.solve(np.eye(turbine.order) - turbine.A, winds), dtype=float),
    )


@lru_cache(maxsize=4)
def _steady(numbers: Numbers, around: Surroundings) -> Steady:
    return unequal_steady_response(numbers.model, around.inflow, around.gravity)


class PeriodicPlant(Plant):
    """n turbines of one model with a periodic part, and their state.

    An episode begins in the stationary response of the mean turbine to the turbulence, which is the unequal one's but
    for the part that turns, and in the steady motion that imbalance, steady inflow and gravity keep up.

    Parameters
    ----------
    model : TurbineModel
        With `periodic`.
    count : int
        Number of turbines n.
    stepping : Stepping
        Its precision has no meaning here.
    """

    def __init__(self, model: TurbineModel, count: int, stepping: Stepping) -> None:
        if model.periodic is None or stepping.single_blade:
            raise ValueError("periodic plant: expected a whole turbine whose blades differ")
        # The kernel's modes are the mean turbine's: only the wind and what it does at the start are taken from it.
        numbers, around, kernel = Numbers.of(model), stepping.surroundings, prepare(model, stepping)
        steady = _steady(numbers, replace(around, field=None)) if around.steady else None
        super().__init__(model, count, stepping, kernel, steady)
        self._constants, self._order = _constants(numbers), model.turbine.order
        names, told = model.turbine.outputs, self.quantities
        self._of_blades = [
            names.index(f"{name}_{part}") for name in told.blade_outputs for part in COMPONENTS
        ]
        self._fixed = [names.index(name) for name in told.fixed_outputs]
        self._elapsed = np.zeros(count, dtype=np.int64)
        self._strongest, self._start_azimuth = np.zeros(count), np.zeros(count)
        self._flaps = np.zeros((4, self._held.size, count))
        self._wind = np.zeros((count, stepping.intervals * stepping.steps_per_action + 1))
        """Its mean over the disk, as it is told."""
        self._blowing = np.zeros((*self._wind.shape, self._constants.under_wind.shape[1]))
        """Homogeneous wind and, of a model that has them, winds by strip, in components."""
        self._ahead = np.zeros((count, self._order))
        """State at the sample after the last one given: what is known of that is known already."""

    @property
    def strongest_wind(self) -> Array:
        """Largest modulus of the wind in each turbine's episode, mean over the rotor, (n,) [m/s]."""
        return self._strongest

    @property
    def elapsed(self) -> IntArray:
        """Actions since each turbine's reset, (n,)."""
        return self._elapsed

    def reset(self, turbines: IntArray, start: Start) -> Loads:
        """Begin an episode of m turbines; their loads at sample 0."""
        state, wind, blowing = self._in_turbulence(start)
        if start.gust is not None:
            self._add_gust(start.gust, state, wind, blowing)
        azimuth, flaps = np.asarray(start.azimuth)[:, None], self._flaps_at(start)
        state += (np.exp(1j * azimuth * np.arange(len(self._constants.steady))) @ self._constants.steady).real
        flap = self._kernel.flap
        stuck = stuck_modes(flap, self._stuck_angles(), start.azimuth, self._kernel.turn)
        state += (stuck @ flap.expand.T).real
        self._wind[turbines], self._blowing[turbines], self._flaps[:, :, turbines] = wind, blowing, flaps
        self._strongest[turbines] = np.abs(wind).max(axis=1)
        self._elapsed[turbines], self._start_azimuth[turbines] = 0, start.azimuth
        outputs, self._ahead[turbines] = self._march(state, flaps[None, :2], blowing[:, :1], azimuth)
        stopped = np.zeros(flaps.shape[1:], dtype=bool)
        return self._told(outputs, wind[:, :1], flaps[None, :2], flaps[3], azimuth, stopped, record=0)

    def _in_turbulence(self, start: Start) -> tuple[Array, Array, Array]:
        """States (m, n) at sample 0, wind as it is told (m, T + 1) and as it blows (m, T + 1, 1 + 3 R) of m episodes.

        One turbine after another: then a realisation is the same to the last bit, whoever else is reset with it.
        """
        m, homogeneous = len(start.azimuth), self.stepping.surroundings.field is None
        state, wind = np.zeros((m, self._order)), np.zeros((m, self._wind.shape[1]))
        blowing, noise = np.zeros((m, *self._blowing.shape[1:])), start.noise
        if start.realisation is not None:
            noise = np.stack([realisation_noise(int(seed), self.noise_count) for seed in start.realisation])
        if noise is None:
            return state, wind, blowing
        for row, (own, azimuth) in enumerate(zip(noise, start.azimuth, strict=True)):
            met = self._kernel.disturbance.blowing(own, self.stepping.intervals, float(azimuth))
            # A field knows how strong it is.
            level = start.intensity[row] / self.model.turbulence_intensity if homogeneous else 1.0
            state[row], wind[row] = level * met.state, level * met.average
            blowing[row, :, slice(0, 1) if homogeneous else slice(1, None)] = level * met.winds
        return state, wind, blowing

    def _add_gust(self, gust: GivenWind, state: Array, wind: Array, blowing: Array) -> None:
        """Add a wind known in advance to what `_in_turbulence` gives."""
        given, before = gust.wind.reshape(len(gust.wind), -1), np.atleast_1d(gust.before)
        by_strip = given.shape[1] > 1
        place = slice(1, None) if by_strip else slice(0, 1)
        blowing[:, :, place] += given
        state += self._constants.under_wind[:, place] @ before
        shares = annulus_weights(nameplate(self.model.case).strip_radii) if by_strip else np.ones(1)
        wind += given[:, :: len(COMPONENTS)] @ shares

    def step(self, actions: FloatArray) -> Loads:
        """Hold actions (n, blades F), finite fractions of the acceleration limits, for k plant steps."""
        p, k = self.parameters, self.stepping.steps_per_action
        command: Array = np.clip(np.asarray(actions, dtype=float), -1.0, 1.0).T * p.acceleration[:, None]
        motion, _, _, stopped = move(p, self._flaps, command)
        # A turbine whose episode is over stays at its last wind.
        at = np.minimum(self._elapsed[:, None] * k + np.arange(1, k + 1), self._wind.shape[1] - 1)
        wind = np.take_along_axis(self._wind, at, axis=1)
        blowing = np.take_along_axis(self._blowing, at[:, :, None], axis=1)
        since = k * self._elapsed[:, None] + np.arange(1, k + 1)
        azimuth = self._start_azimuth[:, None] + self._kernel.turn * since
        outputs, self._ahead = self._march(self._ahead, motion[1:], blowing, azimuth)
        self._flaps = flaps_after(p, self._flaps, motion, command)
        self._elapsed = self._elapsed + 1
        return self._told(outputs, wind, motion, self._flaps[3], azimuth, stopped, record=p.sizes.record)

    def _march(self, state: Array, motion: Array, blowing: Array, azimuth: Array) -> tuple[Array, Array]:
        """Outputs (m, k, ny) in components at k samples, and the state (m, n) after them.

        From flap motion (k, 2, blades F, m), winds (m, k, w) and azimuth (m, k).
        """
        constants, n, (m, k) = self._constants, self._order, azimuth.shape
        transform = blade_transform(azimuth.ravel(), BLADES)
        flaps = components(self.parameters, motion.transpose(1, 2, 3, 0).reshape(2, -1, m * k), transform)
        inputs = np.concatenate([flaps.reshape(m, k, -1), blowing], axis=2)
        angle = azimuth[:, :, None] * np.arange(len(constants.forcing) // 2)
        cosine, sine = np.cos(angle), np.sin(angle)
        forcing = np.concatenate([cosine, sine], axis=2) @ constants.forcing
        harmonics = constants.core.shape[1] // (2 * len(constants.left))
        turned = [part[:, :, 1 : harmonics + 1] for part in (cosine, sine)]
        phase = np.concatenate(turned, axis=2)[:, :, None]
        told = constants.left.shape[1]
        given, outputs = np.empty((m, len(constants.matrix))), np.empty((m, k, told - n))
        for sample in range(k):
            given[:, :n], given[:, n:] = state, inputs[:, sample]
            after = given @ constants.matrix
            turning = (after[:, told:] @ constants.core).reshape(m, 2 * harmonics, -1)
            turning = (phase[:, sample] @ turning)[:, 0] @ constants.left
            after = after[:, :told] + turning + forcing[:, sample]
            state, outputs[:, sample] = after[:, :n], after[:, n:]
        return outputs, state

    def _told(
        self,
        outputs: Array,
        wind: Array,
        motion: Array,
        travel: Array,
        azimuth: Array,
        stopped: BoolArray,
        *,
        record: int,
    ) -> Loads:
        """Loads of outputs (m, k, ny) in components at k samples, and of what is steady."""
        m, k, _ = outputs.shape
        if self._steady is not None:
            outputs = outputs + self._steady.at(azimuth.ravel())[:, :-1].reshape(outputs.shape)
        p, blade_outputs = self.parameters, len(self.quantities.blade_outputs)
        blades = outputs[:, :, self._of_blades].reshape(m, k, blade_outputs, 3).transpose(0, 2, 1, 3)
        blades = to_blades(blades, azimuth[:, None])
        kept = slice(0 if self.stepping.every_sample else k - 1, k)
        sizes = p.sizes._replace(record=record, blade_outputs=blade_outputs, fixed_outputs=len(self._fixed))
        return tell(
            p._replace(sizes=sizes),
            rbm=blades[:, 0],
            others=blades[:, 1:, kept],
            fixed=outputs[:, kept][:, :, self._fixed].transpose(0, 2, 1),
            wind=wind[:, kept],
            motion=motion,
            travel=travel,
            stopped=stopped,
            azimuth=azimuth[:, -1],
        )

    def flap_motion(self) -> tuple[Array, Array]:
        """Angle and rate of every flap, (n, blades F) each [rad, rad/s]."""
        return self._flaps[0].T, self._flaps[1].T

    def get_state(self, turbine: int) -> dict[str, Any]:
        """What changes of a turbine, but for its realisation, as plain values for JSON."""
        return {
            "elapsed": int(self._elapsed[turbine]),
            "flaps": self._flaps[:3, :, turbine].tolist(),
            "travel": self._flaps[3, :, turbine].tolist(),
            "ahead": self._ahead[turbine].tolist(),
        }

    def set_state(self, turbine: int, state: dict[str, Any]) -> None:
        """Go on from there; `reset` with the same realisation comes before."""
        self._elapsed[turbine] = state["elapsed"]
        self._flaps[:3, :, turbine], self._flaps[3, :, turbine] = state["flaps"], state["travel"]
        self._ahead[turbine] = state["ahead"]
