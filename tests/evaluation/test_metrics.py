"""Metrics against the ASTM worked example, closed forms and hand-made series."""

from dataclasses import replace

import numpy as np
import pytest
import rainflow

from flapgym.evaluation.bootstrap import paired_change, summed_damage_change
from flapgym.evaluation.cycles import count_cycles, rainflow_cycles
from flapgym.evaluation.metrics import (
    damage_equivalent_load,
    measure,
    root_mean_square,
    summed_damage_load,
)
from flapgym.evaluation.record import Record

ASTM = [-2.0, 1.0, -3.0, 5.0, -1.0, 3.0, -4.0, 4.0, -2.0]
ASTM_RANGES = {3.0: 0.5, 4.0: 1.5, 6.0: 0.5, 8.0: 1.0, 9.0: 0.5}


def test_rainflow_counts_the_astm_example():
    assert dict(rainflow.count_cycles(ASTM)) == ASTM_RANGES


def test_cycles_of_the_astm_example_are_its_ranges():
    ranges, counts = rainflow_cycles(np.array(ASTM))
    assert {span: counts[ranges == span].sum() for span in ranges} == ASTM_RANGES


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


@pytest.mark.parametrize("seed", range(6))
def test_cycles_of_a_series_with_plateaus_are_those_of_an_independent_count(seed):
    rng = np.random.default_rng(seed)
    load = np.repeat(rng.integers(-5, 5, 500), rng.integers(1, 4, 500)).astype(float)
    expected = [(span, count) for span, _, count, _, _ in rainflow.extract_cycles(load)]
    np.testing.assert_array_equal(np.transpose(rainflow_cycles(load)), expected)


def test_cycles_of_rough_loads_are_those_of_an_independent_count_and_compiled_code_changes_none():
    load = np.cumsum(np.random.default_rng(1).standard_normal(20_000))
    expected = [(span, count) for span, _, count, _, _ in rainflow.extract_cycles(load)]
    np.testing.assert_allclose(np.transpose(rainflow_cycles(load)), expected, rtol=1e-13)
    ranges, counts = np.empty(load.size), np.empty(load.size)
    found = count_cycles(load, np.empty(load.size), ranges, counts)
    np.testing.assert_array_equal([ranges[:found], counts[:found]], rainflow_cycles(load))


@pytest.mark.parametrize(
    "load, cycles", [([3.0], []), ([3.0, 3.0], []), ([1.0, 1.0, 2.0, 5.0], [(4.0, 0.5)])]
)
def test_what_never_turns_is_half_a_cycle_or_none(load, cycles):
    assert list(zip(*rainflow_cycles(np.array(load)), strict=True)) == cycles


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


def test_a_ramp_does_the_damage_of_half_a_cycle():
    ramp = np.linspace(0.0, 10.0, 250)
    # Half a cycle of range 10 in 2.5 s at slope 10.
    assert damage_equivalent_load(ramp, 0.01) == pytest.approx(10.0 * (0.5 / 2.5) ** 0.1, rel=1e-12)
    assert damage_equivalent_load(ramp, 0.01) == pytest.approx(8.5134, abs=5e-5)
    assert damage_equivalent_load([3.0], 0.01) == 0.0


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        (
            {"series": [0.0, np.nan, 1.0]},
            r"damage_equivalent_load.series: expected a finite number, got nan at \[1\]",
        ),
        (
            {"series": np.ma.masked_array([0.0, 9.0, 1.0], [False, True, False])},
            "series: expected every number, got a masked",
        ),
        ({"series": []}, r"series: expected one or more numbers along 1 axis, got shape \(0,\)"),
        ({"series": [[0.0, 1.0]]}, r"series: expected one or more numbers along 1 axis, got shape \(1, 2\)"),
        ({"series": ["0", "1"]}, "series: expected real numbers"),
        ({"series": [1j, 0.0]}, "series: expected real numbers"),
        ({"slope": 0.0}, "slope: expected 0 < number, got 0"),
        ({"slope": -3.0}, "slope: expected 0 < number, got -3"),
        ({"slope": np.nan}, "slope"),
        ({"equivalent_frequency": 0.0}, "equivalent_frequency: expected 0 Hz < frequency, got 0 Hz"),
        ({"time_step": 0.0}, "time_step: expected 0 s < time, got 0 s"),
        ({"time_step": -0.01}, "time_step: expected 0 s < time, got -0.01 s"),
        ({"time_step": "0.01"}, "time_step"),
    ],
)
def test_what_has_no_damage_equivalent_load_is_refused(changed, text):
    given = {"series": [0.0, 2.0, 1.0], "time_step": 0.01} | changed
    with pytest.raises(ValueError, match=text):
        damage_equivalent_load(**given)


