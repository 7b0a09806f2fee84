"""The whole turbine, non-linear: tower on a base that may move, rotor frame S, and three blades in it (eq. 3 to 6).

Support (tower, link, shaft, with nacelle and hub bolted on) and blades are geometrically exact; six Lagrange
multipliers hold the rotor frame's velocities to those of the shaft's end plus the prescribed rotation.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from flapgym.core.arrays import AnyArray
from flapgym.structure.beam import Beam, Configuration
from flapgym.structure.blade import blade_beam
from flapgym.structure.equilibrium import solve_equilibrium
from flapgym.structure.inertia import section_mass
from flapgym.structure.rotation import about_x, about_y, cross, hat
from flapgym.structure.support import shaft_beam, tower_beam
from flapgym.turbine import Turbine
from reference.body_motion import Body, FrameMotion, dynamic_forces, dynamic_tangent, energy
from reference.march import Motion

LINK_STIFFNESS = 1e14
"""Stiffness of the link from tower top to shaft [N, N m2], some hundred times the tower's."""

_AXIS = np.array([1.0, 0.0, 0.0])


def at_rest(time: float) -> FrameMotion:
    """Return the motion of a base that does not move."""
    return FrameMotion(np.zeros(6), np.zeros(6))


def no_load(time: float) -> tuple[AnyArray, ...]:
    """Return no loads."""
    return ()


def weightless(time: float) -> AnyArray:
    """Return no acceleration of free fall."""
    return np.zeros(3)


def support_body(turbine: Turbine) -> Body:
    """Tower, stiff link and shaft as one chain in the base frame; nacelle on the tower top, hub on the shaft's end."""
    tower, shaft = tower_beam(turbine), shaft_beam(turbine)
    top = tower.elements
    position = np.concatenate([tower.reference.position, shaft.reference.position])
    orientation = np.concatenate([tower.reference.orientation, shaft.reference.orientation])
    stiffness = np.concatenate([tower.stiffness, LINK_STIFFNESS * np.eye(6)[None], shaft.stiffness])
    mass = np.concatenate([tower.mass, np.zeros((2, 6, 6))])
    nacelle, axes = turbine.nacelle, tower.reference.orientation[-1]
    roll = nacelle.roll_inertia * np.outer(_AXIS, _AXIS)
    parts = {
        top: section_mass(
            nacelle.mass, axes.T @ np.array([nacelle.downwind, 0.0, nacelle.above]), axes.T @ roll @ axes
        )
    }
    return Body.of(Beam(Configuration(position, orientation), stiffness, mass), parts)


def hub_mass(turbine: Turbine) -> AnyArray:
    """6 x 6 mass of the hub in S axes."""
    return section_mass(
        turbine.hub.mass, np.zeros(3), turbine.hub.inertia_about_shaft * np.outer(_AXIS, _AXIS)
    )


