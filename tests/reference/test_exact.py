"""Responses with every circulation against the reduced turbine and the coupled march."""

from dataclasses import replace

import numpy as np
import pytest

from flapgym.aeroelastic.blade_lattice import reduce_component
from flapgym.aeroelastic.build import assemble_parts
from flapgym.aeroelastic.coupling import couple, multiblade_aerodynamics
from flapgym.aeroelastic.equations import periodic_equations, turbine_equations
from flapgym.turbine import load_case
from reference.exact import harmonic_response
from studies.design import frozen_turbine

FREQUENCY = np.array([0.05, 0.3, 1.0, 3.0])


@pytest.fixture(scope="module", params=["at once", "convected"])
def built(request):
    """Parts, rotor and nearly all states of a coarse case: four strips, a wake of eight rows."""
    case = load_case("nrel5mw-rated")
    grid = replace(
        case.discretisation, first_lattice_node=8, chordwise_panels=3, wake_length=0.005, gust=request.param
    )
    case = replace(case, discretisation=grid, reduction=replace(case.reduction, blade_modes=3, tower_modes=4))
    parts, rotor = assemble_parts(case)
    return parts, rotor, [reduce_component(rotor, parts.lattice, m, 30) for m in (0, 1)]


def test_multiblade_response_is_that_of_the_turbine_with_hardly_reduced_lattice(built):
    parts, rotor, components = built
    speed, dt = parts.case.rotor_speed, rotor.time_step
    equations = turbine_equations(parts)
    exact = harmonic_response(equations, rotor, parts.lattice, FREQUENCY, speed)
    reduced = couple(equations, multiblade_aerodynamics(*components, speed, dt), dt)
    assert_alike(reduced.frequency_response(FREQUENCY), exact)


def test_frozen_response_is_that_of_the_frozen_turbine_with_hardly_reduced_lattice(built):
    parts, rotor, components = built
    exact = harmonic_response(periodic_equations(parts)(0.7), rotor, parts.lattice, FREQUENCY)
    aerodynamics = multiblade_aerodynamics(*components, 0.0, rotor.time_step)
    assert_alike(frozen_turbine(parts, aerodynamics, 0.7).frequency_response(FREQUENCY), exact)


def assert_alike(ours, exact):
    for rows in (slice(0, 3), slice(3, 6), slice(6, 8)):
        scale = np.abs(exact[:, rows]).max(axis=(0, 1))
        assert (np.abs(ours - exact)[:, rows].max(axis=(0, 1)) < 3e-4 * scale).all()
