"""Large deflections against closed forms and published solutions."""

import numpy as np
import pytest

from flapgym.structure import EquilibriumError, solve_equilibrium
from tests.structure.beams import bend_45_degrees, uniform_beam


def test_tip_moment_rolls_a_cantilever_into_a_full_circle() -> None:
    elements, length, bending = 12, 10.0, 3.0
    beam = uniform_beam(elements, length, (1e4, 1e4, 1e4, 1.0, 7.0, bending))
    load = np.zeros((elements + 1, 6))
    load[-1, 4] = 2.0 * np.pi * bending / length  # about y: the third section axis
    rolled = solve_equilibrium(beam, load=load, load_steps=10)
    np.testing.assert_allclose(rolled.position[-1], 0.0, atol=1e-9)
    np.testing.assert_allclose(rolled.orientation[-1], rolled.orientation[0], atol=1e-9)
    radius = length / (2.0 * np.pi)
    half = rolled.position[elements // 2]
    # The nodes lie on the circle around the polygon of the elements' chords.
    polygon = length / elements / (2.0 * np.sin(np.pi / elements))
    assert np.linalg.norm(half) == pytest.approx(2.0 * polygon, rel=1e-9)
    assert np.linalg.norm(half) == pytest.approx(2.0 * radius, rel=0.012)


@pytest.mark.parametrize(
    "force, published",
    [(300.0, (58.84, 22.33, 40.08)), (600.0, (47.23, 15.79, 53.37))],  # Simo and Vu-Quoc 1986
)
def test_45_degree_bend_meets_the_published_tip(force: float, published: tuple[float, ...]) -> None:
    load = np.zeros((9, 6))
    load[-1, 2] = force
    tip = solve_equilibrium(bend_45_degrees(8), load=load, load_steps=6).position[-1]
    np.testing.assert_allclose(tip, published, rtol=0.01)


def test_follower_tip_force_keeps_its_section_axes() -> None:
    # A force normal to the tip section: the tip moment balance about the root holds in the deformed shape.
    beam = uniform_beam(16, 1.0, (1e5, 1e5, 1e5, 1.0, 1.0, 1.0))
    follower = np.zeros((17, 6))
    follower[-1, 1] = 8.0
    shape = solve_equilibrium(beam, follower_load=follower, load_steps=8)
    force = shape.orientation[-1] @ follower[-1, :3]
    # Curvature at the root follows from the moment there; elements carry it at their middle.
    turn = np.linalg.norm(shape.position[1] - shape.position[0])
    first = np.cross(shape.position[-1] - 0.5 * (shape.position[0] + shape.position[1]), force)
    angle = np.arccos(np.clip(shape.orientation[0][:, 0] @ shape.orientation[1][:, 0], -1.0, 1.0))
    assert angle / turn == pytest.approx(np.linalg.norm(first), rel=1e-3)


def test_a_failed_solve_names_the_load_step_and_what_to_try() -> None:
    load = np.zeros((9, 6))
    load[-1, 2] = 6e7
    with pytest.raises(EquilibriumError, match="load step 1 of 1.*try more load steps|smaller load steps"):
        solve_equilibrium(bend_45_degrees(8), load=load)
