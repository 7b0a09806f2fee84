"""What the step of a turbine needs and never changes, as named arrays; prepared once for a model and shared.

Superposition: the response to the flaps is stepped, that to the wind is looked up (flapgym.plant.responses). Between
its stops a flap moves under a held acceleration, so three numbers a flap (four where the acceleration lags) decide an
interval of k steps: it is one product, whatever k. Where a stop changes the motion, what it took away is added. Where
the blades' pitch moves, it is one more actuator on each, with a law of its own.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Annotated, NamedTuple

import numpy as np

from flapgym.core.arrays import BLADES, Array, FloatArray, IntArray
from flapgym.core.fields import Choice, Count, Flag, Quantity, check_fields
from flapgym.core.state_space import StateSpace
from flapgym.model.signals import COMPONENTS, pitch_inputs
from flapgym.model.turbine_model import TurbineModel
from flapgym.plant.actuator import (
    Faults,
    Law,
    free_motion,
    lag_constants,
    pitch_law,
    rate_gained,
    stepwise_motion,
)
from flapgym.plant.box_response import BoxResponse
from flapgym.plant.disturbance import Disturbance, disturbance_modes, wind_modes
from flapgym.plant.field_response import FieldResponse
from flapgym.plant.fingerprint import fingerprint
from flapgym.plant.frame import OutputRows, input_frame
from flapgym.plant.lifted import lift
from flapgym.plant.modal import Modal, modal_form
from flapgym.plant.quantities import Quantities
from flapgym.plant.surroundings import (
    Steady,
    Surroundings,
    steady_response,
    strip_radii,
    strip_system,
)
from flapgym.wind.box_field import BoxField
from flapgym.wind.disk import annulus_weights

PRECISIONS = ("float64", "float32")


class Parameters(NamedTuple):
    """Constants of a step.

    Flap f of blade b comes at b F + f, the pitch of blade b behind all flaps, at blades F + b: A = F + 1 actuators a
    blade, or A = F. M is the number of modes, Q = 3 A kinds what decides a motion.

    Attributes
    ----------
    steps, intervals : int
        Plant steps k an action is held; actions of an episode.
    kept : int
        Samples at which everything but the root moment is told: k, or 1 for the last.
    blades, flaps, pitch : int
        Blades, flaps F on each, and 1 where pitch moves, else 0.
    blade_outputs, fixed_outputs : int
        Quantities that are computed of the blades (1: the root moment alone) and in the fixed frame.
    blade_places, fixed_places : int
        The same of those that have a place among a turbine's numbers; what is not computed is NaN there.
    record : bool
        Whether every plant sample is told.
    time_step, turn : float
        Of a plant step [s, rad of azimuth].
    lags : bool
        Whether a flap's acceleration lags behind its command.
    lag_decay : float
        `flapgym.plant.actuator.lag_constants`.
    lag_gain, stiffness, damping : (blades A,) float
        `flapgym.plant.actuator.Law` of each.
    angle_limit, rate_limit : (blades A,) float
        Stops [rad, rad/s].
    acceleration : (blades A,) float
        What an action of one commands [rad/s^2]; zero for a stuck flap.
    effectiveness : (blades A,) float
    settling : (k, 2) float
        `flapgym.plant.actuator.rate_gained` of pitch, which moves without a command, too.
    decay : (2, M) float
        What an interval leaves of the modes: real and imaginary part of their eigenvalues' k-th power.
    read : (2 M, rows) float
        Modes at the start, real parts first, to the rows (`flapgym.plant.frame.OutputRows`, without the wind's).
    push : (Q + 6 A k, 2 M) float
        What actuators do to the modes at the end, by quantities of each in components 0, c, s in the frame of the
        start. The first Q are of motion that is free of stops: command, if it lags the acceleration at the start,
        angle and rate there. Where stops are met, the command's part is left out, and behind angle and rate come the
        rate gained step by step, less `settling`, and the jumps of the angle step by step.
    feed : (Q + 6 A k, rows) float
        What they do to the rows.
    """

    steps: int
    intervals: int
    kept: int
    blades: int
    flaps: int
    pitch: int
    blade_outputs: int
    fixed_outputs: int
    blade_places: int
    fixed_places: int
    record: bool
    time_step: float
    turn: float
    lags: bool
    lag_decay: float
    lag_gain: Array
    stiffness: Array
    damping: Array
    angle_limit: Array
    rate_limit: Array
    acceleration: Array
    effectiveness: Array
    settling: Array
    decay: FloatArray
    read: FloatArray
    push: FloatArray
    feed: FloatArray

    @property
    def actuators(self) -> int:
        """A."""
        return self.flaps + self.pitch

    @property
    def free(self) -> int:
        """Q."""
        return self.commanded + 2 * BLADES * self.actuators

    @property
    def commanded(self) -> int:
        """Of the Q, those of the command and its lag."""
        return BLADES * self.actuators * (2 if self.lags else 1)

    @property
    def all_flaps(self) -> int:
        """Flaps of all blades: as many actuators come before the first that pitches a blade."""
        return self.blades * self.flaps


class Episode(NamedTuple):
    """What does not change within an episode of n turbines.

    Attributes
    ----------
    azimuth : (n,) float
        Of blade 1 at the reset [rad].
    responses : (places, intervals, rows + kept) float
        What the wind does to the rows, and the wind itself, at unit level.
    place : (n,) int
        Where each turbine's response stands.
    level : (n,) float
        Factor on it.
    """

    azimuth: Array
    responses: FloatArray
    place: IntArray
    level: Array


class State(NamedTuple):
    """What changes from step to step.

    Attributes
    ----------
    elapsed : (n,) int
        Actions since the reset.
    flaps : (4, blades A, n) float
        Of flaps and pitch: angle, rate, lagged acceleration, way since the reset [rad, rad/s, rad/s^2, rad].
    modes : (n, 2 M) float
        Of the response to the flaps, real parts first.
    """

    elapsed: IntArray
    flaps: Array
    modes: FloatArray


class Loads(NamedTuple):
    """What n turbines did during an action.

    Attributes
    ----------
    last : (n, size) float
        At the last sample (`flapgym.plant.quantities.Quantities.last`).
    rbm_square : (n, blades) float
        Mean square of the root moment over the samples [N^2 m^2].
    angle_square : (n,) float
        The same of the flap angles over their stops, mean over the flaps.
    fixed_square : (n, fixed) float
        The same of the fixed outputs, over the samples kept.
    samples : (n, k, sample_size) float
        Every plant sample; (n, 0, 0) where they are not wanted.
    """

    last: Array
    rbm_square: Array
    angle_square: Array
    fixed_square: Array
    samples: Array


@dataclass(frozen=True)
class Stepping:
    """How a plant is stepped.

    Parameters
    ----------
    steps_per_action : int
        Plant steps k for which an action is held.
    intervals : int
        Actions per episode.
    length_scale : float
        Of the turbulence [m].
    every_sample : bool
        Compute everything at every plant sample, not only at the last one of an interval.
    record : bool
        Tell every plant sample; takes `every_sample` and `displacements`.
    displacements : bool
        Compute more than root moments and wind at all; without it the rest is NaN, which saves a tenth of the time of
        a single turbine's step.
    faults : Faults
        Of the flaps.
    single_blade : bool
        The clamped single blade instead of the turbine.
    pitch : bool
        Whether the pitch of each blade moves, too.
    precision : str
        "float64", or "float32" of the modes and of the response to the wind.
    pool : int
        Number of realisations of the turbulence shared by all plants of the process; 0 draws each anew.
    surroundings : Surroundings
        A field in the place of the homogeneous turbulence, steady inflow, gravity.
    """

    steps_per_action: Annotated[int, Count(at_least=1)]
    intervals: Annotated[int, Count(at_least=1)]
    length_scale: Annotated[float, Quantity("length", above=0.0)]
    every_sample: Annotated[bool, Flag()] = False
    record: Annotated[bool, Flag()] = False
    displacements: Annotated[bool, Flag()] = True
    faults: Faults = field(default_factory=Faults)
    single_blade: Annotated[bool, Flag()] = False
    pitch: Annotated[bool, Flag()] = False
    precision: Annotated[str, Choice(PRECISIONS)] = "float64"
    pool: Annotated[int, Count(at_least=0)] = 0
    surroundings: Surroundings = field(default_factory=Surroundings)

    def __post_init__(self) -> None:
        check_fields(self, "stepping")
        if self.single_blade and self.surroundings.turns:
            raise ValueError("surroundings: expected none with the single blade, which does not turn")
        if self.record and not (self.every_sample and self.displacements):
            raise ValueError(
                "stepping.record: expected every_sample and displacements with it, got one without"
            )

    @property
    def blades(self) -> int:
        """Blades that are there."""
        return 1 if self.single_blade else BLADES

    def quantities(self, model: TurbineModel) -> Quantities:
        """What a plant of the model tells."""
        if self.single_blade:
            return Quantities(self.blades, len(model.flaps), False, model.blade.outputs, ())
        return Quantities(self.blades, len(model.flaps), self.pitch, model.blade_outputs, model.fixed_outputs)

    def limits(self, model: TurbineModel) -> Array:
        """Stops of angle and rate of every actuator, (2, blades A) [rad, rad/s]."""
        pitch = [model.pitch_actuator] * self.blades if self.pitch else []
        of_all = [*model.flaps * self.blades, *pitch]
        return np.array([[getattr(each, name) for each in of_all] for name in ("angle_limit", "rate_limit")])

    def require(self, model: TurbineModel) -> None:
        """Refuse a model without the inputs that this takes.

        Raises
        ------
        ValueError
            The message names the setting and a model that has them.
        """
        self.surroundings.require(model)
        if not self.pitch:
            return
        if model.pitch_actuator is None:
            raise ValueError(
                f"pitch: expected a model with pitch as an input, such as nrel5mw-site, got {model.name}; "
                "see [signals] in the case file"
            )
        if self.single_blade:
            raise ValueError("pitch: expected none with the single blade, whose model has no such input")


@dataclass(frozen=True, eq=False)
class Kernel:
    """Systems a plant is made of, in modal form, for intervals of k steps.

    Attributes
    ----------
    flap : Modal
        Angles, rates and, where they act, accelerations of actuators in components to the outputs that have rows, and
        the wind (on which they do nothing).
    wind : Modal
        Wind to the same, for a wind known in advance.
    disturbance : Disturbance, FieldResponse or BoxResponse
        From a realisation's normal numbers to the rows.
    steady : Steady or None
        The response to what is steady.
    rows : OutputRows
    turn : float
        Azimuth of one step [rad].
    content : _ByContent
        The model.
    """

    flap: Modal
    wind: Modal
    disturbance: Disturbance | FieldResponse | BoxResponse
    steady: Steady | None
    rows: OutputRows
    turn: float
    content: _ByContent

    @cached_property
    def strips(self) -> Modal:
        """Winds by strip, in multi-blade coordinates, to the same, for a gust known in advance; made when first wanted.

        Told of the wind is its mean over the disk.
        """
        model = self.content.model
        modal = _wanted(_strip_modes(self.content), self.rows, model)
        direct = modal.D.copy()
        direct[-1, :: len(COMPONENTS)] = annulus_weights(strip_radii(model))
        return replace(modal, D=direct)

    @cached_property
    def direct(self) -> Array:
        """(nu, ny + 1) inputs of a sample to the outputs of the same sample."""
        return np.ascontiguousarray(self.flap.D.T)

    def packed(self, outputs: Array) -> Array:
        """Rows (intervals, count) from outputs and wind (intervals k, ny + 1)."""
        flat = outputs.reshape(-1, self.rows.steps * outputs.shape[1])
        return np.asarray(flat @ self.rows.matrix(self.turn).T)


def prepare(model: TurbineModel, stepping: Stepping) -> Kernel:
    """The systems of a model; what was prepared for the same numbers before is used again."""
    steps, quantities = stepping.steps_per_action, stepping.quantities(model)
    if stepping.single_blade:
        model = replace(model, turbine=blade_as_turbine(model))
    rows = OutputRows(
        steps,
        steps if stepping.every_sample else 1,
        len(quantities.blade_outputs) if stepping.displacements else 1,
        len(quantities.fixed_outputs) if stepping.displacements else 0,
    )
    stepping.require(model)
    return _kernel(_ByContent(model), rows, stepping.length_scale, stepping.surroundings, stepping.pitch)


def parameters_of(model: TurbineModel, stepping: Stepping, kernel: Kernel) -> Parameters:
    """The constants of a step."""
    k, blades, flaps, pitch = (
        stepping.steps_per_action,
        stepping.blades,
        len(model.flaps),
        int(stepping.pitch),
    )
    turn, dt, quantities = kernel.turn, model.time_step, stepping.quantities(model)
    frame = input_frame(k, turn, flaps + pitch, pitch, dt)
    lifted = lift(kernel.flap, k, kernel.rows.matrix(turn)[: kernel.rows.structural], frame)
    laws, each = laws_of(model, stepping), np.eye(BLADES * (flaps + pitch))
    # Motion of an actuator in every component alike.
    lags = stepping.faults.lag > 0.0
    free = np.sum(
        [
            np.kron(free_motion(k, dt, law, lags), each * np.repeat(own, BLADES))
            for law, own in zip(laws, np.eye(flaps + pitch), strict=True)
        ],
        axis=0,
    )
    done = np.concatenate([free, np.kron(stepwise_motion(k, dt), each)], axis=1)
    drive = _parts_apart(lifted.drive)
    effectiveness, stuck = stepping.faults.on(blades, flaps)
    angle_limit, rate_limit = stepping.limits(model)
    of_flaps = np.array([flap.acceleration_limit for flap in model.flaps] * blades)
    acceleration = np.concatenate(
        [
            np.where(np.isnan(stuck), of_flaps, 0.0),
            laws[-1].stiffness * angle_limit[of_flaps.size :],
        ]
    )
    precise = np.dtype(stepping.precision)

    def of_all(name: str) -> Array:
        of_pitch = [getattr(laws[-1], name)] * (blades * pitch)
        return np.array([getattr(law, name) for law in laws[:flaps]] * blades + of_pitch)

    def packed(matrix: Array) -> FloatArray:
        return np.ascontiguousarray(matrix, dtype=precise)

    return Parameters(
        steps=k,
        intervals=stepping.intervals,
        kept=kernel.rows.kept,
        blades=blades,
        flaps=flaps,
        pitch=pitch,
        blade_outputs=kernel.rows.blade_outputs,
        fixed_outputs=kernel.rows.fixed_outputs,
        blade_places=len(quantities.blade_outputs),
        fixed_places=len(quantities.fixed_outputs),
        record=stepping.record,
        time_step=dt,
        turn=turn,
        lags=lags,
        lag_decay=laws[0].lag_decay,
        lag_gain=of_all("lag_gain"),
        stiffness=of_all("stiffness"),
        damping=of_all("damping"),
        angle_limit=angle_limit,
        rate_limit=rate_limit,
        acceleration=acceleration,
        effectiveness=np.concatenate([effectiveness, np.ones(blades * pitch)]),
        settling=rate_gained(k, dt, laws[-1]),
        decay=packed(np.stack([lifted.decay.real, lifted.decay.imag])),
        read=packed(_parts_apart(lifted.read.T).T),
        push=packed(done[: len(drive)].T @ drive),
        feed=packed(done.T @ lifted.feed),
    )


def laws_of(model: TurbineModel, stepping: Stepping) -> list[Law]:
    """Of the actuators of a blade: its flaps, and pitch where it moves."""
    laws = [Law(*lag_constants(model.time_step, stepping.faults.lag))] * len(model.flaps)
    if stepping.pitch:
        assert model.pitch_actuator is not None
        laws.append(pitch_law(model.pitch_actuator, model.time_step))
    return laws


def _parts_apart(alternating: Array) -> Array:
    """Columns of real and imaginary parts in turn, (m, 2 M), with all real parts first."""
    return np.concatenate([alternating[:, 0::2], alternating[:, 1::2]], axis=1)


def _wanted(modal: Modal, rows: OutputRows, model: TurbineModel) -> Modal:
    """A response with those outputs alone that have rows: the blades', the fixed ones, and the wind behind them.

    Parameters
    ----------
    modal : Modal
        To the model's outputs, and the wind last if it is one of them.
    rows : OutputRows
    model : TurbineModel
    """
    with_wind = modal.outputs[-1] == "wind"
    # By name: a model's further outputs of the blades stand behind the tower's.
    names = [f"{name}_{part}" for name in model.blade_outputs[: rows.blade_outputs] for part in COMPONENTS]
    names += model.fixed_outputs[: rows.fixed_outputs]
    kept = [modal.outputs.index(name) for name in names]
    read, direct = modal.read[kept], modal.D[kept]
    # The flaps do nothing to the wind.
    wind_read = modal.read[-1:] if with_wind else np.zeros((1, modal.order), dtype=complex)
    wind_direct = modal.D[-1:] if with_wind else np.zeros((1, modal.D.shape[1]))
    return replace(
        modal,
        read=np.vstack([read, wind_read]),
        D=np.vstack([direct, wind_direct]),
        outputs=(*(modal.outputs[i] for i in kept), "wind"),
    )


def blade_as_turbine(model: TurbineModel) -> StateSpace:
    """The clamped blade in the place of a turbine's collective component; the other components and the tower rest."""
    blade, turbine = model.blade, model.turbine
    inputs = [turbine.inputs.index(f"{name}_0") for name in blade.inputs[:-1]] + [
        turbine.inputs.index("wind")
    ]
    outputs = [turbine.outputs.index(f"{name}_0") for name in blade.outputs]
    B = np.zeros((blade.order, len(turbine.inputs)))
    C, D = np.zeros((len(turbine.outputs), blade.order)), np.zeros(turbine.D.shape)
    B[:, inputs], C[outputs], D[np.ix_(outputs, inputs)] = blade.B, blade.C, blade.D
    return StateSpace(blade.A, B, C, D, blade.time_step, turbine.inputs, turbine.outputs)


class _ByContent:
    """A model that equals another when every number the plant uses is the same, wherever it was loaded from."""

    def __init__(self, model: TurbineModel) -> None:
        self.model = model
        system = model.turbine
        numbers = (model.wind_speed, model.rotor_speed, model.time_step, model.turbulence_intensity)
        matrices = fingerprint((system.A, system.B, system.C, system.D), numbers)
        self._key = (matrices, system.inputs, system.outputs)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _ByContent) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)


