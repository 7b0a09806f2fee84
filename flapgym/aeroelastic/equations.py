"""Equations of motion of the turbine and of one blade in their modes, with what they ask of the lattice."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np

from flapgym.aerodynamics import MeanFlow
from flapgym.aeroelastic.blade_lattice import BladeLattice
from flapgym.aeroelastic.coupling import Equations, LatticeInput, Output, SecondOrder, turbine_structure
from flapgym.aeroelastic.periodic import PeriodicEquations
from flapgym.aeroelastic.pitch import along, pitch_axis, pitch_motion, turned_steady_loads
from flapgym.aeroelastic.speed_loop import CONTROLLED, ROTOR_SPEED, turning
from flapgym.aeroelastic.stations import FLAPWISE, cut_at, nodes_beside, station_shares
from flapgym.core.arrays import Array
from flapgym.core.multiblade import WORK_WEIGHTS, hub_components
from flapgym.model.signals import (
    BLADE_OUTPUTS,
    GENERATOR_TORQUE,
    GRAVITY,
    INDUCED_WIND,
    blade_inputs,
    turbine_inputs,
    turbine_outputs,
)
from flapgym.reduction import normal_modes
from flapgym.structure import LinearBlade, LinearSupport
from flapgym.structure.rotation import rigid_displacement
from flapgym.turbine import Case
from flapgym.turbine.case import BLADE_LOADS, BLADE_MOTIONS, HUB_LOADS, TOWER_LOADS, TOWER_MOTIONS


@dataclass(frozen=True, eq=False)
class Parts:
    """What a turbine is coupled from.

    Attributes
    ----------
    case : Case
    blade : LinearBlade
        Of n elements, about the trim.
    support : LinearSupport
    frequency, shape : (m,), (6 n, m) float
        The blade's modes kept [rad/s], mass-normalised.
    lattice : BladeLattice
        Its lattice in those modes.
    flow : MeanFlow, optional
        The lattice's steady state, about which its loads are linearised; None for a blade without mean load.
    """

    case: Case
    blade: LinearBlade
    support: LinearSupport
    frequency: Array
    shape: Array
    lattice: BladeLattice
    flow: MeanFlow | None = None

    @property
    def strips(self) -> int:
        """Strips whose wind is an input of its own."""
        return self.lattice.strips if self.case.signals.wind == "by strip" else 0

    @property
    def inputs(self) -> tuple[str, ...]:
        """Inputs of the turbine."""
        signals = self.case.signals
        own = turbine_inputs(self.lattice.flaps, self.strips, pitch=signals.pitch, gravity=signals.gravity)
        return own if self.case.speed_control is None else (*own, GENERATOR_TORQUE, INDUCED_WIND)

    @property
    def further(self) -> tuple[tuple[str, bool], ...]:
        """Outputs beside those of every model, each with whether it is the blades'; none of the speed's control."""
        asked = tuple(entry for entry in self.case.signals.further if entry[0] not in CONTROLLED)
        if self.case.speed_control is None or (ROTOR_SPEED, False) in asked:
            return asked
        return (*asked, (ROTOR_SPEED, False))

    def pitch_columns(self, kind: str) -> slice:
        """Where the components of the blades' pitch, its "angle", "rate" or "acceleration", stand among the inputs."""
        first = self.inputs.index(f"pitch_{kind}_0")
        return slice(first, first + 3)

    @cached_property
    def turned(self) -> Array:
        """``turned_steady_loads`` of the blade, zero where pitch is no input."""
        if not self.case.signals.pitch:
            return np.zeros(len(self.lattice.load))
        return turned_steady_loads(self.case, self.blade, self.shape, self.flow)

    @cached_property
    def modal_support(self) -> tuple[tuple[Array, Array, Array], Array]:
        """Mass, damping, stiffness (t, t) of the support in its modes, and those modes (N, t).

        The modes carry the rotor as a rigid body on the hub, so that few of them suffice once the blades move. Where
        the rotor's speed is no prescribed one, the last is the turn of generator and hub together.
        """
        case, support = self.case, self.support
        hub = hub_components() @ support.hub
        rotor = sum(w * part.T @ self.blade.mass_rr @ part for w, part in zip(WORK_WEIGHTS, hub, strict=True))
        frequency, shape = normal_modes(support.mass + rotor, support.stiffness, case.reduction.tower_modes)
        modal = np.diag(2.0 * case.turbine.tower_damping_ratio * frequency)
        mass, damping, stiffness = (
            shape.T @ matrix @ shape for matrix in (support.mass, support.damping, support.stiffness)
        )
        if case.speed_control is not None:
            return self._with_free_turn(shape, modal, stiffness)
        return (mass, damping + modal, stiffness), shape

    def _with_free_turn(
        self, shape: Array, modal: Array, stiffness: Array
    ) -> tuple[tuple[Array, Array, Array], Array]:
        """The support's matrices and modes with a free generator, of which modes alone strain the shaft."""
        support, drivetrain = self.support, self.case.turbine.drivetrain
        wide = np.column_stack([shape, turning(len(shape), support.shaft_axes[:, 0])])
        mass, damping = (wide.T @ matrix @ wide for matrix in (support.mass, support.damping))
        # The gearbox's casing hands the shaft's torque to the nacelle: but for one part in the gearbox's ratio the
        # generator's inertia is between rotor and generator alone.
        mass[-1, -1] += drivetrain.gearbox_ratio**2 * drivetrain.generator_inertia
        damping[:-1, :-1] += modal
        strained = np.zeros_like(mass)
        strained[:-1, :-1] = stiffness
        return (mass, damping, strained), wide


