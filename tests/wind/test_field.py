"""Fields over the disk against von Karman's isotropic correlation, integrals over Bessel functions, and each other.

The generator knows spectra and coherences. What it is held against here is the covariance of frozen isotropic
turbulence at points x along and d across the wind, R = g(r) + (f(r) - g(r)) x^2 / r^2, in closed form.
"""

import itertools

import numpy as np
import pytest
from scipy.signal import csd
from scipy.special import gamma, jv, kv

from flapgym.wind.field import disk_turbulence, harmonic_shares, needed_harmonics
from flapgym.wind.spectrum import von_karman_spectrum
from flapgym.wind.turbulence import Kaimal, VonKarman

WIND, LENGTH, SPEED = 11.0, 147.0, 1.2
RADII = np.array([6.0, 25.0, 44.1, 61.0])
"""The third at 0.7 of a radius of 63 m."""
KARMAN, KAIMAL = VonKarman(0.1, LENGTH), Kaimal(hub_height=90.0)
TURN = SPEED / (2.0 * np.pi)


def _isotropic(along, across):
    """Correlation of the components along the wind, by von Karman's f and the g that isotropy makes of it."""
    x = np.maximum(np.hypot(along, across), 1e-9) / (1.339 * LENGTH)
    scale = 2.0 ** (2 / 3) / gamma(1 / 3) * x ** (1 / 3)
    f, g = scale * kv(1 / 3, x), scale * (kv(1 / 3, x) - 0.5 * x * kv(2 / 3, x))
    return g + (f - g) * (along / (1.339 * LENGTH * x)) ** 2


def _covariance(disk, one, other, angle=0.0, lag=0.0):
    """Of two rings' points `angle` apart, `lag` seconds one after the other, as the square roots make it."""
    products = np.einsum("mfk,mfk->mf", disk.root[:, :, one], disk.root[:, :, other])
    signs = 2.0 * np.cos(np.arange(disk.harmonics + 1) * angle)
    signs[0] = 1.0
    return 4.0 * signs @ products @ np.cos(2.0 * np.pi * disk.frequencies * lag)


def _winds(disk, count, deviation=1.0, seed=0):
    rng = np.random.default_rng(seed)
    return [disk.draw(rng.standard_normal(disk.noise_count), deviation) for _ in range(count)]


@pytest.fixture(scope="module")
def short():
    return disk_turbulence(KARMAN, RADII, WIND, SPEED, 0.007, 2858)


@pytest.fixture(scope="module")
def wind(short):
    return _winds(short, 1, 1.1)[0]


@pytest.fixture(scope="module")
def turning():
    """4000 s of wind at a point that turns at 0.7 of the radius (8, 20000), each wind met by two points."""
    disk = disk_turbulence(KARMAN, RADII[2:3], WIND, SPEED, 0.05, 20000, 2.0)
    azimuth = SPEED * 0.05 * np.arange(disk.steps)
    return np.array([w.at(azimuth + start)[:, 0] for w in _winds(disk, 4) for start in (0.0, np.pi)])


@pytest.fixture(scope="module")
def still():
    """6000 s of wind with so many harmonics, for a slow rotor, that points which stand miss little below 0.3 Hz."""
    disk = disk_turbulence(KARMAN, RADII, WIND, 0.12, 0.25, 8000, 1.0)
    return _winds(disk, 3, seed=2)


@pytest.mark.parametrize("field", [KARMAN, KAIMAL])
@pytest.mark.parametrize("frequency", [0.0, 0.1, 1.0])
def test_cross_spectra_of_harmonics_are_integrals_over_bessel_functions(field, frequency):
    """By the addition theorem, S_m(r1, r2) is the integral of Phi(k) J_m(k r1) J_m(k r2) k dk.

    Phi is the plane transform of the coherence: c / (c^2 + k^2)^(3/2) of exp(-c d), and of von Karman's
    55/18 c^(5/3) k^2 / (c^2 + k^2)^(17/6).
    """
    c = float(field.decay(np.array([frequency]), WIND)[0])
    x, step = np.linspace(0.0, 1.0, 120001, retstep=True)
    k = 60.0 * x**2  # dense where the large eddies are
    plane = {
        "kaimal": c / (c**2 + k**2) ** 1.5,
        "von_karman": 55.0 / 18.0 * c ** (5.0 / 3.0) * k**2 / (c**2 + k**2) ** (17.0 / 6.0),
    }[field.kind]
    rings = RADII[[0, 2, 3]]
    shares = harmonic_shares(field, rings, WIND, np.array([frequency]), 10)[:, 0]
    for m in (0, 1, 4, 10):
        waves = jv(m, np.outer(rings, k))
        exact = (waves * (plane * k * 120.0 * x * step)) @ waves.T
        # The rest is what folds over the azimuth, which the generator says adds a thousandth.
        np.testing.assert_allclose(shares[m], exact, atol=1e-3 * exact.max() + 1e-6, err_msg=f"m = {m}")


