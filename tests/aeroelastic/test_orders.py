"""The rotor's lattice at 20, 50 and 150 states against all its circulations (paper Figure 14)."""

import numpy as np
import pytest

from flapgym.aerodynamics import build_aerodynamics
from flapgym.aeroelastic.blade_lattice import blade_lattice, lattice_response, reduce_component
from flapgym.aeroelastic.equations import root_moment
from flapgym.reduction import normal_modes
from flapgym.structure import linear_blade
from flapgym.turbine import load_case
from flapgym.wind import von_karman_spectrum

CASE = load_case("nrel5mw-rated")
FREQUENCY = np.geomspace(0.02, 3.0, 40)
Z = np.exp(2j * np.pi * FREQUENCY * CASE.discretisation.time_step)


@pytest.fixture(scope="module")
def rotor():
    """The undeflected rotor's lattice in the blade's modes."""
    blade = linear_blade(CASE.turbine, 12, CASE.rotor_speed)
    _, shape = normal_modes(blade.mass, blade.stiffness, CASE.reduction.blade_modes)
    aero = build_aerodynamics(CASE)
    return aero, blade_lattice(CASE, aero, blade, shape), root_moment(blade, CASE.reduction.blade_modes)


# Bounds on the rms error under the reference turbulence: root moment, worst of the first six modal forces.
@pytest.mark.parametrize("component", [0, 1])
@pytest.mark.parametrize(("states", "moment", "modal"), [(20, 0.15, 0.6), (50, 0.08, 0.4), (150, 1e-3, 1e-2)])
def test_error_under_turbulence_falls_with_the_order(rotor, component, states, moment, modal):
    aero, lattice, root = rotor
    reduced = reduce_component(aero, lattice, component, round(states / 3))
    gust = lattice.select("gust").sum(axis=1)
    exact, ours = (
        response @ gust
        for response in (lattice_response(aero, lattice, component, Z), reduced.transfer_function(Z))
    )
    weight = von_karman_spectrum(FREQUENCY, 11.0, 0.1, 147.0)

    def error(rows):
        apart, size = (
            np.trapezoid(np.abs(part @ rows.T) ** 2 * weight[:, None], FREQUENCY, axis=0)
            for part in (ours - exact, exact)
        )
        return np.sqrt(apart / size).max()

    assert error(root) < moment
    assert error(np.eye(len(exact[0]))[:6]) < modal
    assert np.abs(np.linalg.eigvals(reduced.A)).max() < 1.0