def turbine_equations(parts: Parts) -> Equations:
    """The whole turbine in multi-blade coordinates."""
    lattice, m = parts.lattice, parts.lattice.modes
    modal_support, support_shape = parts.modal_support
    own = modal_blade_matrices(parts)
    components = blade_components(parts, support_shape)
    structure, rate, acceleration = turbine_structure(own, modal_support, components, parts.case.rotor_speed)
    T = components.reshape(-1, structure.mass.shape[0])

    by_position, by_rate = lattice.motion_inputs
    three = np.eye(3)
    gust = lattice.select("gust")
    homogeneous = np.kron(three[:, :1], gust.sum(axis=1, keepdims=True))
    flaps = flap_effectiveness(parts) * lattice.select("flap_angle", "flap_rate")
    felt = np.hstack(
        [
            *(np.kron(three, column[:, None]) for column in flaps.T),
            homogeneous,
            *(np.kron(three, column[:, None]) for column in gust.T[: parts.strips]),
        ]
    )
    exogenous = np.zeros((len(felt), len(parts.inputs)))
    exogenous[:, : felt.shape[1]] = felt
    if parts.case.speed_control is not None:
        exogenous[:, [parts.inputs.index(INDUCED_WIND)]] = homogeneous
    if parts.case.signals.pitch:
        held, moved = pitch_motion(parts.case)
        askew = (
            lattice.select("hub_turn") @ pitch_axis(parts.case)[1:]
        )  # about the shaft the wind stays as it is
        hub_velocity = lattice.select("hub_velocity")
        for kind, asked in (("angle", hub_velocity @ held + askew), ("rate", hub_velocity @ moved)):
            exogenous[:, parts.pitch_columns(kind)] = np.kron(three, asked[:, None])
    lattice_input = LatticeInput(
        position=np.kron(three, by_position) @ T + np.kron(three, by_rate) @ rate,
        velocity=np.asarray(np.kron(three, by_rate) @ T),
        exogenous=exogenous,
    )
    motion, acting = (T, rate, acceleration), np.kron(three, lattice.on_structure)
    forcing = structure.work @ acting_on(parts, whole_load(parts, own))
    forcing[3 * m :] += support_forcing(parts, support_shape)
    if parts.case.speed_control is not None:
        forcing[
            -1, parts.inputs.index(GENERATOR_TORQUE)
        ] = -1.0  # it brakes the turn of generator and hub, the last
    structure = replace(structure, work=structure.work @ acting)
    outputs = [
        summed_load(parts, root_load(parts, own), *motion),
        _blade_place(parts, edgewise(parts.case), 1.0, T),
        _positions(parts, _tower_top(parts)),
        *(_further_output(parts, name, own, motion) for name, _ in parts.further),
    ]
    output = Output(*(np.vstack([getattr(part, f.name) for part in outputs]) for f in fields(Output)))
    return Equations(structure, lattice_input, output, parts.inputs, turbine_outputs(parts.further), forcing)


def _positions(parts: Parts, rows: Array) -> Output:
    """Outputs that are rows (k, nd) of the structure's positions."""
    still, k = np.zeros_like(rows), len(rows)
    return Output(
        still, still, rows, np.zeros((k, 3 * len(parts.lattice.load))), np.zeros((k, len(parts.inputs)))
    )


