"""The extreme gusts of IEC 61400-1:2005, 6.3.2, against the standard's formulas and values at given instants."""

from __future__ import annotations

import numpy as np
import pytest

from flapgym.wind import Wind, gust_of
from flapgym.wind.gusts import (
    ExtremeCoherentGust,
    ExtremeDirectionChange,
    ExtremeOperatingGust,
    ExtremeWindShear,
    gust_components,
    gust_on_disk,
)

SIZE = {"rotor_diameter": 126.0, "hub_height": 90.0}  # Lambda_1 = 42 m, D / Lambda_1 = 3
RADII = np.array([10.0, 63.0])
DEGREE = np.pi / 180.0


@pytest.mark.parametrize("letter, intensity", [("A", 0.16), ("B", 0.14), ("C", 0.12)])
@pytest.mark.parametrize("mean", [4.0, 11.0, 25.0])
def test_the_direction_changes_by_four_times_an_arc_tangent(letter, intensity, mean):
    sigma = intensity * (0.75 * mean + 5.6)
    found = ExtremeDirectionChange(turbulence_class=letter, **SIZE).magnitude(mean)
    assert found == pytest.approx(4.0 * np.arctan(sigma / (mean * 1.3)))


def test_the_direction_change_of_a_small_turbine_in_25_m_s_is_the_one_worked_by_hand():
    # D = 42 m, z_hub = 30 m: Lambda_1 = 21 m, sigma_1 = 0.16 * 24.35 = 3.896 m/s,
    # theta_e = 4 arctan(3.896 / (25 * 1.2)) = 29.6 deg.
    gust = ExtremeDirectionChange(rotor_diameter=42.0, hub_height=30.0)
    assert gust.magnitude(25.0) / DEGREE == pytest.approx(29.6, abs=0.05)


def test_the_direction_change_turns_within_six_seconds_and_stays():
    gust = ExtremeDirectionChange(start=2.0, **SIZE)
    found = gust.direction(np.array([0.0, 2.0, 3.5, 5.0, 8.0, 50.0]), 11.0)
    # (1 - cos(pi/4)) / 2 = 0.14645 after a quarter of the time.
    np.testing.assert_allclose(
        found, gust.magnitude(11.0) * np.array([0.0, 0.0, 0.5 - 0.5**1.5, 0.5, 1.0, 1.0]), atol=1e-12
    )


def test_a_change_to_the_right_turns_the_other_way_and_takes_the_same_off_the_wind():
    time = np.linspace(0.0, 10.0, 50)
    left, right = (ExtremeDirectionChange(turns=side, **SIZE) for side in ("left", "right"))
    np.testing.assert_array_equal(left.direction(time, 11.0), -right.direction(time, 11.0))
    np.testing.assert_array_equal(left.wind(time, 11.0), right.wind(time, 11.0))
    expected = 11.0 * (np.cos(left.magnitude(11.0)) - 1.0)
    assert left.wind(np.array([6.0]), 11.0)[0] == pytest.approx(expected)


@pytest.mark.parametrize(
    "mean, degrees", [(3.0, 180.0), (4.0, 180.0), (5.0, 144.0), (10.0, 72.0), (25.0, 28.8)]
)
def test_the_coherent_gust_turns_by_720_deg_over_the_wind_speed_at_most_180(mean, degrees):
    assert ExtremeCoherentGust().magnitude(mean) / DEGREE == pytest.approx(degrees)


def test_the_coherent_gust_rises_by_15_m_s_within_ten_seconds():
    # The rise is what stands when the direction's cosine is taken out: V = (V_hub + u) / cos(theta).
    gust, mean, time = ExtremeCoherentGust(start=1.0), 20.0, np.array([0.0, 1.0, 3.5, 6.0, 11.0, 40.0])
    speed = (mean + gust.wind(time, mean)) / np.cos(gust.direction(time, mean))
    np.testing.assert_allclose(speed - mean, [0.0, 0.0, 15.0 * (0.5 - 0.5**1.5), 7.5, 15.0, 15.0], atol=1e-12)
    assert gust.wind(np.array([11.0]), mean)[0] == pytest.approx(35.0 * np.cos(36.0 * DEGREE) - 20.0)