@lru_cache(maxsize=4)
def _actuator_modes(content: _ByContent, pitch: bool) -> Modal:
    """Angles, then rates of flaps and pitch, then accelerations of pitch as they drive modes and as outputs feel them.

    For an acceleration changes from step to step: what a sample tells is of the step that ends there, and does not
    depend on the next action.
    """
    half = BLADES * len(content.model.flaps)
    of_flaps, of_pitch = content.model.turbine.inputs[: 2 * half], list(pitch_inputs()) if pitch else []
    angles = [*of_flaps[:half], *of_pitch[:BLADES]]
    rates = [*of_flaps[half:], *of_pitch[BLADES : 2 * BLADES]]
    accelerations = of_pitch[2 * BLADES :]
    system = content.model.turbine.select(inputs=[*angles, *rates, *accelerations])
    driving, felt = system.B[:, len(angles) + len(rates) :], system.D[:, len(angles) + len(rates) :]
    return modal_form(
        replace(
            system,
            B=np.hstack([system.B, np.zeros_like(driving)]),
            D=np.hstack([system.D[:, : len(angles) + len(rates)], np.zeros_like(felt), felt]),
            inputs=(*system.inputs, *(f"{name}_before" for name in accelerations)),
        )
    )


@lru_cache(maxsize=4)
def _wind_modes(content: _ByContent) -> Modal:
    return wind_modes(content.model)