def _blade_place(parts: Parts, direction: Array, share: float, T: Array) -> Output:
    """How far a share of each blade has moved in a direction (3,), by bending and by pitch of the bent blade."""
    out = _positions(parts, np.kron(np.eye(3), deflection(parts, share, direction)) @ T)
    if parts.case.signals.pitch:
        there = sum(weight * parts.blade.position[node] for node, weight in nodes_beside(parts.case, share))
        assert out.direct is not None
        out.direct[:, parts.pitch_columns("angle")] = np.eye(3) * np.dot(
            direction, np.cross(pitch_axis(parts.case), there)
        )
    return out


def _further_output(
    parts: Parts,
    name: str,
    own: tuple[Array, Array, Array],
    motion: tuple[Array, Array, Array],
) -> Output:
    """An output that the case asks for by name; ``own`` is of the blade, ``motion`` as for ``summed_load``."""
    if name == ROTOR_SPEED:
        turned = _positions(parts, np.eye(1, motion[0].shape[1], motion[0].shape[1] - 1))
        return replace(turned, velocity=turned.position, position=turned.velocity)
    if name in TOWER_LOADS:
        return _tower_base(parts, TOWER_LOADS.index(name))
    if name in TOWER_MOTIONS:
        top = _positions(parts, _tower_top(parts)[[TOWER_MOTIONS.index(name)]])
        return replace(top, acceleration=top.position, position=top.acceleration)
    if name in HUB_LOADS:
        return _on_shaft(parts, own, motion, HUB_LOADS.index(name))
    if name in BLADE_LOADS:
        axis = (edgewise, along)[BLADE_LOADS.index(name)](parts.case)
        return summed_load(parts, root_load(parts, own, axis), *motion)
    if name in BLADE_MOTIONS:
        return _blade_place(parts, -FLAPWISE, 1.0, motion[0])
    share = int(name.rpartition("_")[2]) / 100.0
    if name.startswith("flapwise_moment"):
        return summed_load(parts, station_load(parts, own, share), *motion)
    return _blade_place(parts, edgewise(parts.case), share, motion[0])


def _tower_top(parts: Parts) -> Array:
    """Displacement (2, nd) of the tower's top, downwind and to the left, per position of the structure."""
    top = (parts.support.tower_top @ parts.modal_support[1])[:2]
    return np.hstack([np.zeros((2, 3 * parts.lattice.modes)), top])


def _on_shaft(
    parts: Parts, own: tuple[Array, Array, Array], motion: tuple[Array, Array, Array], place: int
) -> Output:
    """Force along the shaft, or moment about an axis of its end: all blades' loads on the hub, less the hub's inertia.

    ``place`` counts thrust, torque, tilt and yaw; ``own`` and ``motion`` as for ``_further_output``.
    """
    support, shape = parts.support, parts.modal_support[1]
    at = (0, 3, 4, 5)[place]  # in force and moment along x, y, z of the shaft's frame
    blade = np.zeros((6, parts.lattice.modes))
    gather = np.hstack(
        [w * np.hstack([blade, part.T]) for w, part in zip(WORK_WEIGHTS, hub_components(), strict=True)]
    )[[at]]
    of_blades = summed_load(parts, whole_load(parts, own), *motion)
    rows = {f.name: gather @ getattr(of_blades, f.name) for f in fields(Output)}
    support_columns = slice(3 * parts.lattice.modes, None)
    rows["acceleration"][:, support_columns] -= (support.hub[[at]] @ support.mass) @ shape
    rows["velocity"][:, support_columns] -= (support.hub[[at]] @ support.damping) @ shape
    rows["direct"] += support.hub[[at]] @ support_forcing(parts, np.eye(len(shape)))
    return Output(**rows)


