"""Inertia matrices against Newton's second law for the particles a body consists of."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flapgym.structure.beam import Beam, Configuration, tangent
from flapgym.structure.inertia import distribution, linearise_inertia, steady_force
from flapgym.structure.rotation import hat, rotation_matrix
from reference.body_motion import Body, FrameMotion, dynamic_forces
from tests.structure.beams import random_beam

SPIN = np.array([0.7, 0.0, 0.0])
H = 2e-3  # time step of the differences [s]


def particle_forces(beam: Beam, nodal: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """Nodal inertial forces, then force and moment about the origin of S, in the axes of S at t = 0.

    Nodes move by `nodal` (3, n + 1, 6) and the frame by `frame` (3, 6), each as value, rate, acceleration at t = 0;
    frame motion is superposed on a steady rotation. Positions are written down at five times and differenced.
    """

    def world(t: float) -> tuple[np.ndarray, np.ndarray]:
        basis = np.array([1.0, t, 0.5 * t * t])
        state = beam.reference.moved(np.tensordot(basis, nodal, axes=1))
        shift, turn = np.split(basis @ frame, 2)
        attitude = rotation_matrix(turn) @ rotation_matrix(SPIN * t)
        directors = np.swapaxes(attitude @ state.orientation, 1, 2)
        points = np.concatenate([(state.position @ attitude.T + shift)[:, None], directors], axis=1)
        return points.reshape(-1, 3), np.concatenate([[shift], [turn]])

    times = H * np.arange(-2, 3)
    weights = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / (12.0 * H * H)
    acceleration = np.tensordot(weights, np.stack([world(t)[0] for t in times]), axes=1)
    rate = distribution(beam) @ acceleration
    points, (shift, turn) = world(0.0)
    attitude = rotation_matrix(turn)
    # Forces in the axes of S at t = 0.
    rate, points = (
        rate @ attitude,
        (points - np.tile([[1.0], [0], [0], [0]], (beam.elements + 1, 1)) * shift) @ attitude,
    )
    by_node, arms = rate.reshape(-1, 4, 3), points.reshape(-1, 4, 3)
    moments = np.cross(arms[:, 1:], by_node[:, 1:]).sum(axis=1)
    nodes = np.concatenate([by_node[:, 0], moments], axis=1).ravel()
    resultant = np.concatenate([by_node[:, 0].sum(axis=0), np.cross(arms, by_node).sum(axis=(0, 1))])
    return np.concatenate([nodes, resultant])


@pytest.mark.parametrize("order, name", [(2, "mass"), (1, "damping"), (0, "stiffness")])
def test_motion_of_the_nodes_loads_as_particles_do(order: int, name: str) -> None:
    beam = random_beam(2, 5)
    matrices = linearise_inertia(distribution(beam), beam.reference, SPIN)
    size = 1e-3
    coupling = getattr(
        matrices, {"mass": "mass_rs", "damping": "damping_rs", "stiffness": "stiffness_rs"}[name]
    )
    both = np.vstack([getattr(matrices, name), coupling])
    for column in range(18):
        motion = np.zeros((2, 3, 18))
        motion[:, order, column] = [size, -size]
        plus, minus = (particle_forces(beam, m.reshape(3, 3, 6), np.zeros((3, 6))) for m in motion)
        np.testing.assert_allclose(both[:, column], (plus - minus) / (2 * size), atol=2e-5)


@pytest.mark.parametrize("column", range(6))
def test_motion_of_the_frame_loads_as_particles_do(column: int) -> None:
    # A frame displaced by xi from the steady rotation has nu = R' xi' (R the steady attitude), at t = 0:
    # nu = xi', nu' = xi'' - Omega x xi'.
    beam = random_beam(2, 6)
    matrices = linearise_inertia(distribution(beam), beam.reference, SPIN)
    size, still = 1e-3, np.zeros((3, 3, 6))
    mass = np.vstack([matrices.mass_sr, matrices.mass_rr])
    damping = np.vstack([matrices.damping_sr, matrices.damping_rr])
    carried = np.kron(np.eye(2), hat(SPIN))
    for order, expected in ((2, mass[:, column]), (1, (damping - mass @ carried)[:, column])):
        motion = np.zeros((2, 3, 6))
        motion[:, order, column] = [size, -size]
        plus, minus = (particle_forces(beam, still, m) for m in motion)
        np.testing.assert_allclose(expected, (plus - minus) / (2 * size), atol=2e-5)


def test_a_displaced_frame_feels_nothing_new() -> None:
    beam = random_beam(2, 7)
    moved = np.zeros((3, 6))
    moved[0] = [0.3, -0.2, 0.5, 0.0, 0.0, 0.0]
    still = np.zeros((3, 3, 6))
    np.testing.assert_allclose(
        particle_forces(beam, still, moved), particle_forces(beam, still, 0 * moved), atol=1e-7
    )


def test_steady_force_is_the_centripetal_one() -> None:
    beam = random_beam(3, 8)
    still = particle_forces(beam, np.zeros((3, 4, 6)), np.zeros((3, 6)))
    force = steady_force(distribution(beam), beam.reference, SPIN)
    np.testing.assert_allclose(force.ravel(), still[:24], atol=1e-6)


def test_rigid_inertia_of_a_straight_bar_is_the_textbook_one() -> None:
    density, length, elements = 3.0, 4.0, 7
    position = np.zeros((elements + 1, 3))
    position[:, 2] = np.linspace(0.0, length, elements + 1)
    mass = np.zeros((elements, 6, 6))
    mass[:, :3, :3] = density * np.eye(3)
    beam = Beam(Configuration(position, np.broadcast_to(np.eye(3), (elements + 1, 3, 3))), mass, mass)
    rigid = linearise_inertia(distribution(beam), beam.reference, np.zeros(3)).mass_rr
    total, about_end = density * length, density * length**3 / 3.0
    np.testing.assert_allclose(np.diag(rigid), [total] * 3 + [about_end, about_end, 0.0], atol=1e-12)


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.0, 0.3))
def test_matrices_are_the_derivatives_of_the_non_linear_forces(seed: int, amplitude: float) -> None:
    # By complex step, about a randomly deformed beam at rest in a frame that turns about any axis.
    rng = np.random.default_rng(seed)
    beam = random_beam(2, seed)
    state = beam.reference.moved(amplitude * rng.uniform(-1.0, 1.0, size=(3, 6)))
    spin, body = rng.normal(size=3), Body.of(beam)
    matrices = linearise_inertia(body.distribution, state, spin)
    elastic = np.vstack([tangent(beam, state), np.zeros((6, 18))])
    step, steady = 1e-30, np.append(np.zeros(3), spin)

    def derivative(
        size: int, push: Callable[[np.ndarray], tuple[Configuration, np.ndarray, np.ndarray, FrameMotion]]
    ) -> np.ndarray:
        columns = []
        for column in range(size):
            direction = np.zeros(size, dtype=complex)
            direction[column] = 1j * step
            nodal, resultant = dynamic_forces(body, *push(direction))
            columns.append(np.append(nodal.ravel(), resultant).imag / step)
        return np.array(columns).T

    zero, still = np.zeros((3, 6)), FrameMotion(steady, np.zeros(6))
    for computed, expected in (
        (
            derivative(18, lambda d: (state.moved(d.reshape(3, 6)), zero, zero, still)),
            elastic + np.vstack([matrices.stiffness, matrices.stiffness_rs]),
        ),
        (
            derivative(18, lambda d: (state, d.reshape(3, 6), zero, still)),
            np.vstack([matrices.damping, matrices.damping_rs]),
        ),
        (
            derivative(18, lambda d: (state, zero, d.reshape(3, 6), still)),
            np.vstack([matrices.mass, matrices.mass_rs]),
        ),
        (
            derivative(6, lambda d: (state, zero, zero, FrameMotion(steady + d, np.zeros(6)))),
            np.vstack([matrices.damping_sr, matrices.damping_rr]),
        ),
        (
            derivative(6, lambda d: (state, zero, zero, FrameMotion(steady, d))),
            np.vstack([matrices.mass_sr, matrices.mass_rr]),
        ),
    ):
        np.testing.assert_allclose(computed, expected, atol=1e-12 * max(1.0, np.abs(expected).max()))
