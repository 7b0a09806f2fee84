"""The turbine of unequal blades, whose matrices follow the azimuth: stepped sample by sample, wind and flaps together.

In multi-blade coordinates the matrices are their mean over a revolution and a small part of low rank that turns
(flapgym.model.harmonics). That part forbids modes, but costs little; a plant step is one product with the mean.
A field and gusts are given to it sample by sample. What is steady over the disk and gravity depend on the azimuth
alone, and so does the response to them, which is added: it is solved for once, by harmonic balance.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import lru_cache
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flapgym.core.arrays import BLADES, Array, BoolArray, FloatArray, IntArray
from flapgym.core.multiblade import to_blades, to_components
from flapgym.core.state_space import StateSpace
from flapgym.model.harmonics import PeriodicPart
from flapgym.model.signals import COMPONENTS, grouped, turbine_inputs
from flapgym.model.turbine_model import TurbineModel
from flapgym.plant.backends.numpy import flaps_after, move
from flapgym.plant.disturbance import Disturbance, disturbance_modes
from flapgym.plant.fingerprint import plant_fingerprint
from flapgym.plant.modal import modal_form
from flapgym.plant.parameters import Loads, Stepping, parameters_of, prepare
from flapgym.plant.responses import field_over_disk, realisation_noise
from flapgym.plant.start import GivenWind, Start
from flapgym.plant.stuck import stuck_modes
from flapgym.plant.surroundings import Steady, Surroundings, steady_inputs, strip_radii
from flapgym.plant.telling import tell
from flapgym.plant.upwind import known_ahead, measured_upwind
from flapgym.wind import Lidar, von_karman_filter
from flapgym.wind.blade_field import FieldOnDisk
from flapgym.wind.box_field import BoxOnDisk
from flapgym.wind.disk import annulus_weights
from flapgym.wind.shaping_filter import filtered

_AZIMUTHS = 64
"""Around the revolution, at least, for the steady motion of an unbalanced rotor."""
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
    under_wind : (n, 1 + 3 R) float
        States under a steady wind of 1 m/s, homogeneous or in a component of one of R strips.
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
    turbine, part = _of_flaps_and_winds(model), model.periodic
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
        steady=steady_motion(
            turbine,
            part,
            model.rotor_speed * model.time_step,
            part.forcing_at(_around(_AZIMUTHS))[:, : turbine.order],
        ),
        under_wind=np.asarray(
            np.linalg.solve(np.eye(turbine.order) - turbine.A, turbine.B[:, turbine.inputs.index("wind") :]),
            dtype=float,
        ),
    )


def _of_flaps_and_winds(model: TurbineModel) -> StateSpace:
    """The mean turbine under flaps, homogeneous wind and winds by strip, which stand before all other inputs."""
    return model.turbine.select(inputs=turbine_inputs(len(model.flaps), model.strips))


class PeriodicPlant:
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
        import_module("scipy.signal")  # half a second, which no reset should wait for
        self.model, self.count, self.stepping = model, count, stepping
        self.quantities = stepping.quantities(model)
        self.fingerprint = plant_fingerprint(model)
        stepping.require(model)
        around = stepping.surroundings
        # Of these the actuators' are used, and the field; the modes are those of the mean turbine.
        kernel = prepare(model, replace(stepping, surroundings=Surroundings(around.field)))
        self._field, self._parameters = kernel.disturbance, parameters_of(model, stepping, kernel)
        self._order = model.turbine.order
        names = model.turbine.outputs
        self._of_blades = [
            names.index(f"{name}_{part}") for name in self.quantities.blade_outputs for part in COMPONENTS
        ]
        self._fixed = [names.index(name) for name in self.quantities.fixed_outputs]
        wanted = _Wanted(self.fingerprint, stepping.length_scale, model)
        self._constants = _prepared(wanted)
        self._steady = (
            _steady_response(wanted, Surroundings(None, around.inflow, around.gravity))
            if around.steady
            else None
        )
        _, stuck = stepping.faults.on(stepping.blades, len(model.flaps))
        self._held, self._stuck = ~np.isnan(stuck), np.where(np.isnan(stuck), 0.0, stuck)
        self._step_turn = model.rotor_speed * model.time_step
        self.elapsed = np.zeros(count, dtype=np.int64)
        """Actions since each turbine's reset."""
        self._strongest = np.zeros(count)
        self._start_azimuth = np.zeros(count)
        self._flaps = np.zeros((4, stuck.size, count))
        self._wind = np.zeros((count, stepping.intervals * stepping.steps_per_action + 1))
        """Its mean over the disk, as it is told."""
        self._blowing = np.zeros((*self._wind.shape, self._constants.under_wind.shape[1]))
        """Homogeneous wind and, of a model that has them, winds by strip, in components."""
        self._ahead = np.zeros((count, self._order))
        """State at the sample after the last one given: what is known of that is known already."""

    @property
    def noise_count(self) -> int:
        """Standard normal numbers one turbine's realisation takes."""
        if isinstance(self._field, Disturbance):
            return self._constants.root.shape[1] + self._wind.shape[1]
        return self._field.noise_count(self.stepping.intervals)

    @property
    def strongest_wind(self) -> Array:
        """Largest modulus of the wind in each turbine's episode, mean over the rotor, (n,) [m/s]."""
        return self._strongest

    def field(self, start: Start) -> FieldOnDisk | BoxOnDisk:
        """The wind over the disk while the one turbine of a start goes through its episode, for a picture.

        Raises
        ------
        ValueError
            If there is no field around this plant.
        """
        return field_over_disk(self._field, start, self.stepping.intervals)

    @property
    def known_ahead(self) -> float:
        """Time beyond an episode up to which its wind can be told ahead [s]."""
        return known_ahead(self._field, self.stepping.intervals)

    def upwind(self, lidar: Lidar, start: Start, arrival: Array) -> Array:
        """Speeds along a lidar's beams (m, S, N) [m/s], see `flapgym.plant.upwind.measured_upwind`."""
        return measured_upwind(self._field, self.model, self.stepping, lidar, start, arrival)

    def steady(self, azimuth: Array) -> dict[str, Array]:
        """What steady inflow and gravity do to the outputs at azimuths of blade 1 (n,) [rad], about each one's mean.

        Of the blades' outputs (n, blades), of the fixed ones (n,). What the rotor's imbalance does is no part of it.

        Raises
        ------
        ValueError
            If nothing is steady around this plant.
        """
        if self._steady is None:
            raise ValueError("steady: expected steady inflow or gravity around the plant, there is none")
        return self._steady.told(azimuth)

    def reset(self, turbines: IntArray, start: Start) -> Loads:
        """Begin an episode of m turbines; their loads at sample 0."""
        state, wind, blowing = self._in_turbulence(start, len(turbines))
        if start.gust is not None:
            self._add_gust(start.gust, state, wind, blowing)
        azimuth = np.asarray(start.azimuth)[:, None]
        phase = np.exp(1j * azimuth * np.arange(len(self._constants.steady)))
        state = state + (phase @ self._constants.steady).real + self._under_stuck_flaps(start.azimuth)
        flaps = np.zeros((4, self._held.size, len(turbines)))
        flaps[0] = np.where(self._held, self._stuck, start.angle).T
        flaps[1] = np.where(self._held, 0.0, start.rate).T
        self._wind[turbines], self._blowing[turbines], self._flaps[:, :, turbines] = wind, blowing, flaps
        self._strongest[turbines] = np.abs(wind).max(axis=1)
        self.elapsed[turbines], self._start_azimuth[turbines] = 0, start.azimuth
        outputs, self._ahead[turbines] = self._march(
            state, self._inputs(flaps[None, :2], blowing[:, :1], azimuth), azimuth
        )
        return self._told(outputs, wind[:, :1], flaps[None, :2], flaps[3], azimuth, record=False)

    def _in_turbulence(self, start: Start, count: int) -> tuple[Array, Array, Array]:
        """States (m, n) at sample 0, wind as it is told (m, T + 1) and as it blows (m, T + 1, 1 + 3 R) of m episodes.

        One turbine after another: then a realisation is the same to the last bit, whoever else is reset with it.
        """
        samples = self._wind.shape[1]
        state, wind = np.zeros((count, self._order)), np.zeros((count, samples))
        blowing = np.zeros((count, *self._blowing.shape[1:]))
        noise = start.noise
        if start.realisation is not None:
            noise = np.stack([realisation_noise(int(seed), self.noise_count) for seed in start.realisation])
        if noise is None:
            return state, wind, blowing
        if isinstance(self._field, Disturbance):
            level = np.asarray(start.intensity) / self.model.turbulence_intensity
            known = self._constants.root.shape[1]
            first = np.stack([self._constants.root @ row for row in noise[:, :known]])
            wind = level[:, None] * filtered(self._constants.shaping, first, noise[:, known:])
            state = level[:, None] * first[:, self._constants.shaping.order :]
            blowing[:, :, 0] = wind
            return state, wind, blowing
        for row, (own, azimuth) in enumerate(zip(noise, start.azimuth, strict=True)):
            # A field knows how strong it is.
            met = self._field.blowing(own, self.stepping.intervals, float(azimuth))
            state[row] = (self._field.modal.expand @ met.modes).real
            wind[row], blowing[row, :, 1:] = met.average, met.strips
        return state, wind, blowing

    def _add_gust(self, gust: GivenWind, state: Array, wind: Array, blowing: Array) -> None:
        """Add a wind known in advance to what `_in_turbulence` gives."""
        given, before = gust.wind.reshape(len(gust.wind), -1), np.atleast_1d(gust.before)
        by_strip = given.shape[1] > 1
        place = slice(1, None) if by_strip else slice(0, 1)
        blowing[:, :, place] += given
        state += self._constants.under_wind[:, place] @ before
        wind += given[:, :: len(COMPONENTS)] @ (
            annulus_weights(strip_radii(self.model)) if by_strip else np.ones(1)
        )

    def step(self, actions: FloatArray) -> Loads:
        """Hold actions (n, blades F), finite fractions of the acceleration limits, for k plant steps."""
        p, k = self._parameters, self.stepping.steps_per_action
        command: Array = np.clip(np.asarray(actions, dtype=float), -1.0, 1.0).T * p.acceleration[:, None]
        motion, _, _, stopped = move(p, self._flaps, command)
        # A turbine whose episode is over stays at its last wind.
        at = np.minimum(self.elapsed[:, None] * k + np.arange(1, k + 1), self._wind.shape[1] - 1)
        wind, blowing = (
            np.take_along_axis(self._wind, at, axis=1),
            np.take_along_axis(self._blowing, at[:, :, None], axis=1),
        )
        azimuth = (self._start_azimuth + self._step_turn * k * self.elapsed)[:, None]
        azimuth = azimuth + self._step_turn * np.arange(1, k + 1)
        outputs, self._ahead = self._march(self._ahead, self._inputs(motion[1:], blowing, azimuth), azimuth)
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
        """Loads of outputs (m, k, ny) in components at k samples, and of what is steady."""
        m, k, _ = outputs.shape
        if self._steady is not None:
            outputs = outputs + self._steady.at(azimuth.ravel())[:, :-1].reshape(outputs.shape)
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

    def _inputs(self, motion: Array, blowing: Array, azimuth: Array) -> Array:
        """Inputs (m, k, 6 F + w) from flap motion (k, 2, blades F, m), winds (m, k, w) and azimuth (m, k)."""
        p = self._parameters
        acting = motion * p.effectiveness[:, None]
        k, m = acting.shape[0], acting.shape[-1]
        by_flap = acting.reshape(k, 2, p.blades, p.flaps, m).transpose(4, 0, 1, 3, 2)
        components = to_components(by_flap, azimuth[:, :, None, None])
        return np.concatenate([components.reshape(m, k, -1), blowing], axis=2)

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


