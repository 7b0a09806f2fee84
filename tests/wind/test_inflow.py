"""The steady wind over the disk against closed formulas, numerical integrals, and its own values blade by blade."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from flapgym.core.fields import from_plain
from flapgym.core.multiblade import component_harmonics, to_components
from flapgym.wind.disk import Disk
from flapgym.wind.inflow import HIGHEST, Inflow, tower_dam

MEAN = 11.0
FLAT = Disk(50.0, 80.0, 5.0, 0.0, 0.0, np.array([0.0, 78.0]), np.array([2.0, 2.0]))
LEANING = Disk(50.0, 80.0, 5.0, 0.09, 0.05, np.array([0.0, 78.0]), np.array([2.0, 2.0]))
TAPERED = Disk(50.0, 80.0, 5.0, 0.09, 0.05, np.array([0.0, 78.0]), np.array([2.5, 1.5]))
"""The kink of its taper at the top makes high harmonics fall with a power only."""
TALL = Disk(50.0, 80.0, 5.0, 0.0, 0.0, np.array([0.0, 1e6]), np.array([2.0, 2.0]))
"""Its tower goes on far above the rotor."""
RADII = np.array([5.0, 20.0, 35.0, 50.0])
RNG = np.random.default_rng(5)
ALL = Inflow(shear_exponent=0.2, yaw_error=0.1, upflow=0.14, tower_shadow=True)


def components_at(harmonics, azimuth):
    """(T, R, 3) of harmonics (N + 1, R, 3), term by term."""
    return sum((d * np.exp(3j * k * azimuth)[:, None, None]).real for k, d in enumerate(harmonics))


@pytest.mark.parametrize("disk, rounding", [(FLAT, 1e-12), (LEANING, 1e-12), (TAPERED, 1e-7)])
@pytest.mark.parametrize("inflow", [Inflow(shear_exponent=0.2), Inflow(roughness_length=0.03), ALL])
def test_the_components_summed_again_are_what_the_three_blades_meet(inflow, disk, rounding):
    azimuth = RNG.uniform(0.0, 2.0 * np.pi, 40)
    blades = np.stack(
        [inflow.on_disk(RADII, azimuth + 2.0 * np.pi * b / 3.0, disk, MEAN).T for b in range(3)], axis=-1
    )
    expected = to_components(blades.transpose(1, 0, 2), azimuth).transpose(1, 0, 2)
    found = components_at(inflow.components(RADII, disk, MEAN, highest=HIGHEST), azimuth)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=rounding * MEAN)


def test_any_three_harmonics_fall_on_the_components_exactly():
    harmonics = RNG.standard_normal((8, 2)) + 1j * RNG.standard_normal((8, 2))
    azimuth = RNG.uniform(0.0, 2.0 * np.pi, 20)
    theta = azimuth[:, None] + 2.0 * np.pi / 3.0 * np.arange(3)
    blades = sum((c[:, None, None] * np.exp(1j * m * theta)).real for m, c in enumerate(harmonics))
    expected = np.stack([to_components(each, azimuth) for each in blades], axis=1)
    np.testing.assert_allclose(components_at(component_harmonics(harmonics), azimuth), expected, atol=1e-13)


def test_harmonics_that_end_where_a_component_lacks_one_are_refused():
    with pytest.raises(
        ValueError, match="harmonics: expected those from 0 to a multiple of 3 and one, got 7"
    ):
        component_harmonics(np.zeros((7, 2), dtype=complex))


def test_a_linear_shear_is_one_constant_cosine_component():
    found = Inflow(shear_exponent=1.0).components(RADII, FLAT, MEAN, highest=7)
    expected = np.zeros((3, len(RADII), 3))
    expected[0, :, 1] = MEAN * RADII / FLAT.hub_height
    np.testing.assert_allclose(found, expected, atol=1e-13)


def test_the_power_law_has_the_turn_s_harmonics_of_its_binomial_series():
    # (1 + e cos)^a: its mean and cos are, to the fifth order of e = r / z_hub,
    # 1 + a(a-1)/4 e^2 + a(a-1)(a-2)(a-3)/64 e^4 and a e + a(a-1)(a-2)/8 e^3 + a...(a-4)/192 e^5.
    radius, a = np.array([4.0]), 0.2
    e = radius[0] / FLAT.hub_height
    mean = a * (a - 1) / 4 * e**2 + a * (a - 1) * (a - 2) * (a - 3) / 64 * e**4
    first = a * e + a * (a - 1) * (a - 2) / 8 * e**3 + a * (a - 1) * (a - 2) * (a - 3) * (a - 4) / 192 * e**5
    found = Inflow(shear_exponent=a).harmonics(radius, FLAT, MEAN, highest=4)[:2, 0]
    np.testing.assert_allclose(found, [MEAN * mean, MEAN * first], rtol=1e-5)


@pytest.mark.parametrize("m", [0, 1, 2, 5])
def test_the_harmonics_are_fourier_s_integrals(m):
    radius = np.array([45.0])

    def integrand(theta, part):
        u = ALL.on_disk(radius, np.array([theta]), LEANING, MEAN)[0, 0]
        return u * part(m * theta) / np.pi / (2.0 if m == 0 else 1.0)

    parts = [
        quad(integrand, 0.0, 2.0 * np.pi, (part,), points=[np.pi], limit=400, epsabs=1e-10)[0]
        for part in (np.cos, np.sin)
    ]
    found = ALL.harmonics(radius, LEANING, MEAN, highest=7)[m, 0]
    assert found == pytest.approx(parts[0] - 1j * parts[1], abs=1e-8)


def test_the_logarithmic_law_is_the_one_of_the_textbook():
    azimuth = np.array([0.0, 1.0, np.pi])
    height = 80.0 + 30.0 * np.cos(azimuth)
    found = Inflow(roughness_length=0.05).on_disk(np.array([30.0]), azimuth, FLAT, MEAN)[0]
    np.testing.assert_allclose(found, MEAN * (np.log(height / 0.05) / np.log(80.0 / 0.05) - 1.0), rtol=1e-12)


def test_the_mean_that_shear_takes_off_the_disk_is_kept():
    # Mean over the ring of (1 + e cos)^a by numerical integration.
    e = 50.0 / 80.0
    mean = quad(lambda t: (1.0 + e * np.cos(t)) ** 0.2 - 1.0, 0.0, np.pi)[0] / np.pi
    found = Inflow(shear_exponent=0.2).components(np.array([50.0]), FLAT, MEAN)[0, 0, 0]
    assert found.real == pytest.approx(MEAN * mean, rel=1e-9)
    assert mean < -0.01


@pytest.mark.parametrize("inflow", [Inflow(), Inflow(shear_exponent=0.0, yaw_error=0.0, upflow=0.0)])
def test_without_anything_there_is_no_perturbation(inflow):
    np.testing.assert_array_equal(inflow.on_disk(RADII, np.linspace(0.0, 6.0, 50), LEANING, MEAN), 0.0)


@pytest.mark.parametrize("yaw, upflow", [(0.2, 0.0), (-0.2, 0.0), (0.0, 0.15), (0.3, -0.1)])
def test_yaw_error_and_upflow_are_the_wind_s_vector_in_the_blade_s_frame(yaw, upflow):
    inflow, tilt, azimuth = Inflow(yaw_error=yaw, upflow=upflow), LEANING.tilt, np.linspace(0.0, 6.0, 20)
    # x downwind, y left, z up; the wind at hub height that has MEAN along the shaft if it comes level and straight.
    wind = (
        MEAN
        / np.cos(tilt)
        * np.array([np.cos(upflow) * np.cos(yaw), np.cos(upflow) * np.sin(yaw), np.sin(upflow)])
    )
    shaft = np.array([np.cos(tilt), 0.0, -np.sin(tilt)])
    upright = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    # The way a point of a blade goes, from its place by finite difference.
    place = np.stack([-np.sin(azimuth)[:, None] * [0, 1, 0] + np.cos(azimuth)[:, None] * upright])[0]
    later = -np.sin(azimuth + 1e-6)[:, None] * [0, 1, 0] + np.cos(azimuth + 1e-6)[:, None] * upright
    found = inflow.on_disk(RADII, azimuth, LEANING, MEAN)
    np.testing.assert_allclose(found, wind @ shaft - MEAN, atol=1e-12)
    np.testing.assert_allclose(
        inflow.crosswind(azimuth, LEANING, MEAN), (later - place) / 1e-6 @ wind, atol=1e-5
    )


def test_a_yaw_error_of_either_sign_takes_the_same_off_the_wind_along_the_shaft():
    azimuth = np.zeros(1)
    left, right = (Inflow(yaw_error=s * 0.2).on_disk(RADII, azimuth, FLAT, MEAN) for s in (1, -1))
    np.testing.assert_allclose(left, MEAN * (np.cos(0.2) - 1.0), rtol=1e-12)
    np.testing.assert_array_equal(left, right)


def test_ahead_of_a_tall_tower_the_wind_is_that_of_a_cylinder():
    ahead, left = np.array([5.0, 8.0, 3.0, 1.0]), np.array([0.0, 4.0, -7.0, 60.0])
    found = tower_dam(ahead, left, np.full(4, 50.0), TALL)
    np.testing.assert_allclose(found, 4.0 * (left**2 - ahead**2) / (ahead**2 + left**2) ** 2, atol=1e-10)
    # On the stagnation line: 1 - a^2 / x^2.
    assert found[0] == pytest.approx(-4.0 / 25.0, abs=1e-10)


def test_at_the_height_of_its_top_the_dam_is_half_and_far_above_it_falls_as_a_point_s():
    ahead, left = np.array([6.0]), np.array([2.0])
    cylinder = 4.0 * (left**2 - ahead**2) / (ahead**2 + left**2) ** 2
    np.testing.assert_allclose(tower_dam(ahead, left, np.array([78.0]), FLAT), cylinder / 2.0, rtol=1e-12)
    # The series in rho / h of the dipoles' field at a height h above the top begins with a^2 / (4 h^2).
    above = tower_dam(ahead, left, np.array([78.0 + 400.0]), FLAT)[0]
    assert above == pytest.approx(4.0 / (4.0 * 400.0**2), rel=1e-3)


def test_the_dam_below_the_top_is_the_potential_of_dipoles_along_the_tower():
    def potential(x, y, z):
        dipole = lambda t: x / (x**2 + y**2 + (t - z) ** 2) ** 1.5  # noqa: E731
        return 0.5 * 4.0 * quad(dipole, -np.inf, 78.0, epsabs=1e-13, epsrel=1e-12, limit=200)[0]

    for x, y, z in ((6.0, 2.0, 74.0), (7.0, -9.0, 80.0)):
        slope = (potential(x + 1e-3, y, z) - potential(x - 1e-3, y, z)) / 2e-3
        found = tower_dam(np.array([x]), np.array([y]), np.array([z]), FLAT)[0]
        assert found == pytest.approx(slope, rel=1e-5)


def test_the_cylinder_s_dam_averages_to_nothing_over_a_ring_about_it():
    # A potential's gradient has the mean of its value at infinity over a circle that encloses the cylinder.
    angle = 2.0 * np.pi / 400 * np.arange(400)
    found = tower_dam(30.0 * np.cos(angle), 30.0 * np.sin(angle), np.full(400, 50.0), TALL)
    assert abs(found.mean()) < 1e-9 * np.abs(found).max() + 1e-12


def test_the_tower_strikes_the_blade_that_points_down():
    azimuth = np.linspace(0.0, 2.0 * np.pi, 721)
    wind = Inflow(tower_shadow=True).on_disk(np.array([40.0]), azimuth, FLAT, MEAN)[0]
    assert azimuth[wind.argmin()] == pytest.approx(np.pi)
    assert wind.min() == pytest.approx(-MEAN * 4.0 / 25.0, rel=0.01)


def test_the_harmonics_taken_by_default_leave_out_less_than_a_ten_thousandth_of_the_variance():
    azimuth = 2.0 * np.pi / 1440 * np.arange(1440)
    full = ALL.on_disk(RADII, azimuth, LEANING, MEAN)
    harmonics = ALL.harmonics(RADII, LEANING, MEAN)
    kept = sum(c[:, None] * np.exp(1j * m * azimuth) for m, c in enumerate(harmonics)).real
    assert ((full - kept).var(axis=1) / full.var(axis=1)).max() < 1e-4
    fewer = sum(c[:, None] * np.exp(1j * m * azimuth) for m, c in enumerate(harmonics[:-3])).real
    assert ((full - fewer).var(axis=1) / full.var(axis=1)).max() > 1e-4


def test_points_turn_clockwise_for_one_who_looks_downwind():
    ahead, left, height = LEANING.points(np.array([50.0]), np.array([0.0, np.pi / 2.0, np.pi]))
    assert left[0, 1] == pytest.approx(-50.0 * np.cos(0.05))
    assert height[0, 0] > LEANING.hub_height > height[0, 2]
    # Tilt takes the lower blade away from the tower.
    assert ahead[0, 2] > ahead[0, 1] > ahead[0, 0]


def disk_with(**changes):
    values = {
        "radius": 50.0,
        "hub_height": 80.0,
        "overhang": 5.0,
        "tilt": 0.0,
        "precone": 0.0,
        "tower_height": [0.0, 78.0],
        "tower_radius": [2.0, 2.0],
    }
    return Disk(**(values | changes))


@pytest.mark.parametrize(
    "build, message",
    [
        (lambda: Inflow(shear_exponent=3.0), "^inflow.shear_exponent: expected a number from -1 to 1, got 3"),
        (
            lambda: Inflow(shear_exponent=0.2, roughness_length=0.1),
            "^inflow.roughness_length: expected None beside",
        ),
        (lambda: Inflow(yaw_error=90.0), "^inflow.yaw_error: .*60 deg"),
        (
            lambda: from_plain(Inflow, {"tower_shadow": 1}, "inflow"),
            "^inflow.tower_shadow: expected True or False, got 1",
        ),
        (lambda: disk_with(radius=81.0), "^disk.radius: expected less than disk.hub_height"),
        (
            lambda: Inflow(tower_shadow=True).on_disk(
                RADII, np.array([np.pi]), disk_with(overhang=1.5), MEAN
            ),
            "^disk.overhang: expected blades that pass clear of the tower, got a point 1.5 m",
        ),
        (
            lambda: Inflow(roughness_length=9.0).on_disk(
                np.array([75.0]), np.array([np.pi]), disk_with(radius=75.0), MEAN
            ),
            "^inflow.roughness_length: expected less than the height of the lowest blade point .5 m., got 9 m",
        ),
        (lambda: ALL.on_disk(np.array([51.0]), np.zeros(1), FLAT, MEAN), "^inflow.radius: .* from 0 to 50 m"),
        (lambda: ALL.harmonics(RADII, FLAT, MEAN, highest=5000), "^inflow.highest: .*from 1 to 511"),
    ],
)
def test_an_inflow_that_cannot_be_is_refused_by_its_field(build, message):
    with pytest.raises(ValueError, match=message):
        build()
