"""From a case to its turbine model: linearise, reduce, couple (Sections II.A to II.D in one line)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flapgym.aerodynamics import (
    Aerodynamics,
    flap_downwash,
    gust_downwash,
    transfer_function,
)
from flapgym.aeroelastic.coupling import (
    Equations,
    LatticeInput,
    Output,
    SecondOrder,
    couple,
    multiblade_aerodynamics,
    turbine_structure,
)
from flapgym.aeroelastic.interaction import (
    displacement_downwash,
    hub_turn_downwash,
    interpolation,
    rigid_displacement,
    velocity_downwash,
)
from flapgym.aeroelastic.model import (
    BLADE_INPUTS,
    BLADE_OUTPUTS,
    TURBINE_INPUTS,
    TURBINE_OUTPUTS,
    TurbineModel,
)
from flapgym.aeroelastic.multiblade import WORK_WEIGHTS, hub_components
from flapgym.aeroelastic.trim import deflected_lattice, trim
from flapgym.reduction import ReducedSystem, balanced_reduction, normal_modes
from flapgym.state_space import Array, StateSpace, series
from flapgym.structure import LinearBlade, LinearSupport, linear_support
from flapgym.turbine import Case
from flapgym.turbulence import von_karman_filter

Progress = Callable[[str], None]

# Called with each of these as it begins, so that a caller can show how far the build is.
STAGES = ("trim", "lattice of one blade", "reduction", "coupling")

_FREQUENCIES = 2048  # roots of unity for the impulse response: at least four times the wake rows
_SCALING_FREQUENCY = 0.2  # Hz; lattice outputs count by their size here, where turbulence has its energy


@dataclass(frozen=True, eq=False)
class BladeLattice:
    """One blade's lattice as the structure sees it: named inputs to downwash, Gamma's forces to loads.

    Attributes
    ----------
    downwash : (p, 2 m + 10 + strips) float
        Downwash at the collocation points per unit input: mode rates (m), modes (m), hub velocity (6), hub
        rotation about y and z (2), flap angle and rate, gust in each spanwise strip.
    load : (m + 6, 3 P) float
        Generalised force on the modes, and force and moment on the hub apex, per unit panel force.
    modes, strips : int
        m and the number of strips.
    """

    downwash: Array
    load: Array
    modes: int
    strips: int

    def select(self, *names: str) -> Array:
        """Columns of the identity that feed the named group of inputs, shape (nu, size of the group)."""
        m = self.modes
        bounds = np.cumsum([0, m, m, 6, 2, 1, 1, self.strips])
        groups = ("mode_rate", "mode", "hub_velocity", "hub_turn", "flap_angle", "flap_rate", "gust")
        eye = np.eye(bounds[-1])
        return np.hstack([eye[:, bounds[i] : bounds[i + 1]] for i in map(groups.index, names)])


def build_model(case: Case, progress: Progress | None = None) -> TurbineModel:
    """Build the turbine model of a case.

    Parameters
    ----------
    case : Case
        Turbine, operating point, discretisation, flap, reduction and reference turbulence.
    progress : callable, optional
        Called with the name of each of ``STAGES`` as it begins.

    Returns
    -------
    TurbineModel

    Raises
    ------
    ValueError
        If the reduced aerodynamics or the coupled model is unstable, or the wake is longer than the window
        of the impulse response allows.
    EquilibriumError, RuntimeError
        If blade and lattice find no balance.
    """
    tell = progress or (lambda stage: None)
    tell(STAGES[0])
    balance = trim(case)
    blade, rotor_aero = balance.blade, balance.rotor
    support = linear_support(case.turbine, case.rotor_speed)
    frequency, shape = normal_modes(blade.mass, blade.stiffness, case.reduction.blade_modes)
    lattice = blade_lattice(case, rotor_aero, blade, shape)
    tell(STAGES[1])
    blade_aero = deflected_lattice(case, blade, blades=1)
    tell(STAGES[2])
    order = case.reduction.aerodynamic_states
    collective, whirl = (reduce_component(rotor_aero, lattice, m, order) for m in (0, 1))
    alone = reduce_component(blade_aero, lattice, 0, order)
    tell(STAGES[3])
    dt = case.discretisation.time_step
    rotor = multiblade_aerodynamics(collective, whirl, case.rotor_speed, dt)
    turbine = couple(turbine_equations(case, blade, support, frequency, shape, lattice), rotor, dt)
    single = couple(blade_equations(case, blade, frequency, shape, lattice), alone, dt)
    for name, system in (("turbine", turbine), ("blade", single)):
        radius = system.spectral_radius()
        if radius >= 1.0:
            raise ValueError(
                f"build_model: the {name} of case {case.name!r} is unstable (spectral radius {radius:.6f})"
            )
    limits = case.flap
    return TurbineModel(
        turbine=turbine,
        blade=single,
        name=case.name,
        wind_speed=case.operating_point.wind_speed,
        rotor_speed=case.rotor_speed,
        time_step=case.discretisation.time_step,
        turbulence_intensity=case.turbulence.intensity,
        length_scale=case.turbulence.length_scale,
        flap_angle_limit=limits.angle_limit,
        flap_rate_limit=limits.rate_limit,
        acceleration_limit=limits.acceleration_limit,
        rbm_rms=open_loop_rms(case, turbine),
        inputs_hash=case.hash(),
        case=case.to_dict(),
    )


def blade_lattice(case: Case, aero: Aerodynamics, blade: LinearBlade, shape: Array) -> BladeLattice:
    """Inputs and outputs of one blade's lattice in the blade's modes ``shape`` (6 n, m)."""
    collocation = aero.collocation
    displacement, rotation = interpolation(blade, collocation)
    force_displacement, _ = interpolation(blade, aero.force_point)
    angle, rate = flap_downwash(aero, case.flap)
    gust = gust_downwash(aero)
    hub = hub_turn_downwash(aero, case.operating_point.wind_speed)
    downwash = np.hstack(
        [
            velocity_downwash(aero, displacement @ shape),
            displacement_downwash(aero, case.rotor_speed, displacement @ shape, rotation @ shape),
            velocity_downwash(aero, rigid_displacement(collocation)),
            hub[:, 1:],  # a turn about the shaft changes nothing
            angle[:, None],
            rate[:, None],
            gust,
        ]
    )
    load = np.vstack([(force_displacement @ shape).T, rigid_displacement(aero.force_point).T])
    return BladeLattice(downwash, load, modes=shape.shape[1], strips=gust.shape[1])


def reduce_component(aero: Aerodynamics, lattice: BladeLattice, component: int, order: int) -> ReducedSystem:
    """Balanced reduction of one cyclic component of the lattice, scaled to comparable inputs and outputs."""
    rows = aero.wake_rows
    if 4 * rows > _FREQUENCIES:
        raise ValueError(
            f"discretisation.wake_length: {rows} wake rows, the reduction resolves at most {_FREQUENCIES // 4}; "
            "shorten the wake or raise the time step"
        )
    z = np.exp(2j * np.pi * np.arange(_FREQUENCIES) / _FREQUENCIES)
    response = transfer_function(aero, component, z, lattice.downwash, lattice.load)
    input_scale = 1.0 / np.sqrt((lattice.downwash**2).mean(axis=0))
    at = round(_SCALING_FREQUENCY * aero.time_step * _FREQUENCIES)
    output_scale = np.sqrt((np.abs(response[at] * input_scale) ** 2).mean(axis=1))
    return balanced_reduction(response, order, input_scale, output_scale, real=component == 0)


def turbine_equations(
    case: Case,
    blade: LinearBlade,
    support: LinearSupport,
    frequency: Array,
    shape: Array,
    lattice: BladeLattice,
) -> Equations:
    """The whole turbine in multi-blade coordinates."""
    m = shape.shape[1]
    hub = hub_components()
    modal_support, support_shape = modal_support_matrices(case, support, blade)
    t = support_shape.shape[1]
    components = np.zeros((3, m + 6, 3 * m + t))
    for i in range(3):
        components[i, :m, i * m : (i + 1) * m] = np.eye(m)
        components[i, m:, 3 * m :] = hub[i] @ support.hub @ support_shape
    own = modal_blade_matrices(case, blade, frequency, shape)
    structure, rate, acceleration = turbine_structure(own, modal_support, components, case.rotor_speed)
    T = components.reshape(-1, structure.mass.shape[0])

    held = np.hstack(
        [lattice.select("mode"), np.zeros((lattice.downwash.shape[1], 4)), lattice.select("hub_turn")]
    )
    moving = lattice.select("mode_rate", "hub_velocity")
    three = np.eye(3)
    gust = np.kron(three[:, :1], lattice.select("gust").sum(axis=1, keepdims=True))
    lattice_input = LatticeInput(
        position=np.kron(three, held) @ T + np.kron(three, moving) @ rate,
        velocity=np.asarray(np.kron(three, moving) @ T),
        exogenous=np.hstack(
            [
                np.kron(three, lattice.select("flap_angle")),
                np.kron(three, lattice.select("flap_rate")),
                gust,
            ]
        ),
    )
    root = np.kron(three, root_moment(blade, m))
    mass, damping, stiffness = (np.kron(three, matrix) for matrix in own)
    tip = np.kron(three, tip_deflection(case, shape))
    tower = (support.tower_top @ support_shape)[:2]
    quiet = np.zeros((5, T.shape[1]))
    output = Output(
        acceleration=np.vstack([-root @ mass @ T, quiet]),
        velocity=np.vstack([-root @ (mass @ acceleration[0] + damping @ T), quiet]),
        position=np.vstack(
            [
                -root @ (mass @ acceleration[1] + damping @ rate + stiffness @ T),
                tip @ T,
                np.hstack([np.zeros((2, 3 * m)), tower]),
            ]
        ),
        load=np.vstack([root, np.zeros((5, root.shape[1]))]),
    )
    return Equations(structure, lattice_input, output, TURBINE_INPUTS, TURBINE_OUTPUTS)


def blade_equations(
    case: Case, blade: LinearBlade, frequency: Array, shape: Array, lattice: BladeLattice
) -> Equations:
    """One blade clamped at its root, rotating alone: the paper's design model (Section IV.C)."""
    m = shape.shape[1]
    own = modal_blade_matrices(case, blade, frequency, shape)
    clamp = np.eye(m + 6)[:, :m]
    mass, damping, stiffness = (matrix @ clamp for matrix in own)
    root = root_moment(blade, m)
    tip = tip_deflection(case, shape)
    still = np.zeros((1, m))
    return Equations(
        SecondOrder(mass[:m], damping[:m], stiffness[:m], work=clamp.T),
        LatticeInput(
            position=lattice.select("mode"),
            velocity=lattice.select("mode_rate"),
            exogenous=np.hstack(
                [
                    lattice.select("flap_angle", "flap_rate"),
                    lattice.select("gust").sum(axis=1, keepdims=True),
                ]
            ),
        ),
        Output(
            acceleration=np.vstack([-root @ mass, still]),
            velocity=np.vstack([-root @ damping, still]),
            position=np.vstack([-root @ stiffness, tip @ clamp]),
            load=np.vstack([root, np.zeros_like(root)]),
        ),
        BLADE_INPUTS,
        BLADE_OUTPUTS,
    )


