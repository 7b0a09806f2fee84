"""From a model to what its plants share: systems in modal form, prepared once, and the constants of a step."""

from __future__ import annotations

from dataclasses import astuple, dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from flapgym.core.arrays import BLADES, Array, FloatArray
from flapgym.core.lifted import lift
from flapgym.core.modal import Modal, modal_form
from flapgym.core.state_space import StateSpace
from flapgym.model.nameplate import nameplate
from flapgym.model.signals import COMPONENTS, pitch_inputs, strip_inputs
from flapgym.model.steady import Steady, steady_response
from flapgym.model.turbine_model import TurbineModel
from flapgym.plant.actuator import Law, free_motion, lag_constants, pitch_law, rate_gained, stepwise_motion
from flapgym.plant.box_response import BoxResponse
from flapgym.plant.disturbance import Disturbance, disturbance_system, wind_modes, with_wind
from flapgym.plant.field_response import FieldResponse
from flapgym.plant.fingerprint import Numbers
from flapgym.plant.frame import OutputRows, input_frame
from flapgym.plant.parameters import Parameters, Sizes, Stepping
from flapgym.plant.surroundings import Surroundings
from flapgym.plant.wind_response import WindResponse
from flapgym.wind.box_field import BoxField
from flapgym.wind.disk import annulus_weights


@dataclass(frozen=True, eq=False)
class Kernel:
    """Systems a plant is made of, in modal form, for intervals of k steps.

    Attributes
    ----------
    numbers : Numbers
        The model.
    rows : OutputRows
    turn : float
        Azimuth of one step [rad].
    flap : Modal
        Angles, rates and, where they act, accelerations of actuators in components to the outputs that have rows, and
        the wind (on which they do nothing).
    disturbance : WindResponse
        From a realisation's normal numbers to the rows.
    steady : Steady or None
        The response to what is steady.
    """

    numbers: Numbers
    rows: OutputRows
    turn: float
    flap: Modal
    disturbance: WindResponse
    steady: Steady | None

    @cached_property
    def wind(self) -> Modal:
        """Homogeneous wind to the same, for a gust known in advance; made when first wanted."""
        return _wanted(_wind_modes(self.numbers), self.rows, self.numbers.model)

    @cached_property
    def strips(self) -> Modal:
        """Winds by strip, in multi-blade coordinates, to the same. Told of the wind is its mean over the disk."""
        return _wanted(_strip_modes(self.numbers), self.rows, self.numbers.model)

    def packed(self, outputs: Array) -> Array:
        """Rows (intervals, count) from outputs and wind (intervals k, ny + 1)."""
        flat = outputs.reshape(-1, self.rows.steps * outputs.shape[1])
        return np.asarray(flat @ self.rows.matrix(self.turn).T)


def prepare(model: TurbineModel, stepping: Stepping) -> Kernel:
    """The systems of a model; what was prepared for the same numbers before is used again.

    Raises
    ------
    ValueError
        If the model lacks an input that the stepping takes.
    """
    stepping.require(model)
    steps, quantities = stepping.steps_per_action, stepping.quantities(model)
    if stepping.single_blade:
        model = replace(model, turbine=blade_as_turbine(model))
    rows = OutputRows(
        steps,
        steps if stepping.every_sample else 1,
        len(quantities.blade_outputs) if stepping.displacements else 1,
        len(quantities.fixed_outputs) if stepping.displacements else 0,
    )
    return _kernel(Numbers.of(model), rows, stepping.length_scale, stepping.surroundings, stepping.pitch)


def parameters_of(model: TurbineModel, stepping: Stepping, kernel: Kernel) -> Parameters:
    """The constants of a step."""
    k, blades, flaps, pitch = (
        stepping.steps_per_action,
        stepping.blades,
        len(model.flaps),
        int(stepping.pitch),
    )
    turn, dt, quantities, rows = kernel.turn, model.time_step, stepping.quantities(model), kernel.rows
    each, lags = BLADES * (flaps + pitch), stepping.faults.lag > 0.0
    lifted = lift(
        kernel.flap,
        k,
        rows.matrix(turn)[: rows.structural],
        input_frame(k, turn, flaps + pitch, pitch, dt),
    )
    # Motion of an actuator in every component alike.
    laws = [Law(*lag_constants(dt, stepping.faults.lag))] * flaps
    if model.pitch_actuator is not None and pitch:
        laws.append(pitch_law(model.pitch_actuator, dt))
    free = sum(
        np.kron(free_motion(k, dt, law, lags), np.diag(np.repeat(own, BLADES)))
        for law, own in zip(laws, np.eye(flaps + pitch), strict=True)
    )
    done = np.concatenate([free, np.kron(stepwise_motion(k, dt), np.eye(each))], axis=1)

    def packed(matrix: Array) -> FloatArray:
        return np.ascontiguousarray(matrix, dtype=stepping.precision)

    return Parameters(
        sizes=Sizes(
            steps=k,
            intervals=stepping.intervals,
            kept=rows.kept,
            blades=blades,
            flaps=flaps,
            pitch=pitch,
            blade_outputs=rows.blade_outputs,
            fixed_outputs=rows.fixed_outputs,
            blade_places=len(quantities.blade_outputs),
            fixed_places=len(quantities.fixed_outputs),
            record=int(stepping.record),
            lags=int(lags),
            modes=len(lifted.C),
            rows=rows.structural,
            given=each * (4 if lags else 3),
            commanded=each * (2 if lags else 1),
        ),
        time_step=dt,
        turn=turn,
        actuators=_actuators(model, stepping, laws),
        settling=rate_gained(k, dt, laws[-1]),
        decay=packed(np.stack([lifted.values.real, lifted.values.imag])),
        B=packed(done[: len(lifted.B)].T @ lifted.B),
        C=packed(lifted.C),
        D=packed(done.T @ lifted.D),
    )


