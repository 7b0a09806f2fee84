"""Design models against the turbine they come from."""

from dataclasses import replace

import numpy as np
import pytest

from flapgym.aeroelastic.blade_lattice import reduce_component
from flapgym.aeroelastic.build import assemble_parts
from flapgym.aeroelastic.coupling import couple, multiblade_aerodynamics
from flapgym.aeroelastic.equations import blade_equations
from flapgym.reduction import ReducedSystem
from flapgym.turbine import load_case
from studies.design import clamped_rotor, frozen_turbine, hub_sway, moving_root_blade


@pytest.fixture(scope="module")
def built():
    """Parts and rotor lattice of a coarse case."""
    case = load_case("nrel5mw-rated")
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


def test_a_hub_that_moves_upwind_is_a_gust(built):
    parts, (collective, _), _ = built
    blade = moving_root_blade(parts, collective)
    frequency = np.array([0.0, 0.3, 2.0])
    wind, hub = (
        blade.select(inputs=[name]).frequency_response(frequency) for name in ("wind", "hub_velocity")
    )
    np.testing.assert_allclose(-hub, wind, rtol=1e-9)


def test_without_sway_the_moving_blade_is_the_clamped_one(built):
    parts, (collective, _), _ = built
    dt = parts.case.discretisation.time_step
    clamped = couple(blade_equations(parts), collective, dt)
    moving = moving_root_blade(parts, collective).select(inputs=clamped.inputs)
    frequency = np.array([0.0, 0.3, 2.0])
    np.testing.assert_allclose(
        moving.frequency_response(frequency), clamped.frequency_response(frequency), rtol=1e-9
    )


def test_in_still_air_an_accelerated_root_feels_the_blades_first_moment_of_mass(built):
    """No lattice: a steady acceleration is a load m a along the blade; turning relieves the root of a part."""
    parts, _, _ = built
    nu, nf = parts.lattice.downwash.shape[1], parts.lattice.load.shape[0]
    none = ReducedSystem(
        np.zeros((1, 1)), np.zeros((1, nu)), np.zeros((nf, 1)), np.zeros((nf, nu)), np.ones(1)
    )
    moment, tip = moving_root_blade(parts, none).select(inputs=["hub_acceleration"]).dc_gain()[:, 0]
    sections = parts.case.turbine.blade_sections(12)
    radius, arm = sections.radius, sections.radius - sections.radius[0]
    first_moment = np.trapezoid(sections.mass_density * arm, radius)
    # The deflected blade's centrifugal force pulls back at its lever, the deflection: a parabola, nearly.
    deflection = tip * (arm / arm[-1]) ** 2
    relief = parts.case.rotor_speed**2 * np.trapezoid(sections.mass_density * radius * deflection, radius)
    assert moment < 0.0
    assert -moment == pytest.approx(first_moment + relief, rel=0.02)
    assert relief < -0.02 * first_moment


def test_sway_has_the_velocity_and_the_frequency_asked_for():
    sway = hub_sway(0.32, 0.08, 0.05, 0.007)
    rms = np.sqrt(np.diag(sway.C @ sway.stationary_covariance() @ sway.C.T))
    assert rms[0] == pytest.approx(0.05, rel=1e-9)
    values = np.log(np.linalg.eigvals(sway.A)) / 0.007
    np.testing.assert_allclose(np.abs(values) / (2 * np.pi), 0.32, rtol=1e-9)
    np.testing.assert_allclose(-values.real / np.abs(values), 0.08, rtol=1e-9)
