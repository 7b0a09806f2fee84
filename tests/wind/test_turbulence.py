"""Spectra and coherences against closed formulas and integration; strengths against the standard's numbers."""

import json

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import gamma, kv

from flapgym.core.fields import to_plain
from flapgym.wind.iec import extreme_turbulence, normal_turbulence, turbulence_scale
from flapgym.wind.spectrum import von_karman_spectrum
from flapgym.wind.turbulence import Kaimal, VonKarman, turbulence_of

WIND, LENGTH = 11.0, 147.0
FIELDS = [VonKarman(0.1, LENGTH), Kaimal(hub_height=90.0)]


@pytest.mark.parametrize("field", FIELDS)
def test_the_spectrum_holds_the_variance_once(field):
    total, _ = quad(lambda f: float(field.spectrum(np.array([f]), WIND)[0]), 0.0, np.inf, limit=200)
    assert total == pytest.approx(1.0, abs=2e-4)  # von Karman's 70.8 is rounded


def test_von_karmans_spectrum_at_a_point_is_that_of_the_homogeneous_gust():
    frequency = np.geomspace(1e-3, 10.0, 20)
    ours = FIELDS[0].deviation(WIND) ** 2 * FIELDS[0].spectrum(frequency, WIND)
    np.testing.assert_allclose(ours, von_karman_spectrum(frequency, WIND, 0.1, LENGTH), rtol=1e-12)


def test_kaimals_spectrum_has_the_standards_values():
    # L = 8.1 * 42 m = 340.2 m, 30.93 s at 11 m/s: f S = 4 n / (1 + 6 n)^(5/3) at n = f L/U.
    np.testing.assert_allclose(
        FIELDS[1].spectrum(np.array([0.0, WIND / 340.2]), WIND),
        340.2 / WIND * 4.0 * np.array([1.0, 7.0 ** (-5 / 3)]),
    )


@pytest.mark.parametrize("field", FIELDS)
def test_a_point_is_coherent_with_itself_and_with_none_far_away(field):
    np.testing.assert_allclose(field.coherence(np.array([0.0])), 1.0, rtol=1e-14)
    assert np.abs(field.coherence(np.array([1e-9])) - 1.0) < 1e-8
    np.testing.assert_allclose(field.coherence(np.array([60.0, 1e3, 1e6])), 0.0, atol=1e-20)


def test_kaimals_coherence_has_the_standards_values():
    # exp(-12 sqrt((f d/U)^2 + (0.12 d/L)^2)), at zero frequency and far above U/L.
    field, distance = FIELDS[1], 30.0
    at_rest, at_one = field.coherence(field.decay(np.array([0.0, 1.0]), WIND) * distance)
    assert at_rest == pytest.approx(np.exp(-12.0 * 0.12 * 30.0 / 340.2))
    assert at_one == pytest.approx(np.exp(-12.0 * 30.0 / 11.0), rel=1e-3)


@pytest.mark.parametrize("distance, value", [(5.0, 0.890), (20.0, 0.730), (60.0, 0.476), (120.0, 0.260)])
def test_von_karmans_cross_spectra_integrate_to_his_lateral_correlation(distance, value):
    """g(d) = 2^(2/3)/Gamma(1/3) x^(1/3) (K_1/3(x) - x/2 K_2/3(x)), x = d / (1.339 L): rounded constants leave 0.002."""
    x = distance / (1.339 * LENGTH)
    g = 2.0 ** (2 / 3) / gamma(1 / 3) * x ** (1 / 3) * (kv(1 / 3, x) - 0.5 * x * kv(2 / 3, x))
    assert g == pytest.approx(value, abs=1e-3)
    field = FIELDS[0]

    def cross(log_frequency):
        f = np.exp(np.array([log_frequency]))
        return float((f * field.spectrum(f, WIND) * field.coherence(field.decay(f, WIND) * distance))[0])

    total, _ = quad(cross, np.log(1e-7), np.log(50.0), limit=200)
    assert total == pytest.approx(g, abs=2e-3)


