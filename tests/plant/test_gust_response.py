"""The response to a wind known in advance against the plainest stepping of the model's own matrices."""

from __future__ import annotations

import numpy as np
import pytest

import flapgym.plant.responses as responses
from flapgym.core.multiblade import to_components
from flapgym.model import load_model
from flapgym.plant import GivenWind
from flapgym.plant.disturbance import wind_modes, wind_response
from flapgym.wind import gust_of
from reference.plant import run
from tests.plant.plants import BACKENDS, actions_of, assert_near, flown, model_of, plant_of, rest


def _gust(model, samples):
    time = model.time_step * np.arange(samples)
    gust = {"kind": "extreme_operating_gust", "start": 2.0, "rotor_diameter": 126.0, "hub_height": 90.0}
    return gust_of(gust).wind(time, model.wind_speed)


@pytest.mark.parametrize(
    "model", [model_of(), model_of(2, True), load_model("nrel5mw-rated")], ids=["plain", "further", "shipped"]
)
def test_a_gust_loads_the_turbine_as_stepping_its_matrices_does(model):
    wind = _gust(model, 2501)
    response = wind_response(wind_modes(model), wind, 0.0)
    plain = run(model, np.zeros((2500, 3 * len(model.flaps))), wind, azimuth=0.4)
    azimuth = 0.4 + model.rotor_speed * model.time_step * np.arange(2501)
    names = model.turbine.outputs
    for name in model.blade_outputs:
        # By the largest component: symmetry makes some of them zero but for round-off.
        columns = [names.index(f"{name}_{part}") for part in "0cs"]
        assert_near(response[:, columns], to_components(plain.outputs[name], azimuth), 1e-10, name)
    tower = np.hstack([plain.outputs[name] for name in model.fixed_outputs[:2]])
    columns = [names.index(name) for name in model.fixed_outputs[:2]]
    assert_near(response[:, columns], tower, 1e-10, "tower")
    np.testing.assert_array_equal(response[:, -1], wind)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("steps", [1, 5])
def test_a_plant_in_a_gust_is_the_plain_simulation_in_it(backend, steps):
    model = model_of(2, True)
    plant = plant_of(2, steps, 600 // steps, model, backend)
    wind, actions = _gust(model, 601), actions_of(plant, 600 // steps)
    start = rest(plant, gust=GivenWind(wind, 0.0), azimuth=np.array([0.4, 3.0]))
    flight = flown(plant, start, actions)
    acceleration = np.tile([flap.acceleration_limit for flap in model.flaps], 3)
    for turbine in range(2):
        held = np.repeat(acceleration * actions[:, turbine], steps, axis=0)
        expected = run(model, held, wind, start.azimuth[turbine])
        for name, values in expected.outputs.items():
            assert_near(flight.samples(name)[:, turbine], values[1:], 1e-9, name)


def test_a_gust_and_turbulence_add():
    plant = plant_of(3, 5, 60, model_of(1, True))
    gust = GivenWind(_gust(plant.model, 301), 0.0)
    noise = np.random.default_rng(0).standard_normal((3, plant.noise_count))
    still = np.zeros((60, 3, 3))
    intensity = np.array([0.0, 0.05, 0.15])
    both = flown(plant, rest(plant, gust=gust, noise=noise, intensity=intensity), still)
    turbulence = flown(plant, rest(plant, noise=noise, intensity=intensity), still)
    alone = flown(plant, rest(plant, gust=gust), still)
    for name in plant.quantities.sample:
        assert_near(turbulence.samples(name) + alone.samples(name), both.samples(name), 1e-12, name)


def test_a_wind_that_always_blew_finds_the_turbine_in_equilibrium():
    model = load_model("nrel5mw-rated")
    response = wind_response(wind_modes(model), np.full(300, 1.5), 1.5)
    steady = 1.5 * model.turbine.select(inputs=["wind"]).dc_gain()[:, 0]
    np.testing.assert_allclose(
        response[:, :-1], np.tile(steady, (300, 1)), rtol=1e-8, atol=1e-8 * steady.max()
    )
    np.testing.assert_array_equal(response[:, -1], 1.5)


@pytest.mark.parametrize("backend", BACKENDS)
def test_plants_of_a_process_compute_the_response_to_a_wind_once(monkeypatch, backend):
    winds = []
    monkeypatch.setattr(
        responses,
        "wind_response",
        lambda modal, wind, before: winds.append(wind) or wind_response(modal, wind, before),
    )
    responses.gust_response.cache_clear()
    last = []
    for size in (1.0, 1.0, 2.0, 1.0):
        plant = plant_of(1, 5, 20, backend=backend)
        # Of the same numbers, but another object each time.
        for _ in range(2):
            start = rest(plant, gust=GivenWind(np.linspace(0.0, size, 101), 0.0))
            plant.reset(np.arange(1), start)
        last.append(plant.step(np.zeros((1, 3))).last)
    assert [wind[-1] for wind in winds] == [1.0, 2.0]
    np.testing.assert_array_equal(last[0], last[3])
    assert (last[0] != last[2]).any()