def test_the_spline_over_the_decay_gives_what_each_frequency_gives():
    frequencies = np.arange(300) / 100.0
    shares = harmonic_shares(KARMAN, RADII, WIND, frequencies, 12)
    for place in (0, 3, 40, 150, 299):
        alone = harmonic_shares(KARMAN, RADII, WIND, frequencies[place : place + 1], 12)
        np.testing.assert_allclose(shares[:, place], alone[:, 0], atol=1e-4 * np.abs(alone).max())


@pytest.mark.parametrize("distance, value", [(5.0, 0.890), (20.0, 0.730), (60.0, 0.476), (120.0, 0.260)])
def test_points_across_a_ring_have_von_karmans_lateral_correlation(distance, value):
    # A slow rotor needs hundreds of harmonics, which show all that is more than a few metres apart.
    disk = disk_turbulence(KARMAN, np.array([60.0]), WIND, 0.1, 0.05, 400)
    covariance = _covariance(disk, 0, 0, 2.0 * np.arcsin(distance / 120.0))
    assert covariance == pytest.approx(value, abs=3e-3)
    assert covariance == pytest.approx(_isotropic(0.0, distance), abs=3e-3)


def test_points_of_two_rings_have_von_karmans_lateral_correlation(short):
    for (one, other), angle in itertools.product(itertools.combinations(range(4), 2), (0.0, 0.5, 2.0)):
        distance = abs(RADII[one] - RADII[other] * np.exp(1j * angle))
        assert _covariance(short, one, other, angle) == pytest.approx(_isotropic(0.0, distance), abs=5e-3)


def test_a_point_has_von_karmans_correlation_in_time_over_the_steps(short):
    for lag in (3.0, 6.0, 10.0, 20.0):
        factor = np.sinc(lag / short.period)  # of spectra averaged between frequencies
        aliased = _isotropic(WIND * (short.period - lag), 0.0) * np.sinc(1.0 - lag / short.period)
        exact = _isotropic(WIND * lag, 0.0) * factor + aliased
        assert _covariance(short, 0, 0, lag=lag) == pytest.approx(exact, abs=5e-3)


def test_what_is_left_out_lies_above_the_highest_frequency_that_a_turning_point_meets(short):
    """Directly: the share of a turning point's variance above 3 Hz, by its correlation along the helix."""
    _, density = _helix_spectrum(np.linspace(0.0, 3.0, 3001), RADII[3])
    above = 1.0 - np.trapezoid(density, dx=1e-3)
    assert short.left_out[3] == pytest.approx(above, abs=0.01)
    assert (np.diff(short.left_out) > 0.0).all()


def test_drawn_fields_have_the_variance_they_were_prepared_for():
    disk = disk_turbulence(KARMAN, RADII, WIND, SPEED, 0.5, 40000, 0.5)
    azimuth = np.linspace(0.0, 2.0 * np.pi, 6, endpoint=False)
    variance = [(w.at(np.full(disk.steps, a)) ** 2).mean(axis=0) for w in _winds(disk, 3) for a in azimuth]
    # A correlation exp(-t / T) with T = L/U gives the variance of 60000 s the relative error sqrt(2 T / 60000 s).
    error = np.sqrt(2.0 * LENGTH / WIND / 60000.0)
    np.testing.assert_allclose(np.mean(variance, axis=0), 1.0 - disk.left_out, rtol=4.0 * error)


BANDS = ((0.02, 0.05), (0.05, 0.12), (0.12, 0.3))


