"""The filter against the analytic von Karman spectrum, and realisations against the filter's own statistics."""

import numpy as np
import pytest
import scipy.integrate
import scipy.special

from flapgym.wind import realise, von_karman_filter, von_karman_spectrum

WIND, INTENSITY, LENGTH, STEP = 11.0, 0.10, 147.0, 0.007


def _error_in_decibels(order, highest=10.0):
    """Filter against spectrum, with the spectrum folded about the sampling frequency as sampling does."""
    system = von_karman_filter(WIND, INTENSITY, LENGTH, STEP, order)
    frequency = np.concatenate([[0.0], np.geomspace(1e-4, highest, 300)])
    density = 2.0 * STEP * np.abs(system.frequency_response(frequency)[:, 0, 0]) ** 2
    return 10.0 * np.log10(density / von_karman_spectrum(frequency, WIND, INTENSITY, LENGTH))


@pytest.mark.parametrize(("order", "bound"), [(3, 0.37), (4, 0.12), (5, 0.08)])
def test_filter_follows_the_spectrum_to_ten_hertz(order, bound):
    assert np.abs(_error_in_decibels(order)).max() < bound


@pytest.mark.parametrize("length", [73.5, 147.0, 340.0])
@pytest.mark.parametrize("order", [3, 5])
def test_stationary_variance_is_exactly_sigma_squared(length, order):
    system = von_karman_filter(WIND, INTENSITY, length, STEP, order)
    variance = system.C @ system.stationary_covariance() @ system.C.T
    assert variance[0, 0] == pytest.approx((INTENSITY * WIND) ** 2, rel=1e-8)


def test_integral_of_the_spectrum_is_the_variance():
    total, _ = scipy.integrate.quad(lambda f: von_karman_spectrum(f, 1.0, 0.5, 1.0), 0.0, np.inf)
    assert total == pytest.approx(0.99986 * 0.25, rel=1e-5)


def test_autocorrelation_is_von_karmans():
    """R(t) = sigma^2 2^(2/3)/Gamma(1/3) s^(1/3) K_(1/3)(s), s = t U / (1.339 L), the transform of the spectrum."""
    system = von_karman_filter(WIND, INTENSITY, LENGTH, STEP, 5)
    covariance = system.stationary_covariance()
    lags = np.array([10, 50, 200, 1000, 3000])
    decay = np.diag(system.A)
    ours = np.array([(system.C * decay**lag) @ covariance @ system.C.T for lag in lags]).ravel()
    s = lags * STEP * 2.0 * np.pi * WIND / (np.sqrt(70.8) * LENGTH)
    exact = (
        2.0 ** (2.0 / 3.0)
        / scipy.special.gamma(1.0 / 3.0)
        * s ** (1.0 / 3.0)
        * scipy.special.kv(1.0 / 3.0, s)
    )
    np.testing.assert_allclose(ours / (INTENSITY * WIND) ** 2, exact, atol=2e-3)


def test_halving_the_step_leaves_the_autocorrelation():
    fine, coarse = (von_karman_filter(WIND, INTENSITY, LENGTH, step, 3) for step in (STEP, 2.0 * STEP))
    for lag in (1, 7, 100):
        values = []
        for system, power in ((fine, 2 * lag), (coarse, lag)):
            moved = np.linalg.matrix_power(system.A, power) @ system.stationary_covariance()
            values.append((system.C @ moved @ system.C.T)[0, 0])
        assert values[0] == pytest.approx(values[1], rel=1e-7)


def test_realisations_are_stationary_from_the_first_sample():
    system = von_karman_filter(WIND, INTENSITY, LENGTH, STEP)
    wind = realise(system, 40, np.random.default_rng(1), count=20000)
    spread = wind.std(axis=0) / (INTENSITY * WIND)
    np.testing.assert_allclose(spread[[0, 1, 5, 39]], 1.0, atol=4.0 / np.sqrt(2 * 20000))
    covariance = np.mean(wind[:, 0] * wind[:, 30])
    moved = system.C @ np.linalg.matrix_power(system.A, 30) @ system.stationary_covariance() @ system.C.T
    assert covariance == pytest.approx(moved[0, 0], rel=0.04)


def test_realisation_equals_the_plain_recursion():
    system = von_karman_filter(WIND, INTENSITY, LENGTH, STEP)
    steps, order = 300, system.order
    wind = realise(system, steps, np.random.default_rng(3))[0]
    white = np.random.default_rng(3).standard_normal((1, order + steps))[0]
    forced = system.simulate(white[order:, None])[:, 0]
    free = wind - forced
    values = np.diag(system.A)
    modes = values ** np.arange(steps)[:, None]
    fitted = modes @ np.linalg.lstsq(modes, free, rcond=None)[0]
    np.testing.assert_allclose(free, fitted, atol=1e-9)


def test_the_same_seed_gives_the_same_wind_whatever_the_count():
    system = von_karman_filter(WIND, INTENSITY, LENGTH, STEP)
    one = realise(system, 100, np.random.default_rng(5))
    three = realise(system, 100, np.random.default_rng(5), count=3)
    np.testing.assert_allclose(one[0], three[0], rtol=0, atol=1e-14)


def test_zero_intensity_is_no_wind():
    assert not realise(von_karman_filter(WIND, 0.0, LENGTH, STEP), 50, np.random.default_rng(0)).any()


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        ((0.0, 0.1, 147.0, STEP), "wind_speed"),
        ((11.0, -0.1, 147.0, STEP), "intensity"),
        ((11.0, 0.1, float("nan"), STEP), "length_scale"),
        ((11.0, 0.1, 147.0, 0.0), "time_step"),
        ((11.0, 0.1, 147.0, STEP, 1), "order"),
    ],
)
def test_impossible_turbulence_is_refused_by_name(arguments, name):
    with pytest.raises(ValueError, match=name):
        von_karman_filter(*arguments)
