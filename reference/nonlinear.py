"""The turbine of geometrically exact beams with the linear aerodynamics. Nothing in production uses it.

What the linear turbine is held to at finite amplitude: tower, shaft and blades bend and turn as far as they like
(`structure.multibody`) and carry the same reduced lattice about the same trim, driven by how far nodes and hub have
moved from it. The mean loads of the trim stay on their nodes and turn with the rotor; structural damping is that of
the linear turbine's modes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from flapgym.aeroelastic.equations import Parts, root_moment, tip_deflection
from flapgym.aeroelastic.trim import nodal_load
from flapgym.core.arrays import BLADES, Array
from flapgym.core.multiblade import WORK_WEIGHTS, blade_azimuths, hub_components, on_rotor
from flapgym.reduction import ReducedSystem
from flapgym.structure import solve_equilibrium
from flapgym.structure.blade import LOAD_STEPS
from flapgym.structure.rotation import about_x, cross, rotation_vector
from reference.body_motion import FrameMotion, dynamic_forces
from reference.march import Motion
from reference.multibody import MovingTurbine


@dataclass(frozen=True, eq=False)
class NonlinearTurbine:
    """Beams, joint and lattice about the aeroelastic trim; `nonlinear_turbine` makes it.

    Attributes
    ----------
    parts : Parts
        What the linear turbine is coupled from.
    structure : MovingTurbine
        n unknowns; it carries the trim's mean loads.
    trim : Motion
        Steady state: blades bent by mean and centrifugal loads, support by what the rotor hands on.
    lattice : ReducedSystem
        The rotor's lattice, inputs and outputs blade by blade.
    kinematics : (3 (m + 6), n) float
        Rates of each blade's modes and of its hub motion, in its own axes, per rate of the unknowns; its transpose
        takes the loads on them in.
    by_position, by_rate : (inputs, 3 (m + 6)) float
        Lattice inputs per held position and per rate of these motions.
    exogenous : (inputs, 7) float
        Lattice inputs per flap angles, flap rates and wind.
    blade_damping : (3 (m + 6),) float
        Modal damping of the blades; none on the hub's motion.
    support_damping : (N, N) float
        On the support's free nodes.
    relief : (6,) float
        Force and moment on the shaft's end, in axes that turn with it.
    """

    parts: Parts
    structure: MovingTurbine
    trim: Motion
    lattice: ReducedSystem
    kinematics: Array
    by_position: Array
    by_rate: Array
    exogenous: Array
    blade_damping: Array
    support_damping: Array
    relief: Array

    def motion(self, motion: Motion) -> tuple[Array, Array]:
        """Position and rate (3 (m + 6),) of the blades' modes and hub motions, as departures from the trim."""
        moved = np.zeros(self.structure.size)
        for index, own in enumerate(self.structure.slices[:BLADES]):
            now, before = motion.configuration[index], self.trim.configuration[index]
            turn = rotation_vector(now.orientation @ np.swapaxes(before.orientation, -1, -2))
            moved[own] = np.hstack([now.position - before.position, turn])[1:].ravel()
        position = (self.kinematics @ moved).reshape(BLADES, -1)
        axes = self.structure.hub_axes
        end, before_end = (state.configuration[-1].orientation[-1] @ axes for state in (motion, self.trim))
        turn = rotation_vector(before_end.T @ end)
        for index, azimuth in enumerate(blade_azimuths(self.structure.rotor_speed * motion.time)):
            position[index, -3:] = about_x(-azimuth) @ turn
        return position.ravel(), self.kinematics @ (motion.velocity - self.trim.velocity)

    def signals(self, motion: Motion, inputs: Array) -> Array:
        """Inputs of the lattice for a motion and for flap angles, flap rates and wind (7,)."""
        position, rate = self.motion(motion)
        return np.asarray(self.by_position @ position + self.by_rate @ rate + self.exogenous @ inputs)

    def root_moments(self, motion: Motion, load: Array) -> Array:
        """Flapwise root moments (3,) [N m] by force summation, load (3 (m + 6),) being the lattice's."""
        structure, m = self.structure, self.parts.lattice.modes
        row = root_moment(self.parts.blade, m)[0, m:]
        frame = FrameMotion(motion.velocity[-6:], motion.acceleration[-6:])
        out = row @ load.reshape(BLADES, -1)[:, m:].T
        mean = structure.load(motion.time)
        for index, angle in enumerate(blade_azimuths(0.0)):
            own = structure.slices[index]
            rates, second = (
                np.concatenate([np.zeros(6), part[own]]).reshape(-1, 6)
                for part in (motion.velocity, motion.acceleration)
            )
            shape, applied = motion.configuration[index], mean[index]
            inertia = dynamic_forces(structure.blades[index], shape, rates, second, frame)[1]
            moments = applied[:, 3:] + cross(shape.position, applied[:, :3])
            steady = np.concatenate([applied[:, :3].sum(axis=0), moments.sum(axis=0)])
            out[index] += row @ np.kron(np.eye(2), about_x(-angle)) @ (steady - inertia)
        return np.asarray(out)

    def reading(self, motion: Motion, load: Array) -> Array:
        """Root moments, and how far tips and tower top have moved from the trim (8,)."""
        tip = tip_deflection(self.parts.case, np.eye(6))[0, :3]
        pairs = list(zip(motion.configuration, self.trim.configuration, strict=True))
        tips = [
            tip @ about_x(-angle) @ (now.position[-1] - before.position[-1])
            for angle, (now, before) in zip(blade_azimuths(0.0), pairs[:BLADES], strict=True)
        ]
        top = self.parts.case.turbine.tower.height.size - 1
        now, before = pairs[-1]
        root = self.root_moments(motion, load)
        return np.concatenate([root, tips, (now.position - before.position)[top, :2]])


