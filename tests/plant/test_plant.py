"""The fast plant gives what the plain one gives, one turbine or many, one step or many an action."""

from __future__ import annotations

import numpy as np
import pytest

from flapgym.plant import Plant
from flapgym.plant.disturbance import disturbance_modes, disturbance_system
from flapgym.plant.reference import run
from tests.synthetic import synthetic_blade, synthetic_model

LENGTH_SCALE = 147.0


def _start(plant, seed=0, azimuth=None):
    """A plant at the start of an episode, everything random but the intensity of the first turbine."""
    rng = np.random.default_rng(seed)
    n = plant.count
    start = {
        "noise": rng.standard_normal((n, plant.noise_count)),
        "intensity": np.linspace(0.10, 0.0, n) if n > 1 else np.array([0.10]),
        "azimuth": rng.uniform(0, 2 * np.pi, n) if azimuth is None else azimuth,
        "flap_angle": rng.uniform(-0.1, 0.1, (n, 3)),
        "flap_rate": rng.uniform(-0.5, 0.5, (n, 3)),
    }
    return start, plant.reset(np.arange(n), **start)


def _samples(first, intervals, name, turbine):
    drop = 1 if name.startswith("flap") else 0
    parts = [getattr(first, name)[turbine]] + [getattr(entry, name)[turbine, drop:] for entry in intervals]
    return np.concatenate(parts)


@pytest.mark.parametrize("steps, count", [(1, 1), (5, 1), (5, 3), (7, 2)])
def test_every_sample_agrees_with_the_plain_simulation_to_1e9(steps, count):
    model, actions = synthetic_model(), 600 // steps
    plant = Plant(model, count, steps, actions, LENGTH_SCALE, every_sample=True)
    start, first = _start(plant)
    acceleration = model.acceleration_limit * np.random.default_rng(1).uniform(-1, 1, (actions, count, 3))
    intervals = [plant.advance(entry) for entry in acceleration]
    assert any(entry.stopped.any() for entry in intervals), "the stops must take part"

    modes, root = disturbance_modes(model, LENGTH_SCALE)
    system = disturbance_system(model, LENGTH_SCALE)
    filter_states = system.order - model.turbine.order
    for turbine in range(count):
        level = start["intensity"][turbine] / model.turbulence_intensity
        noise = level * start["noise"][turbine]
        state = (modes.expand @ (noise[: system.order] @ root.T).view(complex)).real
        wind = system.select(outputs=["wind"]).simulate(noise[system.order :, None], state)[:, 0]
        expected = run(
            model,
            np.repeat(acceleration[:, turbine], steps, axis=0),
            wind,
            start["azimuth"][turbine],
            state[filter_states:],
            start["flap_angle"][turbine],
            start["flap_rate"][turbine],
        )
        for name in ("rbm", "tip_deflection", "tower", "flap_angle", "flap_rate"):
            reference = getattr(expected, name)
            got = _samples(first, intervals, name, turbine)
            assert np.abs(got - reference).max() < 1e-9 * np.abs(reference).max(), name
        np.testing.assert_allclose(_samples(first, intervals, "wind", turbine), wind, atol=1e-12)


def test_without_a_tower_three_blades_are_three_single_blades():
    model = synthetic_model(tower_coupling=0.0)
    plant = Plant(model, 1, 4, 200, LENGTH_SCALE, every_sample=True)
    noise = np.random.default_rng(3).standard_normal((1, plant.noise_count))
    plant.reset(np.arange(1), noise, np.zeros(1), np.array([0.7]), np.zeros((1, 3)), np.zeros((1, 3)))
    command = np.random.default_rng(4).uniform(-3.0, 3.0, (200, 1, 3))
    intervals = [plant.advance(entry) for entry in command]
    angle = np.concatenate([entry.flap_angle[0, 1:] for entry in intervals])
    rate = np.concatenate([entry.flap_rate[0, 1:] for entry in intervals])
    rbm = np.concatenate([entry.rbm[0] for entry in intervals])
    for blade in range(3):
        u = np.stack([angle[:, blade], rate[:, blade], np.zeros(800)], axis=1)
        alone = synthetic_blade().simulate(np.vstack([np.zeros(3), u]))[1:, 0]
        np.testing.assert_allclose(rbm[:, blade], alone, atol=1e-9 * np.abs(alone).max())


