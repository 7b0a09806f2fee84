"""Induced velocities against closed forms of classical vortex theory."""

from itertools import pairwise

import numpy as np
import pytest

from flapgym.aerodynamics.biot_savart import ring_influence, ring_velocity, segment_velocity


def test_long_segment_induces_the_plane_vortex():
    velocity = segment_velocity(
        np.array([0.0, 2.0, 0.0]), np.array([0.0, 0.0, -1e6]), np.array([0.0, 0.0, 1e6])
    )
    np.testing.assert_allclose(velocity, [-1.0 / (2.0 * np.pi * 2.0), 0.0, 0.0], rtol=1e-9)


def test_segment_is_regular_on_its_own_prolongation():
    velocity = segment_velocity(np.array([0.0, 0.0, 3.0]), np.zeros(3), np.array([0.0, 0.0, 1.0]))
    np.testing.assert_array_equal(velocity, np.zeros(3))


def test_square_ring_at_its_centre():
    side = 3.0
    node = np.array([[[0, y, z] for z in (0.0, side)] for y in (0.0, side)])
    velocity = ring_velocity(np.array([[0.0, side / 2, side / 2]]), node)[0, 0, 0]
    np.testing.assert_allclose(velocity, [-2.0 * np.sqrt(2.0) / (np.pi * side), 0.0, 0.0], atol=1e-14)


def test_far_ring_is_a_doublet_of_its_area():
    node = np.array([[[0, y, z] for z in (-0.5, 0.5)] for y in (-0.5, 0.5)])
    point = np.array([[30.0, 40.0, 0.0]])
    # Potential of a doublet of moment -e_x (unit circulation times unit area) at the origin.
    r = np.linalg.norm(point)
    moment = np.array([-1.0, 0.0, 0.0])
    expected = (3.0 * (moment @ point[0]) * point[0] / r**2 - moment) / (4.0 * np.pi * r**3)
    np.testing.assert_allclose(ring_velocity(point, node)[0, 0, 0], expected, rtol=3e-3)


def test_grid_of_equal_rings_is_its_outline():
    rng = np.random.default_rng(0)
    plane = np.stack(np.meshgrid(range(4), range(5), [0.0], indexing="ij"), axis=-1)[:, :, 0]
    node = plane + 0.2 * rng.normal(size=plane.shape)
    point = np.array([[2.0, 2.0, 5.0]])
    outline = np.concatenate([node[0, :], node[1:, -1], node[-1, -2::-1], node[-2::-1, 0]])
    expected = sum(segment_velocity(point[0], a, b) for a, b in pairwise(outline))
    np.testing.assert_allclose(ring_velocity(point, node).sum(axis=(1, 2))[0], expected, rtol=1e-12)


@pytest.mark.parametrize("points", [1, 700])
def test_influence_is_the_normal_component_however_it_is_blocked(points):
    rng = np.random.default_rng(1)
    node = rng.normal(size=(40, 11, 3))
    point, normal = rng.normal(size=(points, 3)), rng.normal(size=(points, 3))
    expected = np.einsum("mabi,mi->mab", ring_velocity(point[-1:], node), normal[-1:])
    np.testing.assert_allclose(ring_influence(point, normal, node)[-1:], expected, rtol=1e-12)
