"""Filters for a field: their variances, spectra and turns against integrals of the coherence and the drawn field's."""

from dataclasses import replace

import numpy as np
import pytest

from flapgym.core.multiblade import to_blades
from flapgym.wind import Disk, Inflow, Kaimal, VonKarman, blade_filter, component_filter, effective_field
from flapgym.wind.blade_field import PARTS, blade_turbulence
from flapgym.wind.field_filter import one_sided_spectrum

RADII = np.linspace(15.0, 60.0, 10)
WEIGHTS = RADII / RADII.sum()
SPEED, ROTOR_SPEED, STEP = 11.0, 1.22, 0.007
FIELDS = {"von Karman": VonKarman(0.1, 147.0), "Kaimal": Kaimal(turbulence_class="B", hub_height=90.0)}
DISK = Disk(63.0, 90.0, 5.0, 0.087, 0.0, np.array([0.0, 87.0]), np.array([3.0, 2.0]))


@pytest.fixture(scope="module", params=FIELDS, ids=str)
def field(request):
    return FIELDS[request.param]


@pytest.fixture(scope="module")
def met(field):
    return effective_field(field, RADII, WEIGHTS, SPEED, ROTOR_SPEED)


def _variances(system):
    return np.diag(system.C @ system.stationary_covariance() @ system.C.T)


def _integrated(field, harmonic):
    """E|U_m|^2 by plain quadrature of the coherence over the difference of azimuths and over frequency."""
    apart = 2.0 * np.pi * (np.arange(240) + 0.5) / 240
    squares = RADII[:, None] ** 2 + RADII**2 - 2.0 * np.multiply.outer(np.cos(apart), np.outer(RADII, RADII))
    distance = np.sqrt(squares)
    frequency = np.concatenate([[0.0], np.geomspace(1e-4, 4.0, 80)])
    spectrum = [
        np.mean(
            np.cos(harmonic * apart)
            * np.einsum("r,drs,s->d", WEIGHTS, field.coherence(decay * distance), WEIGHTS)
        )
        for decay in field.decay(frequency, SPEED)
    ]
    integrand = np.array(spectrum) * field.spectrum(frequency, SPEED)
    return np.trapezoid(integrand, frequency) * field.deviation(SPEED) ** 2


def test_the_lyapunov_variance_is_the_integral_of_the_fields_spectrum(field, met):
    """u_0 has harmonics 0 and 3; of u_c the mean square is twice that of 1, 2 and 4."""
    whole = [_integrated(field, m) for m in range(5)]
    found = _variances(component_filter(met, STEP))
    # The midpoint rule over the azimuth is good to a hundredth where the coherence has a cusp.
    np.testing.assert_allclose(found[0], whole[0] + 2.0 * whole[3], rtol=0.01)
    np.testing.assert_allclose(found[1:], 2.0 * (whole[1] + whole[2] + whole[4]), rtol=0.01)


def test_a_blade_meets_the_mean_square_of_the_components(met):
    mean, cosine, sine = _variances(component_filter(met, STEP))
    (blade,) = _variances(blade_filter(met, STEP))
    assert blade == pytest.approx(mean + 0.5 * (cosine + sine), rel=1e-9)


def test_a_turn_later_blade_and_components_have_gone_the_same_way(met):
    """Correlation over some steps: components turned to a blade by their azimuth, and the blade's own filter."""
    components, blade = component_filter(met, STEP), blade_filter(met, STEP)
    for steps in (40, 400, round(2.0 * np.pi / ROTOR_SPEED / STEP)):
        later = [
            system.C @ np.linalg.matrix_power(system.A, steps) @ system.stationary_covariance() @ system.C.T
            for system in (components, blade)
        ]
        # Mean over the azimuth of what blade 1 has of its own components then and now.
        azimuth = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
        now = np.stack([to_blades(np.eye(3), each)[:, 0] for each in azimuth])
        then = np.stack([to_blades(np.eye(3), each + ROTOR_SPEED * STEP * steps)[:, 0] for each in azimuth])
        expected = np.einsum("ti,ij,tj->", then, later[0], now) / len(azimuth)
        assert later[1][0, 0] == pytest.approx(expected, rel=1e-6, abs=1e-9)


