"""The plant gives what the plainest stepping of the model's matrices gives, and what symmetry and linearity ask."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flapgym.core.modal import modal_form
from flapgym.plant import Faults, GivenWind
from flapgym.plant.disturbance import disturbance_system
from reference.plant import run
from tests.plant.plants import (
    BACKENDS,
    LENGTH_SCALE,
    actions_of,
    assert_near,
    flaps_of,
    flown,
    fly,
    model_of,
    plant_of,
    rest,
    start_of,
)

SEVERAL = [(1, False), (2, True), (3, True)]
"""Flaps a blade, and whether the model has further outputs."""


def _wind_and_state(model, start, turbine):
    """Wind of a realisation, and the turbine's state at sample 0, by the plain stepping of the disturbance system."""
    system = disturbance_system(model, LENGTH_SCALE)
    modes = modal_form(system)
    root = modes.stationary_root()
    noise = start.intensity[turbine] / model.turbulence_intensity * start.noise[turbine]
    state = (modes.expand @ (noise[: system.order] @ root.T).view(complex)).real
    wind = system.select(outputs=["wind"]).simulate(noise[system.order :, None], state)[:, 0]
    return wind, state[system.order - model.turbine.order :]


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("steps, count", [(1, 1), (5, 1), (5, 3), (7, 9)])
@pytest.mark.parametrize("kind", SEVERAL)
def test_every_sample_agrees_with_the_plain_simulation_to_1e9(backend, steps, count, kind):
    model, actions = model_of(*kind), 600 // steps
    each = 1.0 - 0.15 * np.arange(3 * kind[0]) / kind[0]
    lag = 0.03 if kind[0] > 1 else 0.0
    plant = plant_of(count, steps, actions, model, backend, faults=Faults(tuple(each), lag=lag))
    start, action = start_of(plant), actions_of(plant, actions)
    plant.reset(np.arange(count), start)
    flight = fly(plant, action)
    stopped = flight.last("flap_stopped")
    assert stopped.any(), "the stops must take part"
    assert stopped.mean() < 0.9

    acceleration = np.tile([flap.acceleration_limit for flap in model.flaps], 3)
    for turbine in range(min(count, 3)):
        wind, state = _wind_and_state(model, start, turbine)
        expected = run(
            model,
            np.repeat(acceleration * action[:, turbine], steps, axis=0),
            wind,
            start.azimuth[turbine],
            state,
            start.angle[turbine],
            start.rate[turbine],
            each,
            lag,
        )
        for name, values in expected.outputs.items():
            assert_near(flight.samples(name)[:, turbine], values[1:], 1e-9, name)
        for name in ("flap_angle", "flap_rate"):
            assert_near(flight.samples(name)[:, turbine], getattr(expected, name)[1:], 1e-9, name)
        np.testing.assert_allclose(flight.samples("wind")[:, turbine, 0], wind[1:], atol=1e-12)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_long_run_does_not_drift_from_the_plain_simulation(backend):
    model, steps = model_of(2, True), 4000
    plant = plant_of(1, 5, steps, model, backend)
    start, action = start_of(plant), actions_of(plant, steps, 3)
    flight = flown(plant, start, action)
    wind, state = _wind_and_state(model, start, 0)
    acceleration = np.tile([flap.acceleration_limit for flap in model.flaps], 3)
    expected = run(
        model,
        np.repeat(acceleration * action[:, 0], 5, axis=0),
        wind,
        start.azimuth[0],
        state,
        start.angle[0],
        start.rate[0],
    )
    for name, values in expected.outputs.items():
        assert_near(flight.samples(name)[:, 0], values[1:], 1e-9, name)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("kind", SEVERAL)
def test_what_a_reset_tells_is_sample_zero_of_the_plain_simulation(backend, kind):
    model = model_of(*kind)
    plant = plant_of(1, 5, 4, model, backend)
    start = start_of(plant)
    last = plant.reset(np.arange(1), start).last[0]
    wind, state = _wind_and_state(model, start, 0)
    still = np.zeros((1, 3 * kind[0]))
    expected = run(model, still, wind, start.azimuth[0], state, start.angle[0], start.rate[0])
    for name, values in expected.outputs.items():
        np.testing.assert_allclose(last[plant.quantities.last[name]], values[0], rtol=1e-9, err_msg=name)
    np.testing.assert_array_equal(last[plant.quantities.last["flap_angle"]], start.angle[0])
    np.testing.assert_array_equal(last[plant.quantities.last["flap_rate"]], start.rate[0])
    np.testing.assert_allclose(last[plant.quantities.last["wind"]], wind[0], rtol=1e-12)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("flaps", [1, 2])
