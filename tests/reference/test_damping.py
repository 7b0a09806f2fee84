"""Named modes of the turning turbine against what is known of them without solving the coupled system."""

from dataclasses import replace

import numpy as np
import pytest

from flapgym.aeroelastic.blade_lattice import BladeLattice
from flapgym.aeroelastic.coupling import couple
from flapgym.aeroelastic.equations import Parts, turbine_equations
from flapgym.reduction import ReducedSystem, normal_modes
from flapgym.structure import linear_blade, linear_support
from flapgym.turbine import load_case
from reference.damping import coupled_modes

CASE = load_case("nrel5mw-rated")
MODES = 4


@pytest.fixture(scope="module", params=[0.02, 1.0], ids=["creeping", "rated"])
def found(request):
    """Parts and named modes of a turbine without air, whose lattice answers nothing."""
    point = replace(CASE.operating_point, tip_speed_ratio=request.param * 7.0)
    case = replace(CASE, operating_point=point)
    blade = linear_blade(case.turbine, 12, case.rotor_speed)
    frequency, shape = normal_modes(blade.mass, blade.stiffness, MODES)
    lattice = BladeLattice(np.zeros((1, 2 * MODES + 11)), np.zeros((MODES + 6, 3)), MODES, flaps=1, strips=1)
    parts = Parts(case, blade, linear_support(case.turbine, case.rotor_speed), frequency, shape, lattice)
    inputs, outputs = 3 * lattice.downwash.shape[1], 3 * (MODES + 6)
    vacuum = ReducedSystem(
        np.zeros((0, 0)),
        np.zeros((0, inputs)),
        np.zeros((outputs, 0)),
        np.zeros((outputs, inputs)),
        np.ones(0),
    )
    turbine = couple(turbine_equations(parts), vacuum, 2e-3)
    return parts, {mode.name: mode for mode in coupled_modes(parts, turbine, 3, 5)}


def test_first_edgewise_whirls_lie_two_rotor_speeds_apart_and_flap_below_edge(found):
    parts, modes = found
    turns = parts.case.rotor_speed / (2.0 * np.pi)
    apart = modes["edge 1 forward"].frequency - modes["edge 1 backward"].frequency
    assert apart == pytest.approx(2.0 * turns, abs=0.02)
    middle = 0.5 * (modes["edge 1 forward"].frequency + modes["edge 1 backward"].frequency)
    assert middle == pytest.approx(parts.frequency[1] / (2.0 * np.pi), rel=0.02)


def test_tower_modes_hardly_feel_the_rotor_s_speed_and_are_the_paper_s(found):
    """Table 1, 12 elements a blade: 0.321, 0.316, 0.617 and 2.931 Hz."""
    _, modes = found
    named = ("tower fore-aft 1", "tower side-to-side 1", "drivetrain 1", "tower fore-aft 2")
    for name, published in zip(named, (0.321, 0.316, 0.617, 2.931), strict=True):
        assert modes[name].frequency == pytest.approx(published, rel=0.03), name


def test_without_air_every_mode_is_damped_by_the_structure_alone(found):
    parts, modes = found
    turbine = parts.case.turbine
    for mode in modes.values():
        assert 0.2 * turbine.blade_damping_ratio < mode.damping < 1.5 * turbine.tower_damping_ratio, mode