def _tower_base(parts: Parts, side: int) -> Output:
    """The turbine's equations for a rigid turn of all it stands on about the foundation: what the ground takes up."""
    _, shape = parts.modal_support
    wide = np.hstack([shape, rigid_turns(parts.support)[:, [side]]])
    support = parts.support
    mass, damping = (wide.T @ matrix @ wide for matrix in (support.mass, support.damping))
    own = modal_blade_matrices(parts)
    structure, _, _ = turbine_structure(
        own,
        (mass, damping, np.zeros_like(mass)),  # a rigid turn strains nothing above the ground
        blade_components(parts, wide),
        parts.case.rotor_speed,
    )
    rows, columns = slice(-1, None), slice(None, -1)
    forcing = (
        structure.work[rows] @ acting_on(parts, whole_load(parts, own)) + support_forcing(parts, wide)[rows]
    )
    return Output(
        acceleration=-structure.mass[rows, columns],
        velocity=-structure.damping[rows, columns],
        position=-structure.stiffness[rows, columns],
        load=structure.work[rows] @ np.kron(np.eye(3), parts.lattice.on_structure),
        direct=forcing,
    )


def rigid_turns(support: LinearSupport) -> Array:
    """Motion (N, 2) of the support's nodes in rigid turns about the base: over downwind, and over to the left.

    The moments that do work on them are positive for a thrust downwind, and for a force to the left of one who looks
    downwind: the sides on which the tower's top moves positively.
    """
    nodes = np.vstack([support.tower_position[1:], support.apex])
    axes = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]).T
    moves = (rigid_displacement(nodes)[:, 3:] @ axes).reshape(-1, 3, 2)
    return np.concatenate([moves, np.broadcast_to(axes, moves.shape)], axis=1).reshape(-1, 2)


def blade_components(parts: Parts, support_shape: Array) -> Array:
    """Multi-blade components (3, m + 6, nd) of a blade's modes and hub motion per unit of (a_0, a_c, a_s, x_t)."""
    hub, m = hub_components(), parts.lattice.modes
    components = np.zeros((3, m + 6, 3 * m + support_shape.shape[1]))
    for i in range(3):
        components[i, :m, i * m : (i + 1) * m] = np.eye(m)
        components[i, m:, 3 * m :] = hub[i] @ parts.support.hub @ support_shape
    return components


@dataclass(frozen=True, eq=False)
class BladeLoad:
    """k loads of one blade, by force summation: the air's less what the blade's motion resists with.

    Attributes
    ----------
    air : (k, ny) float
        Per output of the blade's lattice.
    mass, damping, stiffness : (k, m + 6) float
        Per acceleration, rate and position of its modes and its hub.
    turned : (k,) float
        What steady loads bring as the blade is pitched, per radian.
    """

    air: Array
    mass: Array
    damping: Array
    stiffness: Array
    turned: Array


def whole_load(parts: Parts, own: tuple[Array, Array, Array]) -> BladeLoad:
    """All m + 6 loads on a blade's modes and on its hub; ``own`` are ``modal_blade_matrices``."""
    return BladeLoad(parts.lattice.on_structure, *own, parts.turned[: parts.lattice.modes + 6])


def acting_on(parts: Parts, load: BladeLoad) -> Array:
    """What inputs add to the loads of each blade past its lattice, (3 k, nu), in multi-blade components.

    A blade's weight is its inertia as its hub falls: the same masses at the same places, bent as the blade is. How
    further bending moves the weight's arms is of second order, and left out. Pitch moves the blade's axes as the hub
    does, each blade by itself.
    """
    m = parts.lattice.modes
    out = np.zeros((3 * len(load.mass), len(parts.inputs)))
    if parts.case.signals.gravity:
        fall = hub_components()[:, :3, :3] @ downwards(
            parts.support
        )  # the shaft's own frame stands, blades turn under the weight
        out[:, parts.inputs.index(GRAVITY)] = (fall @ load.mass[:, m : m + 3].T).ravel()
    if parts.case.signals.pitch:
        held, moved = pitch_motion(parts.case)
        mass, damping = load.mass[:, m:], load.damping[:, m:]
        for kind, column in (
            ("angle", load.turned - damping @ held),
            ("rate", -(mass @ held + damping @ moved)),
            ("acceleration", -mass @ moved),
        ):
            out[:, parts.pitch_columns(kind)] = np.kron(np.eye(3), column[:, None])
    return out


def downwards(support: LinearSupport) -> Array:
    """Direction (3,) in which gravity pulls, in the shaft's axes."""
    return np.asarray(support.shaft_axes.T @ np.array([0.0, 0.0, -1.0]))


def support_forcing(parts: Parts, shape: Array) -> Array:
    """What inputs do on motions (N, k) of tower, nacelle and hub by themselves, (k, nu)."""
    out = np.zeros((shape.shape[1], len(parts.inputs)))
    if parts.case.signals.gravity:
        out[:, parts.inputs.index(GRAVITY)] = shape.T @ parts.support.weight
    return out


