"""The plant of unequal blades against the model's own simulation, and against the constant plant of equal ones."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from flapgym.core.multiblade import to_blades, to_components
from flapgym.model.harmonics import PeriodicPart, simulate_periodic
from flapgym.plant import Faults, GivenWind, PeriodicPlant, Stepping, make_plant
from tests.plant.plants import (
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


def _uneven(size, flaps=1, further=False, strips=0):
    """The synthetic turbine with a periodic part of rank 3 and two harmonics, and a turning load."""
    model = model_of(flaps, further, strips=strips)
    turbine = model.turbine
    n, outputs, inputs = turbine.order, len(turbine.outputs), len(turbine.inputs)
    rng = np.random.default_rng(3)
    scale = np.concatenate([np.abs(turbine.A).max(axis=1), np.abs(turbine.C).max(axis=1)])
    forcing = np.zeros((3, n + outputs), dtype=complex)
    forcing[1, n - 4 : n] = 1e-3 + 2e-3j
    forcing[1, n] = 1e4
    part = PeriodicPart(
        left=scale[:, None] * rng.standard_normal((n + outputs, 3)),
        core=size * (rng.standard_normal((2, 3, 3)) + 1j * rng.standard_normal((2, 3, 3))),
        right=rng.standard_normal((3, n + inputs)) / 10.0,
        forcing=forcing if size else 0.0 * forcing,
    )
    return replace(model, periodic=part)


@pytest.mark.parametrize("flaps, further, strips", [(1, False, 0), (2, True, 0), (3, True, 2)])
@pytest.mark.parametrize("faults", [Faults(), Faults((1.0, 0.5, 0.0), lag=0.05), Faults((1.0, 2.0, 0.5))])
def test_without_a_periodic_part_it_is_the_constant_plant(flaps, further, strips, faults):
    equal = _uneven(0.0, flaps, further, strips)
    periodic = plant_of(3, 5, 120, equal, faults=faults)
    constant = plant_of(3, 5, 120, replace(equal, periodic=None), faults=faults)
    assert isinstance(periodic, PeriodicPlant)
    assert not isinstance(constant, PeriodicPlant)
    assert periodic.noise_count == constant.noise_count
    start, actions = start_of(periodic), actions_of(periodic, 100)
    first = [plant.reset(np.arange(3), start).last for plant in (periodic, constant)]
    np.testing.assert_allclose(first[0], first[1], rtol=1e-9, atol=1e-9)
    got, expected = fly(periodic, actions), fly(constant, actions)
    for name in constant.quantities.sample:
        assert_near(got.samples(name), expected.samples(name), 1e-9, name)
    for name in constant.quantities.last:
        assert_near(got.last(name), expected.last(name), 1e-9, name)
    for name in ("rbm_square", "angle_square", "fixed_square"):
        assert_near(getattr(got.loads, name), getattr(expected.loads, name), 1e-9, name)


@pytest.mark.parametrize("flaps, further, strips", [(1, False, 0), (2, True, 2)])
def test_it_steps_what_the_models_own_simulation_gives(flaps, further, strips):
    model = _uneven(1e-4, flaps, further, strips)
    plant = plant_of(2, 5, 120, model)
    gust = GivenWind(np.sin(0.1 * np.arange(601)), 0.0)
    start = start_of(plant, noise=None, intensity=np.zeros(2), gust=gust)
    first = plant.reset(np.arange(2), start).last
    flight = fly(plant, actions_of(plant, 100))
    names = model.turbine.outputs
    for turbine in range(2):
        azimuth = start.azimuth[turbine] + model.rotor_speed * model.time_step * np.arange(501)
        components = []
        for name, at_start in (("flap_angle", start.angle), ("flap_rate", start.rate)):
            motion = np.vstack([at_start[turbine], flight.samples(name)[:, turbine]])
            components += [to_components(motion[:, flap::flaps], azimuth) for flap in range(flaps)]
        inputs = np.hstack([*components, gust.wind[:501, None], np.zeros((501, 3 * strips))])
        steady = plant._constants.steady
        x0 = (np.exp(1j * azimuth[0] * np.arange(len(steady))) @ steady).real
        expected = simulate_periodic(model.turbine, model.periodic, inputs, azimuth, x0)
        for name in model.blade_outputs:
            of_blades = to_blades(expected[:, [names.index(f"{name}_{part}") for part in "0cs"]], azimuth)
            at_first = first[turbine, plant.quantities.last[name]]
            got = np.vstack([at_first, flight.samples(name)[:, turbine]])
            assert_near(got, of_blades, 1e-10, name)
        for name in model.fixed_outputs:
            fixed = expected[1:, [names.index(name)]]
            assert_near(flight.samples(name)[:, turbine], fixed, 1e-10, name)
        np.testing.assert_array_equal(flight.samples("wind")[:, turbine, 0], gust.wind[1:501])


def test_an_unbalanced_rotor_in_still_air_repeats_itself_every_revolution():
    model = _uneven(1e-4)
    # A revolution of a whole number of steps, so that samples can be compared.
    steps = round(2.0 * np.pi / (model.rotor_speed * model.time_step))
    model = replace(model, rotor_speed=2.0 * np.pi / steps / model.time_step)
    plant = plant_of(1, 5, 2 * steps // 5 + 1, model)
    start = rest(plant, azimuth=np.array([1.1]))
    rbm = flown(plant, start, np.zeros((2 * steps // 5, 1, 3))).samples("rbm")[:, 0]
    assert np.abs(rbm).max() > 1e4
    later = rbm[steps:]
    np.testing.assert_allclose(later, rbm[: len(later)], atol=1e-9 * np.abs(rbm).max())


def test_its_state_survives_json():
    plant, twin = (plant_of(2, 5, 120, _uneven(1e-4, 2)) for _ in range(2))
    start = start_of(plant)
    flown(twin, start, actions_of(twin, 1))
    flown(plant, start, actions_of(plant, 40))
    twin.reset(np.arange(2), start)
    for turbine in range(2):
        twin.set_state(turbine, json.loads(json.dumps(plant.get_state(turbine))))
    for action in actions_of(plant, 5, 3):
        for one, other in zip(plant.step(action), twin.step(action), strict=True):
            np.testing.assert_array_equal(one, other)


def test_a_step_changes_no_loads_handed_out_before():
    plant = plant_of(2, 5, 20, _uneven(1e-4))
    plant.reset(np.arange(2), start_of(plant))
    actions = actions_of(plant, 3)
    loads, elapsed = plant.step(actions[0]), plant.elapsed
    copies = [part.copy() for part in loads]
    fly(plant, actions[1:])
    for part, copied in zip(loads, copies, strict=True):
        np.testing.assert_array_equal(part, copied)
    assert elapsed.tolist() == [1, 1]


def test_blades_that_differ_too_much_are_refused():
    with pytest.raises(ValueError, match="blades differ too much"):
        plant_of(1, 5, 120, _uneven(1e3))
    stepping = Stepping(5, 120, LENGTH_SCALE)
    with pytest.raises(ValueError, match="blades differ"):
        PeriodicPlant(model_of(), 1, stepping)
    single = make_plant(_uneven(1e-4), 1, replace(stepping, single_blade=True))
    assert not isinstance(single, PeriodicPlant)


def test_a_realisation_is_the_same_to_the_last_bit_whoever_is_reset_with_it():
    together, alone = (plant_of(5, 5, 120, _uneven(1e-3)) for _ in range(2))
    start, actions = start_of(together), actions_of(together, 20)
    together.reset(np.arange(5), start)
    for turbine in range(5):
        alone.reset(np.array([turbine]), chosen(start, [turbine]))
        alone.set_state(turbine, together.get_state(turbine))
    np.testing.assert_array_equal(fly(alone, actions).loads.last, fly(together, actions).loads.last)


def test_its_pool_is_of_the_realisations_of_seeds():
    model = _uneven(1e-3)
    pool, alone = plant_of(2, 5, 20, model, pool=4), plant_of(2, 5, 20, model)
    noise = np.stack([np.random.default_rng(seed).standard_normal(alone.noise_count) for seed in (3, 1)])
    start = rest(pool, realisation=np.array([3, 1]), intensity=np.array([0.1, 0.05]))
    actions = actions_of(pool, 20)
    expected = flown(alone, replace(start, realisation=None, noise=noise), actions)
    np.testing.assert_array_equal(flown(pool, start, actions).loads.last, expected.loads.last)
