"""The non-linear turbine marched in time, beams and lattice implicit at each step. Nothing in production uses it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from flapgym.core.arrays import Array
from flapgym.structure import Configuration
from flapgym.structure.rotation import about_x
from reference.march import Motion, march
from reference.nonlinear import NonlinearTurbine

_MOTION = ("velocity", "acceleration", "algorithmic", "multipliers")
_MAX_AGE = 10
"""Steps for which a tangent is kept: it costs as much as three rounds of Newton's method."""


@dataclass(eq=False)
class _Tangent:
    """The last derivative of the residual, the time it was last asked for and how often since it was made."""

    matrix: Array
    time: float = -np.inf
    age: int = _MAX_AGE


@dataclass(frozen=True, eq=False)
class _Loaded:
    """The turbine during one step, under what the lattice's past and inputs exert: a system that `march` takes."""

    turbine: NonlinearTurbine
    known: Array
    last: _Tangent

    def moved(self, configuration: tuple[Configuration, ...], increment: Array) -> tuple[Configuration, ...]:
        return self.turbine.structure.moved(configuration, increment)

    def residual(self, motion: Motion) -> Array:
        turbine, structure = self.turbine, self.turbine.structure
        out = structure.residual(motion)
        position, rate = turbine.motion(motion)
        load = self.known + turbine.lattice.D @ (turbine.by_position @ position + turbine.by_rate @ rate)
        out[: structure.size] -= turbine.kinematics.T @ (load - turbine.blade_damping * rate)
        support = structure.slices[-1]
        out[support] += turbine.support_damping @ motion.velocity[support]
        axes = motion.configuration[-1].orientation[-1] @ structure.hub_axes
        out[support.stop - 6 : support.stop] -= np.kron(np.eye(2), axes) @ turbine.relief
        return out

    def iteration_matrix(self, motion: Motion, rate_factor: float, mass_factor: float) -> Array:
        """A recent one with the joint where it is now; a new one after some steps or where Newton asks twice."""
        structure, size, last = self.turbine.structure, self.turbine.structure.size, self.last
        if last.age >= _MAX_AGE or last.time == motion.time:
            last.matrix, last.age = self._tangent(motion, rate_factor, mass_factor), 0
        last.time, last.age = motion.time, last.age + 1
        out = last.matrix.copy()
        axes = motion.configuration[-1].orientation[-1] @ structure.hub_axes
        ends, turns = (
            np.kron(np.eye(2), part) for part in (axes, about_x(structure.rotor_speed * motion.time))
        )
        end, rigid = slice(size - 12, size - 6), slice(size - 6, size)
        out[end, size:], out[rigid, size:] = -ends, turns.T
        out[size:, end], out[size:, rigid] = rate_factor * ends.T, -rate_factor * turns
        return out

    def _tangent(self, motion: Motion, rate_factor: float, mass_factor: float) -> Array:
        turbine, structure = self.turbine, self.turbine.structure
        out = structure.iteration_matrix(motion, rate_factor, mass_factor)
        per_motion = turbine.lattice.D @ (turbine.by_position + rate_factor * turbine.by_rate)
        per_motion -= rate_factor * np.diag(turbine.blade_damping)
        own = slice(0, structure.size)
        out[own, own] -= turbine.kinematics.T @ per_motion @ turbine.kinematics
        support = structure.slices[-1]
        out[support, support] += rate_factor * turbine.support_damping
        return out


@dataclass(eq=False)
class NonlinearMarch:
    """The turbine at one sample after another, from the trim with blade 1 up.

    Parameters
    ----------
    turbine : NonlinearTurbine
    """

    turbine: NonlinearTurbine
    _motion: Motion = field(init=False)
    _state: Array = field(init=False)
    _steady: Array = field(init=False)
    _tangent: _Tangent = field(init=False)
    _begun: bool = field(init=False, default=False)

    def __post_init__(self) -> None:
        self._motion = self.turbine.trim
        self._tangent = _Tangent(np.zeros((0, 0)))
        self._state = np.zeros(self.turbine.lattice.A.shape[0])
        self._steady = self.turbine.reading(self.turbine.trim, np.zeros(self.turbine.blade_damping.size))

    def step(self, inputs: Array) -> Array:
        """Go to the next sample, the first call to the first, and return its outputs (8,), ``PERIODIC_OUTPUTS``.

        inputs (7,) are that sample's flap angles [rad], flap rates [rad/s] and wind [m/s]. They should begin at
        zero: the first sample is the trim itself. A step costs some 12 ms.
        """
        turbine, lattice = self.turbine, self.turbine.lattice
        known = lattice.C @ self._state
        if self._begun:
            loaded = _Loaded(turbine, known + lattice.D @ turbine.exogenous @ inputs, self._tangent)
            time_step = turbine.parts.case.discretisation.time_step
            self._motion = march(loaded, self._motion, time_step, 1)[-1]
        self._begun = True
        signals = turbine.signals(self._motion, inputs)
        self._state = lattice.A @ self._state + lattice.B @ signals
        return turbine.reading(self._motion, known + lattice.D @ signals) - self._steady

    def snapshot(self) -> dict[str, Array]:
        """All that a later `restore` needs to go on from this sample."""
        motion = self._motion
        arrays = {name: np.asarray(getattr(motion, name)) for name in _MOTION}
        position, orientation = (
            np.concatenate([getattr(shape, name) for shape in motion.configuration])
            for name in ("position", "orientation")
        )
        arrays["time"] = np.asarray(motion.time)
        return {**arrays, "position": position, "orientation": orientation, "lattice": self._state}

    def restore(self, snapshot: Mapping[str, Array]) -> None:
        """Go back to the sample of a `snapshot`."""
        ends = np.cumsum([len(shape.position) for shape in self._motion.configuration])[:-1]
        shapes = (np.split(snapshot[name], ends) for name in ("position", "orientation"))
        configuration = tuple(Configuration(*shape) for shape in zip(*shapes, strict=True))
        rest = (snapshot[name] for name in _MOTION)
        self._motion = Motion(float(snapshot["time"]), configuration, *rest)
        self._state, self._begun = snapshot["lattice"], True
