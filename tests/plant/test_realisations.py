"""Realisations of the turbulence: the same for the same numbers, whoever is reset with them, alone or from a pool."""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np
import pytest

from flapgym.plant.disturbance import disturbance_system
from tests.plant.plants import (
    BACKENDS,
    LENGTH_SCALE,
    actions_of,
    assert_near,
    chosen,
    flown,
    fly,
    model_of,
    plant_of,
    rest,
    start_of,
)


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("steps", [1, 5])
def test_a_realisation_is_the_same_to_the_last_bit_whoever_is_reset_with_it(steps, precision):
    together, alone = (plant_of(7, steps, 60, model_of(2, True), precision=precision) for _ in range(2))
    start = start_of(together, intensity=np.linspace(0.15, 0.05, 7))
    expected = together.reset(np.arange(7), start).last
    for turbine in (3, 0, 6, 5, 1, 2, 4):
        first = alone.reset(np.array([turbine]), chosen(start, [turbine])).last[0]
        wind = together.quantities.last["wind"]
        np.testing.assert_array_equal(first[wind], expected[turbine, wind])
        # The flaps' own part of sample 0 may round otherwise for one turbine than for seven.
        np.testing.assert_allclose(first, expected[turbine], rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(alone.episode.responses, together.episode.responses)
    actions = actions_of(together, 20)
    np.testing.assert_array_equal(fly(alone, actions).loads.last, fly(together, actions).loads.last)


def test_a_realisation_is_the_same_however_long_the_actions_are_held():
    flights = []
    for steps in (1, 5, 60):
        plant = plant_of(1, steps, 300 // steps)
        noise = np.random.default_rng(11).standard_normal((1, plant.noise_count))
        start = rest(plant, noise=noise, intensity=np.array([0.1]))
        flights.append(flown(plant, start, np.zeros((300 // steps, 1, 3))))
    for flight in flights[1:]:
        for name in ("wind", "rbm", "tip_deflection", "tower_side_side"):
            assert_near(flight.samples(name), flights[0].samples(name), 1e-12, name)


def test_the_first_sample_has_the_variance_of_the_lyapunov_equation():
    model, count = model_of(1, True), 4000
    plant = plant_of(count, 5, 2, model)
    noise = np.random.default_rng(7).standard_normal((count, plant.noise_count))
    last = plant.reset(np.arange(count), rest(plant, noise=noise, intensity=np.full(count, 0.1))).last
    system = disturbance_system(model, LENGTH_SCALE)
    variance = dict(
        zip(system.outputs, np.diag(system.C @ system.stationary_covariance() @ system.C.T), strict=True)
    )
    # Four standard errors of a variance from 4000 draws.
    sampling = 4.0 * np.sqrt(2.0 / count)
    for name, place in plant.quantities.last.items():
        if name in model.fixed_outputs and variance[name]:
            assert last[:, place].var() == pytest.approx(variance[name], rel=sampling)
        if name in model.blade_outputs:
            # Of every blade at azimuth zero: of blade 1 the mean and the cosine.
            each = system.select(outputs=[f"{name}_0", f"{name}_c"])
            rows = each.C.sum(axis=0)
            direct = each.D.sum()
            expected = rows @ system.stationary_covariance() @ rows + direct**2
            assert last[:, place.start].var() == pytest.approx(expected, rel=sampling)
    assert last[:, plant.quantities.last["wind"]].var() == pytest.approx((0.10 * 11.0) ** 2, rel=sampling)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("count", [3, 9])
def test_resetting_one_turbine_leaves_the_others_alone(count, backend):
    plain, disturbed = (plant_of(count, 5, 20, backend=backend) for _ in range(2))
    start, actions = start_of(plain), actions_of(plain, 10, 8, 0.5)
    for plant in (plain, disturbed):
        flown(plant, start, actions[:5])
    disturbed.reset(np.array([1]), chosen(start, [1]))
    expected, got = fly(plain, actions[5:]), fly(disturbed, actions[5:])
    others = np.arange(count) != 1
    np.testing.assert_array_equal(got.loads.last[:, others], expected.loads.last[:, others])
    assert disturbed.elapsed.tolist() == [10, 5] + [10] * (count - 2)
    # And it flies as from a first reset.
    fresh = plant_of(count, 5, 20, backend=backend)
    np.testing.assert_array_equal(got.loads.last[:, 1], flown(fresh, start, actions[5:]).loads.last[:, 1])


def test_plants_of_a_process_share_a_pool_whose_members_are_the_realisations_of_seeds():
    one, other = (plant_of(2, 5, 20, pool=4) for _ in range(2))
    assert np.shares_memory(one.episode.responses, other.episode.responses)
    alone = plant_of(2, 5, 20)
    noise = np.stack([np.random.default_rng(seed).standard_normal(alone.noise_count) for seed in (3, 1)])
    intensity, actions = np.array([0.1, 0.05]), actions_of(alone, 20)
    start = rest(one, realisation=np.array([3, 1]), intensity=intensity)
    got = flown(one, start, actions)
    expected = flown(alone, replace(start, realisation=None, noise=noise), actions)
    np.testing.assert_allclose(got.loads.last, expected.loads.last, rtol=1e-12, atol=1e-12)
    # Drawn by the other in another order and company.
    other.reset(np.array([1]), chosen(start, [1]))
    np.testing.assert_array_equal(flown(other, start, actions).loads.last, got.loads.last)


def test_a_copy_of_a_plant_shares_its_pool_and_nothing_else():
    plant = plant_of(2, 5, 20, pool=3)
    start = rest(plant, realisation=np.array([2, 0]), intensity=np.full(2, 0.1))
    plant.reset(np.arange(2), start)
    twin = copy.deepcopy(plant)
    assert np.shares_memory(twin.episode.responses, plant.episode.responses)
    actions = actions_of(plant, 10)
    expected = fly(plant, actions)
    assert twin.elapsed.tolist() == [0, 0]
    np.testing.assert_array_equal(fly(twin, actions).loads.last, expected.loads.last)
    twin.reset(np.array([0]), chosen(start, [1]))
    np.testing.assert_array_equal(plant.episode.place, [2, 0])


def test_a_pool_takes_numbers_of_realisations_alone():
    plant = plant_of(1, 5, 20, pool=3)
    with pytest.raises(ValueError, match="start: a pool of realisations takes their numbers"):
        plant.reset(np.arange(1), rest(plant))