@pytest.mark.parametrize(
    "one, other, angle", [(2, 2, 0.0), (2, 2, 0.15), (3, 3, 0.6), (1, 2, 0.0), (0, 2, 1.0), (3, 3, np.pi)]
)
def test_points_of_drawn_fields_have_the_spectra_and_coherences(still, one, other, angle):
    distance = abs(RADII[one] - RADII[other] * np.exp(1j * angle))
    shape, densities = np.ones(8000), []
    for wind, start in itertools.product(still, (0.0, 2.1, 4.2)):
        first, second = wind.at(start * shape)[:, one], wind.at((start + angle) * shape)[:, other]
        frequency, density = csd(first, second, fs=4.0, nperseg=1024)
        densities.append(density.real)
    measured = np.mean(densities, axis=0)
    for low, high in BANDS:
        inside = (frequency >= low) & (frequency < high)
        f = frequency[inside]
        density, coherence = KARMAN.spectrum(f, WIND), KARMAN.coherence(KARMAN.decay(f, WIND) * distance)
        # Of 6000 s there are 6000 (high - low) independent values; three azimuths bring more, which are not counted.
        error = density.mean() * np.sqrt((1.0 + coherence.mean() ** 2) / (2.0 * 6000.0 * (high - low)))
        left_out = 0.04 * density.mean()  # by harmonics beyond the highest
        assert measured[inside].mean() == pytest.approx(
            (density * coherence).mean(), abs=3.0 * error + left_out
        )


SEPARATE = {"one point": (2, 2, 0.0), "6.6 m": (2, 2, 0.15), "19.1 m": (1, 2, 0.0), "36.1 m": (3, 3, 0.6)}
"""Two rings and the angle between their points [rad]."""


@pytest.fixture(scope="module", params=[40.0, 90.0])
def standing(request):
    """Hub height [m], harmonics, and 8000 s of a Kaimal field at points that stand: azimuth to wind (4, 4000, 4)."""
    disk = disk_turbulence(Kaimal(hub_height=request.param), RADII, WIND, 0.12, 0.5, 4000, 0.6)
    winds, shape = _winds(disk, 4, seed=5), np.ones(4000)
    angles = {angle for _, _, angle in SEPARATE.values()}
    return (
        request.param,
        disk.harmonics,
        {angle: np.stack([w.at(angle * shape) for w in winds]) for angle in angles},
    )


@pytest.mark.parametrize("separation", SEPARATE)
@pytest.mark.parametrize("low, high", BANDS)
def test_points_of_drawn_kaimal_fields_have_the_standards_spectrum_and_coherence(
    standing, separation, low, high
):
    """IEC 61400-1:2005, B.14 and B.16, written out; L = 8.1 Lambda is both their length, Lambda = 0.7 z to 42 m.

    His coherence has a cusp, whose harmonics fall off slowly: at one point those beyond the highest hold a tenth above
    0.12 Hz. The sum up to the highest, M, is the coherence times sin((M + 1/2) D) / (2 pi sin(D / 2)), integrated.
    """
    height, highest, winds = standing
    one, other, angle = SEPARATE[separation]
    length = 8.1 * min(0.7 * height, 42.0)
    around = (np.arange(20_000) + 0.5) * 2.0 * np.pi / 20_000
    apart = np.abs(RADII[one] - RADII[other] * np.exp(1j * (around + angle)))
    kernel = np.sin((highest + 0.5) * around) / np.sin(0.5 * around) / 20_000
    frequency, densities = csd(winds[0.0][..., one], winds[angle][..., other], fs=2.0, nperseg=512)
    inside = (frequency >= low) & (frequency < high)
    f = frequency[inside]
    density = 4.0 * length / WIND / (1.0 + 6.0 * f * length / WIND) ** (5.0 / 3.0)
    coherence = np.exp(-12.0 * apart * np.hypot(f / WIND, 0.12 / length)[:, None]) @ kernel
    # 8000 (high - low) independent values.
    error = density.mean() * np.sqrt((1.0 + coherence.mean() ** 2) / (2.0 * 8000.0 * (high - low)))
    measured = densities.mean(axis=0).real[inside].mean()
    assert measured == pytest.approx((density * coherence).mean(), abs=3.0 * error)


def _helix_spectrum(frequency, radius):
    """One-sided spectrum of a turning point, by integration of the frozen field's correlation along its helix."""
    lag = np.arange(0.0, 400.0, 2e-3)
    lag[0] = 1e-7
    correlation = _isotropic(WIND * lag, 2.0 * radius * np.abs(np.sin(0.5 * SPEED * lag)))
    padded = np.fft.rfft(np.concatenate([0.5 * correlation[:1], correlation[1:]]), 500_000)
    resolution = 1.0 / (500_000 * 2e-3)
    density = 4.0 * 2e-3 * padded.real
    return frequency, np.interp(frequency, np.arange(len(density)) * resolution, density)


