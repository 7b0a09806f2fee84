"""The fast plant on the real turbine: well conditioned, and equal to the plain simulation."""

from __future__ import annotations

import numpy as np

from flapgym.aeroelastic.model import load_model
from flapgym.plant import Plant
from flapgym.plant.disturbance import disturbance_system
from flapgym.plant.modal import modal_form
from flapgym.plant.reference import run


def test_its_modes_are_well_conditioned_with_and_without_the_turbulence_filter():
    model = load_model()
    assert modal_form(model.turbine).condition < 1e4
    assert modal_form(disturbance_system(model, model.length_scale)).condition < 1e4


def test_flap_responses_agree_with_the_plain_simulation_to_1e9():
    model = load_model()
    plant = Plant(model, 1, 5, 200, model.length_scale, every_sample=True)
    azimuth, rest = np.array([2.0]), np.zeros((1, 3))
    plant.reset(np.arange(1), np.zeros((1, plant.noise_count)), np.zeros(1), azimuth, rest, rest)
    acceleration = model.acceleration_limit * np.random.default_rng(0).uniform(-1, 1, (200, 1, 3))
    intervals = [plant.advance(entry) for entry in acceleration]
    expected = run(model, np.repeat(acceleration[:, 0], 5, axis=0), np.zeros(1001), azimuth[0])
    for name in ("rbm", "tip_deflection", "tower"):
        got = np.concatenate([getattr(entry, name)[0] for entry in intervals])
        reference = getattr(expected, name)[1:]
        assert np.abs(got - reference).max() < 1e-9 * np.abs(reference).max(), name


def test_wind_responses_agree_with_the_plain_simulation_to_1e9():
    model = load_model()
    plant = Plant(model, 1, 1, 1000, model.length_scale, every_sample=True)
    noise = np.random.default_rng(1).standard_normal((1, plant.noise_count))
    noise[0, :-1001] = 0.0  # from rest
    rest = np.zeros((1, 3))
    plant.reset(np.arange(1), noise, np.array([model.turbulence_intensity]), np.zeros(1), rest, rest)
    intervals = [plant.advance(rest) for _ in range(1000)]
    outputs = disturbance_system(model, model.length_scale).simulate(noise[0, -1001:, None])
    expected = run(model, np.zeros((1000, 3)), outputs[:, 8])
    for name in ("rbm", "tip_deflection", "tower"):
        got = np.concatenate([getattr(entry, name)[0] for entry in intervals])
        reference = getattr(expected, name)[1:]
        assert np.abs(got - reference).max() < 1e-9 * np.abs(reference).max(), name


def test_the_model_constant_is_the_rms_of_the_stationary_response():
    model = load_model()
    system = disturbance_system(model, model.length_scale)
    covariance = system.stationary_covariance()
    variance = np.diag(system.C @ covariance @ system.C.T)
    # Mean over blades: the collective part, and half of each cyclic part.
    rms = np.sqrt(variance[0] + 0.5 * (variance[1] + variance[2]))
    np.testing.assert_allclose(rms, model.rbm_rms, rtol=1e-3)
