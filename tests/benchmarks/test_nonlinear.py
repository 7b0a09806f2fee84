"""The comparison of linear and non-linear turbine: both meet the same loop, and equal series show no difference."""

import numpy as np
import pytest

from benchmarks.nonlinear import LinearMarch, Loop, measures, table, wind_of
from flapgym.control import OpenLoop, load_agent
from flapgym.core.multiblade import to_blades
from flapgym.model import load_model
from reference.plant import run


@pytest.fixture(scope="module")
def model():
    return load_model("nrel5mw-rated")


def test_open_loop_is_the_models_response_to_the_wind(model):
    wind = wind_of("gust", model, 0.0)
    loop = Loop(LinearMarch(model).step, OpenLoop(), model)
    loop.run(wind[:500])
    loop.run(wind[500:])
    expected = model.turbine.select(inputs=["wind"]).simulate(wind[:, None])
    azimuth = model.rotor_speed * model.time_step * np.arange(len(wind))
    np.testing.assert_allclose(loop.series[:, :3], to_blades(expected[:, :3], azimuth), atol=1.0)
    np.testing.assert_allclose(loop.series[:, 6:8], expected[:, 6:8], atol=1e-9)


def test_flaps_of_the_closed_loop_load_the_turbine_as_in_the_plain_plant(model):
    agent = load_agent("lqg", model)
    commands = []

    class Heard:
        observe = agent.observe

        def predict(self, observation, state=None):
            action, state = agent.predict(observation, state)
            commands.append(model.flaps[0].acceleration_limit * action)
            return action, state

    wind = wind_of("gust", model, 0.0)[:600]
    loop = Loop(LinearMarch(model).step, Heard(), model)
    loop.run(wind)
    plain = run(model, np.array(commands[:-1]), wind)
    moments = plain.outputs["rbm"]
    assert np.abs(plain.flap_angle).max() > 1e-3
    np.testing.assert_allclose(loop.series[:, 8:], plain.flap_angle, atol=1e-9)
    np.testing.assert_allclose(loop.series[:, :3], moments, atol=1e-3 * np.abs(moments).max())


def test_a_longer_wind_begins_as_a_shorter_one(model):
    shorter, longer = (wind_of("turbulence", model, duration) for duration in (1.0, 3.0))
    np.testing.assert_array_equal(longer[: len(shorter)], shorter)


def test_measures_of_a_sinusoid_and_of_equal_series():
    time = np.arange(0.0, 10.0, 0.01)
    series = 1e6 * np.tile(np.sin(2.0 * np.pi * time)[:, None], (1, 11))
    found = measures(series, 0.01)
    assert found["RBM rms [MN m]"] == pytest.approx(np.sqrt(0.5))
    assert found["RBM DEL [MN m]"] == pytest.approx(2.0, rel=0.01)
    for row in table("any", series, series, 0.01).splitlines():
        assert "mean" in row or "| +0.00 | " in row