def nonlinear_turbine(parts: Parts, aerodynamics: ReducedSystem, relieved: bool = False) -> NonlinearTurbine:
    """The non-linear turbine of what the linear one is coupled from.

    Parameters
    ----------
    parts : Parts
    aerodynamics : ReducedSystem
        The lattice of all blades the parts were made with, seen on the rotor, in components (0, c, s):
        ``multiblade_aerodynamics`` at rotor speed zero. Without the states of a moving wake.
    relieved : bool
        Take the mean thrust and torque off the support, which the linear turbine has unloaded: its exact limit.
    """
    case, lattice = parts.case, parts.lattice
    if case.operating_point.pitch != 0.0:
        raise ValueError(
            f"operating_point.pitch: expected 0 for the non-linear beams, got {case.operating_point.pitch} rad"
        )
    if parts.flow is None:
        raise ValueError("parts: expected a blade about its trim, got one without mean load")
    mean = nodal_load(parts.blade, parts.flow.loads).reshape(-1, 2, 3)
    loads = tuple((mean @ about_x(angle).T).reshape(-1, 6) for angle in blade_azimuths(0.0))
    structure = MovingTurbine(
        case.turbine, case.discretisation.blade_elements, case.rotor_speed, load=lambda time: loads
    )
    trim = _balance(structure, relieved)
    by_position, by_rate = lattice.motion_inputs
    each = np.eye(BLADES)
    gather = np.kron(np.linalg.inv(on_rotor()), np.eye(by_position.shape[0]))
    spread = np.kron(on_rotor(), np.eye(by_position.shape[1]))
    damping = np.append(2.0 * case.turbine.blade_damping_ratio * parts.frequency, np.zeros(6))
    return NonlinearTurbine(
        parts=parts,
        structure=structure,
        trim=trim,
        lattice=ReducedSystem(
            aerodynamics.A,
            aerodynamics.B @ gather,
            spread @ aerodynamics.C,
            spread @ aerodynamics.D @ gather,
            aerodynamics.hankel_singular_values,
        ),
        kinematics=_kinematics(structure, parts.shape.T @ parts.blade.mass),
        by_position=np.asarray(np.kron(each, by_position)),
        by_rate=np.asarray(np.kron(each, by_rate)),
        exogenous=np.hstack(
            [
                *(np.kron(each, column[:, None]) for column in lattice.select("flap_angle", "flap_rate").T),
                np.tile(lattice.select("gust").sum(axis=1), BLADES)[:, None],
            ]
        ),
        blade_damping=np.tile(damping, BLADES),
        support_damping=_support_damping(parts),
        relief=-trim.multipliers if relieved else np.zeros(6),
    )


def _balance(structure: MovingTurbine, relieved: bool) -> Motion:
    """Steady state under the mean loads: equal blades hand on thrust and torque, which bend a support that has them."""
    turning = structure.steady()
    rotation = turning.velocity[-3:]
    shapes = [
        solve_equilibrium(body.beam, rotation, load, load_steps=LOAD_STEPS)
        for body, load in zip(structure.blades, structure.load(0.0), strict=True)
    ]
    support = structure.support.beam
    steady = replace(turning, configuration=(*shapes, support.reference))
    joint = -structure.residual(steady)[structure.size - 6 : structure.size]
    if relieved:
        return replace(steady, multipliers=joint)
    follower = np.zeros((support.elements + 1, 6))
    follower[-1] = np.kron(np.eye(2), structure.hub_axes) @ joint
    bent = solve_equilibrium(support, follower_load=follower)
    return replace(steady, configuration=(*shapes, bent), multipliers=joint)


def _kinematics(structure: MovingTurbine, modal: Array) -> Array:
    """Rates of the modes, modal (m, 6 n), and hub motions of the blades in their own axes, per rate of the unknowns."""
    m, nodes = modal.shape[0], modal.shape[1] // 3
    out = np.zeros((BLADES, m + 6, structure.size))
    for index, angle in enumerate(blade_azimuths(0.0)):
        back = about_x(-angle)
        out[index, :m, structure.slices[index]] = modal @ np.kron(np.eye(nodes), back)
        out[index, m:, -6:] = np.kron(np.eye(2), back)
    return out.reshape(-1, structure.size)


def _support_damping(parts: Parts) -> Array:
    """Damping (N, N) of the linear support's modes on the free nodes of the chain, which has one more, the link's."""
    support, hub = parts.support, hub_components() @ parts.support.hub
    (_, damping, _), shape = parts.modal_support
    rotor = sum(w * part.T @ parts.blade.mass_rr @ part for w, part in zip(WORK_WEIGHTS, hub, strict=True))
    to_modes = shape.T @ (support.mass + rotor)
    ours = to_modes.T @ (damping - shape.T @ support.damping @ shape) @ to_modes
    size, link = ours.shape[0] + 6, ours.shape[0] - 6
    kept = np.delete(np.arange(size), np.s_[link : link + 6])
    out = np.zeros((size, size))
    out[np.ix_(kept, kept)] = ours
    return out