def _turning_spectrum(frequency, radius, harmonics):
    """The same of the harmonics: each about as many turns a second as it has waves in a turn."""
    density = np.zeros(len(frequency))
    for m in range(-harmonics, harmonics + 1):
        met = np.abs(frequency - m * TURN)
        order = np.argsort(met)
        share = np.empty(len(met))
        share[order] = harmonic_shares(KARMAN, np.array([radius]), WIND, met[order], abs(m))[abs(m), :, 0, 0]
        density += KARMAN.spectrum(met, WIND) * share
    return density


def test_a_turning_point_meets_the_spectrum_of_its_helix():
    frequency = np.arange(0.02, 2.0, 0.011)
    harmonics = needed_harmonics(KARMAN, 61.0, WIND, SPEED, 3.0)
    _, exact = _helix_spectrum(frequency, 44.1)
    np.testing.assert_allclose(_turning_spectrum(frequency, 44.1, harmonics), exact, rtol=0.03)


def test_a_turning_point_meets_peaks_at_multiples_of_the_turns():
    for multiple in (1, 2, 3):
        near = TURN * (multiple + np.array([-0.4, 0.0, 0.4]))
        below, peak, above = _turning_spectrum(near, 44.1, 18)
        # Below 1P the slow end of the spectrum may be higher.
        assert peak > max(below if multiple > 1 else 0.0, above)


def test_a_point_that_turns_in_a_drawn_field_has_the_power_of_its_helix(turning):
    frequency, density = csd(turning, turning, fs=20.0, nperseg=4096)
    for multiple in (1, 2, 3):
        about = np.abs(frequency - multiple * TURN) < 0.04
        _, exact = _helix_spectrum(frequency[about], 44.1)
        # 4000 s of 0.08 Hz are 320 values, two thirds of which lie in the peak; four of their errors.
        assert density.real.mean(axis=0)[about].sum() == pytest.approx(exact.sum(), rel=4.0 / np.sqrt(200.0))


def test_the_harmonics_kept_hold_nine_tenths_of_what_a_tip_meets_at_the_highest_frequency():
    harmonics = needed_harmonics(KARMAN, 61.0, WIND, SPEED, 3.0)
    _, exact = _helix_spectrum(np.array([3.0]), 61.0)
    assert _turning_spectrum(np.array([3.0]), 61.0, harmonics)[0] > 0.88 * exact[0]
    assert _turning_spectrum(np.array([3.0]), 61.0, harmonics - 1)[0] < 0.92 * exact[0]


def test_on_a_disk_that_is_small_beside_the_eddies_the_wind_is_one():
    # As seen from the eddies, the same as an infinite length on a rotor of one size.
    frequencies = np.arange(300) / 100.0
    shares = harmonic_shares(KARMAN, 1e-7 * RADII, WIND, frequencies, 4)
    assert np.abs(shares[1:]).max() < 1e-6
    np.testing.assert_allclose(shares[0], 1.0, atol=1e-6)


def test_on_a_disk_that_is_small_beside_the_eddies_the_wind_is_the_homogeneous_gust():
    disk = disk_turbulence(KARMAN, 1e-7 * RADII, WIND, SPEED, 0.05, 2000)
    power = 4.0 * np.einsum("mfrk,mfrk->fr", disk.root, disk.root) * disk.period
    power[0] *= 2.0
    about = np.abs(disk.frequencies[:, None] + (np.arange(200) - 99.5) / 200.0 / disk.period)
    exact = von_karman_spectrum(about, WIND, 0.1, LENGTH).mean(axis=1) / (0.1 * WIND) ** 2
    # Four points a frequency: an average at the spectrum's knee is off by a 24th of its curvature times their distance
    # squared, 0.0017 here.
    np.testing.assert_allclose(power, np.tile(exact[:, None], 4), rtol=2e-3)


def test_components_are_the_field_at_the_three_blades(short, wind):
    azimuth = 0.3 + SPEED * 0.007 * np.arange(short.steps) + 0.1 * np.sin(np.arange(short.steps) / 300.0)
    mean, cosine, sine = np.moveaxis(wind.components(azimuth), -1, 0)
    for blade in range(3):
        angle = azimuth + 2.0 * np.pi * blade / 3.0
        met = mean + cosine * np.cos(angle)[:, None] + sine * np.sin(angle)[:, None]
        np.testing.assert_allclose(met, wind.at(angle), atol=1e-12)