def test_damage_adds_over_realisations_where_the_mean_of_ratios_does_not():
    # At slope 2 a realisation of three times the load does nine times the damage.
    ours, reference = np.array([[1.0], [3.0]]), np.array([[2.0], [3.0]])
    change = summed_damage_change(ours, reference, slope=2.0)
    assert change.mean == pytest.approx(np.sqrt((1.0 + 9.0) / (4.0 + 9.0)) - 1.0)
    assert paired_change(ours, reference).mean == pytest.approx(-0.25)
    assert change.low == pytest.approx(-0.5)
    assert change.high == pytest.approx(0.0)


def test_the_load_of_all_realisations_together_is_that_of_their_histories_end_to_end():
    rng = np.random.default_rng(3)
    # Each begins and ends at the bottom, so that no cycle spans two of them.
    histories = [
        np.concatenate([[-9.0], size * rng.standard_normal(400), [-9.0]]) for size in (1.0, 1.5, 2.0)
    ]
    each = np.array([damage_equivalent_load(history, 0.1, 4.0) for history in histories])
    joined = damage_equivalent_load(np.concatenate(histories), 0.1, 4.0)
    assert summed_damage_load(each, 4.0) == pytest.approx(joined, rel=5e-3)


@pytest.mark.parametrize("function", [paired_change, summed_damage_change])
@pytest.mark.parametrize(
    ("values", "reference", "text"),
    [
        ([1.0, np.nan], [1.0, 1.0], "values: expected 0 <= number, got nan"),
        ([1.0, 1.0], [1.0, 0.0], "reference: expected a positive number beside a value above 0, got 0"),
        ([1.0, -1.0], [1.0, 1.0], "values"),
        ([1.0, 1.0], [1.0], "no pairs"),
        ([], [], "values"),
    ],
)
def test_pairs_without_a_ratio_are_refused(function, values, reference, text):
    with pytest.raises(ValueError, match=text):
        function(values, reference)


@pytest.mark.parametrize("series", [[], [np.nan], np.ma.masked_array([1.0], [True]), ["one"]])
def test_a_root_mean_square_of_what_is_no_series_is_refused(series):
    with pytest.raises(ValueError, match="root_mean_square.series"):
        root_mean_square(series)


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        ({"rbm": np.full((1, 5, 3), np.nan)}, "record.rbm: expected a finite number"),
        ({"rbm": np.zeros((2, 5, 3))}, r"record.tip_deflection: expected shape \(2, 5, 3\)"),
        ({"time_step": 0.0}, "record.time_step"),
        ({"wind": np.zeros((1, 4))}, r"record.wind: expected shape \(1, 5\)"),
    ],
)
def test_a_record_without_metrics_is_refused(changed, text):
    blades, one = np.zeros((1, 5, 3)), np.zeros((1, 5))
    fine = Record(blades, blades, blades, blades, one, one, one, np.zeros(1), 0.01)
    assert measure(fine).rbm_del.tolist() == [[0.0, 0.0, 0.0]]
    with pytest.raises(ValueError, match=text):
        measure(replace(fine, **changed))
