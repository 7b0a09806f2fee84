"""What turning blades meet of a field, against closed forms of frozen isotropic turbulence along their helices."""

import itertools

import numpy as np
import pytest

from flapgym.core.multiblade import blade_azimuths, to_blades
from flapgym.wind.blade_field import PARTS, blade_turbulence, field_on_disk
from flapgym.wind.spectrum import von_karman_spectrum
from tests.wind.test_field import (
    KAIMAL,
    KARMAN,
    LENGTH,
    RADII,
    SPEED,
    TURN,
    WIND,
    _helix_spectrum,
    _isotropic,
)

PERIOD = 400.0


@pytest.fixture(scope="module")
def blades():
    return blade_turbulence(KARMAN, RADII, WIND, SPEED, PERIOD)


def _covariance(blades, one, other, turned, lag=0.0):
    """Of ring `one` of blade 1, and `lag` seconds later ring `other` of the blade `turned` ahead of it.

    Both by their components, at an azimuth of blade 1 that must not count: any will do.
    """
    azimuth = 0.7
    waves = np.einsum("cp,fprs->frcps", PARTS, blades.root)
    products = np.einsum("fcps,fdps->fcd", waves[:, one], waves[:, other].conj())
    components = (products * np.exp(-2j * np.pi * blades.frequencies * lag)[:, None, None]).sum(axis=0).real
    sees = [np.array([1.0, np.cos(a), np.sin(a)]) for a in (azimuth, azimuth + turned + SPEED * lag)]
    return sees[0] @ components @ sees[1]


def _spectrum(blades, ring, frequency):
    """One-sided, of the wind at a ring of a blade: the two parts of u_0, and 2 z either side of once a turn."""
    power = np.einsum("fps,fps->pf", blades.root[:, :, ring], blades.root[:, :, ring]) * blades.period
    power[:, 0] *= 2.0

    def part(number, met):
        return np.interp(met, blades.frequencies, power[number])

    below = np.where(frequency < TURN, part(3, np.abs(frequency - TURN)), part(2, np.abs(frequency - TURN)))
    return part(0, frequency) + part(1, frequency) + below + part(3, frequency + TURN)


@pytest.mark.parametrize("ring", [1, 2, 3])
def test_a_blade_meets_the_spectrum_of_its_helix_up_to_the_highest_frequency(blades, ring):
    frequency = np.arange(0.02, 3.0, 0.011)
    _, exact = _helix_spectrum(frequency, RADII[ring])
    # At the peaks both are averages, over the waves' distance and over the integral's.
    np.testing.assert_allclose(_spectrum(blades, ring, frequency), exact, rtol=0.02)


@pytest.mark.parametrize("lag", [0.0, 0.5, 2.0, 7.0, 20.0])
def test_two_blades_have_von_karmans_correlation_of_their_places(blades, lag):
    for (one, other), blade in itertools.product(itertools.product(range(4), repeat=2), range(3)):
        turned = 2.0 * np.pi * blade / 3.0
        apart = abs(RADII[one] - RADII[other] * np.exp(1j * (turned + SPEED * lag)))
        if np.hypot(WIND * lag, apart) < 5.0:
            continue  # what is above the highest frequency is of points as close as that
        exact = _isotropic(WIND * lag, apart) * np.sinc(
            lag / PERIOD
        )  # of spectra averaged between frequencies
        assert _covariance(blades, one, other, turned, lag) == pytest.approx(exact, abs=5e-3)


@pytest.mark.parametrize("ring", [0, 3])
def test_what_a_blade_does_not_meet_lies_above_the_highest_frequency(blades, ring):
    _, density = _helix_spectrum(np.linspace(0.0, 3.0, 3001), RADII[ring])
    above = 1.0 - np.trapezoid(density, dx=1e-3)
    # Of what is a turn above the components have a part.
    assert above - 0.005 < 1.0 - _covariance(blades, ring, ring, 0.0) < above + 0.001


def test_on_a_disk_that_is_small_beside_the_eddies_blades_meet_the_homogeneous_gust():
    blades = blade_turbulence(KARMAN, 1e-7 * RADII, WIND, SPEED, PERIOD)
    power = np.einsum("fprk,fprk->pfr", blades.root, blades.root) * blades.period
    power[:, 0] *= 2.0
    about = np.abs(blades.frequencies[:, None] + (np.arange(200) - 99.5) / 200.0 / blades.period)
    exact = von_karman_spectrum(about, WIND, 0.1, LENGTH).mean(axis=1) / (0.1 * WIND) ** 2
    # Four points a frequency are off at the spectrum's knee, as on the disk.
    np.testing.assert_allclose(power[0], np.tile(exact[:, None], 4), rtol=2e-3)
    assert power[1:].max() < 1e-6 * power[0].max()


