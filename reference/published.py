"""The turbine as the paper counts it: eq. 14 with multipliers, Newmark states, turbulence filter and double integrator.

Nothing is eliminated that eq. 7 and 15 keep. The rotor's velocities nu and the six multipliers lambda are found with
the accelerations from the constraint at each step; flap accelerations and white noise are the inputs. It is the same
discretisation as ``periodic``'s and gives the same outputs; with a third more states it is here to be counted and
compared, not to be stepped.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg

from flapgym.aeroelastic.equations import Parts, periodic_equations
from flapgym.aeroelastic.periodic import PERIODIC_OUTPUTS
from flapgym.core.arrays import BLADES, Array
from flapgym.core.multiblade import on_rotor
from flapgym.core.state_space import StateSpace
from flapgym.reduction import ReducedSystem
from flapgym.structure.rotation import about_x
from flapgym.wind import von_karman_filter
from reference.joint import join

PUBLISHED_INPUTS = (*(f"flap_acceleration_{b}" for b in (1, 2, 3)), "white")
# Force and moment of the joint are those that hold the rotor; the tower feels them with the other sign.
PUBLISHED_OUTPUTS = (
    *PERIODIC_OUTPUTS,
    *(f"hub_velocity_{axis}" for axis in "xyz"),
    *(f"hub_rate_{axis}" for axis in "xyz"),
    *(f"joint_force_{axis}" for axis in "xyz"),
    *(f"joint_moment_{axis}" for axis in "xyz"),
)
_OUTPUT_UNITS = (
    *3 * ("N m",),
    *5 * ("m",),
    *(unit for unit in ("m/s", "rad/s", "N", "N m") for _ in "xyz"),
)


@dataclass(frozen=True)
class Signal:
    """An input or output: its name, unit, and its size in it: the limit, or the rms in the case's turbulence."""

    name: str
    unit: str
    scale: float


@dataclass(frozen=True)
class StateGroup:
    """States of one kind: where they stand, their unit, and their size in it: the largest stationary rms, or stop."""

    name: str
    place: slice
    unit: str
    scale: float

    @property
    def count(self) -> int:
        """Number of states."""
        return int(self.place.stop - self.place.start)


