"""The plant of unequal blades against the model's own simulation, and against the constant plant of equal ones."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from flapgym.model.harmonics import PeriodicPart, simulate_periodic
from flapgym.model.multiblade import to_blades, to_components
from flapgym.plant.actuator import Faults
from flapgym.plant.interface import GivenWind, Setup, Start, Task
from flapgym.plant.layout import (
    RBM,
    ROW,
    SAMPLE,
    SAMPLE_ANGLE,
    SAMPLE_RATE,
    SAMPLE_RBM,
    SAMPLE_TIP,
    SAMPLE_WIND,
)
from flapgym.plant.lifted_plant import LiftedPlant
from flapgym.plant.periodic_plant import PeriodicPlant
from tests.synthetic import synthetic_model

TASK = Task(
    columns=np.arange(RBM, RBM + 3),
    factors=np.full(3, 1e-6),
    bounds=np.full(3, 50.0),
    noisy=np.array([-1, -1, -1]),
    rbm_weight=1e-12,
)
SETUP = Setup(steps_per_action=5, intervals=120, length_scale=147.0, every_sample=True)


def _uneven(size):
    """The synthetic turbine with a periodic part of rank 3 and two harmonics, and a turning load."""
    model = synthetic_model()
    n, rng = model.turbine.order, np.random.default_rng(3)
    scale = np.concatenate([np.abs(model.turbine.A).max(axis=1), np.abs(model.turbine.C).max(axis=1)])
    forcing = np.zeros((3, n + 8), dtype=complex)
    forcing[1, n - 4 : n] = 1e-3 + 2e-3j
    forcing[1, n] = 1e4
    part = PeriodicPart(
        left=scale[:, None] * rng.standard_normal((n + 8, 3)),
        core=size * (rng.standard_normal((2, 3, 3)) + 1j * rng.standard_normal((2, 3, 3))),
        right=rng.standard_normal((3, n + 7)) / np.concatenate([np.full(n, 10.0), np.full(7, 10.0)]),
        forcing=forcing if size else 0.0 * forcing,
    )
    return replace(model, periodic=part)


def _start(plant, count, seed=0, **changes):
    rng = np.random.default_rng(seed)
    usual = {
        "azimuth": rng.uniform(0, 6, count),
        "flap_angle": rng.uniform(-0.1, 0.1, (count, 3)),
        "flap_rate": rng.uniform(-0.5, 0.5, (count, 3)),
        "intensity": np.linspace(0.05, 0.15, count),
        "noise": rng.standard_normal((count, plant.noise_count)),
    }
    return Start(**(usual | changes))


def _run(plant, start, intervals=100, seed=1):
    """Samples (n, intervals k, SAMPLE), and rows of the first sample."""
    _, first = plant.reset(np.arange(plant.count), start)
    rng, taken = np.random.default_rng(seed), []
    observation, rows = np.zeros((plant.count, 3), dtype=np.float32), np.zeros((plant.count, ROW))
    for _ in range(intervals):
        samples = np.zeros((plant.count, 5, SAMPLE))
        actions = rng.uniform(-1, 1, 3 * plant.count)
        assert plant.step(actions, observation.reshape(-1), rows.reshape(-1), samples) in (0, 2)
        taken.append(samples)
    return np.concatenate(taken, axis=1), first


def test_without_a_periodic_part_it_is_the_constant_plant():
    equal = _uneven(0.0)
    for setup in (SETUP, replace(SETUP, faults=Faults(effectiveness=(1.0, 0.5, 0.0), lag=0.05))):
        periodic = PeriodicPlant(equal, 3, setup, TASK)
        constant = LiftedPlant(replace(equal, periodic=None), 3, setup, TASK)
        assert periodic.noise_count == constant.noise_count
        start = _start(periodic, 3)
        (got, got_first), (expected, expected_first) = _run(periodic, start), _run(constant, start)
        np.testing.assert_allclose(got_first, expected_first, rtol=1e-9, atol=1e-9)
        size = np.abs(expected).max(axis=(0, 1))
        assert (np.abs(got - expected).max(axis=(0, 1)) <= 1e-9 * size).all()


def test_it_steps_what_the_models_own_simulation_gives():
    model = _uneven(1e-4)
    plant = PeriodicPlant(model, 2, SETUP, TASK)
    gust = GivenWind(np.sin(0.1 * np.arange(601)), 0.0)
    start = _start(plant, 2, noise=None, intensity=np.zeros(2), gust=gust)
    samples, first = _run(plant, start)
    for turbine in range(2):
        azimuth = start.azimuth[turbine] + model.rotor_speed * model.time_step * np.arange(501)
        angle = np.vstack([start.flap_angle[turbine], samples[turbine, :, SAMPLE_ANGLE : SAMPLE_ANGLE + 3]])
        rate = np.vstack([start.flap_rate[turbine], samples[turbine, :, SAMPLE_RATE : SAMPLE_RATE + 3]])
        inputs = np.hstack(
            [to_components(angle, azimuth), to_components(rate, azimuth), gust.wind[:501, None]]
        )
        steady = plant._constants.steady
        x0 = (np.exp(1j * azimuth[0] * np.arange(len(steady))) @ steady).real
        expected = simulate_periodic(model.turbine, model.periodic, inputs, azimuth, x0)
        rbm = to_blades(expected[:, :3], azimuth)
        np.testing.assert_allclose(
            np.vstack([first[turbine, RBM : RBM + 3], samples[turbine, :, SAMPLE_RBM : SAMPLE_RBM + 3]]),
            rbm,
            atol=1e-10 * np.abs(rbm).max(),
        )
        tip = to_blades(expected[1:, 3:6], azimuth[1:])
        np.testing.assert_allclose(
            samples[turbine, :, SAMPLE_TIP : SAMPLE_TIP + 3], tip, atol=1e-10 * np.abs(tip).max()
        )
        np.testing.assert_array_equal(samples[turbine, :, SAMPLE_WIND], gust.wind[1:501])


def test_an_unbalanced_rotor_in_still_air_repeats_itself_every_revolution():
    model = _uneven(1e-4)
    turn = model.rotor_speed * model.time_step
    # A revolution of a whole number of steps, so that samples can be compared.
    steps = round(2.0 * np.pi / turn)
    model = replace(model, rotor_speed=2.0 * np.pi / steps / model.time_step)
    plant = PeriodicPlant(model, 1, replace(SETUP, intervals=2 * steps // 5 + 1), TASK)
    start = _start(
        plant, 1, noise=None, intensity=np.zeros(1), flap_angle=np.zeros((1, 3)), flap_rate=np.zeros((1, 3))
    )
    plant.reset(np.arange(1), start)
    observation, rows, taken = np.zeros((1, 3), dtype=np.float32), np.zeros((1, ROW)), []
    for _ in range(2 * steps // 5):
        samples = np.zeros((1, 5, SAMPLE))
        plant.step(np.zeros(3), observation.reshape(-1), rows.reshape(-1), samples)
        taken.append(samples[0, :, SAMPLE_RBM : SAMPLE_RBM + 3])
    rbm = np.concatenate(taken)
    assert np.abs(rbm).max() > 1e4
    later = rbm[steps:]
    np.testing.assert_allclose(later, rbm[: len(later)], atol=1e-9 * np.abs(rbm).max())


def test_its_state_survives_json():
    model = _uneven(1e-4)
    plant, twin = PeriodicPlant(model, 2, SETUP, TASK), PeriodicPlant(model, 2, SETUP, TASK)
    start = _start(plant, 2)
    for each in (plant, twin):
        _run(each, start, intervals=1)
    _run(plant, start, intervals=40)
    twin.reset(np.arange(2), start)
    for turbine in range(2):
        twin.set_state(turbine, json.loads(json.dumps(plant.get_state(turbine))))
    for each in (plant, twin):
        each.last = np.zeros(2 * ROW)
        each.step(np.full(6, 0.5), np.zeros(6, dtype=np.float32), each.last, np.zeros((2, 5, SAMPLE)))
    np.testing.assert_array_equal(plant.last, twin.last)


def test_blades_that_differ_too_much_are_refused():
    with pytest.raises(ValueError, match="blades differ too much"):
        PeriodicPlant(_uneven(1e3), 1, SETUP, TASK)
    with pytest.raises(ValueError, match="blades differ"):
        PeriodicPlant(synthetic_model(), 1, SETUP, TASK)


def test_a_realisation_is_the_same_to_the_last_bit_whoever_is_reset_with_it():
    together, alone = (PeriodicPlant(_uneven(1e-3), 5, SETUP, TASK) for _ in range(2))
    start = _start(together, 5)
    together.reset(np.arange(5), start)
    for turbine in range(5):
        own = [turbine]
        single = Start(
            azimuth=start.azimuth[own],
            flap_angle=start.flap_angle[own],
            flap_rate=start.flap_rate[own],
            intensity=start.intensity[own],
            noise=start.noise[own],
        )
        alone.reset(np.array(own), single)
        alone.set_state(turbine, together.get_state(turbine))
    given, rows = [], np.zeros(5 * ROW)
    for plant in (together, alone):
        observation = np.zeros(15, dtype=np.float32)
        for _ in range(20):
            plant.step(np.full(15, 0.3), observation, rows)
        given.append(rows.copy())
    np.testing.assert_array_equal(*given)
