"""A beam in a rotating frame against published frequencies and closed forms."""

import numpy as np
import pytest
import scipy.linalg

from flapgym.structure import solve_equilibrium
from flapgym.structure.body import linearise
from tests.structure.beams import uniform_beam

# Wright et al. 1982, flapwise, hub radius zero: (Omega*, first three omega*).
PUBLISHED = [
    (0.0, (3.5160, 22.0345, 61.6972)),
    (3.0, (4.7973, 23.3203, 62.9850)),
    (6.0, (7.3604, 26.8091, 66.6839)),
    (12.0, (13.1702, 37.6031, 79.6145)),
]
IN_PLANE = slice(1, None, 6)  # displacement along y: in the plane of rotation
OUT_OF_PLANE = slice(0, None, 6)


def frequencies(elements: int, speed: float) -> tuple[np.ndarray, np.ndarray]:
    """Lowest flapwise and edgewise frequencies of equal bending stiffness both ways, decoupled by direction."""
    beam = uniform_beam(elements, stiffness=(1e6, 1e6, 1e6, 1.0, 1.0, 1.0), rotary=(2e-6, 1e-6, 1e-6))
    body = linearise(beam, solve_equilibrium(beam, np.array([speed, 0.0, 0.0])), speed)
    squared, shapes = scipy.linalg.eigh(body.stiffness, body.mass, subset_by_index=(0, 7))
    out_of_plane = (shapes[OUT_OF_PLANE] ** 2).sum(axis=0) > (shapes[IN_PLANE] ** 2).sum(axis=0)
    return np.sqrt(squared[out_of_plane]), np.sqrt(squared[~out_of_plane])


@pytest.mark.parametrize("speed, published", PUBLISHED)
def test_flapwise_frequencies_of_a_rotating_cantilever_are_the_published_ones(
    speed: float, published: tuple[float, ...]
) -> None:
    flapwise, _ = frequencies(60, speed)
    assert flapwise[0] == pytest.approx(published[0], rel=5e-4)
    np.testing.assert_allclose(flapwise[:3], published, rtol=3e-3)


@pytest.mark.parametrize("speed", [2.0, 9.0])
def test_edgewise_frequency_is_softened_by_the_rotation(speed: float) -> None:
    # omega_edge^2 = omega_flap^2 - Omega^2, exact for an inextensible beam.
    flapwise, edgewise = frequencies(40, speed)
    np.testing.assert_allclose(edgewise[:2] ** 2, flapwise[:2] ** 2 - speed**2, rtol=2e-4)


def test_centrifugal_stretch_is_the_closed_form() -> None:
    # Simo and Vu-Quoc 1986: EA u'' = -rho A Omega^2 (s + u), u(0) = 0, u'(L) = 0.
    axial, density, length, speed = 2.8e7, 1.2, 10.0, 6.0
    beam = uniform_beam(40, length, (axial, 1e7, 1e7, 1e4, 1.4e4, 1.4e4), density)
    shape = solve_equilibrium(beam, np.array([speed, 0.0, 0.0]))
    wave = speed * np.sqrt(density / axial)
    closed = np.tan(wave * length) / wave - length
    assert shape.position[-1, 2] - length == pytest.approx(closed, rel=1e-3)
    assert closed == pytest.approx(5.14e-4, rel=2e-3)


def test_matrices_of_a_rotating_body_are_symmetric_and_skew() -> None:
    beam = uniform_beam(10, rotary=(2e-3, 1e-3, 1e-3))
    body = linearise(beam, solve_equilibrium(beam, np.array([4.0, 0.0, 0.0])), 4.0)
    for matrix, sign in ((body.mass, 1.0), (body.stiffness, 1.0), (body.damping, -1.0)):
        np.testing.assert_allclose(matrix, sign * matrix.T, atol=1e-13 * np.abs(matrix).max())