def test_the_filters_spectra_are_those_of_the_drawn_field_below_four_times_the_rotors_speed(field, met):
    """Against the cross-spectra that realisations are drawn with: other sums, over all harmonics."""
    period = 200.0
    drawn = blade_turbulence(field, RADII, SPEED, ROTOR_SPEED, period)
    at = (drawn.frequencies > 0.0) & (drawn.frequencies < 0.7)
    own = np.einsum("r,fprs->fps", WEIGHTS, drawn.root)
    of_parts = np.einsum("fps,fps->fp", own, own) * period * field.deviation(SPEED) ** 2
    expected = of_parts @ (np.abs(PARTS) ** 2).T
    found = one_sided_spectrum(component_filter(met, STEP), drawn.frequencies[at])
    # Near the very tops of narrow peaks bins average; harmonics from 5 on are left out.
    assert np.abs(10.0 * np.log10(found[0] / expected[at, 0])).max() < 1.5
    assert np.abs(10.0 * np.log10(found[1] / expected[at, 1])).max() < 1.5
    np.testing.assert_allclose(found[1], found[2], rtol=1e-9)


def test_the_fit_is_within_a_decibel_of_its_spectrum_below_one_hertz(met):
    frequency = np.linspace(0.0, 1.0, 400)
    mean, cyclic = met.component_spectra(frequency)
    of_components = one_sided_spectrum(component_filter(met, STEP), frequency)
    (of_blade,) = one_sided_spectrum(blade_filter(met, STEP), frequency)
    for found, expected in (
        (of_components[0], mean),
        (of_components[1], cyclic),
        (of_blade, met.blade_spectrum(frequency)),
    ):
        assert np.abs(10.0 * np.log10(found / expected)).max() < 1.2


def test_shear_adds_its_mean_square_and_stays(field):
    inflow = Inflow(shear_exponent=0.2)
    steady = inflow.harmonics(RADII, DISK, SPEED)
    with_shear = effective_field(field, RADII, WEIGHTS, SPEED, ROTOR_SPEED, steady)
    without = replace(with_shear, steady=np.zeros_like(with_shear.steady))
    more, less = (component_filter(each, STEP) for each in (with_shear, without))
    # Of harmonics 1, 2 and 4, in either of u_c and u_s, half the square of an amplitude.
    amplitude = np.abs(steady @ WEIGHTS)
    added = 0.5 * sum(amplitude[m] ** 2 for m in (1, 2, 4) if m < len(amplitude))
    np.testing.assert_allclose(_variances(more)[1:] - _variances(less)[1:], added, rtol=1e-6)
    # What a blade meets of it comes back after a turn.
    blade = blade_filter(with_shear, STEP)
    still = blade_filter(without, STEP)
    turn = 2.0 * np.pi / ROTOR_SPEED
    kept = [
        (
            each.C
            @ np.linalg.matrix_power(each.A, round(turn / STEP))
            @ each.stationary_covariance()
            @ each.C.T
        )[0, 0]
        for each in (blade, still)
    ]
    whole = _variances(blade)[0] - _variances(still)[0]
    assert kept[0] - kept[1] == pytest.approx(whole, rel=0.04)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"weights": WEIGHTS[:-1]}, "field_filter.weights"),
        ({"weights": 2.0 * WEIGHTS}, "field_filter.weights"),
        ({"radii": RADII[::-1]}, "field.radii"),
        ({"wind_speed": 0.0}, "field.wind_speed"),
        ({"harmonics": 0}, "field_filter.harmonics"),
    ],
)
def test_what_makes_no_filter_is_refused_by_name(change, text):
    arguments = {"radii": RADII, "weights": WEIGHTS, "wind_speed": SPEED, "rotor_speed": ROTOR_SPEED}
    with pytest.raises(ValueError, match=text):
        effective_field(FIELDS["Kaimal"], **{**arguments, **change})