@dataclass(frozen=True, eq=False)
class PublishedTurbine:
    """Eq. 14 by azimuth: ``at`` gives the matrices of the step that begins there.

    Attributes
    ----------
    parts : Parts
    aerodynamics : ReducedSystem
        The rotor's lattice seen on the rotor: ``multiblade_aerodynamics`` at rotor speed zero.
    wind : StateSpace
        The von Karman filter.
    """

    parts: Parts
    aerodynamics: ReducedSystem
    wind: StateSpace

    @property
    def time_step(self) -> float:
        """Time step [s]."""
        return self.parts.case.discretisation.time_step

    @cached_property
    def _sizes(self) -> dict[str, int]:
        tower, rotor = self._support.shape[1], BLADES * self.parts.lattice.modes
        return {
            "aerodynamics": int(self.aerodynamics.A.shape[0]),
            "tower position": tower,
            "tower rate": tower,
            "blades position": rotor,
            "blades rate": rotor,
            "hub velocity": 6,
            "multipliers": 6,
            "tower acceleration": tower,
            "blades acceleration": rotor,
            "turbulence filter": self.wind.order,
            "double integrator": 2 * BLADES,
        }

    @cached_property
    def _places(self) -> dict[str, slice]:
        ends = np.cumsum(list(self._sizes.values()))
        starts = ends - list(self._sizes.values())
        return {name: slice(int(a), int(b)) for name, a, b in zip(self._sizes, starts, ends, strict=True)}

    @property
    def order(self) -> int:
        """Number of states."""
        return sum(self._sizes.values())

    @cached_property
    def _support(self) -> Array:
        return self.parts.modal_support[1]

    @property
    def inputs(self) -> tuple[Signal, ...]:
        """Flap accelerations, whose size is the actuator's limit, and the white noise behind the turbulence."""
        limit = self.parts.case.flaps[0].acceleration_limit
        *flaps, white = PUBLISHED_INPUTS
        return (*(Signal(name, "rad/s^2", limit) for name in flaps), Signal(white, "-", 1.0))

    @cached_property
    def outputs(self) -> tuple[Signal, ...]:
        """Loads, deflections, the hub's motion and the joint's loads, with their rms as that of the states."""
        rows = self.at(0.0).C[:, : len(self._covariance)]
        size = np.sqrt(np.clip(np.einsum("ij,jk,ik->i", rows, self._covariance, rows), 0.0, None))
        named = zip(PUBLISHED_OUTPUTS, _OUTPUT_UNITS, size.tolist(), strict=True)
        return tuple(Signal(*each) for each in named)

    @cached_property
    def _covariance(self) -> Array:
        """Of all states but the flaps', which are still, at a frozen azimuth in the case's turbulence."""
        frozen = self.at(0.0)
        free = slice(0, self._places["double integrator"].start)
        driven = frozen.B[free, -1:]
        return np.asarray(scipy.linalg.solve_discrete_lyapunov(frozen.A[free, free], driven @ driven.T))

    @cached_property
    def states(self) -> tuple[StateGroup, ...]:
        """The states in order, in the paper's eq. 15 and after it, with their units and sizes in its turbulence.

        Modal amplitudes are those of unit modal mass, hence their unit. The sizes are the rms at a frozen azimuth,
        flaps still; those of the flaps their stops.
        """
        units = ["-", "kg^1/2 m", "kg^1/2 m/s", "kg^1/2 m", "kg^1/2 m/s", "m/s, rad/s", "N, N m"]
        units += ["kg^1/2 m/s^2", "kg^1/2 m/s^2", "-", "rad, rad/s"]
        size = np.sqrt(np.clip(np.diag(self._covariance), 0.0, None))
        flap = self.parts.case.flaps[0]
        limits = flap.angle_limit, flap.rate_limit
        size = np.append(size, np.repeat(limits, BLADES))
        return tuple(
            StateGroup(name, place, unit, float(size[place].max()))
            for (name, place), unit in zip(self._places.items(), units, strict=True)
        )

    def at(self, azimuth: float) -> StateSpace:
        """Matrices of the step that begins at an azimuth [rad]."""
        place, n, step = self._places, self.order, self.time_step
        here, there = self._instant(azimuth), self._instant(azimuth + self.parts.case.rotor_speed * step)
        half = 0.5 * step
        left, right = np.eye(n), np.zeros((n, n))

        air, motion = self.aerodynamics, here["lattice input"]
        right[place["aerodynamics"]] = air.B @ motion
        right[place["aerodynamics"], place["aerodynamics"]] += air.A
        for body in ("tower", "blades"):  # Newmark's average acceleration
            position, rate, acceleration = (
                place[f"{body} {kind}"] for kind in ("position", "rate", "acceleration")
            )
            same = np.eye(position.stop - position.start)
            left[position, rate] = left[rate, acceleration] = -half * same
            right[position, position] = right[rate, rate] = same
            right[position, rate] = right[rate, acceleration] = half * same
        # Accelerations, hub velocities and multipliers answer to the end of the step alone.
        for name in ("hub velocity", "multipliers", "tower acceleration", "blades acceleration"):
            left[place[name]] = there[name]
        filtered, flaps = place["turbulence filter"], place["double integrator"]
        right[filtered, filtered] = self.wind.A
        right[flaps, flaps] = np.kron([[1.0, step], [0.0, 1.0]], np.eye(BLADES))
        entering = np.zeros((n, len(PUBLISHED_INPUTS)))
        entering[filtered, -1:] = self.wind.B
        entering[flaps, :BLADES] = np.kron([[half * step], [step]], np.eye(BLADES))
        A, B = np.linalg.solve(left, right), np.linalg.solve(left, entering)
        outputs = here["outputs"]
        return StateSpace(
            np.asarray(A),
            np.asarray(B),
            outputs,
            np.zeros((len(outputs), B.shape[1])),
            step,
            PUBLISHED_INPUTS,
            PUBLISHED_OUTPUTS,
        )

    def _instant(self, azimuth: float) -> dict[str, Array]:
        """Rows over the states that vanish at any instant (eq. 7), and what is read off the states there."""
        parts, place, m = self.parts, self._places, self.parts.lattice.modes
        equations, rotor = periodic_equations(parts), BLADES * m
        shapes = scipy.linalg.block_diag(parts.shape, parts.shape, parts.shape, self._support, np.eye(6))
        joined = join([parts.blade] * BLADES, parts.support, azimuth)
        elastic = shapes[: joined.size, :-6]
        tower = elastic.shape[1] - rotor
        mass, damping = shapes.T @ joined.mass @ shapes, shapes.T @ joined.damping @ shapes
        stiffness = shapes.T @ joined.stiffness @ elastic
        constraint, constraint_rate = joined.constraint @ shapes, joined.constraint_rate @ shapes
        ratios = parts.case.turbine
        support = equations.support[1] - self._support.T @ parts.support.damping @ self._support
        blade = 2.0 * ratios.blade_damping_ratio * parts.frequency
        damping[:-6, :-6] += scipy.linalg.block_diag(np.diag(np.tile(blade, BLADES)), support)

        eye = np.eye(self.order)

        def pick(*names: str) -> Array:
            return np.vstack([eye[place[name]] for name in names])

        position, rate = (pick(f"blades {kind}", f"tower {kind}") for kind in ("position", "rate"))
        velocity = np.vstack([rate, pick("hub velocity")])
        # What each blade and its hub do, in its own frame, and what its lattice is told of it.
        by_position, by_rate, load = [], [], []
        for b in range(BLADES):
            own = position[b * m : (b + 1) * m]
            turn = np.kron(np.eye(2), about_x(-2.0 * np.pi * b / BLADES))
            fixed = np.kron(np.eye(2), about_x(-azimuth)) @ equations.hub @ position[rotor:]
            by_position.append(np.vstack([own, turn @ fixed]))
            by_rate.append(np.vstack([rate[b * m : (b + 1) * m], turn @ velocity[-6:]]))
            to_joint = np.zeros((rotor + tower + 6, m + 6))
            to_joint[b * m : (b + 1) * m, :m] = np.eye(m)
            to_joint[-6:, m:] = turn.T
            load.append(to_joint)
        flaps, wind = pick("double integrator"), self.wind.C @ pick("turbulence filter")
        told = [
            equations.by_position[b] @ by_position[b]
            + equations.by_rate[b] @ by_rate[b]
            + np.outer(equations.flap_angle[b], flaps[b])
            + np.outer(equations.flap_rate[b], flaps[BLADES + b])
            + np.outer(equations.gust[b].sum(axis=1), wind[0])
            for b in range(BLADES)
        ]
        gather = np.kron(np.linalg.inv(on_rotor()), np.eye(len(told[0])))
        lattice_input = gather @ np.vstack(told)
        air = self.aerodynamics
        answer = air.D @ lattice_input
        answer[:, place["aerodynamics"]] += air.C
        blades = (np.kron(on_rotor(), np.eye(m + 6)) @ answer).reshape(BLADES, m + 6, -1)

        force = sum(to_joint @ own for to_joint, own in zip(load, blades, strict=True))
        resting = force - damping @ velocity - stiffness @ position
        # Accelerations (of the modes and of the hub) and multipliers, out of everything else.
        scale = np.abs(mass).max()
        saddle = np.block([[mass, scale * constraint.T], [scale * constraint, np.zeros((6, 6))]])
        solved = np.linalg.solve(saddle, np.vstack([resting, -scale * constraint_rate @ velocity]))
        accelerations, multipliers = solved[:-6], scale * solved[-6:]
        hub = np.linalg.solve(constraint[:, -6:], -constraint[:, :-6] @ rate)
        outputs = self._outputs(
            equations.root[0], equations.tip[0], blades, by_position, by_rate, accelerations
        )
        top = equations.tower_top @ position[rotor:]
        return {
            "lattice input": lattice_input,
            "blades acceleration": eye[place["blades acceleration"]] - accelerations[:rotor],
            "tower acceleration": eye[place["tower acceleration"]] - accelerations[rotor:-6],
            "hub velocity": eye[place["hub velocity"]] - hub,
            "multipliers": eye[place["multipliers"]] - multipliers,
            "outputs": np.vstack([*outputs, top, pick("hub velocity", "multipliers")]),
        }

    def _outputs(
        self,
        root: Array,
        tip: Array,
        load: Array,
        by_position: list[Array],
        by_rate: list[Array],
        second: Array,
    ) -> list[Array]:
        """Root moments by force summation, and tip deflections, as rows over the states."""
        from_modes = periodic_equations(self.parts).blades[0]
        m, moments, tips = self.parts.lattice.modes, [], []
        for b in range(BLADES):
            turn = np.kron(np.eye(2), about_x(-2.0 * np.pi * b / BLADES))
            acceleration = np.vstack([second[b * m : (b + 1) * m], turn @ second[-6:]])
            mass, damping, stiffness = from_modes
            moments.append(
                root @ (load[b] - mass @ acceleration - damping @ by_rate[b] - stiffness @ by_position[b])
            )
            tips.append(tip @ by_position[b])
        return [np.stack(moments), np.stack(tips)]


def published_turbine(parts: Parts, aerodynamics: ReducedSystem, filter_order: int = 3) -> PublishedTurbine:
    """The turbine of eq. 14 with the case's reference turbulence behind its white input.

    Parameters
    ----------
    parts : Parts
        Of equal blades.
    aerodynamics : ReducedSystem
        ``multiblade_aerodynamics`` at rotor speed zero.
    filter_order : int
        Poles of the von Karman filter.
    """
    case = parts.case
    wind = von_karman_filter(
        case.operating_point.wind_speed,
        case.turbulence.intensity,
        case.turbulence.length_scale,
        case.discretisation.time_step,
        filter_order,
    )
    return PublishedTurbine(parts, aerodynamics, wind)
