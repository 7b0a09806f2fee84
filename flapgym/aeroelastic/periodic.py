"""The paper's own form of the turbine: eq. 14 with a state matrix A(theta) that follows the azimuth.

Blades keep their own rotating frames and may differ; tower, nacelle and shaft stand in the fixed frame. The six
multipliers of the joint are eliminated with the rotor's velocities, nu = A_CC(theta)^T Lambda x_t', which the
structure's own tests hold to the multiplier form. For equal blades the
multi-blade form (``coupling``) is the same turbine with a constant A, and the two differ by the order dt^2 of
Newmark's rule, which they apply in different coordinates.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from flapgym.aeroelastic.coupling import (
    Equations,
    LatticeInput,
    Output,
    SecondOrder,
    explicit_part,
    implicit_part,
    instant,
    reading,
)
from flapgym.core.arrays import BLADES, Array
from flapgym.core.multiblade import blade_azimuths, derivative_coupling, hub_components, on_rotor
from flapgym.model.signals import EACH_BLADE, GRAVITY, turbine_inputs, turbine_outputs
from flapgym.reduction import ReducedSystem

IMBALANCE = "imbalance"
PERIODIC_OUTPUTS = turbine_outputs(parts=EACH_BLADE)


@dataclass(frozen=True, eq=False)
class PeriodicModel:
    """x^{n+1} = A(theta_n) x^n + B(theta_n) u^n, y^n = C(theta_n) x^n + D(theta_n) u^n.

    Attributes
    ----------
    A : (k, n, n), B : (k, n, nu), C : (k, ny, n), D : (k, ny, nu) float
        Matrices for the steps that begin at the azimuths 2 pi i / k, i = 0 .. k - 1.
    time_step, rotor_speed : float
        [s, rad/s].
    inputs, outputs : tuple of str
    """

    A: Array
    B: Array
    C: Array
    D: Array
    time_step: float
    rotor_speed: float
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def simulate(self, u: Array, azimuth: float, refresh: int = 1) -> Array:
        """Outputs (T, ny) for inputs u (T, nu) from rest.

        Parameters
        ----------
        u : (T, nu) float
        azimuth : float
            Of blade 1 at the first step [rad].
        refresh : int
            Steps after which A and B are looked up anew; the paper takes five.
        """
        entries = len(self.A)
        x, y = np.zeros(self.A.shape[1]), np.empty((len(u), len(self.outputs)))
        step = self.rotor_speed * self.time_step
        for n, now in enumerate(u):
            at = round((azimuth + n * step) / (2.0 * np.pi) * entries) % entries
            if n % refresh == 0:
                held = at
            y[n] = self.C[at] @ x + self.D[at] @ now
            x = self.A[held] @ x + self.B[held] @ now
        return y


@dataclass(frozen=True, eq=False)
class PeriodicEquations:
    """Equations of motion in d = (a_1, a_2, a_3, x_t) by azimuth; call with an azimuth [rad].

    Attributes
    ----------
    blades : sequence of three (mass, damping, stiffness), each (m + 6, m + 6)
        Of each blade in its modes and its hub motion (eq. 2).
    support : (mass, damping, stiffness), each (t, t)
    hub : (6, t) float
        Hub motion in the fixed frame per support mode.
    tower_top : (2, t) float
        Displacement downwind and sideways per support mode.
    by_position, by_rate : (3, nu, m + 6) float
        Lattice inputs of each blade per held position and per rate of its modes and its hub.
    work : (3, m + 6, ny) float
        Loads on each blade's modes and hub per its lattice outputs.
    flap_angle, flap_rate : (3, nu, F) float
        Lattice inputs of each blade per angle and per rate of its F flaps.
    gust : (3, nu, strips) float
        The same per wind in each strip.
    root, tip : (3, m + 6) float
        Flapwise root moment per load on (modes, hub); tip deflection per (modes, hub).
    rotor_speed : float
        [rad/s].
    by_strip : bool
        Whether the wind in each strip of each blade is an input, too.
    weight : ((3,), (t,) float), optional
        Where gravity is an input: the direction in which it pulls, in the shaft's axes, and its generalised force on
        the support's modes per unit.
    steady : (3, 6) float, optional
        Steady force and moment of each blade on the hub, in its frame: what of it turns with unequal blades is a
        further input, ``IMBALANCE``, held at one.
    """

    blades: Sequence[tuple[Array, Array, Array]]
    support: tuple[Array, Array, Array]
    hub: Array
    tower_top: Array
    by_position: Array
    by_rate: Array
    work: Array
    flap_angle: Array
    flap_rate: Array
    gust: Array
    root: Array
    tip: Array
    rotor_speed: float
    by_strip: bool = False
    weight: tuple[Array, Array] | None = None
    steady: Array | None = None

    @property
    def modes(self) -> int:
        """Modes of a blade."""
        return int(self.by_position.shape[2]) - 6

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        strips = self.gust.shape[2] if self.by_strip else 0
        own = turbine_inputs(
            self.flap_angle.shape[2], strips, parts=EACH_BLADE, gravity=self.weight is not None
        )
        return own if self.steady is None else (*own, IMBALANCE)

    def __call__(self, azimuth: float) -> Equations:
        """Equations with the joint at an azimuth."""
        T, turning = self._kinematics(azimuth)
        mass, damping, stiffness = (scipy.linalg.block_diag(*part) for part in zip(*self.blades, strict=True))
        moves = damping @ T + mass @ turning
        t, nd = self.support[0].shape[0], T.shape[1]
        own = [np.zeros((nd, nd)) for _ in range(3)]
        for matrix, part in zip(own, self.support, strict=True):
            matrix[nd - t :, nd - t :] = part
        # The lattice speaks in components on the rotor; blades in their own signals.
        spread = scipy.linalg.block_diag(*self.work) @ np.kron(on_rotor(), np.eye(self.work.shape[2]))
        gather = np.kron(np.linalg.inv(on_rotor()), np.eye(self.by_position.shape[1]))
        homogeneous = self.gust.sum(axis=2).reshape(-1, 1)
        strips = _blade_by_blade(self.gust) if self.by_strip else []
        flaps = _blade_by_blade(self.flap_angle) + _blade_by_blade(self.flap_rate)
        felt = gather @ np.hstack([*flaps, homogeneous, *strips])
        exogenous = np.zeros((len(felt), len(self.inputs)))
        exogenous[:, : felt.shape[1]] = felt
        root = scipy.linalg.block_diag(*(row[None] for row in self.root))
        forcing, direct = (
            np.zeros((nd, len(self.inputs))),
            np.zeros((len(PERIODIC_OUTPUTS), len(self.inputs))),
        )
        if self.weight is not None:
            place, load = self.inputs.index(GRAVITY), self._weights(azimuth)
            forcing[:, place] = T.T @ load
            forcing[nd - t :, place] += self.weight[1]
            direct[:BLADES, place] = root @ load
        if self.steady is not None:
            forcing[nd - t :, -1] = self._imbalance(azimuth)
        quiet = np.zeros((BLADES + 2, nd))
        return Equations(
            SecondOrder(
                T.T @ mass @ T + own[0], T.T @ moves + own[1], T.T @ stiffness @ T + own[2], T.T @ spread
            ),
            LatticeInput(
                position=gather @ scipy.linalg.block_diag(*self.by_position) @ T,
                velocity=gather @ scipy.linalg.block_diag(*self.by_rate) @ T,
                exogenous=exogenous,
            ),
            Output(
                acceleration=np.vstack([-root @ mass @ T, quiet]),
                velocity=np.vstack([-root @ moves, quiet]),
                position=np.vstack(
                    [
                        -root @ stiffness @ T,
                        scipy.linalg.block_diag(*(row[None] for row in self.tip)) @ T,
                        np.hstack([np.zeros((2, nd - t)), self.tower_top]),
                    ]
                ),
                load=np.vstack([root @ spread, np.zeros((BLADES + 2, spread.shape[1]))]),
                direct=direct,
            ),
            self.inputs,
            PERIODIC_OUTPUTS,
            forcing,
        )

    def _weights(self, azimuth: float) -> Array:
        """Load of gravity on the modes and hub of each blade, one after another, per unit: `acting_on` of equal blades.

        A blade's weight is its inertia as its hub falls, so a heavier blade brings a weight of its own.
        """
        assert self.weight is not None
        axial, cosine, sine = hub_components()[:, :3, :3]
        moved = slice(self.modes, self.modes + 3)
        return np.concatenate(
            [
                mass[:, moved] @ (axial + np.cos(angle) * cosine + np.sin(angle) * sine) @ self.weight[0]
                for angle, (mass, _, _) in zip(blade_azimuths(azimuth), self.blades, strict=True)
            ]
        )

    def _imbalance(self, azimuth: float) -> Array:
        """Force (t,) on the support of what turns in the blades' steady loads; their mean is the trim's own."""
        assert self.steady is not None
        _, cosine, sine = hub_components()
        angles = blade_azimuths(azimuth)
        load = sum(
            (np.cos(angle) * cosine + np.sin(angle) * sine).T @ each
            for angle, each in zip(angles, self.steady, strict=True)
        )
        return np.asarray(self.hub.T @ load)

    def _kinematics(self, azimuth: float) -> tuple[Array, Array]:
        """T and its part of the acceleration: blades' (a, h) rates are T d', accelerations T d'' + turning d'."""
        modes, t = self.modes, self.hub.shape[1]
        T = np.zeros((BLADES, modes + 6, BLADES * modes + t))
        turning = np.zeros_like(T)
        components = hub_components()
        rate = derivative_coupling(self.rotor_speed)
        for b, angle in enumerate(blade_azimuths(azimuth)):
            T[b, :modes, b * modes : (b + 1) * modes] = np.eye(modes)
            basis = np.array([1.0, np.cos(angle), np.sin(angle)])
            T[b, modes:, BLADES * modes :] = np.tensordot(basis, components, 1) @ self.hub
            turning[b, modes:, BLADES * modes :] = np.tensordot(basis @ rate, components, 1) @ self.hub
        return T.reshape(-1, T.shape[2]), turning.reshape(-1, T.shape[2])