def test_von_karmans_coherence_is_negative_where_isotropy_wants_it():
    coherence = FIELDS[0].coherence(np.array([2.2, 2.3, 3.36, 10.0]))
    assert coherence[0] > 0.0 > coherence[1]
    # The lateral transform of k^2 / (k^2 + 1)^(17/6), normalised: integrated over a plane, it vanishes.
    total, _ = quad(lambda e: float(FIELDS[0].coherence(np.array([e]))[0]) * e, 0.0, 60.0, limit=200)
    assert total == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("letter, intensity", [("A", 0.16), ("B", 0.14), ("C", 0.12)])
def test_normal_turbulence_at_15_m_s_is_18_percent_of_the_reference_and_more(letter, intensity):
    assert normal_turbulence(letter, 15.0) == pytest.approx(intensity * 16.85)
    assert Kaimal(turbulence_class=letter).deviation(15.0) == pytest.approx(intensity * 16.85)


@pytest.mark.parametrize(
    "turbine_class, mean, sigma",
    # 2 * 0.16 * (0.072 (V_ave/2 + 3) (U/2 - 4) + 10), by hand, V_ave = 10, 8.5, 7.5 m/s.
    [("I", 11.0, 3.47648), ("II", 11.0, 3.45056), ("III", 25.0, 4.52192)],
)
def test_extreme_turbulence_has_the_standards_values(turbine_class, mean, sigma):
    assert extreme_turbulence(turbine_class, "A", mean) == pytest.approx(sigma)
    assert Kaimal(turbulence="ETM", turbine_class=turbine_class).deviation(mean) == pytest.approx(sigma)


def test_the_scale_grows_with_the_hub_up_to_60_m():
    assert [turbulence_scale(height) for height in (40.0, 60.0, 90.0)] == pytest.approx([28.0, 42.0, 42.0])


def test_a_given_intensity_stands_in_the_place_of_the_standards():
    assert Kaimal(turbulence="ETM", turbulence_intensity=0.1).deviation(12.0) == pytest.approx(1.2)


def test_a_case_fills_what_a_field_leaves_open():
    assert VonKarman().on_turbine(0.1, 147.0, None) == VonKarman(0.1, 147.0)
    assert VonKarman(0.2, 50.0).on_turbine(0.1, 147.0, 90.0) == VonKarman(0.2, 50.0)
    assert Kaimal().on_turbine(0.1, 147.0, 90.0) == Kaimal(hub_height=90.0)


@pytest.mark.parametrize(
    "plain",
    [
        {"kind": "von_karman", "turbulence_intensity": 0.1, "length_scale": 147.0},
        {
            "kind": "kaimal",
            "turbulence": "ETM",
            "turbine_class": "II",
            "turbulence_class": "B",
            "turbulence_intensity": 0.2,
            "hub_height": 90.0,
        },
    ],
)
def test_a_mapping_makes_the_field_that_writes_it(plain):
    field = turbulence_of(plain)
    assert {"kind": field.kind, **json.loads(json.dumps(to_plain(field)))} == plain


@pytest.mark.parametrize(
    "given, message",
    [
        ({"kind": "mann"}, "^field.kind: expected one of 'von_karman', 'kaimal', 'box'"),
        ({"kind": "kaimal", "turbulence": "EWM"}, "^field.turbulence: expected 'NTM' or 'ETM', got 'EWM'"),
        ({"kind": "kaimal", "turbulence_class": "D"}, "^field.turbulence_class: expected one of 'A'"),
        (
            {"kind": "von_karman", "length_scale": -1.0},
            "^field.length_scale: expected a length from 1 to 10000 m, got",
        ),
        (
            {"kind": "von_karman", "intensity": 0.1},
            "^field.intensity: unknown key; did you mean 'turbulence_intensity'",
        ),
        (
            {"kind": "von_karman", "turbulence_intensity": 10.0},
            "^field.turbulence_intensity: expected 0 <= fraction",
        ),
    ],
)
def test_a_field_that_cannot_be_is_refused_by_its_entry(given, message):
    with pytest.raises(ValueError, match=message):
        turbulence_of(given)


def test_what_no_case_has_told_is_asked_for():
    with pytest.raises(ValueError, match=r"^field.length_scale: expected a number"):
        VonKarman(0.1).spectrum(np.ones(1), WIND)
    with pytest.raises(ValueError, match=r"^field.hub_height: expected a number"):
        Kaimal().decay(np.ones(1), WIND)
    with pytest.raises(ValueError, match=r"^field.turbulence_intensity: expected a number"):
        VonKarman(length_scale=147.0).deviation(WIND)
