"""An interval under held accelerations: nothing but accelerations and jumps drives the shifted modes."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from flapgym.model.multiblade import to_components
from flapgym.plant.frame import OutputRows, turned
from flapgym.plant.held import held
from flapgym.plant.modal import modal_form
from tests.plant.plants import plant_of
from tests.synthetic import synthetic_model

TURN = 0.03


@pytest.mark.parametrize("steps", [1, 2, 5])
def test_outputs_and_modes_are_those_of_the_motion_sample_by_sample(steps):
    turbine = synthetic_model().turbine
    modal = modal_form(turbine.select(inputs=turbine.inputs[:6]))
    rows, rng, dt = OutputRows(steps, 1), np.random.default_rng(steps), modal.time_step
    wanted = np.delete(rows.matrix(TURN).reshape(rows.count, steps, 9), 8, axis=2).reshape(rows.count, -1)
    interval = held(modal, steps, wanted, TURN)

    # Three flaps on turning blades, as any motion would be: accelerations of each step, and jumps of the angles.
    azimuth = 0.4 + TURN * np.arange(steps + 1)
    angle, rate = rng.standard_normal((2, 3))
    acceleration, jump = rng.standard_normal((2, steps, 3))
    motion = [np.concatenate([to_components(each, azimuth[0]) for each in (angle, rate)])]
    for step in range(steps):
        angle = angle + dt * (rate + 0.5 * dt * acceleration[step]) + jump[step]
        rate = rate + dt * acceleration[step]
        motion.append(np.concatenate([to_components(each, azimuth[step + 1]) for each in (angle, rate)]))
    modes = rng.standard_normal(modal.order) + 1j * rng.standard_normal(modal.order)
    shifted = modes + interval.shift @ motion[0]
    outputs = []
    for before, after in itertools.pairwise(motion):
        modes = modal.values * modes + modal.drive @ before
        outputs.append((modal.read @ modes).real + modal.D @ after)

    steps_done = np.stack(
        [
            np.concatenate([to_components(each[step], azimuth[step + 1]) for each in (acceleration, jump)])
            for step in range(steps)
        ]
    )
    given = np.concatenate([motion[0], steps_done.ravel()])
    got = shifted.view(float) @ interval.read + given @ interval.feed
    expected = wanted @ np.concatenate(outputs)
    np.testing.assert_allclose(got, expected, atol=1e-11 * np.abs(expected).max())
    after = interval.decay * shifted
    for step in range(steps):
        after = after + modal.values ** (steps - 1 - step) * (interval.step @ steps_done[step])
    np.testing.assert_allclose(after, modes + interval.shift @ motion[-1], atol=1e-11 * np.abs(after).max())


def test_a_held_acceleration_is_the_same_in_every_step():
    turbine = synthetic_model().turbine
    modal = modal_form(turbine.select(inputs=turbine.inputs[:6]))
    steps, ny = 4, len(modal.outputs)
    interval = held(modal, steps, np.eye(steps * ny), TURN)
    acceleration = np.array([0.3, -1.0, 0.7])
    seen = [turned((step + 1) * TURN) @ acceleration for step in range(steps)]
    pushed = sum(
        modal.values ** (steps - 1 - step) * (interval.step[:, :3] @ each) for step, each in enumerate(seen)
    )
    np.testing.assert_allclose(interval.push @ acceleration, pushed, rtol=1e-12)
    every_step = np.zeros((steps, 6))
    every_step[:, :3] = seen
    fed = every_step.ravel() @ interval.feed[6:]
    np.testing.assert_allclose(acceleration @ interval.held_feed, fed, atol=1e-12 * np.abs(fed).max())
    by_modes = (modal.read @ (interval.push @ acceleration)).real
    np.testing.assert_allclose((acceleration @ interval.pushed)[-ny:], by_modes, rtol=1e-12)
    assert not (acceleration @ interval.pushed)[:-ny].any()


def test_the_nearest_mode_to_the_rotors_speed_decides_who_may_step():
    model = synthetic_model()
    plant = plant_of(1, 5, 4, model, kernel="auto")
    assert type(plant).__name__ == "CompiledPlant"
    turning = np.exp(1j * model.rotor_speed * model.time_step)
    close = np.array([[turning.real, -turning.imag], [turning.imag, turning.real]]) * (1.0 - 1e-5)
    turbine = model.turbine
    blocked = [
        scipy.linalg.block_diag(turbine.A, close),
        np.vstack([turbine.B, np.ones((2, 7))]),
        np.hstack([turbine.C, np.ones((8, 2))]),
    ]
    near = replace(model, turbine=replace(turbine, A=blocked[0], B=blocked[1], C=blocked[2]))
    assert type(plant_of(1, 5, 4, near, kernel="auto")).__name__ == "LiftedPlant"
    with pytest.raises(ValueError, match="kernel: the model has a mode too near"):
        plant_of(1, 5, 4, near, kernel="numba")
