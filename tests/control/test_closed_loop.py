"""The multi-blade closed loop against a simulation blade by blade, and against one blade alone."""

import numpy as np
import pytest

from flapgym.control import Weights, closed_loop, design_model, stability, stationary_rms, synthesise
from flapgym.control.closed_loop import with_effectiveness
from flapgym.core.state_space import StateSpace, series
from flapgym.wind import realise, von_karman_filter
from tests.synthetic import synthetic_model


@pytest.fixture(scope="module")
def model():
    return synthetic_model()


@pytest.fixture(scope="module")
def controller(model):
    return synthesise(design_model(model), Weights(rbm=3.0))


def test_the_loop_equals_a_simulation_of_three_blades_in_their_own_frames(model, controller):
    """Start with one flap deflected: only an asymmetric motion shows a wrong turn of the copies."""
    steps, dt = 800, model.time_step
    wind = realise(von_karman_filter(11.0, 0.1, 147.0, dt), steps, np.random.default_rng(0))[0]
    plant, order = model.turbine, controller.order
    x, copies = np.zeros(plant.order), np.zeros((3, order))
    angle, rate = np.array([0.1, -0.02, 0.0]), np.zeros(3)
    azimuth = 2.0 * np.pi * np.arange(3) / 3.0
    to_axes = np.array([[1 / 3] * 3, [2 / 3] * 3, [2 / 3] * 3])
    found, flap = np.empty((steps, plant.C.shape[0])), np.empty((steps, 3))
    for n in range(steps):
        theta = azimuth + model.rotor_speed * n * dt
        shape = np.array([np.ones(3), np.cos(theta), np.sin(theta)])
        transform = to_axes * shape
        u = np.concatenate([transform @ angle, transform @ rate, [wind[n]]])
        found[n], flap[n] = plant.C @ x + plant.D @ u, transform @ angle
        rbm = shape.T @ found[n, :3]
        measured = np.stack([rbm, angle, rate], axis=1)
        acceleration = copies @ controller.C[0] + measured @ controller.D[0]
        copies = copies @ controller.A.T + measured @ controller.B.T
        x = plant.A @ x + plant.B @ u
        angle, rate = angle + dt * rate + 0.5 * dt**2 * acceleration, rate + dt * acceleration
    loop = closed_loop(model, controller).select(inputs=["wind"])
    start = np.zeros(6 + 3 * order)
    start[:3] = (to_axes * np.array([np.ones(3), np.cos(azimuth), np.sin(azimuth)])) @ [0.1, -0.02, 0.0]
    expected = loop.simulate(wind[:, None], np.concatenate([np.zeros(plant.order), start]))
    scale = np.abs(found).max(axis=0) + 1e-12
    np.testing.assert_allclose(expected[:, : found.shape[1]] / scale, found / scale, atol=1e-9)
    np.testing.assert_allclose(expected[:, found.shape[1] : found.shape[1] + 3], flap, atol=1e-11)


def test_without_tower_coupling_the_turbine_is_its_clamped_blade(controller):
    model = synthetic_model(tower_coupling=0.0)
    blade, m = model.blade, controller.order
    dt = model.time_step
    b_flap, b_wind = blade.B[:, :2], blade.B[:, 2:]
    d_flap, d_wind = blade.D[:1, :2], blade.D[:1, 2:]
    kick = np.array([[0.5 * dt**2], [dt]])
    n = blade.order
    to_rbm, to_flap = controller.B[:, :1], controller.B[:, 1:]
    a = np.block(
        [
            [blade.A, b_flap, np.zeros((n, m))],
            [
                np.zeros((2, n)),
                np.array([[1.0, dt], [0.0, 1.0]]) + kick @ controller.D[:, 1:],
                kick @ controller.C,
            ],
            [to_rbm @ blade.C[:1], to_flap + to_rbm @ d_flap, controller.A],
        ]
    )
    loop = StateSpace(
        a,
        np.vstack([b_wind, np.zeros((2, 1)), to_rbm @ d_wind]),
        np.vstack([np.hstack([blade.C[:1], d_flap, np.zeros((1, m))]), np.eye(1, n + 2 + m, n)]),
        np.vstack([d_wind, np.zeros((1, 1))]),
        dt,
        ("wind",),
        ("rbm", "flap_angle"),
    )
    driven = series(von_karman_filter(11.0, 0.1, 147.0, dt), loop)
    rms = np.sqrt(np.diag(driven.C @ driven.stationary_covariance() @ driven.C.T))
    whole = stationary_rms(model, controller)
    assert whole["rbm"] == pytest.approx(rms[0], rel=1e-8)
    assert whole["flap_angle"] == pytest.approx(rms[1], rel=1e-8)


def test_open_loop_rms_is_the_integral_of_the_spectrum(model):
    rms = stationary_rms(model)
    assert rms["rbm"] == pytest.approx(model.rbm_rms, rel=5e-3)
    assert rms["wind"] == pytest.approx(1.1)


def test_the_margin_is_where_stability_ends(model):
    fierce = synthesise(design_model(model), Weights(rbm=1e4, acceleration=1e-5))
    found = stability(model, fierce)
    assert found.spectral_radius == pytest.approx(closed_loop(model, fierce).spectral_radius(), rel=1e-12)
    assert 1.0 < found.effectiveness_margin < 8.0
    assert closed_loop(model, fierce, found.effectiveness_margin).spectral_radius() < 1.0
    assert closed_loop(model, fierce, found.effectiveness_margin + 0.02).spectral_radius() >= 1.0


def test_effectiveness_multiplies_what_the_flap_does_and_nothing_else(model):
    half = with_effectiveness(model.turbine, 0.5)
    np.testing.assert_allclose(half.dc_gain()[:, :6], 0.5 * model.turbine.dc_gain()[:, :6], atol=1e-9)
    np.testing.assert_allclose(half.dc_gain()[:, 6], model.turbine.dc_gain()[:, 6])


def test_a_regulator_lowers_what_it_weighs(model, controller):
    assert stationary_rms(model, controller)["rbm"] < 0.9 * stationary_rms(model)["rbm"]