def _actuators(model: TurbineModel, stepping: Stepping, laws: list[Law]) -> Array:
    """The table of `Parameters`, from the laws of a blade's actuators."""
    blades, flaps = stepping.blades, len(model.flaps)
    limits, (effectiveness, stuck) = stepping.limits(model), stepping.faults.on(blades, flaps)
    moving = np.tile([flap.acceleration_limit for flap in model.flaps], blades) * np.isnan(stuck)
    pitching = laws[-1].stiffness * limits[0, blades * flaps :]
    return np.vstack(
        [
            limits,
            np.concatenate([moving, pitching]),
            np.concatenate([effectiveness, np.ones(pitching.size)]),
            np.array([astuple(law) for law in [*laws[:flaps] * blades, *laws[flaps:] * blades]]).T,
        ]
    )


def _wanted(modal: Modal, rows: OutputRows, model: TurbineModel) -> Modal:
    """A response with those outputs alone that have rows: the blades', the fixed ones, and the wind behind them."""
    # By name: a model's further outputs of the blades stand behind the tower's.
    names = [f"{name}_{part}" for name in model.blade_outputs[: rows.blade_outputs] for part in COMPONENTS]
    names += [*model.fixed_outputs[: rows.fixed_outputs], "wind"]
    kept = [modal.outputs.index(name) for name in names]
    return replace(modal, C=modal.C[kept], D=modal.D[kept], outputs=tuple(names))


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


@lru_cache(maxsize=4)
def _actuator_modes(numbers: Numbers, pitch: bool) -> Modal:
    """Angles, then rates of flaps and pitch, then accelerations of pitch as they drive modes and as outputs feel them.

    For an acceleration changes from step to step: what a sample tells is of the step that ends there, and does not
    depend on the next action.
    """
    turbine, half = numbers.model.turbine, BLADES * len(numbers.model.flaps)
    of_pitch = list(pitch_inputs()) if pitch else []
    angles = [*turbine.inputs[:half], *of_pitch[:BLADES]]
    rates = [*turbine.inputs[half : 2 * half], *of_pitch[BLADES : 2 * BLADES]]
    accelerations, moving = of_pitch[2 * BLADES :], len(angles) + len(rates)
    system = turbine.select(inputs=[*angles, *rates, *accelerations])
    driving, felt = system.B[:, moving:], system.D[:, moving:]
    system = replace(
        system,
        B=np.hstack([system.B, np.zeros_like(driving)]),
        D=np.hstack([system.D[:, :moving], np.zeros_like(felt), felt]),
        inputs=(*system.inputs, *(f"{name}_before" for name in accelerations)),
    )
    return modal_form(with_wind(system, np.zeros((1, system.order)), np.zeros((1, len(system.inputs)))))


@lru_cache(maxsize=4)
def _wind_modes(numbers: Numbers) -> Modal:
    return wind_modes(numbers.model)


@lru_cache(maxsize=4)
def _strip_modes(numbers: Numbers) -> Modal:
    model = numbers.model
    strips = model.turbine.select(inputs=list(strip_inputs(model.strips)))
    average = np.zeros((1, len(strips.inputs)))
    average[0, :: len(COMPONENTS)] = annulus_weights(nameplate(model.case).strip_radii)
    return modal_form(with_wind(strips, np.zeros((1, strips.order)), average))


@lru_cache(maxsize=8)
def _disturbance_modes(numbers: Numbers, length_scale: float) -> tuple[Modal, Array]:
    modal = modal_form(disturbance_system(numbers.model, length_scale))
    return modal, modal.stationary_root()


@lru_cache(maxsize=16)
def _kernel(
    numbers: Numbers, rows: OutputRows, length_scale: float, surroundings: Surroundings, pitch: bool
) -> Kernel:
    model, field = numbers.model, surroundings.field
    turn = model.rotor_speed * model.time_step
    flap = _wanted(_actuator_modes(numbers, pitch), rows, model)
    disturbance: WindResponse
    if field is None:
        noise, root = _disturbance_modes(numbers, length_scale)
        disturbance = Disturbance.of(_wanted(noise, rows, model), root, rows, turn, model.turbine.order)
    else:
        strips, radii = _wanted(_strip_modes(numbers), rows, model), nameplate(model.case).strip_radii
        if isinstance(field, BoxField):
            disturbance = BoxResponse.of(strips, rows, turn, field, radii)
        else:
            disturbance = FieldResponse(strips, rows, turn, field, radii, model.wind_speed)
    steady = None
    if surroundings.steady and model.periodic is None:
        steady = steady_response(model, surroundings.inflow, surroundings.gravity, flap.outputs[:-1])
    return Kernel(numbers, rows, turn, flap, disturbance, steady)