def test_without_a_tower_three_blades_are_three_single_blades(backend, flaps):
    model = model_of(flaps, tower_coupling=0.0)
    plant = plant_of(1, 4, 200, model, backend)
    flight = flown(plant, rest(plant, azimuth=np.array([0.7])), actions_of(plant, 200, 4, 0.3))
    for blade in range(3):
        own = slice(blade * flaps, (blade + 1) * flaps)
        motion = [flight.samples(name)[:, 0, own] for name in ("flap_angle", "flap_rate")]
        u = np.hstack([*motion, np.zeros((800, 1))])
        alone = model.blade.simulate(np.vstack([np.zeros(2 * flaps + 1), u]))[1:]
        for output, name in enumerate(("rbm", "tip_deflection")):
            assert_near(flight.samples(name)[:, 0, blade], alone[:, output], 1e-9, name)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("flaps", [1, 3])
def test_the_single_blade_is_the_models_blade(backend, flaps):
    model = model_of(flaps, True)
    plant = plant_of(2, 4, 100, model, backend, single_blade=True)
    assert plant.quantities.blade_outputs == model.blade.outputs
    wind = np.sin(0.01 * np.arange(401))
    flight = flown(plant, rest(plant, gust=GivenWind(wind, 0.0)), actions_of(plant, 100, 4, 0.3))
    for turbine in range(2):
        motion = [flight.samples(name)[:, turbine] for name in ("flap_angle", "flap_rate")]
        u = np.hstack([np.vstack([np.zeros(2 * flaps), np.hstack(motion)]), wind[:, None]])
        alone = model.blade.simulate(u)[1:]
        for output, name in enumerate(("rbm", "tip_deflection")):
            assert_near(flight.samples(name)[:, turbine, 0], alone[:, output], 1e-9, name)


@pytest.mark.parametrize("backend", BACKENDS)
def test_the_single_blade_is_each_of_three_alike(backend):
    model = model_of(2, tower_coupling=0.0)
    single, whole = (plant_of(2, 5, 80, model, backend, single_blade=alone) for alone in (True, False))
    noise = np.random.default_rng(3).standard_normal((2, single.noise_count))
    gust = GivenWind(np.cos(0.02 * np.arange(401)), 1.0)
    action = actions_of(single, 80, 5)
    alone = flown(single, rest(single, gust=gust), action)
    three = flown(whole, rest(whole, gust=gust, azimuth=np.array([0.3, 2.0])), np.tile(action, 3))
    for name in ("rbm", "tip_deflection", "flap_angle", "flap_travel"):
        expected = alone.last(name)
        assert_near(three.last(name), np.tile(expected, 3), 1e-9, name)
    assert_near(three.loads.rbm_square, np.repeat(alone.loads.rbm_square, 3, axis=2), 1e-9)
    assert_near(three.loads.angle_square, alone.loads.angle_square, 1e-12)
    assert noise.shape[1] == single.noise_count


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("kind", SEVERAL)
def test_no_blade_is_special(backend, kind):
    """A rotor turned by a third of a revolution, with its flaps' commands handed on, is the same rotor."""
    plant = plant_of(2, 5, 60, model_of(*kind), backend)
    flaps = kind[0]
    start, action = start_of(plant, intensity=np.zeros(2)), actions_of(plant, 60)

    def handed_on(values):
        return np.roll(values, -flaps, axis=-1)

    action[:, 1] = handed_on(action[:, 0])
    turned = replace(
        start,
        azimuth=start.azimuth[0] + np.array([0.0, 2.0 * np.pi / 3.0]),
        angle=np.stack([start.angle[0], handed_on(start.angle[0])]),
        rate=np.stack([start.rate[0], handed_on(start.rate[0])]),
    )
    flight = flown(plant, turned, action)
    for name in plant.quantities.sample:
        first, second = flight.samples(name)[:, 0], flight.samples(name)[:, 1]
        if name in plant.quantities.blade_outputs:
            first = np.roll(first, -1, axis=-1)
        elif name.startswith("flap"):
            first = handed_on(first)
        assert_near(second, first, 1e-11, name)