@pytest.mark.parametrize("field", [KARMAN, KAIMAL], ids=["von_karman", "kaimal"])
def test_drawn_winds_of_three_blades_have_the_variance_and_correlation_they_were_prepared_for(field):
    blades = blade_turbulence(field, RADII[[1, 3]], WIND, SPEED, PERIOD)
    rng, count = np.random.default_rng(4), 400
    waves = np.stack([blades.waves(rng.standard_normal(blades.noise_count)) for _ in range(count)])
    winds = waves.real.sum(axis=1)  # components (count, 2, 3) at time zero
    sees = [np.array([1.0, np.cos(a), np.sin(a)]) for a in 2.0 * np.pi * np.arange(3) / 3.0]
    for (one, other), blade in itertools.product([(0, 0), (0, 1), (1, 1)], range(3)):
        turned = 2.0 * np.pi * blade / 3.0
        expected = _covariance(blades, one, other, turned)
        spread = np.sqrt(_covariance(blades, one, one, 0.0) * _covariance(blades, other, other, 0.0))
        measured = np.mean((winds[:, one] @ sees[0]) * (winds[:, other] @ sees[blade]))
        # Of a product of normal numbers: sqrt(1 + correlation^2) / sqrt(count) at most.
        assert measured == pytest.approx(expected, abs=4.0 * spread * np.sqrt(2.0 / count))


def test_winds_of_blades_are_prepared_once():
    first = blade_turbulence(KAIMAL, RADII, WIND, SPEED, 50.0, 1.0)
    assert blade_turbulence(KAIMAL, RADII.copy(), WIND, SPEED, 50.0, 1.0) is first


@pytest.mark.parametrize(
    "given, message",
    [
        ({"radii": [5.0, 5.0]}, "^field.radii: expected them to rise, got 5, 5 m"),
        ({"wind_speed": 0.0}, "^field.wind_speed: expected 0 m/s < speed, got 0 m/s"),
        ({"rotor_speed": 0.0}, "^field.rotor_speed: expected 0 deg/s < angular rate, got 0 deg/s"),
        ({"period": 0.0}, "^field.period: expected 0 s < time, got 0 s"),
        ({"highest_frequency": -1.0}, "^field.highest_frequency: expected 0 Hz < frequency, got -1 Hz"),
    ],
)
def test_what_cannot_be_prepared_is_refused_by_name(given, message):
    asked = {"radii": RADII, "wind_speed": WIND, "rotor_speed": SPEED, "period": 100.0}
    with pytest.raises(ValueError, match=message):
        blade_turbulence(KARMAN, **{**asked, **given})


def test_noise_of_another_length_is_refused(blades):
    with pytest.raises(ValueError, match=r"^noise: expected the shape \(\d+,\), got \(3,\)"):
        blades.waves(np.zeros(3))


@pytest.mark.parametrize("field", [KARMAN, KAIMAL])
def test_the_field_for_a_picture_is_what_the_blades_meet_where_they_are(field):
    turbulence = blade_turbulence(field, RADII, WIND, SPEED, 60.0)
    noise = np.random.default_rng(3).standard_normal(turbulence.noise_count)
    disk = field_on_disk(field, turbulence, WIND, SPEED, noise)
    waves = turbulence.waves(noise) * field.deviation(WIND)
    for time, rotor in ((0.0, 0.4), (7.3, 2.9)):
        ahead = np.exp(2j * np.pi * turbulence.frequencies * time)
        components = np.einsum("frc,f->rc", waves, ahead).real
        met = to_blades(components, rotor)
        shown = disk.on_disk(time, rotor, blade_azimuths(rotor))
        # As far as the smooth field's root has an inverse.
        np.testing.assert_allclose(shown, met, atol=2e-4)


def test_the_field_for_a_picture_stands_while_the_rotor_turns():
    """At low frequencies blades pass each place often, so what is shown there does not turn with them."""
    turbulence = blade_turbulence(KARMAN, RADII, WIND, SPEED, 60.0)
    noise = np.random.default_rng(4).standard_normal(turbulence.noise_count)
    disk = field_on_disk(KARMAN, turbulence, WIND, SPEED, noise)
    azimuth, times = np.linspace(0.0, 2.0 * np.pi, 90, endpoint=False), 0.2 * np.arange(200)
    shown = np.stack([disk.on_disk(t, SPEED * t, azimuth)[2] for t in times])
    # Correlation over 0.4 s, as an eddy of a rotor's size passes: at places that stand, and at ones that turn.
    still = np.mean(shown[:-2] * shown[2:])
    turned = (
        np.mean(
            [
                np.roll(a, round(SPEED * 0.4 / (azimuth[1] - azimuth[0]))) @ b
                for a, b in zip(shown, shown[2:], strict=False)
            ]
        )
        / 90
    )
    assert still > 0.93 * np.mean(shown**2)
    assert still > turned


def test_the_field_for_a_picture_has_most_of_the_variance():
    turbulence = blade_turbulence(KARMAN, RADII, WIND, SPEED, 60.0)
    rng, azimuth = np.random.default_rng(5), np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    squares = [
        field_on_disk(KARMAN, turbulence, WIND, SPEED, rng.standard_normal(turbulence.noise_count)).on_disk(
            0.0, 0.0, azimuth
        )
        ** 2
        for _ in range(60)
    ]
    share = np.mean(squares) / KARMAN.deviation(WIND) ** 2
    assert 0.7 < share < 1.0
