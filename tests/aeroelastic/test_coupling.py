"""The implicit coupling against the continuous system it discretises."""

import numpy as np
import pytest

from flapgym.aeroelastic.coupling import Equations, LatticeInput, Output, SecondOrder, couple
from flapgym.reduction import ReducedSystem

DT = 0.01
RNG = np.random.default_rng(5)


@pytest.fixture
def parts():
    """Two structural degrees of freedom, one lattice load with two states of lag, one exogenous input."""
    structure = SecondOrder(
        mass=np.array([[2.0, 0.3], [0.3, 1.0]]),
        damping=np.array([[0.4, 0.1], [-0.1, 0.2]]),
        stiffness=np.array([[90.0, -10.0], [-10.0, 40.0]]),
        work=np.array([[1.0], [0.5]]),
    )
    aerodynamics = ReducedSystem(
        np.array([[0.9, 0.1], [-0.1, 0.8]]),
        RNG.standard_normal((2, 3)),
        RNG.standard_normal((1, 2)),
        RNG.standard_normal((1, 3)),
        np.ones(2),
    )
    lattice_input = LatticeInput(
        position=np.array([[0.0, 0.4], [0.0, 0.0], [0.0, 0.0]]),
        velocity=np.array([[0.0, 0.0], [-1.0, -0.3], [0.0, 0.0]]),
        exogenous=np.array([[0.0], [0.0], [1.0]]),
    )
    output = Output(
        acceleration=np.array([[1.0, 2.0]]),
        velocity=np.array([[0.5, 0.0]]),
        position=np.array([[0.0, 3.0]]),
        load=np.array([[-2.0]]),
    )
    return structure, aerodynamics, lattice_input, output


def test_coupled_response_is_the_continuous_structure_under_the_bilinear_map_with_the_lattice_at_the_same_step(
    parts,
):
    structure, aerodynamics, lattice_input, output = parts
    system = couple(Equations(structure, lattice_input, output, ("e",), ("y",)), aerodynamics, DT)
    frequency = np.array([0.1, 1.0, 1.5, 10.0, 40.0])
    for f, ours in zip(frequency, system.frequency_response(frequency), strict=True):
        z = np.exp(2j * np.pi * f * DT)
        s = 2.0 / DT * (z - 1.0) / (z + 1.0)
        lattice = aerodynamics.transfer_function(np.array([z]))[0]
        drive = lattice_input.position + s * lattice_input.velocity
        dynamic = structure.mass * s**2 + structure.damping * s + structure.stiffness
        d = np.linalg.solve(
            dynamic - structure.work @ lattice @ drive, structure.work @ lattice @ lattice_input.exogenous
        )
        load = lattice @ (drive @ d + lattice_input.exogenous)
        y = (output.acceleration * s**2 + output.velocity * s + output.position) @ d + output.load @ load
        np.testing.assert_allclose(ours, y, rtol=1e-9)


def test_state_after_one_step_of_a_unit_step_input_feels_the_load_at_both_ends(parts):
    structure, _, lattice_input, _ = parts
    massless = ReducedSystem(
        np.zeros((0, 0)), np.zeros((0, 3)), np.zeros((1, 0)), np.array([[0.0, 0.0, 1.0]]), np.ones(0)
    )
    output = Output(np.zeros((1, 2)), np.zeros((1, 2)), np.array([[1.0, 0.0]]), np.zeros((1, 1)))
    system = couple(Equations(structure, lattice_input, output, ("e",), ("y",)), massless, DT)
    impulse = system.simulate(np.array([[0.0], [1.0], [1.0]]))[:, 0]
    # The trapezoid rule by hand from rest: acceleration zero at step 0, a at step 1.
    mass, damping, stiffness = structure.mass, structure.damping, structure.stiffness
    a = np.linalg.solve(mass + DT / 2 * damping + DT**2 / 4 * stiffness, structure.work[:, 0])
    assert impulse[1] == pytest.approx(DT**2 / 4 * a[0], rel=1e-12)
