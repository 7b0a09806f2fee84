"""Spectral bands against Parseval's theorem and sinusoids of known frequency."""

from dataclasses import astuple

import numpy as np
import pytest

from flapgym.evaluation.bands import bands

ROTOR_SPEED, TIME_STEP = 1.2, 0.01
REVOLUTION = 2.0 * np.pi / ROTOR_SPEED


def _time(revolutions):
    return TIME_STEP * np.arange(round(revolutions * REVOLUTION / TIME_STEP))


@pytest.mark.parametrize("revolutions", [1, 2, 7, 8, 51])
def test_squares_of_the_bands_add_up_to_the_variance(revolutions):
    series = 3.0 + np.random.default_rng(revolutions).standard_normal((2, 3, _time(revolutions).size))
    found = bands(series, TIME_STEP, ROTOR_SPEED)
    total = sum(np.square(band) for band in astuple(found))
    np.testing.assert_allclose(total, series.var(axis=-1), rtol=1e-12)


@pytest.mark.parametrize(
    ("order", "band"),
    [(0.25, "slow"), (1, "once"), (1.3, "once"), (2, "twice"), (3, "thrice"), (4, "fast"), (20, "fast")],
)
def test_a_sinusoid_lies_in_its_band(order, band):
    found = bands(2.0 * np.sin(order * ROTOR_SPEED * _time(40) + 0.4), TIME_STEP, ROTOR_SPEED)
    # Half a time step in forty revolutions is all that a period may be off.
    for name in ("slow", "once", "twice", "thrice", "fast"):
        expected = np.sqrt(2.0) if name == band else 0.0
        assert getattr(found, name) == pytest.approx(expected, abs=2e-3), name


def test_loads_once_and_twice_a_revolution_are_told_apart_whatever_is_left_of_a_revolution():
    time = _time(30.6)
    series = 5.0 + 2.0 * np.cos(ROTOR_SPEED * time) + 0.02 * np.sin(2.0 * ROTOR_SPEED * time)
    found = bands(series, TIME_STEP, ROTOR_SPEED)
    assert found.once == pytest.approx(np.sqrt(2.0), rel=1e-3)
    assert found.twice == pytest.approx(0.02 / np.sqrt(2.0), rel=2e-2)


def test_a_line_on_an_edge_belongs_to_the_band_above():
    found = bands(np.sin(0.5 * ROTOR_SPEED * _time(20)), TIME_STEP, ROTOR_SPEED)
    assert found.once == pytest.approx(np.sqrt(0.5), rel=1e-3)


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        (
            {"series": np.zeros(100)},
            r"bands.series: expected a revolution of 523\.6 samples or more, got 100",
        ),
        ({"series": [np.nan]}, "bands.series: expected a finite number"),
        ({"time_step": 0.0}, "bands.time_step: expected 0 s < time"),
        ({"rotor_speed": -1.0}, "bands.rotor_speed"),
    ],
)
def test_what_has_no_bands_is_refused(changed, text):
    given = {"series": np.zeros(1000), "time_step": TIME_STEP, "rotor_speed": ROTOR_SPEED} | changed
    with pytest.raises(ValueError, match=text):
        bands(**given)