def modal_blade_matrices(
    case: Case, blade: LinearBlade, frequency: Array, shape: Array
) -> tuple[Array, Array, Array]:
    """Mass, damping and stiffness (m + 6, m + 6) of one blade in its modes and the motion of its hub (eq. 2).

    Structural damping is modal, the documented share of critical for every mode.
    """
    m = shape.shape[1]
    mass = np.block([[np.eye(m), shape.T @ blade.mass_sr], [blade.mass_rs @ shape, blade.mass_rr]])
    modal = np.diag(2.0 * case.turbine.blade_damping_ratio * frequency)
    damping = np.block(
        [
            [shape.T @ blade.damping @ shape + modal, shape.T @ blade.damping_sr],
            [blade.damping_rs @ shape, blade.damping_rr],
        ]
    )
    stiffness = np.zeros_like(mass)
    stiffness[:m, :m] = np.diag(frequency**2)
    stiffness[m:, :m] = blade.stiffness_rs @ shape
    return mass, damping, stiffness


def modal_support_matrices(
    case: Case, support: LinearSupport, blade: LinearBlade
) -> tuple[tuple[Array, Array, Array], Array]:
    """Mass, damping, stiffness (t, t) of the support in its modes, and those modes (N, t).

    The modes carry the rotor as a rigid body on the hub, so that few of them suffice once the blades move.
    """
    hub = hub_components() @ support.hub
    rotor = sum(w * part.T @ blade.mass_rr @ part for w, part in zip(WORK_WEIGHTS, hub, strict=True))
    frequency, shape = normal_modes(support.mass + rotor, support.stiffness, case.reduction.tower_modes)
    modal = np.diag(2.0 * case.turbine.tower_damping_ratio * frequency)
    mass, damping, stiffness = (
        shape.T @ matrix @ shape for matrix in (support.mass, support.damping, support.stiffness)
    )
    return (mass, damping + modal, stiffness), shape


def root_moment(blade: LinearBlade, modes: int) -> Array:
    """Row (1, m + 6) that takes the flapwise root moment out of loads on (modes, hub apex).

    Force summation: load minus inertia, moved from the apex to the root node, about the in-plane axis y of the
    coned, untwisted blade.
    """
    x, _, z = blade.position[0]
    row = np.zeros((1, modes + 6))
    row[0, modes:] = [-z, 0.0, x, 0.0, 1.0, 0.0]  # M_y - (r x F)_y, (r x F)_y = z F_x - x F_z
    return row


def tip_deflection(case: Case, shape: Array) -> Array:
    """Row (1, m + 6) for the tip's deflection normal to the coned, undeflected blade, downwind."""
    cone = case.turbine.rotor.precone
    flapwise = np.array([np.cos(cone), 0.0, np.sin(cone)])
    return np.hstack([flapwise @ shape[-6:-3], np.zeros(6)])[None]


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
    covariance = driven.C @ driven.stationary_covariance() @ driven.C.T + driven.D @ driven.D.T
    return float(np.sqrt(np.diag(covariance) @ [1.0, 0.5, 0.5]))
