"""A coarse turbine at a site marched by azimuth with all its circulations, against its multi-blade form."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.constants import g as STANDARD_GRAVITY

from flapgym.aeroelastic.blade_lattice import reduce_component
from flapgym.aeroelastic.build import assemble_parts
from flapgym.aeroelastic.coupling import couple, multiblade_aerodynamics
from flapgym.aeroelastic.equations import turbine_equations
from flapgym.core.multiblade import to_components
from flapgym.model.signals import strip_inputs
from flapgym.turbine import load_case
from reference.by_azimuth import OUTPUTS
from reference.full import march_model_inputs, told_by_blade

STEPS, AZIMUTH = 800, 0.3


@pytest.fixture(scope="module")
def built():
    """Parts, rotor and multi-blade form with nearly all states: four strips, a wake of eight rows."""
    case = load_case("nrel5mw-site")
    grid = replace(case.discretisation, first_lattice_node=8, chordwise_panels=3, wake_length=0.005)
    airloads = replace(case.airloads, slow_wake="frozen", mean_wake="perturbations", mean_induction=0.0)
    modes = replace(case.reduction, blade_modes=3, tower_modes=4)
    parts, rotor = assemble_parts(replace(case, discretisation=grid, airloads=airloads, reduction=modes))
    components = [reduce_component(rotor, parts.lattice, m, 30) for m in (0, 1)]
    aerodynamics = multiblade_aerodynamics(*components, parts.case.rotor_speed, rotor.time_step)
    return parts, rotor, couple(turbine_equations(parts), aerodynamics, rotor.time_step)


def winds_by_strip(parts, azimuth, time):
    """Inputs (T, nu): each strip of each blade meets a gust of its own, below its edgewise mode of 1.1 Hz.

    There Newmark's rule, which the two apply in coordinates that turn, would set them apart by some (omega dt)^2.
    """
    rng, u = np.random.default_rng(7), np.zeros((len(time), len(parts.inputs)))
    frequency = rng.uniform(0.2, 0.8, (parts.strips, 3))
    met = np.sin(
        2.0 * np.pi * frequency * time[:, None, None] + rng.uniform(0.0, 2.0 * np.pi, frequency.shape)
    )
    places = [parts.inputs.index(name) for name in strip_inputs(parts.strips)]
    u[:, places] = to_components(met, azimuth[:, None]).reshape(len(time), -1)
    return u


def weight(parts, azimuth, time):
    u = np.zeros((len(time), len(parts.inputs)))
    u[:, parts.inputs.index("gravity")] = STANDARD_GRAVITY
    return u


@pytest.mark.parametrize("given", [winds_by_strip, weight])
def test_a_march_of_every_circulation_by_azimuth_tells_what_the_multiblade_form_does_to_a_thousandth(
    built, given
):
    parts, rotor, still = built
    time = rotor.time_step * np.arange(STEPS)
    azimuth = AZIMUTH + parts.case.rotor_speed * time
    fade = 0.5 - 0.5 * np.cos(np.pi * np.minimum(time / 2.0, 1.0))
    u = fade[:, None] * given(parts, azimuth, time)
    marched = march_model_inputs(parts, rotor, u, AZIMUTH)
    told = told_by_blade(still.outputs, still.simulate(u), azimuth)
    for name, expected in zip(OUTPUTS, marched.T, strict=True):
        assert np.linalg.norm(told[name] - expected) < 1e-3 * np.linalg.norm(expected), name