def test_an_action_held_for_five_steps_is_five_actions_of_one_step():
    model = synthetic_model()
    five, one = Plant(model, 2, 5, 40, LENGTH_SCALE), Plant(model, 2, 1, 200, LENGTH_SCALE)
    _start(five)
    _start(one)
    for action in np.random.default_rng(2).uniform(-10.0, 10.0, (40, 2, 3)):
        held = five.advance(action)
        steps = [one.advance(action) for _ in range(5)]
        np.testing.assert_allclose(
            held.rbm, np.concatenate([entry.rbm for entry in steps], axis=1), rtol=1e-9, atol=1e-3
        )
        np.testing.assert_allclose(held.tower[:, -1], steps[-1].tower[:, -1], atol=1e-12)


def test_wind_and_flap_responses_add():
    model = synthetic_model()
    command = np.random.default_rng(5).uniform(-2.0, 2.0, (60, 3, 3))
    noise = np.random.default_rng(6).standard_normal((1, Plant(model, 1, 5, 60, LENGTH_SCALE).noise_count))
    plant = Plant(model, 3, 5, 60, LENGTH_SCALE)
    rest = np.zeros((3, 3))
    # Turbine 0: wind and flaps; 1: wind alone; 2: flaps alone.
    plant.reset(
        np.arange(3), np.repeat(noise, 3, axis=0), np.array([0.1, 0.1, 0.0]), np.full(3, 0.4), rest, rest
    )
    for entry in command:
        entry[1], entry[2] = 0.0, entry[0]
        rbm = plant.advance(entry).rbm
        np.testing.assert_allclose(rbm[0], rbm[1] + rbm[2], atol=1e-6)


def test_a_realisation_is_the_same_however_long_the_actions_are_held():
    model = synthetic_model()
    rest = np.zeros((1, 3))
    winds = []
    for steps in (1, 5):
        plant = Plant(model, 1, steps, 300 // steps, LENGTH_SCALE, every_sample=True)
        noise = np.random.default_rng(11).standard_normal((1, plant.noise_count))
        plant.reset(np.arange(1), noise, np.array([0.1]), np.zeros(1), rest, rest)
        winds.append(np.concatenate([plant.advance(rest).wind[0] for _ in range(300 // steps)]))
    np.testing.assert_allclose(winds[0], winds[1], atol=1e-12)


def test_the_first_sample_has_the_variance_of_the_lyapunov_equation():
    model, count = synthetic_model(), 4000
    plant = Plant(model, count, 5, 2, LENGTH_SCALE)
    noise = np.random.default_rng(7).standard_normal((count, plant.noise_count))
    rest = np.zeros((count, 3))
    first = plant.reset(np.arange(count), noise, np.full(count, 0.1), np.zeros(count), rest, rest)
    system = disturbance_system(model, LENGTH_SCALE)
    variance = np.diag(system.C @ system.stationary_covariance() @ system.C.T)
    # Four standard errors of a variance from 4000 draws.
    sampling = 4.0 * np.sqrt(2.0 / count)
    assert first.rbm[:, 0, 0].var() == pytest.approx(variance[0], rel=sampling)
    assert first.tip_deflection[:, 0, 1].var() == pytest.approx(variance[3], rel=sampling)
    assert first.tower[:, 0, 0].var() == pytest.approx(variance[6], rel=sampling)
    assert first.wind[:, 0].var() == pytest.approx((0.10 * 11.0) ** 2, rel=sampling)


def test_resetting_one_turbine_leaves_the_others_alone():
    model = synthetic_model()
    plain, disturbed = Plant(model, 3, 5, 20, LENGTH_SCALE), Plant(model, 3, 5, 20, LENGTH_SCALE)
    start, _ = _start(plain)
    _start(disturbed)
    command = np.random.default_rng(8).uniform(-5.0, 5.0, (10, 3, 3))
    for entry in command[:5]:
        plain.advance(entry)
        disturbed.advance(entry)
    disturbed.reset(np.array([1]), *(value[[1]] for value in start.values()))
    for entry in command[5:]:
        expected, got = plain.advance(entry), disturbed.advance(entry)
        np.testing.assert_array_equal(got.rbm[[0, 2]], expected.rbm[[0, 2]])
    assert disturbed.elapsed.tolist() == [10, 5, 10]