@lru_cache(maxsize=4)
def _steady_response(wanted: _Wanted, surroundings: Surroundings) -> Steady:
    """The response to steady inflow and gravity, about each blade's own mean over a revolution.

    As with equal blades a mean is a matter of the trim, and the blades' trims are their own.
    """
    model = wanted.model
    assert model.periodic is not None
    turbine, part, n = model.turbine, model.periodic, model.turbine.order
    forced = steady_inputs(model, surroundings)
    highest = BLADES * (max(len(forcing) for _, forcing in forced) - 1) + part.harmonics
    # At least two azimuths a wave, and as many again for what the turning part adds to it.
    azimuth = _around(max(_AZIMUTHS, 1 << (4 * highest - 1).bit_length()))
    inputs = np.zeros((len(azimuth), len(turbine.inputs)))
    for names, forcing in forced:
        phase = np.exp(1j * BLADES * azimuth[:, None] * np.arange(len(forcing)))
        inputs[:, [turbine.inputs.index(name) for name in names]] += (phase @ forcing).real
    push = inputs @ np.vstack([turbine.B, turbine.D]).T + _turning(
        part, azimuth, inputs @ part.right[:, n:].T
    )
    series = steady_motion(turbine, part, model.rotor_speed * model.time_step, push[:, :n])
    motion = _summed(series)
    outputs = (
        push[:, n:] + motion @ turbine.C.T + _turning(part, azimuth, motion @ part.right[:, :n].T)[:, n:]
    )
    mean = np.zeros(outputs.shape[1] + 1)
    for base, of_blades in grouped(turbine.outputs):
        if of_blades:
            place = [turbine.outputs.index(f"{base}_{component}") for component in COMPONENTS]
            blades = to_blades(outputs[:, place], azimuth)
            own = blades.mean(axis=0)
            outputs[:, place], mean[place] = (
                to_components(blades - own, azimuth),
                to_components(own, np.zeros(())),
            )
        else:
            place = [turbine.outputs.index(base)]
            mean[place] = outputs[:, place].mean(axis=0)
            outputs[:, place] -= mean[place]
    harmonics = np.fft.rfft(outputs, axis=0)[: len(azimuth) // 2] / len(azimuth)
    harmonics[1:] *= 2.0
    kept = np.flatnonzero((np.abs(harmonics) > _ENOUGH * np.abs(outputs).max(axis=0)).any(axis=1))
    harmonics = np.pad(harmonics[: kept.max(initial=0) + 1], ((0, 0), (0, 1)))
    return Steady(turbine.outputs, harmonics, mean, every=1)


def _around(count: int) -> Array:
    """Azimuths (count,) around a revolution [rad]."""
    return 2.0 * np.pi / count * np.arange(count, dtype=np.float64)


def _turning(part: PeriodicPart, azimuth: Array, reached: Array) -> Array:
    """What the turning part adds (T, n + ny) at azimuths (T,) to what reaches it (T, s)."""
    return np.einsum("ars,as->ar", part.core_at(azimuth), reached) @ part.left.T


def _summed(series: NDArray[np.complex128]) -> Array:
    """States (2 k, n) around the revolution, from their harmonics (k, n)."""
    halved = np.concatenate([series[:1], 0.5 * series[1:]])
    return np.fft.irfft(halved, 2 * len(series), axis=0, norm="forward")


def steady_motion(
    mean: StateSpace, periodic: PeriodicPart, turn: float, force: Array
) -> NDArray[np.complex128]:
    """States that a force keeps up, x(theta) = Re sum_k X[k] exp(j k theta), shape (A / 2, n).

    The periodic part is small, so its answer to itself is found by repetition: each harmonic by the mean's resolvent.

    Parameters
    ----------
    mean : StateSpace
    periodic : PeriodicPart
    turn : float
        Azimuth of one step [rad].
    force : (A, n) float
        What is added to the next state, at A azimuths around the revolution.

    Raises
    ------
    ValueError
        If the blades differ by so much that repetition does not converge.
    """
    azimuth, harmonics = _around(len(force)), len(force) // 2
    core = periodic.core_at(azimuth)
    values, vectors = np.linalg.eig(mean.A)
    resolvent = 1.0 / (np.exp(1j * turn * np.arange(harmonics))[:, None] - values)
    to_modes = np.linalg.inv(vectors).T
    motion, first = np.zeros_like(force), 0.0
    for _ in range(100):
        push = (
            force
            + np.einsum("ars,as->ar", core, motion @ periodic.right[:, : mean.order].T)
            @ periodic.left[: mean.order].T
        )
        series = np.fft.rfft(push, axis=0)[:harmonics] / len(force)
        series[1:] *= 2.0
        answer = (resolvent * (series @ to_modes)) @ vectors.T
        before, motion = motion, _summed(answer)
        change = np.abs(motion - before).max()
        if change <= _ENOUGH * np.abs(motion).max():
            return answer
        first = first or change
        if change > 10.0 * first:
            break
    raise ValueError(
        "periodic plant: the steady motion of the unbalanced rotor was not found; blades differ too much"
    )
