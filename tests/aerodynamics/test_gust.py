"""Gusts that strike all panels at once or travel along the chord, in frequency and in time (paper Figure 8)."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import jv

from flapgym.aerodynamics import (
    build_aerodynamics,
    collective_response,
    convected_gust_downwash,
    gust_downwash,
    march,
    root_moment_load,
    steady_circulation,
    transfer_function,
)
from tests.aerodynamics.wings import straight_wing, theodorsen


def impulsive_gust(case, blades, revolutions):
    """Flapwise root moment per m/s after a gust that starts at once, and its steady value."""
    aero = build_aerodynamics(case, blades=blades)
    gust, load = gust_downwash(aero).sum(axis=1, keepdims=True), root_moment_load(aero, case)
    steps = round(revolutions * 2 * np.pi / case.rotor_speed / aero.time_step)
    moment = collective_response(aero, np.ones((steps, 1)), gust, load)[:, 0]
    return moment, (load @ aero.force.sum(axis=0) @ steady_circulation(aero, gust)).item()


def test_collective_response_is_the_march_of_the_full_state(rotor, case):
    rng = np.random.default_rng(3)
    inputs, signal = gust_downwash(rotor)[:, [2, 9]], rng.normal(size=(30, 2))
    downwash = np.broadcast_to((signal @ inputs.T)[:, None], (30, 3, 100))
    _, force = march(rotor, downwash)
    load = root_moment_load(rotor, case)
    expected = force.reshape(30, 3, -1) @ load[0]
    response = collective_response(rotor, signal, inputs, load)
    np.testing.assert_allclose(
        np.repeat(response, 3, axis=1), expected, rtol=1e-9, atol=1e-9 * abs(expected).max()
    )


@pytest.mark.parametrize("k", [0.05, 0.1])
def test_convected_gust_on_a_wing_is_sears(k):
    wing = straight_wing(panels=20)
    # The wing of the wing tests has its normal along x; the gust's phase is that at the leading edge.
    z = np.exp(2j * k * wing.aero.time_step)
    response = transfer_function(
        wing.aero, 0, z, convected_gust_downwash(wing.aero, z), wing.lift_load
    ).item()
    sears = (jv(0, k) - 1j * jv(1, k)) * theodorsen(k) + 1j * jv(1, k)
    assert abs(response / (2 * np.pi * sears * np.exp(-1j * k)) - 1) < 0.015


def test_convected_gust_differs_only_at_high_frequency(rotor, case):
    frequency = np.array([0.0, 0.2, 1.0, 10.0])
    z = np.exp(2j * np.pi * frequency * rotor.time_step)
    load = root_moment_load(rotor, case)
    convected = transfer_function(rotor, 0, z, convected_gust_downwash(rotor, z), load).sum(axis=2)[:, 0]
    at_once = transfer_function(rotor, 0, z, gust_downwash(rotor), load).sum(axis=2)[:, 0]
    ratio = abs(convected / at_once)
    assert ratio[0] == pytest.approx(1.0, rel=1e-12)
    assert ratio[1] == pytest.approx(1.0, rel=5e-3)
    assert ratio[2] == pytest.approx(1.0, rel=0.04)
    assert ratio[3] < 0.85


def test_figure_8_with_the_papers_wake(case):
    full, full_steady = impulsive_gust(case, 3, 1.0)
    single, single_steady = impulsive_gust(case, 1, 1.0)
    assert full[-1] == pytest.approx(full_steady, rel=1e-3)
    assert single[-1] == pytest.approx(single_steady, rel=1e-3)
    # A quarter diameter is 0.56 of a turn: the blades meet one another's wake once, and 6 % is what that takes.
    assert full_steady / single_steady == pytest.approx(0.94, abs=0.01)


def test_figure_8_with_a_longer_slower_wake_has_the_papers_fifteen_percent(case):
    slow = replace(case, discretisation=replace(case.discretisation, wake_length=1.0, induction=0.3))
    full, full_steady = impulsive_gust(slow, 3, 1.2)
    single, single_steady = impulsive_gust(slow, 1, 1.2)
    assert full_steady / single_steady == pytest.approx(0.86, abs=0.01)
    turn = len(full) / 1.2

    def drop(moment, start, end):
        return (moment[round(start * turn)] - moment[round(end * turn)]) / single_steady

    # The full rotor drops at each third of a turn, the single blade after a whole one and not before.
    assert drop(full, 0.28, 0.43) > 3 * drop(full, 0.52, 0.62)
    assert drop(full, 0.62, 0.77) > 1.1 * drop(full, 0.5, 0.62)
    assert drop(single, 0.85, 1.1) > 0.015
    assert abs(drop(single, 0.55, 0.8)) < 0.003
