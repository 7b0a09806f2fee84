"""The turbine of unequal blades, whose matrices follow the azimuth: stepped sample by sample, wind and flaps together.

In multi-blade coordinates the matrices are their mean over a revolution and a small part of low rank that turns
(flapgym.model.harmonics). That part forbids modes, but costs little; a plant step is one product with the mean.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flapgym.core.arrays import BLADES, Array, BoolArray, FloatArray, IntArray
from flapgym.core.multiblade import to_blades, to_components
from flapgym.core.state_space import StateSpace
from flapgym.model.harmonics import PeriodicPart
from flapgym.model.signals import COMPONENTS
from flapgym.model.turbine_model import TurbineModel
from flapgym.plant.backends.numpy import flaps_after, move
from flapgym.plant.disturbance import disturbance_modes
from flapgym.plant.fingerprint import plant_fingerprint
from flapgym.plant.modal import modal_form
from flapgym.plant.parameters import Loads, Stepping, parameters_of, prepare
from flapgym.plant.responses import realisation_noise
from flapgym.plant.start import Start
from flapgym.plant.stuck import stuck_modes
from flapgym.plant.telling import tell
from flapgym.wind import von_karman_filter

_AZIMUTHS = 64
"""Around the revolution, for the steady motion of an unbalanced rotor."""
_ENOUGH = 1e-12
_SMALLEST = 1e-8
"""Of harmonics, over the largest: what is smaller is left out."""


@dataclass(frozen=True, eq=False)
class Constants:
    """What is constant in the stepping of a model; prepared once and shared by its plants.

    Attributes
    ----------
    matrix : (n + nu, n + ny + s) float
        From state and inputs: the mean's answer and, behind it, what the turning part is applied to.
    core : (s, 2 K r) float
        From there to r numbers for the cosine and the sine of each of K harmonics.
    left : (r, n + ny) float
        From their sum to next state and outputs.
    forcing : (2 F, n + ny) float
        For cosine and sine of the harmonics from 0 on.
    root : (n + filter's order, normal numbers) float
        Normal numbers to first states of turbulence filter and mean turbine.
    shaping : StateSpace
        The turbulence filter.
    steady : (harmonics, n) complex
        States that the imbalance keeps up.
    under_wind : (n,) float
        States under a steady wind of 1 m/s.
    """

    matrix: Array
    core: Array
    left: Array
    forcing: Array
    root: Array
    shaping: StateSpace
    steady: NDArray[np.complex128]
    under_wind: Array

    @property
    def harmonics(self) -> int:
        """Number K of harmonics of the core."""
        return self.core.shape[1] // (2 * self.left.shape[0])


@dataclass(frozen=True)
class _Wanted:
    """A model by the fingerprint of its numbers, wherever it was loaded from."""

    fingerprint: str
    length_scale: float
    model: TurbineModel = field(compare=False)


@lru_cache(maxsize=4)
def _prepared(wanted: _Wanted) -> Constants:
    model = wanted.model
    assert model.periodic is not None
    turbine, part = _of_flaps_and_wind(model), model.periodic
    mean = np.block([[turbine.A, turbine.B], [turbine.C, turbine.D]])
    size = np.abs(part.core).max(axis=(1, 2))
    core = part.core[: 1 + int(np.flatnonzero(size >= _SMALLEST * size.max()).max())]
    modal, root = disturbance_modes(model, wanted.length_scale)
    return Constants(
        matrix=np.ascontiguousarray(np.vstack([mean, part.right[:, : mean.shape[1]]]).T),
        core=np.ascontiguousarray(np.concatenate([core.real, -core.imag]).reshape(-1, core.shape[2]).T),
        left=np.ascontiguousarray(part.left.T),
        forcing=np.vstack([part.forcing.real, -part.forcing.imag]),
        # Contiguous, as it is in a copy of the plant: in strides a product differs in its last bit.
        root=np.ascontiguousarray((modal.expand @ (root[0::2] + 1j * root[1::2])).real),
        shaping=von_karman_filter(
            model.wind_speed, model.turbulence_intensity, wanted.length_scale, model.time_step
        ),
        steady=steady_motion(turbine, part, model.rotor_speed * model.time_step),
        under_wind=np.asarray(
            np.linalg.solve(np.eye(turbine.order) - turbine.A, turbine.B[:, turbine.inputs.index("wind")]),
            dtype=float,
        ),
    )


def _of_flaps_and_wind(model: TurbineModel) -> StateSpace:
    """The mean turbine without the winds by strip, which stand behind the others."""
    inputs = model.turbine.inputs
    return model.turbine.select(inputs=inputs[: inputs.index("wind") + 1])


class PeriodicPlant:
    """n turbines of one model with a periodic part, and their state.

    An episode begins in the stationary response of the mean turbine to the turbulence, which is the unequal one's but
    for the part that turns, and in the steady motion that the rotor's imbalance keeps up.

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
        import_module("scipy.signal")  # half a second, which no reset should wait for
        self.model, self.count, self.stepping = model, count, stepping
        self.quantities = stepping.quantities(model)
        self.fingerprint = plant_fingerprint(model)
        # Of these the actuators' are used; the modes are those of the mean turbine.
        self._parameters = parameters_of(model, stepping, prepare(model, stepping))
        self._order = model.turbine.order
        names = model.turbine.outputs
        self._of_blades = [
            names.index(f"{name}_{part}") for name in self.quantities.blade_outputs for part in COMPONENTS
        ]
        self._fixed = [names.index(name) for name in self.quantities.fixed_outputs]
        self._constants = _prepared(_Wanted(self.fingerprint, stepping.length_scale, model))
        _, stuck = stepping.faults.on(stepping.blades, len(model.flaps))
        self._held, self._stuck = ~np.isnan(stuck), np.where(np.isnan(stuck), 0.0, stuck)
        self._step_turn = model.rotor_speed * model.time_step
        self.elapsed = np.zeros(count, dtype=np.int64)
        """Actions since each turbine's reset."""
        self._strongest = np.zeros(count)
        self._start_azimuth = np.zeros(count)
        self._flaps = np.zeros((4, stuck.size, count))
        self._wind = np.zeros((count, stepping.intervals * stepping.steps_per_action + 1))
        self._ahead = np.zeros((count, self._order))
        """State at the sample after the last one given: what is known of that is known already."""

    @property
    def noise_count(self) -> int:
        """Standard normal numbers one turbine's realisation takes."""
        return self._constants.root.shape[1] + self._wind.shape[1]

    @property
    def strongest_wind(self) -> Array:
        """Largest modulus of the wind in each turbine's episode, (n,) [m/s]."""
        return self._strongest

    def reset(self, turbines: IntArray, start: Start) -> Loads:
        """Begin an episode of m turbines; their loads at sample 0."""
        level = np.asarray(start.intensity) / self.model.turbulence_intensity
        state, wind = np.zeros((len(turbines), self._order)), np.zeros((len(turbines), self._wind.shape[1]))
        noise = start.noise
        if start.realisation is not None:
            noise = np.stack([realisation_noise(int(seed), self.noise_count) for seed in start.realisation])
        if noise is not None:
            known = self._constants.root.shape[1]
            # One turbine after another: then a realisation is the same to the last bit, whoever else is reset with it.
            first = np.stack([self._constants.root @ row for row in noise[:, :known]])
            wind = level[:, None] * filtered(self._constants.shaping, first, noise[:, known:])
            state = level[:, None] * first[:, self._constants.shaping.order :]
        if start.gust is not None:
            wind, state = wind + start.gust.wind, state + start.gust.before * self._constants.under_wind
        azimuth = np.asarray(start.azimuth)[:, None]
        phase = np.exp(1j * azimuth * np.arange(len(self._constants.steady)))
        state = state + (phase @ self._constants.steady).real + self._under_stuck_flaps(start.azimuth)
        flaps = np.zeros((4, self._held.size, len(turbines)))
        flaps[0] = np.where(self._held, self._stuck, start.angle).T
        flaps[1] = np.where(self._held, 0.0, start.rate).T
        self._wind[turbines], self._flaps[:, :, turbines] = wind, flaps
        self._strongest[turbines] = np.abs(wind).max(axis=1)
        self.elapsed[turbines], self._start_azimuth[turbines] = 0, start.azimuth
        outputs, self._ahead[turbines] = self._march(
            state, self._inputs(flaps[None, :2], wind[:, :1], azimuth), azimuth
        )
        return self._told(outputs, wind[:, :1], flaps[None, :2], flaps[3], azimuth, record=False)

    def step(self, actions: FloatArray) -> Loads:
        """Hold actions (n, blades F), finite fractions of the acceleration limits, for k plant steps."""
        p, k = self._parameters, self.stepping.steps_per_action
        command: Array = np.clip(np.asarray(actions, dtype=float), -1.0, 1.0).T * p.acceleration[:, None]
        motion, _, _, stopped = move(p, self._flaps, command)
        # A turbine whose episode is over stays at its last wind.
        at = np.minimum(self.elapsed[:, None] * k + np.arange(1, k + 1), self._wind.shape[1] - 1)
        wind = np.take_along_axis(self._wind, at, axis=1)
        azimuth = (self._start_azimuth + self._step_turn * k * self.elapsed)[:, None]
        azimuth = azimuth + self._step_turn * np.arange(1, k + 1)
        outputs, self._ahead = self._march(self._ahead, self._inputs(motion[1:], wind, azimuth), azimuth)
        self._flaps = flaps_after(p, self._flaps, motion, command)
        self.elapsed = self.elapsed + 1
        return self._told(outputs, wind, motion, self._flaps[3], azimuth, stopped, record=p.record)

    def _told(
        self,
        outputs: Array,
        wind: Array,
        motion: Array,
        travel: Array,
        azimuth: Array,
        stopped: BoolArray | None = None,
        *,
        record: bool,
    ) -> Loads:
        """Loads of outputs (m, k, ny) in components at k samples."""
        m, k, _ = outputs.shape
        p, quantities = self._parameters, self.quantities
        count = len(quantities.blade_outputs)
        blades = outputs[:, :, self._of_blades].reshape(m, k, count, 3).transpose(0, 2, 1, 3)
        blades = to_blades(blades, azimuth[:, None])
        kept = slice(0 if self.stepping.every_sample else k - 1, k)
        told = p._replace(record=record, blade_outputs=count, fixed_outputs=len(quantities.fixed_outputs))
        return tell(
            told,
            rbm=blades[:, 0],
            others=blades[:, 1:, kept],
            fixed=outputs[:, kept][:, :, self._fixed].transpose(0, 2, 1),
            wind=wind[:, kept],
            motion=motion,
            travel=travel,
            stopped=np.zeros(travel.shape, dtype=bool) if stopped is None else stopped,
            azimuth=azimuth[:, -1],
        )

    def flap_motion(self) -> tuple[Array, Array]:
        """Angle and rate of every flap, (n, blades F) each [rad, rad/s]."""
        return self._flaps[0].T, self._flaps[1].T

    def _under_stuck_flaps(self, azimuth: Array) -> Array:
        """States (m, n) of the mean turbine that stuck flaps keep up."""
        angle = (self._stuck * self._parameters.effectiveness).reshape(BLADES, -1)
        if not angle.any():
            return np.zeros((len(azimuth), self._order))
        turbine = self.model.turbine
        flap = modal_form(turbine.select(inputs=turbine.inputs[: 6 * len(self.model.flaps)]))
        modes = stuck_modes(flap, angle, azimuth, self._step_turn)
        return np.asarray((modes @ flap.expand.T).real)

    def _inputs(self, motion: Array, wind: Array, azimuth: Array) -> Array:
        """Inputs (m, k, 6 F + 1) of the model from flap motion (k, 2, blades F, m), wind (m, k) and azimuth (m, k)."""
        p = self._parameters
        acting = motion * p.effectiveness[:, None]
        k, m = acting.shape[0], acting.shape[-1]
        by_flap = acting.reshape(k, 2, p.blades, p.flaps, m).transpose(4, 0, 1, 3, 2)
        components = to_components(by_flap, azimuth[:, :, None, None])
        return np.concatenate([components.reshape(m, k, -1), wind[:, :, None]], axis=2)

    def _march(self, state: Array, inputs: Array, azimuth: Array) -> tuple[Array, Array]:
        """Outputs (m, k, ny) in components at k samples, and the state (m, n) after them."""
        constants, (m, k, _) = self._constants, inputs.shape
        n, harmonics = self._order, constants.harmonics
        angle = azimuth[:, :, None] * np.arange(len(constants.forcing) // 2)
        cosine, sine = np.cos(angle), np.sin(angle)
        forcing = np.concatenate([cosine, sine], axis=2) @ constants.forcing
        turn = [part[:, :, 1 : harmonics + 1] for part in (cosine, sine)]
        phase = np.concatenate(turn, axis=2)[:, :, None]
        outputs_count = constants.left.shape[1] - n
        given, outputs = np.empty((m, constants.matrix.shape[0])), np.empty((m, k, outputs_count))
        for sample in range(k):
            given[:, :n], given[:, n:] = state, inputs[:, sample]
            after = given @ constants.matrix
            turning = (after[:, n + outputs_count :] @ constants.core).reshape(m, 2 * harmonics, -1)
            after = (
                after[:, : n + outputs_count]
                + (phase[:, sample] @ turning)[:, 0] @ constants.left
                + forcing[:, sample]
            )
            state, outputs[:, sample] = after[:, :n], after[:, n:]
        return outputs, state

    def get_state(self, turbine: int) -> dict[str, Any]:
        """What changes of a turbine, but for its realisation, as plain values for JSON."""
        return {
            "elapsed": int(self.elapsed[turbine]),
            "flaps": self._flaps[:3, :, turbine].tolist(),
            "travel": self._flaps[3, :, turbine].tolist(),
            "ahead": self._ahead[turbine].tolist(),
        }

    def set_state(self, turbine: int, state: dict[str, Any]) -> None:
        """Go on from there; `reset` with the same realisation comes before."""
        self.elapsed[turbine] = state["elapsed"]
        self._flaps[:3, :, turbine], self._flaps[3, :, turbine] = state["flaps"], state["travel"]
        self._ahead[turbine] = state["ahead"]


def steady_motion(mean: StateSpace, periodic: PeriodicPart, turn: float) -> NDArray[np.complex128]:
    """States that the forcing keeps up, x(theta) = Re sum_k X[k] exp(j k theta), shape (k, n).

    The periodic part is small, so its answer to itself is found by repetition: each harmonic by the mean's resolvent.

    Parameters
    ----------
    mean : StateSpace
    periodic : PeriodicPart
    turn : float
        Azimuth of one step [rad].

    Raises
    ------
    ValueError
        If the blades differ by so much that repetition does not converge.
    """
    n, harmonics = mean.order, _AZIMUTHS // 2
    azimuth = 2.0 * np.pi / _AZIMUTHS * np.arange(_AZIMUTHS)
    core, force = periodic.core_at(azimuth), periodic.forcing_at(azimuth)[:, :n]
    values, vectors = np.linalg.eig(mean.A)
    resolvent = 1.0 / (np.exp(1j * turn * np.arange(harmonics))[:, None] - values)
    to_modes = np.linalg.inv(vectors).T
    motion, first = np.zeros((_AZIMUTHS, n)), 0.0
    for _ in range(100):
        push = force + np.einsum("ars,as->ar", core, motion @ periodic.right[:, :n].T) @ periodic.left[:n].T
        series = np.fft.rfft(push, axis=0)[:harmonics] / _AZIMUTHS
        series[1:] *= 2.0
        answer = (resolvent * (series @ to_modes)) @ vectors.T
        before, motion = motion, (np.exp(1j * azimuth[:, None] * np.arange(harmonics)) @ answer).real
        change = np.abs(motion - before).max()
        if change <= _ENOUGH * np.abs(motion).max():
            return answer
        first = first or change
        if change > 10.0 * first:
            break
    raise ValueError(
        "periodic plant: the steady motion of the unbalanced rotor was not found; blades differ too much"
    )


def filtered(shaping: StateSpace, first: Array, white: Array) -> Array:
    """Wind (m, T) of a diagonal filter from its first states (m, n or more) and white noise (m, T)."""
    from scipy.signal import lfilter  # turbines of equal blades do without

    wind = shaping.D[0, 0] * white
    for mode, decay in enumerate(np.diag(shaping.A)):
        # Of the state before each sample: x' = decay x + B w, read by C.
        states, _ = lfilter([0.0, shaping.B[mode, 0]], [1.0, -decay], white, zi=first[:, mode : mode + 1])
        wind += shaping.C[0, mode] * states
    return np.asarray(wind)