def root_load(parts: Parts, own: tuple[Array, Array, Array], axis: Array = FLAPWISE) -> BladeLoad:
    """The root moment about an axis (3,) in S; ``own`` are ``modal_blade_matrices``."""
    row = root_moment(parts.blade, parts.lattice.modes, axis)
    whole = whole_load(parts, own)
    return BladeLoad(*(row @ getattr(whole, f.name) for f in fields(BladeLoad)))


def station_load(parts: Parts, own: tuple[Array, Array, Array], share: float) -> BladeLoad:
    """The flapwise moment at a share of the blade's length."""
    root, blade, shape = root_load(parts, own), parts.blade, parts.shape
    if not share:
        return root
    cut = cut_at(parts.case, blade, share)
    # Its own output of the lattice, after those on the structure.
    place = parts.lattice.modes + 6 + station_shares(parts.case).index(share)
    return BladeLoad(
        air=cut.root * root.air + np.eye(1, root.air.shape[1], place),
        mass=cut.root * root.mass + np.append(cut.work @ blade.mass @ shape, cut.work @ blade.mass_sr),
        damping=cut.root * root.damping
        + np.append(cut.work @ blade.damping @ shape, cut.work @ blade.damping_sr),
        stiffness=cut.root * root.stiffness + np.append(cut.stiffness @ shape, np.zeros(6)),
        turned=cut.root * root.turned + parts.turned[place],
    )


def summed_load(parts: Parts, load: BladeLoad, T: Array, rate: Array, acceleration: Array) -> Output:
    """Loads of each blade in multi-blade components; T, ``rate`` and ``acceleration`` of ``turbine_structure``."""
    rows = (np.kron(np.eye(3), row) for row in (load.mass, load.damping, load.stiffness))
    mass, damping, stiffness = (np.asarray(row) for row in rows)
    return Output(
        acceleration=-mass @ T,
        velocity=-(mass @ acceleration[0] + damping @ T),
        position=-(mass @ acceleration[1] + damping @ rate + stiffness @ T),
        load=np.asarray(np.kron(np.eye(3), load.air)),
        direct=acting_on(parts, load),
    )


def blade_equations(parts: Parts) -> Equations:
    """One blade clamped at its root, rotating alone: the paper's design model (Section IV.C)."""
    lattice, m = parts.lattice, parts.lattice.modes
    own = modal_blade_matrices(parts)
    clamp = np.eye(m + 6)[:, :m]
    mass, damping, stiffness = (matrix @ clamp for matrix in own)
    root = root_moment(parts.blade, m)
    tip = tip_deflection(parts.case, parts.shape)
    still = np.zeros((1, m))
    return Equations(
        SecondOrder(mass[:m], damping[:m], stiffness[:m], work=clamp.T @ lattice.on_structure),
        LatticeInput(
            position=lattice.select("mode"),
            velocity=lattice.select("mode_rate"),
            exogenous=np.hstack(
                [
                    flap_effectiveness(parts) * lattice.select("flap_angle", "flap_rate"),
                    lattice.select("gust").sum(axis=1, keepdims=True),
                ]
            ),
        ),
        Output(
            acceleration=np.vstack([-root @ mass, still]),
            velocity=np.vstack([-root @ damping, still]),
            position=np.vstack([-root @ stiffness, tip @ clamp]),
            load=np.vstack([root, np.zeros_like(root)]) @ lattice.on_structure,
        ),
        blade_inputs(lattice.flaps),
        BLADE_OUTPUTS,
    )


def periodic_equations(parts: Parts) -> PeriodicEquations:
    """The whole turbine of equal blades by azimuth, its blades in their own frames."""
    return blade_by_blade(parts, (parts,) * 3, (0,) * 3)


