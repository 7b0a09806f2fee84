"""The response to a wind known in advance against the plainest stepping of the model's own matrices."""

from __future__ import annotations

import numpy as np
import pytest

import flapgym.plant.responses as responses
from flapgym.model import load_model
from flapgym.model.multiblade import to_components
from flapgym.plant.disturbance import wind_modes, wind_response
from flapgym.plant.interface import GivenWind
from flapgym.wind import gust_of
from reference.plant import run
from tests.plant.plants import KERNELS, plant_of, rest
from tests.synthetic import synthetic_model


@pytest.mark.parametrize(
    "model", [synthetic_model(), load_model("nrel5mw-rated")], ids=["synthetic", "shipped"]
)
def test_a_gust_loads_the_turbine_as_stepping_its_matrices_does(model):
    time = model.time_step * np.arange(2501)
    gust = {"kind": "extreme_operating_gust", "start": 2.0, "rotor_diameter": 126.0, "hub_height": 90.0}
    wind = gust_of(gust).wind(time, model.wind_speed)
    response = wind_response(wind_modes(model), wind, 0.0)
    plain = run(model, np.zeros((2500, 3)), wind, azimuth=0.4)
    azimuth = 0.4 + model.rotor_speed * time
    expected = np.hstack(
        [
            to_components(plain.rbm, azimuth),
            to_components(plain.tip_deflection, azimuth),
            plain.tower,
            wind[:, None],
        ]
    )
    # Each quantity by its largest component: symmetry makes some of them zero but for round-off.
    for columns in (slice(0, 3), slice(3, 6), slice(6, 8), slice(8, 9)):
        error = np.abs(response[:, columns] - expected[:, columns]).max()
        assert error <= 1e-10 * np.abs(expected[:, columns]).max()


def test_a_wind_that_always_blew_finds_the_turbine_in_equilibrium():
    model = load_model("nrel5mw-rated")
    response = wind_response(wind_modes(model), np.full(300, 1.5), 1.5)
    steady = 1.5 * model.turbine.select(inputs=["wind"]).dc_gain()[:, 0]
    np.testing.assert_allclose(
        response[:, :8], np.tile(steady, (300, 1)), rtol=1e-8, atol=1e-8 * steady.max()
    )
    np.testing.assert_array_equal(response[:, 8], 1.5)


@pytest.mark.parametrize("kernel", KERNELS)
def test_plants_of_a_process_compute_the_response_to_a_wind_once(monkeypatch, kernel):
    winds = []
    monkeypatch.setattr(
        responses,
        "wind_response",
        lambda modal, wind, before: winds.append(wind) or wind_response(modal, wind, before),
    )
    responses.gust_response.cache_clear()
    rows = []
    for size in (1.0, 1.0, 2.0, 1.0):
        plant = plant_of(1, 5, 20, kernel=kernel)
        # Of the same numbers, but another object each time.
        rows.append(plant.reset(np.arange(1), rest(1, gust=GivenWind(np.linspace(0.0, size, 101), 0.0)))[1])
        plant.reset(np.arange(1), rest(1, gust=GivenWind(np.linspace(0.0, size, 101), 0.0)))
    assert [wind[-1] for wind in winds] == [1.0, 2.0]
    np.testing.assert_array_equal(rows[0], rows[3])