@pytest.mark.parametrize("backend", BACKENDS)
def test_an_action_held_for_five_steps_is_five_actions_of_one_step(backend):
    five, one = (
        plant_of(2, k, 200 // k, model_of(2, True), backend, record=False, faults=Faults(lag=0.02))
        for k in (5, 1)
    )
    start, actions = start_of(one), actions_of(five, 40, 2)
    held = flown(five, replace(start, noise=start.noise[:, : five.noise_count]), actions)
    single = flown(one, start, np.repeat(actions, 5, axis=0))
    for name in five.quantities.last:
        if name != "flap_stopped":
            assert_near(held.last(name), single.last(name)[4::5], 1e-9, name)
    met = single.last("flap_stopped").reshape(40, 5, 2, -1).any(axis=1)
    np.testing.assert_array_equal(held.last("flap_stopped") != 0.0, met)
    for name in ("rbm_square", "angle_square"):
        expected = getattr(single.loads, name)
        mean = expected.reshape(40, 5, *expected.shape[1:]).mean(axis=1)
        np.testing.assert_allclose(getattr(held.loads, name), mean, rtol=1e-9)


@pytest.mark.parametrize("backend", BACKENDS)
def test_wind_and_flap_responses_add(backend):
    model = model_of(2, True)
    plant = plant_of(3, 5, 60, model, backend)
    noise = np.repeat(np.random.default_rng(6).standard_normal((1, plant.noise_count)), 3, axis=0)
    # Turbine 0: wind and flaps; 1: wind alone; 2: flaps alone.
    start = rest(plant, noise=noise, intensity=np.array([0.1, 0.1, 0.0]), azimuth=np.full(3, 0.4))
    action = actions_of(plant, 60, 5)
    action[:, 1], action[:, 2] = 0.0, action[:, 0]
    flight = flown(plant, start, action)
    assert flight.last("flap_stopped").any()
    for name in (*model.blade_outputs, *model.fixed_outputs):
        of_both = flight.samples(name)
        assert_near(of_both[:, 1] + of_both[:, 2], of_both[:, 0], 1e-12, name)


@pytest.mark.parametrize("backend", BACKENDS)
def test_the_loads_of_single_flaps_add_up_though_each_meets_its_stops(backend):
    model = model_of(2, True)
    plant = plant_of(7, 5, 60, model, backend)
    count = flaps_of(plant).shape[1]
    action = actions_of(plant, 60, 5)
    # Turbine 0 moves every flap, turbine i flap i alone.
    action[:, 1:] = np.eye(count) * action[:, :1]
    flight = flown(plant, rest(plant, azimuth=np.full(7, 0.4)), action)
    assert flight.last("flap_stopped")[:, 0].any()
    for name in (*model.blade_outputs, *model.fixed_outputs):
        parts = flight.samples(name)
        assert_near(parts[:, 1:].sum(axis=1), parts[:, 0], 1e-12, name)


def test_winds_by_strip_beside_the_homogeneous_one_change_nothing():
    plain, strips = (plant_of(2, 5, 20, model_of(2, True, strips=count), "numpy") for count in (0, 3))
    start, actions = start_of(plain), actions_of(plain, 20)
    expected, got = flown(plain, start, actions), flown(strips, start, actions)
    for name in plain.quantities.sample:
        assert_near(got.samples(name), expected.samples(name), 1e-12, name)


def test_models_of_the_same_numbers_under_other_names_are_not_taken_for_each_other():
    model = model_of(1, True)
    own = model.turbine.outputs[:8]
    others = ("tilt", "speed_0", "speed_c", "speed_s", "yaw", "hinge_0", "hinge_c", "hinge_s")
    renamed = replace(model, turbine=replace(model.turbine, outputs=(*own, *others)))
    for each in (model, renamed, model):
        plant = plant_of(1, 5, 20, each, "numpy")
        actions = actions_of(plant, 20)
        flight = flown(plant, rest(plant), actions)
        held = np.repeat(each.flaps[0].acceleration_limit * actions[:, 0], 5, axis=0)
        for name, values in run(each, held, np.zeros(101)).outputs.items():
            assert_near(flight.samples(name)[:, 0], values[1:], 1e-9, name)