@dataclass(frozen=True, eq=False)
class MovingTurbine:
    """The turbine as a system that `march` takes.

    Unknowns: each blade's free nodes (6n, all in S axes, blade b turned by 2 pi b / 3), the support's free nodes
    in base axes, the rotor frame's velocities nu in S axes. Multipliers: force and moment of the rotor on
    the shaft's end in axes H fixed to it.

    Parameters
    ----------
    turbine : Turbine
        The machine.
    elements : int
        Beam elements a blade.
    rotor_speed : float
        Constant Omega [rad/s]; the azimuth starts at zero.
    base : callable
        Time [s] -> motion of the tower's base frame in its own axes; default at rest.
    load : callable
        Time [s] -> dead nodal loads (elements + 1, 6) in S axes on the first blades; default none.
    gravity : callable
        Time [s] -> acceleration of free fall (3,) [m/s^2] in base axes; default none. For a base that turns it
        follows from `attitude.base_path`.
    """

    turbine: Turbine
    elements: int
    rotor_speed: float
    base: Callable[[float], FrameMotion] = at_rest
    load: Callable[[float], tuple[AnyArray, ...]] = no_load
    gravity: Callable[[float], AnyArray] = weightless
    blades: tuple[Body, ...] = field(init=False)
    support: Body = field(init=False)
    hub: AnyArray = field(init=False)
    hub_axes: AnyArray = field(init=False)

    def __post_init__(self) -> None:
        beam = blade_beam(self.turbine, self.elements)
        count = self.turbine.rotor.blade_count
        support = support_body(self.turbine)
        axes = support.beam.reference.orientation[-1].T @ about_y(self.turbine.rotor.tilt)
        for name, value in {
            "blades": tuple(Body.of(turned(beam, 2.0 * np.pi * index / count)) for index in range(count)),
            "support": support,
            "hub": hub_mass(self.turbine),
            "hub_axes": axes,
        }.items():
            object.__setattr__(self, name, value)

    @property
    def bodies(self) -> tuple[Body, ...]:
        """The blades, then the support."""
        return (*self.blades, self.support)

    @property
    def slices(self) -> list[slice]:
        """Where each body's free nodes are among the unknowns; nu follows."""
        ends = np.cumsum([0] + [6 * body.beam.elements for body in self.bodies])
        return [slice(first, last) for first, last in pairwise(ends.tolist())]

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.slices[-1].stop + 6

    def steady(self) -> Motion:
        """The turning rotor in centrifugal equilibrium on an undeformed support, without load."""
        rotation = self.rotor_speed * _AXIS
        shapes = [solve_equilibrium(body.beam, rotation) for body in self.blades]
        velocity = np.zeros(self.size)
        velocity[-3:] = rotation
        still = np.zeros(self.size)
        return Motion(0.0, (*shapes, self.support.beam.reference), velocity, still, still, np.zeros(6))

    def moved(
        self, configuration: tuple[Configuration, ...], increment: AnyArray
    ) -> tuple[Configuration, ...]:
        """Return the configuration after an increment; the frame S itself carries none."""
        parts = [_nodes(increment[own]) for own in self.slices]
        return tuple(shape.moved(part) for shape, part in zip(configuration, parts, strict=True))

    def _hub(self, motion: Motion) -> tuple[AnyArray, AnyArray]:
        """Axes of H (3, 3) in base axes and the shaft end's position."""
        shape = motion.configuration[-1]
        return shape.orientation[-1] @ self.hub_axes, shape.position[-1]

    def constraint(self, motion: Motion) -> AnyArray:
        """Violation (6,) of the joint, in H axes: velocity of the shaft's end less that of S but for Omega."""
        axes, position = self._hub(motion)
        base = self.base(motion.time).velocity
        end = motion.velocity[self.slices[-1]][-6:]
        linear = end[:3] + base[:3] + cross(base[3:], position)
        turn = about_x(self.rotor_speed * motion.time)
        rotor = motion.velocity[-6:] - np.append(np.zeros(3), self.rotor_speed * _AXIS)
        return np.concatenate(
            [axes.T @ linear - turn @ rotor[:3], axes.T @ (end[3:] + base[3:]) - turn @ rotor[3:]]
        )

    def residual(self, motion: Motion) -> AnyArray:
        """Return imbalance of forces and violation of the joint."""
        axes, turn = self._hub(motion)[0], about_x(-self.rotor_speed * motion.time)
        fall = self.gravity(motion.time)
        frame = _falling(FrameMotion(motion.velocity[-6:], motion.acceleration[-6:]), turn @ axes.T @ fall)
        base = _falling(self.base(motion.time), fall)
        loads, out = self.load(motion.time), np.zeros(self.size)
        resultant = _rigid_forces(self.hub, frame)
        for index, (body, own) in enumerate(zip(self.bodies, self.slices, strict=True)):
            rates, second = _nodes(motion.velocity[own]), _nodes(motion.acceleration[own])
            carrier = frame if index < len(self.blades) else base
            shape = motion.configuration[index]
            nodal, total = dynamic_forces(body, shape, rates, second, carrier)
            if index < len(loads):
                nodal = nodal - loads[index]
                moments = loads[index][:, 3:] + cross(shape.position, loads[index][:, :3])
                total = total - np.concatenate([loads[index][:, :3].sum(axis=0), moments.sum(axis=0)])
            if index < len(self.blades):
                resultant = resultant + total
            out[own] = nodal[1:].ravel()
        joint, end = motion.multipliers, self.slices[-1].stop
        out[end - 6 : end] -= np.concatenate([axes @ joint[:3], axes @ joint[3:]])
        out[end:] = resultant + np.concatenate([turn @ joint[:3], turn @ joint[3:]])
        return np.concatenate([out, self.constraint(motion)])

    def iteration_matrix(self, motion: Motion, rate_factor: float, mass_factor: float) -> AnyArray:
        """Return the derivative of `residual`, without what the nodes' own rates and turning joint loads add."""
        size = self.size
        out = np.zeros((size + 6, size + 6))
        rigid = slice(size - 6, size)
        out[rigid, rigid] = mass_factor * self.hub
        for index, (body, own) in enumerate(zip(self.bodies, self.slices, strict=True)):
            rotor = index < len(self.blades)
            spin = motion.velocity[-3:] if rotor else self.base(motion.time).velocity[3:]
            part = dynamic_tangent(body, motion.configuration[index], spin, rate_factor, mass_factor)
            out[own, own] = part.ss[6:, 6:]
            if rotor:
                out[own, rigid], out[rigid, own] = part.sr[6:], part.rs[:, 6:]
                out[rigid, rigid] += part.rr
        end = slice(size - 12, size - 6)
        axes, turn = (
            np.kron(np.eye(2), self._hub(motion)[0]),
            np.kron(np.eye(2), about_x(self.rotor_speed * motion.time)),
        )
        out[end, size:], out[rigid, size:] = -axes, turn.T
        out[size:, end], out[size:, rigid] = rate_factor * axes.T, -rate_factor * turn
        return out

    def energy(self, motion: Motion) -> float:
        """Kinetic and elastic energy [J]."""
        frame = FrameMotion(motion.velocity[-6:], np.zeros(6))
        total = 0.5 * float(frame.velocity @ self.hub @ frame.velocity)
        for index, (body, own) in enumerate(zip(self.bodies, self.slices, strict=True)):
            carrier = frame if index < len(self.blades) else self.base(motion.time)
            total += energy(body, motion.configuration[index], _nodes(motion.velocity[own]), carrier)
        return total


def turned(beam: Beam, azimuth: float) -> Beam:
    """The beam turned about x of its frame [rad]."""
    turn = about_x(azimuth)
    reference = Configuration(beam.reference.position @ turn.T, turn @ beam.reference.orientation)
    return Beam(reference, beam.stiffness, beam.mass)


def _nodes(free: AnyArray) -> AnyArray:
    return np.concatenate([np.zeros(6), free]).reshape(-1, 6)


def _falling(frame: FrameMotion, fall: AnyArray) -> FrameMotion:
    """The frame as inertia feels it under gravity: accelerated against the free fall (3,) in its axes."""
    return FrameMotion(frame.velocity, frame.acceleration - np.append(fall, np.zeros(3)))


def _rigid_forces(mass: AnyArray, frame: FrameMotion) -> AnyArray:
    """Force and moment (6,) that the inertia of a rigid part at the frame's origin asks for: M nu' + nu x M nu."""
    spin = np.kron(np.eye(2), hat(frame.velocity[3:]))
    momentum = mass @ frame.velocity
    force = mass @ frame.acceleration + spin @ momentum
    force[3:] += cross(frame.velocity[:3], momentum[:3])
    return force
