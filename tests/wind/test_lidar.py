"""What a lidar sees: against what blades meet later, closed forms of the field's cross-spectra, and waves by hand."""

import numpy as np
import pytest

from flapgym.wind import Kaimal, Lidar, VonKarman, WindBox
from flapgym.wind.blade_field import blade_turbulence
from flapgym.wind.disk import annulus_weights
from flapgym.wind.upwind import seen_of_box, seen_of_gust, upwind_turbulence

WIND, SPEED = 11.0, 1.2
RADII = np.array([12.0, 28.0, 44.0, 60.0])
KAIMAL, KARMAN = Kaimal(hub_height=90.0), VonKarman(0.1, 147.0)
SCALE = 8.1 * 42.0
"""Of Kaimal's coherence 90 m above the ground (IEC 61400-1:2005, annex B.2) [m]."""
FROZEN = {"range": 110.0, "probe_length": 0.0, "decay": 0.0}
RNG = np.random.default_rng(8)


def _drawn(upwind, rng):
    return rng.standard_normal(upwind.turbulence.noise_count), rng.standard_normal(upwind.noise_count)


@pytest.mark.parametrize("field", [KAIMAL, KARMAN])
def test_a_beam_sees_of_a_frozen_field_what_a_blade_meets_there_when_it_arrives(field):
    blades = blade_turbulence(field, RADII, WIND, SPEED, 150.0)
    lidar = Lidar(radius=RADII[2], beams=4, **FROZEN)
    upwind, azimuth = upwind_turbulence(field, blades, WIND, SPEED, lidar), 0.4
    noise, own = _drawn(upwind, np.random.default_rng(1))
    own[-2 * upwind.unmet.size :] = 0.0  # what the blades would meet too fast
    # Blade 1 passes a beam after every quarter of a turn.
    number = np.arange(60)
    time = (0.5 * np.pi * number - azimuth) / SPEED
    waves = blades.waves(noise)[:, 2]
    zero, cosine, sine = (np.exp(2j * np.pi * np.outer(time, blades.frequencies)) @ waves).real.T
    place = azimuth + SPEED * time
    met = zero + cosine * np.cos(place) + sine * np.sin(place)
    seen = upwind.seen(noise, own, time, azimuth)[number, number % 4]
    np.testing.assert_allclose(seen, met, atol=1e-6)


def _decay(frequency):
    return 12.0 * np.hypot(frequency / WIND, 0.12 / SCALE)


def _between_rings(one, other, frequency):
    """Mean over both rings of the coherence between their points, by rectangles over the azimuth between them."""
    apart = 2.0 * np.pi * (np.arange(2000) + 0.5) / 2000
    distance = np.sqrt(one**2 + other**2 - 2.0 * one * other * np.cos(apart))
    return np.exp(-_decay(frequency) * distance).mean()


def _spectra(lidar, frequency):
    """Of the beams' mean with the mean over the disk, and of each, by direct integration; but for common factors."""
    point = (1.0 + 6.0 * frequency * SCALE / WIND) ** (-5.0 / 3.0)
    weights = annulus_weights(RADII)
    disk = np.array([[_between_rings(a, b, frequency) for b in RADII] for a in RADII])
    shared = np.array([_between_rings(a, lidar.radius, frequency) for a in RADII]) @ weights
    chords = 2.0 * lidar.radius * np.sin(np.pi * np.arange(lidar.beams) / lidar.beams)
    beams = np.exp(-_decay(frequency) * chords).mean()
    like = np.exp(-0.5 * lidar.decay * frequency * lidar.range / WIND)
    spread = 30.0 * lidar.projection / np.sqrt(8.0 * np.log(2.0)) / WIND
    smooth = np.exp(-0.5 * (2.0 * np.pi * frequency * spread) ** 2)
    return point * np.array([like * smooth * shared, smooth**2 * beams, weights @ disk @ weights])


