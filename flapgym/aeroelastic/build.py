"""From a case to its turbine model: trim, reduce, couple (Sections II.A to II.D in one line)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import scipy
import scipy.linalg

from flapgym import __version__
from flapgym.aerodynamics import Aerodynamics, MeanFlow, pitch_transport, speed_transport, wake_transport
from flapgym.aerodynamics.rotor import root_moment_shares
from flapgym.aeroelastic.blade_lattice import (
    blade_lattice,
    reduce_component,
    reduce_stacked,
    reduction_error,
)
from flapgym.aeroelastic.coupling import couple, multiblade_aerodynamics
from flapgym.aeroelastic.equations import Parts, blade_equations, turbine_equations
from flapgym.aeroelastic.periodic import step_matrices
from flapgym.aeroelastic.speed_loop import with_speed_loop, without_azimuth
from flapgym.aeroelastic.trim import deflected_lattice, trim
from flapgym.aeroelastic.unequal import (
    UnequalParts,
    assemble_unequal,
    multiblade_equations,
    unequal_equations,
)
from flapgym.core.arrays import Array
from flapgym.core.state_space import StateSpace, delayed, series
from flapgym.core.wording import number
from flapgym.model.harmonics import TOLERANCE, fourier_series
from flapgym.model.record import Record, readings
from flapgym.model.reduced import reduced_model
from flapgym.model.signals import flap_names, grouped
from flapgym.model.turbine_model import ModelFlap, TurbineModel
from flapgym.reduction import ReducedSystem, normal_modes, output_rms
from flapgym.structure import linear_support
from flapgym.turbine import Case
from flapgym.wind import von_karman_filter

Progress = Callable[[str], None]

# Called with each of these as it begins, so that a caller can show how far the build is.
STAGES = ("trim", "lattice of one blade", "reduction", "coupling")


def build_model(case: Case, progress: Progress | None = None) -> TurbineModel:
    """Build the turbine model of a case.

    Parameters
    ----------
    case : Case
        Turbine, operating point, discretisation, flaps, reduction and reference turbulence.
    progress : callable, optional
        Called with the name of each of ``STAGES`` as it begins.

    Returns
    -------
    TurbineModel
        Its single blade keeps the shape it has in the rotor's trim and turns alone in its own wake.

    Raises
    ------
    ValueError
        If blade and lattice find no balance, or the reduced aerodynamics or the coupled model is unstable.
    """
    if case.blades.unequal and case.reduction.coupled_tolerance:
        raise ValueError(
            "reduction.coupled_tolerance: expected 0 % with unequal blades, whose periodic form is not reduced, "
            f"got {number(100 * case.reduction.coupled_tolerance)} %"
        )
    if case.blades.unequal and case.signals.outputs:
        raise ValueError(
            f"signals.outputs: expected none with unequal blades, got {', '.join(case.signals.outputs)}; leave them out"
        )
    if case.blades.unequal and case.signals.pitch:
        raise ValueError("signals.pitch: expected false with unequal blades, got true; leave it out")
    if case.reduction.coupled_tolerance and case.signals.further_inputs:
        raise ValueError(
            f"reduction.coupled_tolerance: expected 0 % with {case.signals.further_inputs[0]}, which no spectrum "
            f"weighs here, got {number(100 * case.reduction.coupled_tolerance)} %"
        )
    if case.signals.wind == "by strip" and case.reduction.coupled_tolerance:
        raise ValueError(
            'reduction.coupled_tolerance: expected 0 % with signals.wind "by strip", which no spectrum weighs here, '
            f"got {number(100 * case.reduction.coupled_tolerance)} %"
        )
    tell = progress or (lambda stage: None)
    tell(STAGES[0])
    unequal = None
    if case.blades.unequal:
        unequal, rotor_aero = assemble_unequal(case)
        parts, lattices = unequal.mean, [own.lattice for own in unequal.lattices]
    else:
        parts, rotor_aero = assemble_parts(case)
        lattices = [parts.lattice]
    tell(STAGES[1])
    blade_aero = deflected_lattice(parts.case, parts.blade, blades=1)
    tell(STAGES[2])
    keep = case.reduction.aerodynamic_states, case.reduction.aerodynamic_tolerance
    collective, whirl = (reduce_stacked(rotor_aero, lattices, m, *keep) for m in (0, 1))
    alone = reduce_component(blade_aero, parts.lattice, 0, *keep)
    errors = {
        f"lattice reduced, {name}": reduction_error(rotor_aero, lattices, m, part)
        for m, (name, part) in enumerate((("collective", collective), ("whirl", whirl)))
    }
    tell(STAGES[3])
    dt, periodic = case.discretisation.time_step, None
    rotor = multiblade_aerodynamics(collective, whirl, case.rotor_speed, dt)
    single = couple(blade_equations(parts), alone, dt)
    late = bool(case.discretisation.input_delay)
    if unequal is None:
        turbine = couple(turbine_equations(parts), rotor, dt)
        if case.speed_control is not None:
            # Positions stand first, and the turn of the rotor is the last of them.
            turbine = without_azimuth(turbine, 3 * parts.lattice.modes + parts.modal_support[1].shape[1] - 1)
        turbine = series(slow_wake(parts), turbine)
        if case.speed_control is not None:
            moving = case.airloads.slow_wake == "moving" and parts.flow is not None
            turbine = with_speed_loop(
                turbine, case, speed_transport(case, parts.flow) if moving and parts.flow else None
            )
        turbine = delayed(carried_on(turbine, case.rotor_speed * dt)) if late else turbine
    else:
        turbine, periodic = fourier_series(azimuth_steps(unequal, rotor, slow_wake(parts), late))
        errors["harmonics left out, at most"] = TOLERANCE
    single = delayed(single) if late else single
    refuse_unstable(case, {"turbine": turbine, "blade": single})
    model = TurbineModel(
        turbine=turbine,
        blade=single,
        name=case.name,
        wind_speed=case.operating_point.wind_speed,
        rotor_speed=case.rotor_speed,
        time_step=case.discretisation.time_step,
        turbulence_intensity=case.turbulence.intensity,
        length_scale=case.turbulence.length_scale,
        flaps=tuple(
            ModelFlap(name, flap.angle_limit, flap.rate_limit, flap.acceleration_limit)
            for name, flap in zip(flap_names(len(case.flaps)), case.flaps, strict=True)
        ),
        rbm_rms=open_loop_rms(case, turbine),
        inputs_hash=case.hash(),
        case=case.to_dict(),
        periodic=periodic,
        record=Record(tools=tools(), readings=readings(case), errors=errors),
    )
    tolerance = case.reduction.coupled_tolerance
    return reduced_model(model, tolerance) if tolerance else model


def refuse_unstable(case: Case, systems: Mapping[str, StateSpace]) -> None:
    """Raise on a system that grows, with the operating point that it grows at."""
    for name, system in systems.items():
        radius = system.spectral_radius()
        if radius >= 1.0:
            point = case.operating_point
            raise ValueError(
                f"operating_point: the {name} of case {case.name!r} is unstable (spectral radius {radius:.6f}) at "
                f"{number(point.wind_speed)} m/s, tip-speed ratio {number(point.tip_speed_ratio)} and "
                f"{number(np.degrees(point.pitch))} deg of pitch; above rated wind the rotor keeps its speed "
                "and is pitched"
            )


def tools() -> dict[str, str]:
    """Versions of what builds models."""
    return {"flapgym": __version__, "numpy": np.__version__, "scipy": scipy.__version__}


def assemble_parts(case: Case) -> tuple[Parts, Aerodynamics]:
    """Blade about its trim in modes, support, and the lattice of the whole rotor, for a case of equal blades."""
    case = case.alike()
    balance = trim(case)
    blade = balance.blade
    frequency, shape = normal_modes(blade.mass, blade.stiffness, case.reduction.blade_modes)
    flow = MeanFlow(balance.mean, balance.loads)
    parts = Parts(
        case=case,
        blade=blade,
        support=linear_support(case.turbine, case.rotor_speed),
        frequency=frequency,
        shape=shape,
        lattice=blade_lattice(case, balance.rotor, blade, shape, flow),
        flow=flow,
    )
    return parts, balance.rotor


def slow_wake(parts: Parts) -> StateSpace:
    """The turbine's inputs as its lattice feels them: wind and collective flaps behind the states of a moving wake.

    Winds by strip have the homogeneous one's state together. To the wind is added what collective pitch makes of the
    wake. Each input is as it is, without states, where the case keeps to its frozen wake.
    """
    case, inputs = parts.case, parts.inputs
    dt, eye = case.discretisation.time_step, np.eye(len(inputs))
    if case.airloads.slow_wake == "frozen":
        none = np.zeros((0, 0)), np.zeros((0, len(inputs))), np.zeros((len(inputs), 0))
        return StateSpace(*none, eye, dt, inputs, inputs)
    if parts.flow is None:
        raise ValueError("airloads.slow_wake: a blade without mean load has no wake to move")
    found = wake_transport(case, parts.flow.shed)
    angles = [f"{name}_angle_0" for name in flap_names(len(case.flaps))]
    states = [found.wind.state_space(dt, "wind")]
    states += [flap.state_space(dt, angle) for flap, angle in zip(found.flaps, angles, strict=True)]
    felt_as = ["wind", *angles]
    if case.signals.pitch:
        states.append(pitch_transport(case, parts.flow).state_space(dt, "pitch_angle_0"))
        felt_as.append("wind")
    place = eye[:, [inputs.index(name) for name in felt_as]]
    effective = eye[[inputs.index(state.inputs[0]) for state in states]]
    if parts.strips:
        # The wake moves as a whole, by what the strips' winds do to the root moment that its state was fitted to.
        effective[0, [inputs.index(f"wind{j}_0") for j in range(1, parts.strips + 1)]] = root_moment_shares(
            case
        )
    direct = eye + place @ np.diag([state.D.item() - 1.0 for state in states]) @ effective
    return StateSpace(
        A=np.diag([state.A.item() for state in states]),
        B=np.diag([state.B.item() for state in states]) @ effective,
        C=place @ np.diag([state.C.item() for state in states]),
        D=direct,
        time_step=dt,
        inputs=inputs,
        outputs=inputs,
    )


def azimuth_steps(
    unequal: UnequalParts, rotor: ReducedSystem, effective: StateSpace, late: bool = False
) -> Callable[[float], tuple[StateSpace, Array]]:
    """Steps of unequal blades by azimuth [rad], in multi-blade coordinates, with their forcing (n + ny,).

    Parameters
    ----------
    unequal : UnequalParts
    rotor : ReducedSystem
        Its lattices, seen from the ground.
    effective : StateSpace
        ``slow_wake`` of the mean blade.
    late : bool
        Whether the inputs act a step late.
    """
    time_step = effective.time_step
    equations = unequal_equations(unequal)
    turn = equations.rotor_speed * time_step
    by_azimuth = multiblade_equations(equations)
    outputs = by_azimuth(0.0).outputs

    def at(azimuth: float) -> tuple[StateSpace, Array]:
        A, B, C, D = step_matrices(by_azimuth, rotor, time_step, azimuth, turn)
        system = StateSpace(A, B[:, :-1], C, D[:, :-1], time_step, effective.outputs, outputs)
        system = series(effective, system)
        queue = np.zeros(len(effective.inputs) if late else 0)
        forcing = np.concatenate([np.zeros(effective.order), B[:, -1], queue, D[:, -1]])
        return (delayed(carried_on(system, turn)) if late else system), forcing

    return at


def carried_on(turbine: StateSpace, turn: float) -> StateSpace:
    """The turbine for inputs given in the multi-blade coordinates of an azimuth smaller by ``turn`` [rad].

    A blade keeps its flap while the rotor turns on, so a late input's components turn back.
    """
    cosine, sine = np.cos(turn), np.sin(turn)
    back = scipy.linalg.block_diag(1.0, [[cosine, -sine], [sine, cosine]])
    mix = scipy.linalg.block_diag(*(back if of_blades else 1.0 for _, of_blades in grouped(turbine.inputs)))
    return replace(turbine, B=turbine.B @ mix, D=turbine.D @ mix)


def open_loop_rms(case: Case, turbine: StateSpace) -> float:
    """Rms of the root bending moment [N m] under the reference turbulence, mean over the blades.

    From the Lyapunov equation. Over a revolution the mean square of a blade is that of u_0 plus half those of
    u_c and u_s.
    """
    point, turbulence = case.operating_point, case.turbulence
    wind = von_karman_filter(
        point.wind_speed, turbulence.intensity, turbulence.length_scale, case.discretisation.time_step
    )
    driven = series(wind, turbine.select(inputs=["wind"], outputs=["rbm_0", "rbm_c", "rbm_s"]))
    return float(np.sqrt(output_rms(driven) ** 2 @ [1.0, 0.5, 0.5]))
