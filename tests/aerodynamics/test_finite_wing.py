"""Finite wings: lift slope against lifting-surface theory, induced drag against its closed form."""

import numpy as np
import pytest

from flapgym.aerodynamics import steady_circulation
from flapgym.aerodynamics.steady import joukowski_force, suction_drag
from tests.aerodynamics.wings import elliptic_wing


def coefficients(wing):
    """Lift, Joukowski's drag and eq. 13's drag at unit incidence."""
    circulation = steady_circulation(wing.aero, np.ones((len(wing.aero.normal), 1)))[:, 0]
    lift = (wing.lift_load @ wing.aero.force.sum(axis=0) @ circulation).item()
    drag = joukowski_force(wing.aero, circulation)[:, 1].sum() / (0.5 * wing.area)
    return lift, drag, suction_drag(wing.aero, circulation).sum() / (0.5 * wing.area)


@pytest.mark.parametrize("aspect_ratio", [6.0, 10.0, 20.0])
def test_elliptic_lift_slope_is_van_dykes(aspect_ratio):
    lift, _, _ = coefficients(elliptic_wing(aspect_ratio, panels=5, straight=0.5))
    # Third-order lifting-line theory (Van Dyke 1964), good to a fraction of a percent at these aspect ratios.
    third = 16.0 / (np.pi * aspect_ratio) ** 2 * np.log(1.0 + np.pi * np.exp(-9.0 / 8.0) * aspect_ratio)
    assert lift == pytest.approx(2.0 * np.pi / (1.0 + 2.0 / aspect_ratio + third), rel=6e-3)


def test_circular_lift_slope_converges_to_lifting_surface_theory():
    coarse, fine = (
        coefficients(elliptic_wing(4.0 / np.pi, panels=5, strips=n, straight=0.5))[0] for n in (20, 40)
    )
    # The error falls as one over the strips; Jordan (1973) has 1.7900 for the circular wing.
    assert 2.0 * fine - coarse == pytest.approx(1.7900, rel=5e-3)


def test_elliptic_induced_drag_is_least_drag():
    wing = elliptic_wing(10.0, wake_chords=10.0)
    lift, drag, by_suction = coefficients(wing)
    least = lift**2 / (np.pi * 10.0)
    assert drag == pytest.approx(least, rel=0.015)
    assert by_suction == pytest.approx(least, rel=0.05)


def test_suction_drag_tends_to_joukowskis_with_the_chordwise_panels():
    gaps = []
    for panels in (5, 10, 20):
        _, drag, by_suction = coefficients(elliptic_wing(10.0, panels, strips=20, wake_chords=10.0))
        gaps.append(abs(by_suction / drag - 1.0))
    assert gaps[1] < 0.65 * gaps[0]
    assert gaps[2] < 0.65 * gaps[1]