def test_the_extreme_shear_has_the_standard_s_amplitude_at_the_rotor_s_edge():
    # Half a diameter from the hub at half time: (1/2) (2.5 + 0.2 * 6.4 * sigma_1 * 3^(1/4)) * 2, sigma_1 = 2.216 m/s.
    gust = ExtremeWindShear(**SIZE)
    amplitude = 2.5 + 0.2 * 6.4 * 0.16 * (0.75 * 11.0 + 5.6) * 3.0**0.25
    found = gust_on_disk(gust, np.array([6.0]), np.array([63.0]), np.array([0.0, np.pi]), 11.0)
    np.testing.assert_allclose(found[0, 0], [amplitude, -amplitude])
    assert amplitude == pytest.approx(6.233, abs=1e-3)


def test_the_extreme_shear_comes_and_goes_within_twelve_seconds():
    slope = ExtremeWindShear(start=2.0, **SIZE).slope(np.array([0.0, 2.0, 5.0, 8.0, 11.0, 14.0, 20.0]), 11.0)
    np.testing.assert_allclose(slope / slope.max(), [0.0, 0.0, 0.5, 1.0, 0.5, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    "side, above, left", [("above", 1.0, 0.0), ("below", -1.0, 0.0), ("left", 0.0, 1.0), ("right", 0.0, -1.0)]
)
def test_the_extreme_shear_is_linear_in_height_or_to_the_side(side, above, left):
    gust, azimuth, time = (
        ExtremeWindShear(stronger=side, **SIZE),
        np.linspace(0.0, 6.0, 13),
        np.array([1.0, 6.0]),
    )
    up, leftwards = np.outer(RADII, np.cos(azimuth)), -np.outer(RADII, np.sin(azimuth))
    expected = gust.slope(time, 11.0)[:, None, None] * (above * up + left * leftwards)
    np.testing.assert_allclose(gust_on_disk(gust, time, RADII, azimuth, 11.0), expected, atol=1e-12)


@pytest.mark.parametrize(
    "gust", [ExtremeOperatingGust(rotor_diameter=126.0, hub_height=90.0), ExtremeCoherentGust()]
)
def test_a_gust_that_is_the_same_over_the_disk_is_the_first_component(gust):
    time = np.linspace(-1.0, 12.0, 27)
    found = gust_components(gust, time, RADII, 11.0)
    np.testing.assert_array_equal(found[..., 0], np.repeat(gust.wind(time, 11.0)[:, None], 2, axis=1))
    assert not found[..., 1:].any()


def test_the_extreme_shear_leaves_the_hub_alone():
    gust = ExtremeWindShear(**SIZE)
    assert not gust.wind(np.linspace(0.0, 12.0, 20), 11.0).any()


def test_the_extreme_shear_is_refused_where_one_wind_stands_for_the_disk():
    with pytest.raises(
        ValueError, match="^gust.kind: expected a gust that is the same .* got extreme_wind_shear"
    ):
        Wind(gust={"kind": "extreme_wind_shear"}).given(np.zeros(3), 11.0, 126.0, 90.0)


def test_the_direction_change_takes_the_size_of_the_turbine_it_strikes():
    time = np.linspace(0.0, 8.0, 20)
    found = Wind(gust={"kind": "extreme_direction_change"}).given(time, 11.0, 126.0, 90.0)
    np.testing.assert_array_equal(found, ExtremeDirectionChange(**SIZE).wind(time, 11.0))


@pytest.mark.parametrize("kind", ["extreme_direction_change", "extreme_wind_shear"])
def test_an_extreme_gust_without_the_turbine_s_size_is_refused(kind):
    gust = gust_of({"kind": kind, "rotor_diameter": 126.0})
    with pytest.raises(ValueError, match="^gust.hub_height: the model's case does not tell it; give it in m"):
        gust_components(gust, np.zeros(1), RADII, 11.0)


@pytest.mark.parametrize(
    "spec, message",
    [
        (
            {"kind": "extreme_direction_change", "turns": "up"},
            "^gust.turns: expected 'left' or 'right', got 'up'",
        ),
        ({"kind": "extreme_coherent_gust", "start": "now"}, "^gust.start: expected a time"),
        ({"kind": "extreme_wind_shear", "stronger": "ahead"}, "^gust.stronger: expected one of 'above'"),
        ({"kind": "extreme_wind_shear", "turbulence_class": "D"}, "^gust.turbulence_class"),
    ],
)
def test_an_impossible_extreme_gust_is_refused_by_name(spec, message):
    with pytest.raises(ValueError, match=message):
        gust_of(spec)
