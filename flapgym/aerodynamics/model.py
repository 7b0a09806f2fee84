"""The linear unsteady vortex-lattice model of a rotor or wing: influence, wake and loads (paper eq. 8 and 12)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from flapgym.aerodynamics.biot_savart import ring_influence, segment_velocity, velocity_influence
from flapgym.aerodynamics.lattice import Inflow, Lattice, rotation_about_x, wake_ages, wake_nodes
from flapgym.aerodynamics.loads import Cover, force_matrices, leading_segments
from flapgym.core.arrays import Array, ComplexArray

WakeEnd = Literal["closed", "open"]


@dataclass(frozen=True, eq=False)
class Aerodynamics:
    """Boundary condition, wake and loads of `blades` equal blades, written for blade 1.

    sum_b (bound_pair[b] Gamma_b^t + sum_k wake_pair[b, :, :, k - 1] S Gamma_b^{t - k}) + w^t = 0, where S takes the
    last chordwise row; F^t = sum_l force[l] Gamma^{t - l}. The downwash w is the velocity of the air relative to the
    surface, without the vortices, along the normals (positive downwind).

    Parameters
    ----------
    lattice : Lattice
        Bound rings of blade 1 (n of them on `strips` strips).
    inflow : Inflow
        Undisturbed flow and rotation.
    time_step, air_density : float
        Time step [s]; density [kg/m^3].
    wake_age : (K + 1,) float
        Ages of the wake rows' edges [s]. Only where rows and time steps are alike, as `wake_ages` has them, can the
        wake be marched or taken to the z-domain; any others do for steady flow.
    bound_pair : (blades, n, n) float
        Normal velocity on blade 1 per unit circulation of blade b's bound rings [1/m].
    wake_pair : (blades, n, strips, K) float
        The same of blade b's wake rings, age k + 1 steps at index k.
    force_point : (P, 3) float
        Points of attack of the forces [m].
    force : (lags, 3 P, n) float
        Forces [N] per circulation [m^2/s], by lag in time steps.
    """

    lattice: Lattice
    inflow: Inflow
    time_step: float
    air_density: float
    wake_age: Array
    bound_pair: Array
    wake_pair: Array
    force_point: Array
    force: Array

    @property
    def blades(self) -> int:
        """Number of blades."""
        return int(self.bound_pair.shape[0])

    @property
    def wake_rows(self) -> int:
        """Number K of wake rows behind a blade."""
        return int(self.wake_pair.shape[3])

    @property
    def collocation(self) -> Array:
        """Collocation points (n, 3) [m]."""
        return self.lattice.collocation

    @property
    def normal(self) -> Array:
        """Unit normals (n, 3) at the collocation points, towards the suction side (downwind)."""
        return self.lattice.normal

    @property
    def relative_velocity(self) -> Array:
        """Undisturbed velocity of the air relative to the collocation points, shape (n, 3) [m/s]."""
        return self.inflow.relative_velocity(self.lattice.collocation)

    @cached_property
    def bound_influence(self) -> ComplexArray:
        """Bound influence per cyclic component, shape (components, n, n) [1/m].

        Component m: blade b carries exp(+2j pi m b / blades) times blade 1's circulation. Three blades give m = 0
        (collective) and 1 (whirl), m = 2 being the conjugate of 1; one blade gives m = 0.
        """
        return np.conj(np.fft.rfft(self.bound_pair, axis=0))

    @cached_property
    def wake_influence(self) -> ComplexArray:
        """Wake influence per cyclic component, shape (components, n, strips, K) [1/m]."""
        return np.conj(np.fft.rfft(self.wake_pair, axis=0))

    @cached_property
    def leading_pair(self) -> tuple[Array, Array]:
        """Velocity on blade 1's leading segments per unit circulation of blade b [1/m].

        Bound rings (blades, 3 n, n) and wake rings by age (blades, 3 n, strips, K), components of one segment adjacent.
        """
        point = leading_segments(self.lattice).midpoint
        wake = wake_nodes(self.lattice, self.inflow, self.wake_age)
        bound, shed = [], []
        for turn in blade_turns(self.blades):
            near = velocity_influence(point, self.lattice.node @ turn)
            bound.append(near.reshape(3 * point.shape[0], -1))
            far = velocity_influence(point, wake @ turn)
            shed.append(far.transpose(0, 1, 3, 2).reshape(3 * point.shape[0], self.lattice.strips, -1))
        return np.stack(bound), np.stack(shed)

    @cached_property
    def leading_influence(self) -> tuple[ComplexArray, ComplexArray]:
        """The same per cyclic component."""
        bound, wake = self.leading_pair
        return np.conj(np.fft.rfft(bound, axis=0)), np.conj(np.fft.rfft(wake, axis=0))


def blade_turns(blades: int) -> list[Array]:
    """Rotations (3, 3), to be multiplied from the right, that carry blade 1's points to each blade."""
    return [rotation_about_x(2.0 * np.pi * blade / blades).T for blade in range(blades)]


