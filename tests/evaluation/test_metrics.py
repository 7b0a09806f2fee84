"""Metrics against the ASTM worked example, closed forms and hand-made series."""

import numpy as np
import pytest
import rainflow

from flapgym.evaluation.bootstrap import paired_change
from flapgym.evaluation.metrics import Record, damage_equivalent_load, measure, turning_points

ASTM = [-2.0, 1.0, -3.0, 5.0, -1.0, 3.0, -4.0, 4.0, -2.0]
ASTM_RANGES = {3.0: 0.5, 4.0: 1.5, 6.0: 0.5, 8.0: 1.0, 9.0: 0.5}


def test_rainflow_counts_the_astm_example():
    assert dict(rainflow.count_cycles(ASTM)) == ASTM_RANGES


def test_del_of_the_astm_example():
    damage = sum(count * span**4 for span, count in ASTM_RANGES.items())
    expected = (damage / (2.0 * len(ASTM) * 0.5)) ** 0.25
    assert damage_equivalent_load(ASTM, 0.5, slope=4.0, equivalent_frequency=2.0) == pytest.approx(expected)


@pytest.mark.parametrize("slope", [3.0, 10.0])
def test_del_of_a_sinusoid_at_the_equivalent_frequency_is_its_range(slope):
    time = np.arange(0.0, 400.0, 0.01)
    assert damage_equivalent_load(2.5e6 * np.sin(2.0 * np.pi * time), 0.01, slope) == pytest.approx(
        5e6, rel=2e-3
    )


def test_del_scales_with_the_load_and_ignores_its_mean():
    load = np.random.default_rng(0).standard_normal(3000)
    base = damage_equivalent_load(load, 0.1)
    assert damage_equivalent_load(7.0 * load + 100.0, 0.1) == pytest.approx(7.0 * base, rel=1e-12)
    assert damage_equivalent_load(np.full(100, 3.0), 0.1) == 0.0


def test_turning_points_leave_the_cycle_count_unchanged():
    load = np.repeat(np.random.default_rng(2).integers(-5, 5, 500), 2).astype(float)
    assert rainflow.count_cycles(turning_points(load)) == rainflow.count_cycles(load)


def test_measure_of_a_record_known_by_hand():
    time = np.arange(0.0, 100.0, 0.01)
    wave = np.sin(2.0 * np.pi * time)[None, :, None] * np.array([1.0, 2.0, 3.0])
    still = np.zeros((1, time.size))
    metrics = measure(
        Record(wave, 0.1 * wave, 0.2 * wave, 0.4 * wave, still + 2.0, still, still, np.zeros(1), 0.01)
    )
    np.testing.assert_allclose(metrics.rbm_rms, [np.array([1.0, 2.0, 3.0]) / np.sqrt(2.0)], rtol=1e-6)
    np.testing.assert_allclose(metrics.tip_rms, 0.1 * metrics.rbm_rms)
    np.testing.assert_allclose(metrics.rbm_del, [[2.0, 4.0, 6.0]], rtol=2e-3)
    np.testing.assert_allclose(metrics.tower_rms, [2.0])
    np.testing.assert_allclose(metrics.flap_angle_max, [0.6], rtol=1e-6)
    np.testing.assert_allclose(metrics.flap_rate_max, [1.2], rtol=1e-6)
    # A sinusoid of amplitude a and frequency f travels 4 a f a second.
    np.testing.assert_allclose(metrics.flap_travel, [4.0 * 0.2 * 2.0], rtol=1e-3)


def test_paired_change_takes_the_mean_of_ratios_blade_by_blade():
    reference = np.array([[1.0, 2.0, 4.0], [2.0, 2.0, 2.0]])
    change = paired_change(reference * [[0.5, 0.5, 0.8], [0.9, 0.9, 0.9]], reference)
    assert change.mean == pytest.approx(0.5 * (0.6 + 0.9) - 1.0)
    assert change.low == pytest.approx(-0.4)
    assert change.high == pytest.approx(-0.1)


def test_the_bias_corrected_interval_covers_a_normal_mean_as_often_as_it_claims():
    rng = np.random.default_rng(4)
    hits = 0
    for _ in range(60):
        change = paired_change(1.0 + 0.1 * rng.standard_normal(40), np.ones(40))
        hits += change.low <= 0.0 <= change.high
    assert 51 <= hits <= 60  # 57 expected of 60


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_few_realisations_still_give_an_answer(count):
    change = paired_change(0.8 + 0.01 * np.arange(count), np.ones(count))
    assert change.mean == pytest.approx(-0.2 + 0.005 * (count - 1))
    if count == 1:
        assert change.low is None
        assert change.high is None
    else:
        assert change.low < change.mean < change.high


def test_an_unchanged_agent_changes_by_nothing():
    reference = np.random.default_rng(1).uniform(1.0, 2.0, (5, 3))
    assert paired_change(reference, reference) == paired_change(np.zeros(4), np.zeros(4))
    assert paired_change(reference, reference).low == 0.0