@lru_cache(maxsize=8)
def _disturbance_modes(content: _ByContent, length_scale: float) -> tuple[Modal, Array]:
    return disturbance_modes(content.model, length_scale)


@lru_cache(maxsize=4)
def _strip_modes(content: _ByContent) -> Modal:
    return modal_form(strip_system(content.model))


@lru_cache(maxsize=16)
def _kernel(
    content: _ByContent, rows: OutputRows, length_scale: float, surroundings: Surroundings, pitch: bool
) -> Kernel:
    model = content.model
    turn = model.rotor_speed * model.time_step
    flap = _wanted(_actuator_modes(content, pitch), rows, model)
    disturbance: Disturbance | FieldResponse | BoxResponse
    if surroundings.field is None:
        noise_modes, root = _disturbance_modes(content, length_scale)
        disturbance = Disturbance.of(_wanted(noise_modes, rows, model), root, rows, turn)
    else:
        strips = _wanted(_strip_modes(content), rows, model)
        if isinstance(surroundings.field, BoxField):
            disturbance = BoxResponse.of(strips, rows, turn, surroundings.field, strip_radii(model))
        else:
            disturbance = FieldResponse(
                strips, rows, turn, surroundings.field, strip_radii(model), model.wind_speed
            )
    return Kernel(
        flap=flap,
        wind=_wanted(_wind_modes(content), rows, model),
        disturbance=disturbance,
        steady=steady_response(model, surroundings, flap.outputs[:-1]) if surroundings.steady else None,
        rows=rows,
        turn=turn,
        content=content,
    )