@pytest.mark.parametrize("distance", [60.0, 150.0])
@pytest.mark.parametrize("beams", [2, 5])
def test_the_mean_of_the_beams_is_as_like_the_rotors_as_the_cross_spectra_say(distance, beams):
    blades = blade_turbulence(KAIMAL, RADII, WIND, SPEED, 400.0)
    lidar = Lidar(range=distance, radius=36.0, beams=beams, decay=1.0)
    upwind = upwind_turbulence(KAIMAL, blades, WIND, SPEED, lidar)
    samples = 512  # over the whole period
    time, rng, half = 400.0 / samples * np.arange(samples), np.random.default_rng(beams), 120
    both, of_lidar, of_rotor = np.zeros(half, dtype=complex), np.zeros(half), np.zeros(half)
    for _ in range(150):
        noise, own = _drawn(upwind, rng)
        seen = lidar.projection * upwind.seen(noise, own, time, 0.0) @ lidar.estimator[0]
        waves = np.fft.rfft(seen)[:half] / samples
        mean = (blades.root[:half, 0] @ blades.parts(noise)[:half, 0, :, None])[..., 0] @ annulus_weights(
            RADII
        )
        both += waves * mean.conj()
        of_lidar += np.abs(waves) ** 2
        of_rotor += np.abs(mean) ** 2
    for band in (slice(5, 11), slice(17, 25), slice(35, 47)):
        frequency = np.arange(band.start, band.stop) / 400.0
        found = np.abs(both[band].sum()) ** 2 / (of_lidar[band].sum() * of_rotor[band].sum())
        cross, *own = np.sum([_spectra(lidar, f) for f in frequency], axis=0)
        exact = cross**2 / np.prod(own)
        # Of 150 draws of so many waves, three deviations.
        count = 150 * len(frequency)
        assert found == pytest.approx(exact, abs=3.0 * np.sqrt(2.0 * exact / count) * (1.0 - exact) + 0.005)


