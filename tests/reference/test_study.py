"""Further outputs of the coupled turbine against the elastic reactions they must equal."""

from dataclasses import replace

import numpy as np
import pytest

from flapgym.aeroelastic.blade_lattice import BladeLattice
from flapgym.aeroelastic.equations import Parts, turbine_equations
from flapgym.reduction import normal_modes
from flapgym.structure import linear_blade, linear_support
from flapgym.structure.beam import tangent
from flapgym.structure.support import tower_beam
from flapgym.turbine import load_case
from reference.study import STUDY_OUTPUTS, study_equations

CASE = load_case("nrel5mw-rated")
MODES = 72


@pytest.fixture(scope="module")
def undamped():
    """All modes of blades and support, no damping, and a made-up lattice, whose loads drive them."""
    turbine = replace(CASE.turbine, blade_damping_ratio=0.0, tower_damping_ratio=0.0)
    case = replace(CASE, turbine=turbine, reduction=replace(CASE.reduction, tower_modes=66))
    blade = linear_blade(turbine, 12, case.rotor_speed)
    frequency, shape = normal_modes(blade.mass, blade.stiffness, MODES)
    lattice = BladeLattice(np.zeros((1, 2 * MODES + 11)), np.zeros((MODES + 6, 3)), MODES, strips=1)
    return Parts(case, blade, linear_support(turbine, case.rotor_speed), frequency, shape, lattice)


def harmonic(parts, equations, omega):
    """Motion and outputs under random lattice loads at a frequency [rad/s]."""
    structure, read = equations.structure, equations.output
    s = 1j * omega
    load = np.random.default_rng(5).standard_normal(structure.work.shape[1])
    dynamic = structure.mass * s**2 + structure.damping * s + structure.stiffness
    d = np.linalg.solve(dynamic, structure.work @ load)
    return d, (read.acceleration * s**2 + read.velocity * s + read.position) @ d + read.load @ load


@pytest.mark.parametrize("omega", [0.0, 1.5, 12.0])
def test_moments_on_the_foundation_are_the_lowest_element_s_elastic_reaction(undamped, omega):
    d, y = harmonic(undamped, study_equations(undamped), omega)
    _, shape = undamped.modal_support
    tower = tower_beam(undamped.case.turbine)
    q = (shape @ d[3 * MODES :])[: 6 * tower.elements]
    reaction = tangent(tower, tower.reference)[:6, 6:] @ q
    expected = np.array([-reaction[4], reaction[3]])  # about +y, and about -x
    np.testing.assert_allclose(y[-2:], expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())


def test_outputs_of_the_model_come_first_and_unchanged(undamped):
    _, ours = harmonic(undamped, study_equations(undamped), 3.0)
    _, theirs = harmonic(undamped, turbine_equations(undamped), 3.0)
    np.testing.assert_array_equal(ours[:8], theirs)
    assert study_equations(undamped).outputs[8:] == STUDY_OUTPUTS