def test_the_disk_at_one_step_is_the_field_at_that_step(short, wind):
    azimuth = np.linspace(0.0, 6.0, 5)
    for step in (0, 1, 1234, short.steps - 1):
        expected = [wind.at(np.full(short.steps, angle))[step] for angle in azimuth]
        np.testing.assert_allclose(wind.on_disk(step, azimuth), np.transpose(expected), atol=1e-12)


def test_the_rotor_average_is_the_mean_over_the_disk(short, wind):
    azimuth = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)
    rings = wind.on_disk(700, azimuth).mean(axis=1)
    edges = np.array([-3.5, 15.5, 34.55, 52.55, 69.45])  # midway, and as far beyond the ends
    annuli = RADII * np.diff(edges)
    assert wind.rotor_average()[700] == pytest.approx(annuli @ rings / annuli.sum(), abs=1e-12)


def test_between_coarse_steps_the_series_are_the_sums_of_their_waves(short):
    noise = np.random.default_rng(4).standard_normal(short.noise_count)
    drawn = (short.root @ noise.reshape(*short.root.shape[:3], 4)).reshape(*short.root.shape[:3], 2, 2)
    waves = drawn[..., 0] + 1j * drawn[..., 1]
    time = 0.007 * np.arange(0, short.steps, 97)
    turns = np.exp(2j * np.pi * np.outer(time, short.frequencies))
    exact = np.einsum("tf,fr->tr", turns, waves[3, :, :, 0]) + np.einsum(
        "tf,fr->tr", turns.conj(), waves[3, :, :, 1]
    )
    ours = short.draw(noise, 1.0).harmonic(3)[::97]
    np.testing.assert_allclose(ours, exact, atol=2e-4 * np.abs(exact).max())


def test_round_off_takes_nothing_from_the_variance(short):
    assert 0.0 <= short.clipped < 1e-6


def test_the_deviation_scales_a_realisation(short):
    noise = np.random.default_rng(3).standard_normal(short.noise_count)
    one, two = short.draw(noise, 1.0), short.draw(noise, 2.0)
    np.testing.assert_array_equal(2.0 * one.rotor_average(), two.rotor_average())
    np.testing.assert_array_equal(short.draw(noise, 0.0).rotor_average(), 0.0)


def test_the_same_noise_is_the_same_wind_whatever_is_drawn_beside_it(short):
    alone = _winds(short, 1, seed=5)[0]
    among = _winds(short, 3, seed=5)
    np.testing.assert_array_equal(alone.samples, among[0].samples)


def test_a_field_is_prepared_once():
    first = disk_turbulence(KAIMAL, RADII, WIND, SPEED, 0.1, 50, 1.0)
    assert disk_turbulence(Kaimal(hub_height=90.0), RADII.copy(), WIND, SPEED, 0.1, 50, 1.0) is first


@pytest.mark.parametrize(
    "given, message",
    [
        ({"radii": [0.0, 5.0]}, "^field.radii: expected 0 m < length"),
        ({"radii": [5.0, 5.0]}, "^field.radii: expected them to rise, got 5, 5 m"),
        ({"wind_speed": 0.0}, "^field.wind_speed: expected 0 m/s < speed, got 0 m/s"),
        ({"rotor_speed": 0.0}, "^field.rotor_speed: expected 0 deg/s < angular rate, got 0 deg/s"),
        ({"time_step": 0.2}, "^field.time_step: expected 0 s < time <= 0.1666.* s, got 0.2 s"),
        ({"steps": 0}, "^field.steps: expected a whole number of at least 1, got 0"),
        ({"highest_frequency": -1.0}, "^field.highest_frequency: expected 0 Hz < frequency, got -1 Hz"),
    ],
)
def test_what_cannot_be_prepared_is_refused_by_name(given, message):
    asked = {"radii": RADII, "wind_speed": WIND, "rotor_speed": SPEED, "time_step": 0.007, "steps": 100}
    with pytest.raises(ValueError, match=message):
        disk_turbulence(KARMAN, **{**asked, **given})


def test_noise_of_another_length_is_refused(short):
    with pytest.raises(ValueError, match=r"^noise: expected the shape \(\d+,\), got \(3,\)"):
        short.draw(np.zeros(3), 1.0)