def test_wind_that_changes_on_its_way_is_as_strong_as_frozen_wind():
    blades = blade_turbulence(KAIMAL, RADII, WIND, SPEED, 100.0)
    of_both = []
    for decay in (0.0, 5.0):
        lidar = Lidar(range=100.0, radius=30.0, decay=decay)
        upwind = upwind_turbulence(KAIMAL, blades, WIND, SPEED, lidar)
        of_both.append(
            [
                np.einsum("fhr,fhr->fh", regression, regression) + np.einsum("fhr,fhr->fh", rest, rest)
                for regression, rest in zip(upwind.regression, upwind.rest, strict=True)
            ]
        )
    for frozen, changed in zip(*of_both, strict=True):
        np.testing.assert_allclose(frozen, changed, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize(("radius", "beams"), [(30.0, 4), (0.0, 1)])
def test_where_a_beam_measures_the_wind_is_as_strong_as_the_field_but_for_what_is_fast(radius, beams):
    blades = blade_turbulence(KAIMAL, RADII, WIND, SPEED, 400.0)
    lidar = Lidar(radius=radius, beams=beams, **FROZEN)
    upwind = upwind_turbulence(KAIMAL, blades, WIND, SPEED, lidar)
    assert np.isfinite(upwind.seen(*_drawn(upwind, RNG), np.arange(9.0), 0.0)).all()
    variance = sum(
        np.einsum("fhr,fhr->", a, a) + np.einsum("fhr,fhr->", b, b)
        for a, b in zip(upwind.regression, upwind.rest, strict=True)
    )
    # Of Kaimal's spectrum (1 + 6 f L / U)^-(5/3) up to 3 Hz.
    slow = 1.0 - (1.0 + 6.0 * 3.0 * SCALE / WIND) ** (-2.0 / 3.0)
    assert variance + (upwind.unmet**2).sum() == pytest.approx(slow, abs=2e-3)


def test_beams_see_a_wave_in_a_box_range_over_wind_earlier():
    step, places = 0.25, np.linspace(-70.0, 70.0, 5)
    moments = step * np.arange(400)
    wave = np.sin(2.0 * np.pi * 0.11 * moments)
    box = WindBox(np.broadcast_to(wave[:, None, None], (400, 5, 5)).copy(), places, places, step, WIND)
    lidar = Lidar(radius=50.0, **FROZEN)
    time = np.arange(0.0, 20.0, step)
    _, arrival = lidar.schedule(time, WIND)
    seen = seen_of_box(box, 5.0, lidar, arrival)
    expected = np.sin(2.0 * np.pi * 0.11 * (5.0 + time + 10.0))
    np.testing.assert_allclose(seen, np.repeat(expected[:, None], 4, axis=1), atol=1e-12)


def test_a_mean_along_the_beam_of_a_box_lowers_a_wave_as_its_transfer_says():
    step, places = 0.25, np.linspace(-70.0, 70.0, 5)
    slope = 0.03 * step * np.arange(800)
    box = WindBox(np.broadcast_to(slope[:, None, None], (800, 5, 5)).copy(), places, places, step, WIND)
    lidar = Lidar(range=110.0, radius=50.0, decay=0.0)
    # A straight rise keeps its value, and a wave loses what `averaging` says.
    np.testing.assert_allclose(seen_of_box(box, 50.0, lidar, np.array([10.0]))[0], 0.03 * 60.0, rtol=1e-9)
    before, weights = lidar.along(WIND)
    for frequency in (0.02, 0.1, 0.3):
        assert weights @ np.cos(2.0 * np.pi * frequency * before) == pytest.approx(
            lidar.averaging(np.array([frequency]), WIND)[0], abs=1e-3
        )


def test_the_weights_along_a_beam_are_half_as_high_half_the_probe_length_from_the_middle():
    lidar = Lidar(range=40.0, radius=30.0, probe_length=25.0)  # a cosine of 0.8
    before, weights = lidar.along(WIND)
    half = np.interp(0.5 * 0.8 * 25.0 / WIND, before, weights)
    assert half == pytest.approx(0.5 * weights.max(), rel=5e-3)


@pytest.mark.parametrize("frequency", [0.05, 0.2])
def test_of_a_homogeneous_wave_likeness_and_averaging_are_left(frequency):
    lidar, step = Lidar(range=110.0, radius=0.0, beams=1, decay=1.5), 0.01
    time = step * np.arange(12000)
    wave = np.cos(
        2.0 * np.pi * frequency * (time - time[-1])
    )  # whole half periods from end to end, but for a sample
    spread = 30.0 / np.sqrt(8.0 * np.log(2.0)) / WIND
    smooth = np.exp(-0.5 * (2.0 * np.pi * frequency * spread) ** 2)
    like = np.exp(-0.5 * 1.5 * frequency * 10.0)
    middle = slice(3000, 9000)
    none = np.zeros(len(time))
    for winds, share in (((wave, none), like), ((none, wave), np.sqrt(1.0 - like**2))):
        seen = seen_of_gust(*winds, lidar, WIND, step)
        np.testing.assert_allclose(seen[middle], share * smooth * wave[middle], atol=2e-3)


def test_a_frozen_homogeneous_wind_is_seen_as_it_is():
    wind = RNG.standard_normal(500)
    seen = seen_of_gust(wind, RNG.standard_normal(500), Lidar(radius=0.0, beams=1, **FROZEN), WIND, 0.01)
    np.testing.assert_allclose(seen, wind, atol=1e-12)


@pytest.mark.parametrize(("beams", "told"), [(1, 1), (2, 2), (3, 3), (5, 3)])
def test_the_estimates_are_a_linear_wind_as_far_as_the_beams_tell(beams, told):
    lidar, wind = Lidar(range=40.0, radius=30.0, beams=beams), np.array([0.7, -1.3, 0.4])
    wind[told:] = 0.0
    at_beams = wind[0] + wind[1] * np.cos(lidar.azimuths) + wind[2] * np.sin(lidar.azimuths)
    np.testing.assert_allclose(lidar.estimator @ (0.8 * at_beams), wind, atol=1e-12)


def test_the_newest_measurement_is_held_and_comes_late():
    lidar = Lidar(range=110.0, radius=0.0, beams=1, sample_rate=2.0, delay=0.3)
    newest, arrival = lidar.schedule(np.array([0.0, 0.2, 0.3, 0.7, 0.8, 1.2]), WIND)
    assert newest.tolist() == [0, 0, 1, 1, 2, 2]
    np.testing.assert_allclose(arrival, [9.5, 10.0, 10.5])


@pytest.mark.parametrize(
    ("fields", "line"),
    [
        ({"range": 0.0}, "lidar.range: expected a length from 1 to 1000 m, got 0 m"),
        ({"radius": -1.0}, "lidar.radius: expected"),
        ({"beams": 0}, "lidar.beams: expected"),
        ({"radius": 0.0}, "lidar.beams: expected 1 at radius 0, where all are the same, got 4"),
        ({"probe_length": "30"}, "lidar.probe_length: expected"),
        ({"decay": -0.1}, "lidar.decay: expected"),
        ({"sample_rate": 0.0}, "lidar.sample_rate: expected"),
        ({"delay": float("nan")}, "lidar.delay: expected"),
        ({"noise": -1.0}, "lidar.noise: expected"),
    ],
)
def test_a_lidar_that_cannot_be_is_refused_in_one_line(fields, line):
    with pytest.raises(ValueError) as refusal:
        Lidar(**{"range": 100.0, "radius": 40.0, **fields})
    assert str(refusal.value).startswith(line)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("fields", "line"),
    [
        ({"delay": 9.9}, "lidar.delay: expected at most 9.75 s"),
        ({"range": 2.0}, "lidar.range: expected at least 2.75 m"),
        ({"range": 400.0}, "lidar.range: expected at most 330 m, 30 s of this wind, got 400 m"),
    ],
)
def test_a_lidar_that_tells_too_late_or_sees_too_far_is_refused(fields, line):
    with pytest.raises(ValueError) as refusal:
        Lidar(**{"range": 110.0, "radius": 40.0, **fields}).require_ahead(WIND, 30.0)
    assert str(refusal.value).startswith(line)
