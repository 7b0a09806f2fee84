"""The beam's forces and tangents as derivatives of its energy, over random states."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flapgym.structure.beam import Beam, Configuration, internal_force, strain_energy, strains, tangent
from tests.structure.beams import random_beam, turned

STEP = 1e-30
states = settings(max_examples=20, deadline=None)
seeds = st.integers(0, 10_000)


def random_state(seed: int, amplitude: float) -> tuple[Beam, Configuration]:
    beam = random_beam(3, seed)
    motion = amplitude * np.random.default_rng(seed + 1).uniform(-1.0, 1.0, size=(4, 6))
    return beam, beam.reference.moved(motion)


@states
@given(seeds, st.floats(0.0, 0.3))
def test_tangent_is_the_derivative_of_the_force(seed: int, amplitude: float) -> None:
    beam, state = random_state(seed, amplitude)
    exact = tangent(beam, state)
    by_complex_step = np.empty_like(exact)
    for column in range(len(exact)):
        push = np.zeros(len(exact), dtype=complex)
        push[column] = 1j * STEP
        force = internal_force(beam, state.moved(push.reshape(-1, 6)))
        by_complex_step[:, column] = force.ravel().imag / STEP
    np.testing.assert_allclose(exact, by_complex_step, atol=1e-12 * np.abs(exact).max())


@states
@given(seeds, st.floats(0.0, 0.3))
def test_force_is_the_gradient_of_the_energy(seed: int, amplitude: float) -> None:
    beam, state = random_state(seed, amplitude)
    direction = np.random.default_rng(seed + 2).normal(size=(4, 6))
    work = np.sum(internal_force(beam, state) * direction)
    strain = strains(beam, state.moved(1j * STEP * direction))
    lengths = np.linalg.norm(np.diff(beam.reference.position, axis=0), axis=1)
    energy = 0.5 * np.einsum("n,ni,nij,nj->", lengths, strain, beam.stiffness, strain)
    assert energy.imag / STEP == pytest.approx(work, rel=1e-10, abs=1e-9)
    assert energy.real == pytest.approx(strain_energy(beam, state), rel=1e-12, abs=1e-12)


@states
@given(seeds, st.tuples(*3 * [st.floats(-3.0, 3.0)]))
def test_a_rigid_rotation_strains_nothing(seed: int, angles: tuple[float, float, float]) -> None:
    beam = random_beam(5, seed)
    moved = turned(beam, angles, np.array([3.0, -20.0, 7.0]))
    np.testing.assert_allclose(strains(beam, moved), 0.0, atol=1e-12)


@states
@given(seeds, st.tuples(*3 * [st.floats(-3.0, 3.0)]))
def test_strain_does_not_change_when_a_deformed_beam_is_turned(
    seed: int, angles: tuple[float, float, float]
) -> None:
    beam, state = random_state(seed, 0.3)
    moved = turned(Beam(state, beam.stiffness, beam.mass), angles, np.ones(3))
    np.testing.assert_allclose(strains(beam, moved), strains(beam, state), atol=1e-12)
