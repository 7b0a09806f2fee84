"""Blades that pitch: the plant against the plainest stepping, its actuator against the equation it stands for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.signal

from flapgym.model import load_model
from flapgym.plant import Faults
from flapgym.plant.actuator import free_motion, pitch_law
from flapgym.turbine import Pitch
from reference.plant import run
from tests.plant.plants import BACKENDS, actions_of, assert_near, flown, model_of, plant_of, rest, start_of

DEGREE = np.pi / 180.0


def pitched(plant, action):
    """What the plain stepping makes of actions (T, n, blades A) of a plant's first turbine."""
    model, k = plant.model, plant.stepping.steps_per_action
    flaps = 3 * len(model.flaps)
    acceleration = np.tile([flap.acceleration_limit for flap in model.flaps], 3)
    commands = np.repeat(action[:, 0], k, axis=0)
    return (
        np.clip(commands[:, :flaps], -1.0, 1.0) * acceleration,
        np.clip(commands[:, flaps:], -1.0, 1.0) * model.pitch_actuator.angle_limit,
    )


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("steps, count", [(1, 1), (5, 1), (5, 3), (7, 2)])
@pytest.mark.parametrize("flaps, lag", [(1, 0.0), (2, 0.03)])
def test_every_sample_agrees_with_the_plain_simulation_to_1e9(backend, steps, count, flaps, lag):
    model, actions = model_of(flaps, True, pitch=True), 600 // steps
    plant = plant_of(count, steps, actions, model, backend, pitch=True, faults=Faults(lag=lag))
    action = actions_of(plant, actions)
    # Slow and large, so that pitch moves, and meets its stops at times.
    held = 150 // steps
    slow = np.sign(actions_of(plant, -(-actions // held), seed=2))
    action[:, :, 3 * flaps :] = np.repeat(slow, held, axis=0)[:actions, :, 3 * flaps :]
    start = rest(plant, azimuth=np.linspace(0.4, 3.0, count))
    flight = flown(plant, replace(start, noise=start_of(plant).noise), action)
    assert 0.02 < flight.last("pitch_stopped").mean() < 0.9, "the stops must take part"
    accelerations, demands = pitched(plant, action)
    still = np.zeros(len(demands) + 1)
    expected = run(model, accelerations, still, start.azimuth[0], lag=lag, pitch=demands)
    for name, values in expected.outputs.items():
        assert_near(flight.samples(name)[:, 0], values[1:], 1e-9, name)
    for name in ("flap_angle", "flap_rate", "pitch_angle", "pitch_rate"):
        assert_near(flight.samples(name)[:, 0], getattr(expected, name)[1:], 1e-9, name)


@pytest.mark.parametrize("backend", BACKENDS)
def test_an_action_held_for_five_steps_is_five_actions_of_one_step(backend):
    model = model_of(2, True, pitch=True)
    five, one = (plant_of(2, k, 300 // k, model, backend, record=False, pitch=True) for k in (5, 1))
    actions = np.repeat(actions_of(five, 6, seed=4), 10, axis=0)
    start = replace(rest(five), noise=start_of(one).noise)
    held = flown(five, replace(start, noise=start.noise[:, : five.noise_count]), actions)
    single = flown(one, start, np.repeat(actions, 5, axis=0))
    for name in five.quantities.last:
        if not name.endswith("stopped"):
            assert_near(held.last(name), single.last(name)[4::5], 1e-11, name)


def test_the_actuator_is_the_one_of_second_order_it_stands_for():
    """Against the step response of w^2 / (s^2 + 2 zeta w s + w^2); the rule is of second order in the step."""
    pitch, dt, steps = Pitch(1.0, 10.0, 0.5, 0.7), 0.007, 600
    w = 2.0 * np.pi * pitch.natural_frequency
    law = pitch_law(pitch, dt)
    rows = free_motion(steps, dt, law, False)[:, 0].reshape(-1, 2) * law.stiffness
    time = dt * np.arange(steps + 1)
    plain = scipy.signal.lti([w**2], [1.0, 2.0 * pitch.damping * w, w**2])
    _, angle = scipy.signal.step(plain, T=time)
    np.testing.assert_allclose(rows[:, 0], angle, atol=2e-4)
    assert rows[-1, 0] == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_demand_beyond_what_the_rate_allows_is_followed_at_the_largest_rate(backend):
    model = model_of(pitch=True)
    plant = plant_of(1, 5, 80, model, backend, pitch=True)
    actions = np.zeros((80, 1, 6))
    actions[:, :, 3:] = np.where(np.arange(80) < 40, -1.0, 1.0)[:, None, None]
    rate = flown(plant, rest(plant), actions).samples("pitch_rate")
    assert rate.max() == pytest.approx(model.pitch_actuator.rate_limit, rel=1e-12)


@pytest.mark.parametrize("backend", BACKENDS)
def test_pitch_held_gives_the_loads_that_the_shipped_model_gives_at_rest(backend):
    """Collective pitch held for long: the model's static gain, by its matrices alone."""
    model = load_model("nrel5mw-site")
    plant = plant_of(1, 5, 3000, model, backend, record=False, pitch=True)
    actions = np.zeros((3000, 1, 6))
    actions[:, :, 3:] = 0.2
    rbm = flown(plant, rest(plant), actions).last("rbm")[-1, 0]
    gain = model.turbine.select(["pitch_angle_0"], ["rbm_0"]).frequency_response(np.zeros(1))[0, 0, 0].real
    # The tower still rings, mostly in cosine and sine.
    assert rbm.mean() == pytest.approx(0.2 * model.pitch_actuator.angle_limit * gain, rel=5e-4)


def test_a_model_without_pitch_is_refused_by_name():
    with pytest.raises(
        ValueError, match=r"^pitch: expected a model with pitch as an input, such as nrel5mw-site"
    ):
        plant_of(1, 5, 4, pitch=True)
