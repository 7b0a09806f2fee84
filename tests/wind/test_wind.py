"""The wind as one object: from a mapping and back, what is known of it in advance, and a kind of one's own."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
import pytest

from flapgym.core.fields import Quantity, check_fields, from_plain, to_plain
from flapgym.wind import Wind
from flapgym.wind.gusts import GUSTS, ExtremeOperatingGust, Step

TIME = np.arange(-1, 2000) * 0.007
MEAN = 11.0


@dataclass(frozen=True)
class Bell:
    """The example of `flapgym.wind.wind`."""

    kind: ClassVar[str] = "bell"
    size: Annotated[float, Quantity("speed", at_least=-20.0, at_most=20.0)]
    middle: Annotated[float, Quantity("time", at_least=0.0)] = 10.0
    width: Annotated[float, Quantity("time", above=0.0)] = 2.0

    def __post_init__(self) -> None:
        check_fields(self, "gust")

    def wind(self, time, mean):
        return self.size * np.exp(-0.5 * ((time - self.middle) / self.width) ** 2)


def test_a_mapping_makes_the_wind_that_writes_it():
    plain = {
        "turbulence_intensity": [0.1, 0.2],
        "length_scale": 170.0,
        "gust": {"kind": "step", "size": 1.0, "start": 2.0},
    }
    wind = from_plain(Wind, plain, "wind")
    assert wind == Wind((0.1, 0.2), 170.0, Step(1.0, 2.0))
    assert json.loads(json.dumps(to_plain(wind))) == plain
    assert from_plain(Wind, {}) == Wind()


def test_an_environment_has_the_intensity_of_all_its_own_or_the_model_s():
    np.testing.assert_array_equal(Wind().intensities(2, 0.07), [0.07, 0.07])
    np.testing.assert_array_equal(Wind(0.1).intensities(2, 0.07), [0.1, 0.1])
    np.testing.assert_array_equal(Wind((0.1, 0.2)).intensities(2, 0.07), [0.1, 0.2])
    with pytest.raises(ValueError, match=r"^wind.turbulence_intensity: .* each of 3 environments, got 2"):
        Wind((0.1, 0.2)).intensities(3, 0.07)


def test_without_a_gust_nothing_is_known_in_advance():
    np.testing.assert_array_equal(Wind(0.1).given(TIME, MEAN), np.zeros(TIME.shape))


@pytest.mark.parametrize(
    "gust",
    [
        {"kind": "step", "size": 1.0},
        {"kind": "ramp", "size": -2.0, "duration": 3.0},
        {"kind": "sinusoid", "amplitude": 1.0, "frequency": 0.3},
        {"kind": "extreme_operating_gust", "rotor_diameter": 126.0, "hub_height": 90.0},
    ],
)
def test_a_gust_is_given_as_its_class_has_it(gust):
    expected = GUSTS[gust["kind"]](**{key: gust[key] for key in gust if key != "kind"}).wind(TIME, MEAN)
    np.testing.assert_array_equal(Wind(gust=gust).given(TIME, MEAN), expected)


def test_the_extreme_gust_takes_the_size_of_the_turbine_it_strikes():
    wind = Wind(gust={"kind": "extreme_operating_gust"})
    expected = ExtremeOperatingGust(rotor_diameter=100.0, hub_height=80.0).wind(TIME, MEAN)
    np.testing.assert_array_equal(wind.given(TIME, MEAN, 100.0, 80.0), expected)
    with pytest.raises(ValueError, match=r"^gust.hub_height: .*give it in m"):
        wind.given(TIME, MEAN, rotor_diameter=100.0)


def test_a_sinusoid_that_the_samples_would_show_as_a_slower_one_is_refused():
    wind = Wind(gust={"kind": "sinusoid", "amplitude": 1.0, "frequency": 6.0})
    assert wind.given(TIME, MEAN).max() == pytest.approx(1.0, abs=0.01)
    with pytest.raises(ValueError, match="gust.frequency: expected at most 5 Hz"):
        wind.given(np.arange(100) * 0.1, MEAN)


def test_a_kind_of_one_s_own_is_an_object_with_wind():
    gust = Wind(turbulence_intensity=0.0, gust=Bell(3.0)).given(TIME, MEAN)
    assert TIME[gust.argmax()] == pytest.approx(10.0, abs=0.007)
    assert gust.max() == pytest.approx(3.0, rel=1e-5)
    with pytest.raises(ValueError, match="gust.size: expected a speed from -20 to 20 m/s, got 21 m/s"):
        Bell(21.0)


@pytest.mark.parametrize(
    "values, message",
    [
        ([1.0, np.nan, 0.0], r"gust own: expected a speed from -100 to 100 m/s, got nan m/s at \[1\]"),
        ([1.0], "gust own: expected wind at 3 times, got 1"),
        (1.0, "gust own: expected one or more numbers along 1 axis"),
        ([1e3, 0.0, 0.0], "gust own: expected a speed from -100 to 100 m/s, got 1000 m/s"),
    ],
)
def test_what_a_kind_of_one_s_own_gives_is_checked(values, message):
    class Own:
        kind = "own"

        def wind(self, time, mean):
            return np.array(values)

    with pytest.raises(ValueError, match=message):
        Wind(gust=Own()).given(np.zeros(3), MEAN)


@pytest.mark.parametrize(
    "given, message",
    [
        ({"intensity": 0.1}, "^wind.intensity: unknown key; did you mean 'turbulence_intensity'"),
        ({"turbulence_intensity": 10.0}, "^wind.turbulence_intensity: expected 0 <= fraction < 1, got 10"),
        ({"length_scale": 0.0}, "^wind.length_scale: expected a length from 1 to 100000 m, got 0 m"),
        ({"gust": {"kind": "gale"}}, "^wind.gust.kind: expected one of 'step'"),
        ({"gust": {"kind": "step", "size": 1e9}}, "^wind.gust.size: expected a speed from -100 to 100 m/s"),
        ({"pool": -1}, "^wind.pool: expected a whole number from 0 to 1000000, got -1"),
        ({"pool": 3, "gust": {"kind": "step", "size": 1.0}}, "^wind.pool: expected 0 beside a gust"),
    ],
)
def test_a_wind_that_cannot_be_is_refused_by_its_field(given, message):
    with pytest.raises(ValueError, match=message):
        from_plain(Wind, given, "wind")
