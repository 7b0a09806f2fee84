"""Non-linear steady equilibrium of a clamped beam in a steadily rotating frame: Newton with load steps."""

from __future__ import annotations

import numpy as np

from flapgym.core.arrays import AnyArray
from flapgym.core.fields import Count
from flapgym.structure.beam import Beam, Configuration, internal_force, tangent
from flapgym.structure.inertia import distribution, linearise_inertia, steady_force
from flapgym.structure.rotation import hat

MAX_ITERATIONS = 60
TOLERANCE = 1e-13
LARGEST_TURN = 0.5
"""Newton increments are shortened to turn no node by more than this [rad], so that no element folds on the way."""


class EquilibriumError(RuntimeError):
    """No steady equilibrium was found; the message says at which load step, how far off and what to try."""


def solve_equilibrium(
    beam: Beam,
    rotation: AnyArray | None = None,
    load: AnyArray | None = None,
    follower_load: AnyArray | None = None,
    load_steps: int = 1,
    start: Configuration | None = None,
) -> Configuration:
    """Equilibrium of a beam clamped at its first node.

    Parameters
    ----------
    beam : Beam
        The beam, described in S.
    rotation : (3,) float, optional
        Constant angular velocity of S [rad/s], in S axes; default none.
    load : (n + 1, 6) float, optional
        Dead nodal forces [N] and moments [N m] in S axes.
    follower_load : (n + 1, 6) float, optional
        Nodal forces and moments that turn with the section axes, in section axes.
    load_steps : int
        The load and the square of the rotation grow in this many equal steps.
    start : Configuration, optional
        First guess; default the unstrained beam.

    Raises
    ------
    EquilibriumError
        If Newton's method does not converge within a load step.
    """
    shape = (beam.elements + 1, 6)
    rotation = np.zeros(3) if rotation is None else np.asarray(rotation, dtype=float)
    load = np.zeros(shape) if load is None else np.asarray(load, dtype=float)
    follower = np.zeros(shape) if follower_load is None else np.asarray(follower_load, dtype=float)
    Count(at_least=1).check(load_steps, "equilibrium.load_steps")
    for name, value, expected in (
        ("rotation", rotation, (3,)),
        ("load", load, shape),
        ("follower_load", follower, shape),
    ):
        if value.shape != expected or not np.isfinite(value).all():
            raise ValueError(
                f"equilibrium.{name}: expected {expected} finite values, got shape {value.shape}"
            )
    inertia = distribution(beam)
    configuration = beam.reference if start is None else start
    for step in range(1, load_steps + 1):
        part = step / load_steps
        configuration = _newton(
            beam,
            inertia,
            configuration,
            np.sqrt(part) * rotation,
            part * load,
            part * follower,
            f"load step {step} of {load_steps}",
        )
    return configuration


def _newton(
    beam: Beam,
    inertia: AnyArray,
    configuration: Configuration,
    rotation: AnyArray,
    load: AnyArray,
    follower: AnyArray,
    where: str,
) -> Configuration:
    """Newton's method on one load step; ends on the increment (a residual stalls because EA is large)."""
    scale = float(np.linalg.norm(np.diff(beam.reference.position, axis=0), axis=1).sum())
    imbalance = np.inf
    for _ in range(MAX_ITERATIONS):
        turned, turned_slope = _follow(configuration, follower)
        try:
            elastic = internal_force(beam, configuration)
        except ValueError as error:
            raise EquilibriumError(f"equilibrium: {where} failed, {error}") from error
        residual = elastic + steady_force(inertia, configuration, rotation) - load - turned
        stiffness = tangent(beam, configuration) - turned_slope
        if rotation.any():
            stiffness += linearise_inertia(inertia, configuration, rotation).stiffness
        imbalance = float(np.abs(residual[1:]).max())
        increment = np.zeros_like(load)
        increment[1:] = -np.linalg.solve(stiffness[6:, 6:], residual[1:].ravel()).reshape(-1, 6)
        length = max(float(np.abs(increment[:, :3]).max()) / scale, float(np.abs(increment[:, 3:]).max()))
        if not np.isfinite(length):
            break
        turn = float(np.linalg.norm(increment[:, 3:], axis=1).max())
        configuration = configuration.moved(increment * min(1.0, LARGEST_TURN / max(turn, LARGEST_TURN)))
        if length < TOLERANCE:
            return configuration
    raise EquilibriumError(
        f"equilibrium: {where} did not converge, largest imbalance {imbalance:.3g} N (N m); "
        "try more load steps, more elements or a smaller load"
    )


def _follow(configuration: Configuration, follower: AnyArray) -> tuple[AnyArray, AnyArray]:
    """Follower loads in S axes (n + 1, 6) and their derivative (N, N) for spatial nodal rotations."""
    nodes = len(follower)
    parts = follower.reshape(nodes, 2, 3)
    turned = np.einsum("nij,nkj->nki", configuration.orientation, parts)
    slope = np.zeros((nodes, 6, nodes, 6))
    index = np.arange(nodes)
    slope[index, :, index, 3:] = -hat(turned).reshape(nodes, 6, 3)
    return turned.reshape(nodes, 6), slope.reshape(6 * nodes, 6 * nodes)
