"""Flutter by the reduced lattice against Theodorsen's section, and what moves it on the turbine's blade."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.optimize

from flapgym.aerodynamics import transfer_function
from flapgym.aeroelastic.coupling import Equations, LatticeInput, Output, SecondOrder, couple
from flapgym.aeroelastic.flutter import crossing, find_flutter, growing_frequency, speeding_blade
from flapgym.model.record import MARGIN, Flutter
from flapgym.reduction import balanced_reduction
from flapgym.turbine import load_case
from tests.aerodynamics.wings import straight_wing, theodorsen

# A section of the textbooks: elastic axis and centre of gravity at a and e semichords behind mid-chord, mass ratio,
# squared radius of gyration about the elastic axis, ratio of the uncoupled frequencies.
A, E, MASS_RATIO, GYRATION, RATIO = -0.2, -0.1, 20.0, 0.24, 0.4
SEMICHORD = 0.5
MASS = MASS_RATIO * np.pi * SEMICHORD**2
INERTIA = (
    MASS * SEMICHORD**2 * np.array([[1.0, -(E - A)], [-(E - A), GYRATION]])
)  # of (plunge up / b, nose-up)


def spring(speed):
    """Stiffness at a reduced speed V / (b omega_alpha), V = 1."""
    twisting = 1.0 / (SEMICHORD * speed)
    return MASS * SEMICHORD**2 * twisting**2 * np.diag([RATIO**2, GYRATION])


def theodorsen_flutter():
    """Reduced speed and frequency ratio at which the section with Theodorsen's loads oscillates undamped."""

    def determinant(unknown):
        speed, ratio = unknown
        k = ratio / speed
        s, lag = 1j * k / SEMICHORD, theodorsen(k)
        b, arm = SEMICHORD, 0.5 - A
        # Per (plunge up / b, nose-up): its downward rate, the incidence at three quarters of the chord, and the loads.
        down, up = np.array([-1.0, 0.0]) * s * b, np.array([0.0, 1.0])
        quasi = down + (1.0 + s * b * arm) * up
        lift = np.pi * b**2 * (s * down + (s - A * b * s**2) * up) + 2.0 * np.pi * b * lag * quasi
        moment = np.pi * b**2 * (A * b * s * down - (arm * b * s + (0.125 + A**2) * b**2 * s**2) * up)
        loads = np.stack([b * lift, moment + 2.0 * np.pi * b**2 * (A + 0.5) * lag * quasi])
        value = np.linalg.det(s**2 * INERTIA + spring(speed) - loads)
        return [value.real, value.imag]

    return scipy.optimize.fsolve(determinant, [2.1, 0.65])


@pytest.fixture(scope="module")
def section():
    """The section on the lattice, by reduced speed."""
    wing = straight_wing(panels=20, wake_chords=50.0)
    aero, axis = wing.aero, SEMICHORD * (1.0 + A)
    downwash = np.stack([-SEMICHORD * np.ones(20), np.ones(20), wing.station - axis], axis=1)
    lift = np.tile([1.0, 0.0, 0.0], len(aero.force_point))
    arm = np.repeat(axis - aero.force_point[:, 1], 3)
    load = np.stack([SEMICHORD * lift, arm * lift]) / wing.area
    z = np.exp(2j * np.pi * np.arange(8192) / 8192)
    response = transfer_function(aero, 0, z, downwash, load)
    reduced = balanced_reduction(response, 12, np.ones(3), np.ones(2), real=True, block_rows=1500)
    held, rates = np.zeros((3, 2)), np.zeros((3, 2))
    rates[0, 0], held[1, 1], rates[2, 1] = 1.0, 1.0, 1.0
    none = np.zeros((0, 2))

    def at(speed):
        equations = Equations(
            SecondOrder(INERTIA, np.zeros((2, 2)), spring(speed), work=np.eye(2)),
            LatticeInput(held, rates, np.zeros((3, 0))),
            Output(none, none, none, none),
            (),
            (),
        )
        return couple(equations, reduced, aero.time_step)

    return at


def test_section_flutters_where_theodorsen_says(section):
    speed, ratio = theodorsen_flutter()
    ours = crossing(lambda s: section(s).spectral_radius(), 1.5, 2.5)
    assert ours == pytest.approx(speed, rel=0.02)
    frequency = growing_frequency(section(ours)) * 2.0 * np.pi * SEMICHORD * ours
    assert frequency == pytest.approx(ratio, rel=0.02)


CASE = load_case("nrel5mw-rated")


def blade(shift):
    """The shipped case, coarser, its centres of gravity a share of the chord further aft."""
    turbine = CASE.turbine
    sections, planform = turbine.blade_sections_12, turbine.planform
    chord = np.interp(sections.radius, planform.radius, planform.chord)
    sections = replace(sections, centre_of_gravity_offset=sections.centre_of_gravity_offset + shift * chord)
    return replace(
        CASE,
        turbine=replace(turbine, blade_sections_12=sections),
        discretisation=replace(CASE.discretisation, chordwise_panels=3, wake_length=0.05, time_step=0.014),
        reduction=replace(CASE.reduction, blade_modes=8, aerodynamic_states=15),
    )


def test_mass_further_aft_makes_the_blade_flutter_between_second_flap_and_first_torsion():
    as_shipped, aft = (speeding_blade(blade(shift)) for shift in (0.0, 0.2))
    assert as_shipped(1.9).spectral_radius() < 1.0
    assert aft(1.0).spectral_radius() < 1.0
    unstable = aft(1.9)
    assert unstable.spectral_radius() > 1.0
    assert 2.1 < growing_frequency(unstable) < 5.7


def test_search_says_how_far_it_went():
    assert find_flutter(blade(0.0), 1.25) == Flutter(1.25)


def test_a_flutter_speed_near_the_operating_one_is_warned_of():
    assert "WARNING" in Flutter(2.0, MARGIN - 0.05, 3.4).describe()
    assert "WARNING" not in Flutter(2.0, MARGIN + 0.05, 3.4).describe()
    assert "none" in Flutter(2.0).describe()
