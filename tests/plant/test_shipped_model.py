"""The plant on the real turbine: well conditioned, and equal to the plain simulation."""

from __future__ import annotations

import numpy as np
import pytest

from flapgym.core.modal import modal_form
from flapgym.model import load_model
from flapgym.plant.disturbance import disturbance_system
from reference.plant import run
from tests.plant.plants import BACKENDS, actions_of, assert_near, flown, plant_of, rest


def test_its_modes_are_well_conditioned_with_and_without_the_turbulence_filter():
    model = load_model()
    assert modal_form(model.turbine).condition < 1e4
    assert modal_form(disturbance_system(model, model.length_scale)).condition < 1e4


@pytest.mark.parametrize("backend", BACKENDS)
def test_flap_responses_agree_with_the_plain_simulation_to_1e9(backend):
    model = load_model()
    plant = plant_of(1, 5, 200, model, backend)
    action = actions_of(plant, 200, 0)
    flight = flown(plant, rest(plant, azimuth=np.array([2.0])), action)
    acceleration = np.repeat(model.flaps[0].acceleration_limit * action[:, 0], 5, axis=0)
    expected = run(model, acceleration, np.zeros(1001), 2.0)
    for name, values in expected.outputs.items():
        assert_near(flight.samples(name)[:, 0], values[1:], 1e-9, name)


def test_wind_responses_agree_with_the_plain_simulation_to_1e9():
    model = load_model()
    plant = plant_of(1, 1, 1000, model)
    noise = np.random.default_rng(1).standard_normal((1, plant.noise_count))
    noise[0, :-1001] = 0.0  # from rest
    start = rest(plant, noise=noise, intensity=np.array([model.turbulence_intensity]))
    flight = flown(plant, start, np.zeros((1000, 1, 3)))
    # Its length scale is the synthetic model's, which is the shipped one's, too.
    outputs = disturbance_system(model, plant.stepping.length_scale).simulate(noise[0, -1001:, None])
    expected = run(model, np.zeros((1000, 3)), outputs[:, -1])
    for name, values in expected.outputs.items():
        # Symmetry leaves the tower's sideways motion zero but for round-off.
        if name != "tower_side_side":
            assert_near(flight.samples(name)[:, 0], values[1:], 1e-9, name)
    tower = np.abs(expected.outputs["tower_fore_aft"]).max()
    sideways = flight.samples("tower_side_side")[:, 0] - expected.outputs["tower_side_side"][1:]
    assert np.abs(sideways).max() < 1e-9 * tower


def test_the_model_constant_is_the_rms_of_the_stationary_response():
    model = load_model()
    system = disturbance_system(model, model.length_scale)
    covariance = system.stationary_covariance()
    variance = np.diag(system.C @ covariance @ system.C.T)
    # Mean over blades: the collective part, and half of each cyclic part.
    rms = np.sqrt(variance[0] + 0.5 * (variance[1] + variance[2]))
    np.testing.assert_allclose(rms, model.rbm_rms, rtol=1e-3)