def assemble(
    lattice: Lattice,
    inflow: Inflow,
    *,
    time_step: float,
    wake_rows: int,
    air_density: float,
    blades: int = 1,
    difference: Literal[1, 2] = 2,
    cover: Cover = "ring",
    wake_end: WakeEnd = "closed",
    wake_step: float | None = None,
    lift_slope: Array | None = None,
) -> Aerodynamics:
    """Influence and loads of `blades` equal surfaces at even azimuths about x (one: the surface alone).

    `wake_step` [s] makes the wake's rows longer than a time step: for steady flow only. `lift_slope` (strips,) [1/rad]
    gives the strips another lift slope than the flat plate's 2 pi: the boundary condition then asks for that many
    times the circulation that a plate would need in the same flow, whatever induces it.

    `difference` and `cover` choose the form of the unsteady forces, see `force_matrices`. A "closed" wake ends with
    the last ring's own rear vortex, which in steady flow is a starting vortex at the wake's length; an "open" one
    leaves it out, so that the trailing vortices just end.
    Cost: 0.3 s and 60 MB for three blades of 10 x 10 panels and 409 wake rows.
    """
    collocation, normal = lattice.collocation, lattice.normal
    ages = wake_ages(time_step, wake_rows)
    if wake_step is not None:
        # The first edge stays where the bound rings end.
        ages = ages[0] + wake_step * np.arange(wake_rows + 1)
    wake = wake_nodes(lattice, inflow, ages)
    bound_pair, wake_pair = [], []
    for turn in blade_turns(blades):
        bound = ring_influence(collocation, normal, lattice.node @ turn)
        bound_pair.append(bound.reshape(normal.shape[0], -1))
        shed = ring_influence(collocation, normal, wake @ turn)
        if wake_end == "open":
            rear = wake[-1] @ turn
            shed[:, -1] += np.einsum(
                "msi,mi->ms", segment_velocity(collocation[:, None], rear[:-1], rear[1:]), normal
            )
        wake_pair.append(shed.transpose(0, 2, 1))
    if lift_slope is not None:
        bound_pair[0] = bound_pair[0] + section_resistance(lattice, lift_slope)
    point, force = force_matrices(lattice, inflow, air_density, time_step, difference, cover)
    return Aerodynamics(
        lattice=lattice,
        inflow=inflow,
        time_step=time_step,
        air_density=air_density,
        wake_age=ages,
        bound_pair=np.stack(bound_pair),
        wake_pair=np.ascontiguousarray(np.stack(wake_pair)),
        force_point=point,
        force=force,
    )


def section_resistance(lattice: Lattice, lift_slope: Array) -> Array:
    """Addition (n, n) [1/m] to the bound influence that gives each strip its section's lift slope (strips,) [1/rad].

    In two dimensions a plate answers the downwash w with Gamma = -A^-1 w, A the influence of its own spanwise vortices
    alone; a section of slope a answers with a / (2 pi) times that, so that A grows by (2 pi / a - 1) A.
    """
    nc, ns = lattice.chordwise, lattice.strips
    vortex, point = (np.arange(nc) + 0.25) / nc, (np.arange(nc) + 0.75) / nc
    net = np.eye(nc) - np.eye(nc, k=-1)  # of the vortex at the front of each ring
    plate = -1.0 / (2.0 * np.pi * (point[:, None] - vortex)) @ net
    share = (2.0 * np.pi / lift_slope - 1.0) / np.linalg.norm(lattice.chord_vector, axis=1)
    return np.einsum("ij,st->isjt", plate, np.diag(share)).reshape(nc * ns, nc * ns)
