"""What a plant tells of an action: means of its samples, ways of its flaps, and NaN for what is not computed."""

from __future__ import annotations

import numpy as np
import pytest

from tests.plant.plants import BACKENDS, actions_of, assert_near, flown, model_of, plant_of, start_of


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("count", [1, 6])
@pytest.mark.parametrize("flaps", [1, 2])
def test_what_is_told_of_an_action_is_what_its_samples_say(backend, count, flaps):
    model, steps, intervals = model_of(flaps, True), 4, 30
    plant = plant_of(count, steps, intervals, model, backend)
    start = start_of(plant)
    flight = flown(plant, start, actions_of(plant, intervals))

    def mean_square(values):
        return np.mean(np.square(values).reshape(intervals, steps, *values.shape[1:]), axis=1)

    np.testing.assert_allclose(flight.loads.rbm_square, mean_square(flight.samples("rbm")), rtol=1e-12)
    # Every flap's angle over its own stop.
    stops = np.tile([flap.angle_limit for flap in model.flaps], 3)
    angle = flight.samples("flap_angle")
    np.testing.assert_allclose(
        flight.loads.angle_square, mean_square(angle / stops).mean(axis=-1), rtol=1e-12
    )
    fixed = [mean_square(flight.samples(name))[:, :, 0] for name in model.fixed_outputs]
    np.testing.assert_allclose(flight.loads.fixed_square, np.stack(fixed, axis=-1), rtol=1e-12)
    for name in plant.quantities.sample:
        np.testing.assert_array_equal(
            flight.last(name), flight.samples(name)[steps - 1 :: steps], err_msg=name
        )

    way = np.cumsum(np.abs(np.diff(np.concatenate([start.angle[None], angle]), axis=0)), axis=0)
    np.testing.assert_allclose(flight.last("flap_travel"), way[steps - 1 :: steps], rtol=1e-12)
    elapsed = steps * np.arange(1, intervals + 1)[:, None]
    azimuth = start.azimuth + model.rotor_speed * model.time_step * elapsed
    told = flight.last("azimuth")[:, :, 0]
    assert ((told >= 0.0) & (told <= 2.0 * np.pi)).all()
    np.testing.assert_allclose(np.exp(1j * told), np.exp(1j * azimuth), atol=1e-12)
    heading = np.stack([np.cos(azimuth), np.sin(azimuth)], axis=-1)
    np.testing.assert_allclose(flight.last("heading"), heading, atol=1e-12)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("count", [1, 2, 20])
def test_what_is_recorded_beside_the_last_sample_does_not_change_it(count, backend):
    flights = []
    for told in ({"record": True}, {"record": False, "every_sample": True}, {"record": False}):
        plant = plant_of(count, 3, 6, model_of(2, True), backend, **told)
        flights.append(flown(plant, start_of(plant), actions_of(plant, 6)))
    assert flights[1].loads.samples.size == flights[2].loads.samples.size == 0
    for flight in flights[1:]:
        for name in flight.quantities.last:
            assert_near(flight.last(name), flights[0].last(name), 1e-12, name)
        assert_near(flight.loads.rbm_square, flights[0].loads.rbm_square, 1e-12)
    assert_near(flights[1].loads.fixed_square, flights[0].loads.fixed_square, 1e-12)
    last = np.stack([flights[2].last(name)[:, :, 0] for name in plant.model.fixed_outputs], axis=-1)
    np.testing.assert_allclose(flights[2].loads.fixed_square, last**2, rtol=1e-12)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("count", [1, 2, 20])
def test_a_plant_asked_for_no_displacements_gives_the_same_moments(backend, count):
    model = model_of(2, True)
    flights = []
    for displacements in (True, False):
        plant = plant_of(count, 3, 6, model, backend, record=False, displacements=displacements)
        flights.append(flown(plant, start_of(plant), actions_of(plant, 6)))
    expected, got = flights
    for name in expected.quantities.last:
        if name in (*model.blade_outputs[1:], *model.fixed_outputs):
            assert np.isnan(got.last(name)).all()
        else:
            assert_near(got.last(name), expected.last(name), 1e-12, name)
    assert_near(got.loads.rbm_square, expected.loads.rbm_square, 1e-12)
