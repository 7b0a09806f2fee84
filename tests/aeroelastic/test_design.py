"""Design models against the turbine they come from."""

from dataclasses import replace

import numpy as np
import pytest

from flapgym.aeroelastic.blade_lattice import reduce_component
from flapgym.aeroelastic.build import assemble_parts
from flapgym.aeroelastic.coupling import couple, multiblade_aerodynamics
from flapgym.aeroelastic.design import clamped_rotor, frozen_turbine
from flapgym.aeroelastic.equations import blade_equations
from flapgym.turbine import load_case


@pytest.fixture(scope="module")
def built():
    """Parts and rotor lattice of a coarse case."""
    case = load_case()
    grid = replace(case.discretisation, chordwise_panels=3, wake_length=0.1)
    reduction = replace(case.reduction, blade_modes=3, tower_modes=4, aerodynamic_states=12)
    case = replace(case, discretisation=grid, reduction=reduction)
    parts, rotor = assemble_parts(case)
    components = [reduce_component(rotor, parts.lattice, m, 12) for m in (0, 1)]
    return parts, components, multiblade_aerodynamics(*components, 0.0, grid.time_step)


def test_clamped_rotor_in_a_homogeneous_gust_is_one_blade_in_the_collective_wake(built):
    parts, (collective, _), aerodynamics = built
    rotor = clamped_rotor(parts, aerodynamics)
    blade = couple(blade_equations(parts), collective, parts.case.discretisation.time_step)
    frequency = np.array([0.05, 0.5, 1.5])
    ours = rotor.select(inputs=["wind"], outputs=["rbm_1", "rbm_2", "rbm_3"]).frequency_response(frequency)
    alone = blade.select(inputs=["wind"], outputs=["rbm"]).frequency_response(frequency)
    np.testing.assert_allclose(ours, np.broadcast_to(alone, ours.shape), rtol=1e-9)


def test_blades_of_the_clamped_rotor_feel_each_other_s_flaps_alike_around_the_rotor(built):
    parts, _, aerodynamics = built
    gain = clamped_rotor(parts, aerodynamics).dc_gain()[:3, :3]
    np.testing.assert_allclose(np.roll(gain, (1, 1), axis=(0, 1)), gain, rtol=1e-9)
    assert 0.0 < np.abs(gain[0, 1:]).max() < 0.1 * gain[0, 0]


def test_frozen_turbine_is_the_same_machine_after_a_third_of_a_turn_with_blades_renamed(built):
    parts, _, aerodynamics = built
    here, there = (
        frozen_turbine(parts, aerodynamics, angle).dc_gain() for angle in (0.4, 0.4 + 2 * np.pi / 3)
    )
    flaps, moments = [2, 0, 1], [2, 0, 1]
    scale = np.abs(here[:3, :3]).max()
    np.testing.assert_allclose(there[np.ix_(moments, flaps)], here[:3, :3], atol=1e-8 * scale)


def test_frozen_turbine_is_stable(built):
    parts, _, aerodynamics = built
    assert frozen_turbine(parts, aerodynamics, 1.0).spectral_radius() < 1.0