def blade_by_blade(mean: Parts, blades: Sequence[Parts], lattice: Sequence[int]) -> PeriodicEquations:
    """The whole turbine by azimuth, each blade with parts of its own.

    Parameters
    ----------
    mean : Parts
        Of the mean blade, the one the modes of the support are made with.
    blades : three Parts
        Of each blade.
    lattice : three ints
        Which of the lattices stacked in the aerodynamics' inputs and outputs is each blade's.
    """
    support, support_shape = mean.modal_support
    slots = np.eye(max(lattice) + 1)[list(lattice)]

    def asked(per_blade: Callable[[Parts], Array]) -> Array:
        return np.stack(
            [np.kron(slot[:, None], per_blade(own)) for slot, own in zip(slots, blades, strict=True)]
        )

    def flaps(name: str) -> Array:
        return asked(lambda own: flap_effectiveness(own) * own.lattice.select(name))

    modes = mean.lattice.modes
    weight = downwards(mean.support), support_shape.T @ mean.support.weight
    return PeriodicEquations(
        blades=tuple(modal_blade_matrices(own) for own in blades),
        support=support,
        hub=mean.support.hub @ support_shape,
        tower_top=(mean.support.tower_top @ support_shape)[:2],
        by_position=asked(lambda own: own.lattice.motion_inputs[0]),
        by_rate=asked(lambda own: own.lattice.motion_inputs[1]),
        work=np.stack([np.kron(slot[None], mean.lattice.on_structure) for slot in slots]),
        flap_angle=flaps("flap_angle"),
        flap_rate=flaps("flap_rate"),
        gust=asked(lambda own: own.lattice.select("gust")),
        by_strip=mean.strips > 0,
        weight=weight if mean.case.signals.gravity else None,
        root=np.stack([root_moment(own.blade, modes)[0] for own in blades]),
        tip=np.stack([tip_deflection(own.case, own.shape)[0] for own in blades]),
        rotor_speed=mean.case.rotor_speed,
    )


def flap_effectiveness(parts: Parts) -> float:
    """Factor on what the flaps of this blade do."""
    return parts.case.blades.flap_effectiveness[0]


def modal_blade_matrices(parts: Parts) -> tuple[Array, Array, Array]:
    """Mass, damping and stiffness (m + 6, m + 6) of one blade in its shapes and the motion of its hub (eq. 2).

    Structural damping is modal, the documented share of critical for every mode of the blade within its shapes.
    """
    blade, shape, m = parts.blade, parts.shape, parts.lattice.modes
    own_mass, own_stiffness = shape.T @ blade.mass @ shape, shape.T @ blade.stiffness @ shape
    frequency, modes = normal_modes(own_mass, own_stiffness, m)
    momentum = own_mass @ modes
    modal = momentum * (2.0 * parts.case.turbine.blade_damping_ratio * frequency) @ momentum.T
    mass = np.block([[own_mass, shape.T @ blade.mass_sr], [blade.mass_rs @ shape, blade.mass_rr]])
    damping = np.block(
        [
            [shape.T @ blade.damping @ shape + modal, shape.T @ blade.damping_sr],
            [blade.damping_rs @ shape, blade.damping_rr],
        ]
    )
    stiffness = np.zeros_like(mass)
    stiffness[:m, :m] = own_stiffness
    stiffness[m:, :m] = blade.stiffness_rs @ shape
    return mass, damping, stiffness


def root_moment(blade: LinearBlade, modes: int, axis: Array = FLAPWISE) -> Array:
    """Row (1, m + 6) that takes the root moment about an axis (3,) in S out of loads on (modes, hub apex).

    Force summation: load minus inertia, moved from the apex to the root node.
    """
    row = np.zeros((1, modes + 6))
    row[0, modes:] = [*np.cross(blade.position[0], axis), *axis]  # a . (M - r x F) = a . M + (r x a) . F
    return row


def edgewise(case: Case) -> Array:
    """Axis (3,) square to the coned, untwisted blade, about which a load in the rotor's direction turns positively."""
    cone = case.turbine.rotor.precone
    return np.array([np.cos(cone), 0.0, np.sin(cone)])


def deflection(parts: Parts, share: float, direction: Array) -> Array:
    """Row (1, m + 6) for the deflection at a share of the blade's length in a direction, linear between its nodes."""
    clamped = np.vstack([np.zeros((6, parts.shape.shape[1])), parts.shape]).reshape(
        -1, 6, parts.shape.shape[1]
    )
    between = sum(weight * clamped[node] for node, weight in nodes_beside(parts.case, share))
    return _moved(between, direction)


def tip_deflection(case: Case, shape: Array) -> Array:
    """Row (1, m + 6) for the deflection of a shape's last node normal to the coned, undeflected blade, downwind."""
    return _moved(shape, edgewise(case))


def _moved(shape: Array, direction: Array) -> Array:
    return np.hstack([direction @ shape[-6:-3], np.zeros(6)])[None]