def _blade_by_blade(part: Array) -> list[Array]:
    """Columns (3 nu, 3) of the inputs (3, nu, k) flap by flap, or strip by strip, each on all blades."""
    return [
        scipy.linalg.block_diag(*(column[:, None] for column in of_blades))
        for of_blades in np.moveaxis(part, 2, 0)
    ]


def periodic_model(
    equations: PeriodicEquations, aerodynamics: ReducedSystem, time_step: float, entries: int
) -> PeriodicModel:
    """Table of eq. 14 over one revolution.

    Parameters
    ----------
    equations : PeriodicEquations
    aerodynamics : ReducedSystem
        The lattice seen on the rotor, real, in the components (0, c, s) of the blades' fixed angles:
        ``multiblade_aerodynamics`` at rotor speed zero.
    time_step : float
        [s].
    entries : int
        Azimuths in the table; a step leads from each to the azimuth one time step later.
    """
    turn = equations.rotor_speed * time_step
    steps = [
        step_matrices(equations, aerodynamics, time_step, azimuth, turn)
        for azimuth in 2.0 * np.pi * np.arange(entries) / entries
    ]
    A, B, C, D = (np.stack(matrices) for matrices in zip(*steps, strict=True))
    return PeriodicModel(A, B, C, D, time_step, equations.rotor_speed, equations.inputs, PERIODIC_OUTPUTS)


def step_matrices(
    equations: Callable[[float], Equations],
    aerodynamics: ReducedSystem,
    time_step: float,
    azimuth: float,
    turn: float,
) -> tuple[Array, Array, Array, Array]:
    """A, B, C, D of eq. 14 for the step from an azimuth [rad] over a `turn` [rad].

    ``equations`` and ``aerodynamics`` may be those of blades' own frames and the rotor, or both in multi-blade
    coordinates: Newmark's rule is applied in theirs.
    """
    before, after = equations(azimuth), equations(azimuth + turn)
    here, there = instant(before, aerodynamics), instant(after, aerodynamics)
    right, now = explicit_part(here, time_step)
    left, _ = implicit_part(there, time_step)
    # The input's part at n + 1 is moved into the state with the matrices of its own instant.
    jump = np.linalg.solve(*implicit_part(here, time_step))
    A = np.linalg.solve(left, right)
    C, direct = reading(before.output, here)
    B = np.linalg.solve(left, now) + A @ jump
    return np.asarray(A), np.asarray(B), C, direct + C @ jump
