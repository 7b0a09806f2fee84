"""A flap that is stuck loads its blade steadily: marching the modes leaves them where they were found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flapgym.model import load_model
from flapgym.model.harmonics import PeriodicPart
from flapgym.model.multiblade import to_components
from flapgym.plant import Faults, layout
from flapgym.plant.modal import modal_form
from flapgym.plant.stuck import stuck_modes
from tests.plant.plants import KERNELS, fly, plant_of, rest
from tests.synthetic import synthetic_model


def test_the_steady_motion_under_stuck_flaps_is_the_one_that_marching_keeps():
    model = load_model("nrel5mw-rated")
    flap = modal_form(model.turbine.select(inputs=model.turbine.inputs[:6]))
    turn, angle, theta = model.rotor_speed * model.time_step, np.array([0.0, 0.08, -0.03]), 0.7
    z = stuck_modes(flap, angle, np.array([theta]), turn)[0]
    steps = 200
    for step in range(steps):
        components = to_components(angle, np.array(theta + step * turn))
        z = flap.values * z + flap.drive[:, :3] @ components
    expected = stuck_modes(flap, angle, np.array([theta + steps * turn]), turn)[0]
    np.testing.assert_allclose(z, expected, atol=1e-10 * np.abs(expected).max())


def test_equal_stuck_flaps_load_the_turbine_as_its_steady_gain_says():
    model = load_model("nrel5mw-rated")
    flap = modal_form(model.turbine.select(inputs=model.turbine.inputs[:6]))
    turn, azimuth = model.rotor_speed * model.time_step, np.array([0.3, 2.0])
    z = stuck_modes(flap, np.full(3, 0.05), azimuth, turn)
    outputs = (z @ flap.read.T).real + 0.05 * flap.D[:, 0]
    steady = 0.05 * model.turbine.dc_gain()[:, 0]
    # Each quantity by its largest component: symmetry makes some of them zero but for round-off.
    for part in (slice(0, 3), slice(3, 6), slice(6, 8)):
        error = np.abs(outputs[:, part] - steady[part]).max()
        assert error <= 1e-9 * np.abs(steady[part]).max()


@pytest.mark.parametrize("kernel", [*KERNELS, "periodic"])
@pytest.mark.parametrize("count", [2, 9])
def test_plants_start_in_the_steady_motion_under_their_stuck_flaps(kernel, count):
    model, faults = synthetic_model(), Faults(effectiveness=(0.5, 1.0, 1.0), stuck=(0.03, None, -0.02))
    steps = round(2.0 * np.pi / (model.rotor_speed * model.time_step))
    # A revolution of a whole number of actions, so that rows can be compared.
    model = replace(model, rotor_speed=2.0 * np.pi / (5 * (steps // 5)) / model.time_step)
    if kernel == "periodic":
        n = model.turbine.order
        model = replace(
            model,
            periodic=PeriodicPart(
                np.zeros((n + 8, 1)),
                np.zeros((1, 1, 1), complex),
                np.zeros((1, n + 7)),
                np.zeros((2, n + 8), complex),
            ),
        )
    plant = plant_of(count, 5, 200, model, kernel="auto" if kernel == "periodic" else kernel, faults=faults)
    _, first = plant.reset(np.arange(count), rest(count))
    rows = fly(plant, np.zeros((steps // 5, count, 3)))[0]
    assert np.abs(first[:, :3]).max() > 5e4
    for part in (slice(0, 3), slice(3, 6), slice(layout.TOWER, layout.TOWER + 2)):
        np.testing.assert_allclose(
            rows[-1][:, part], first[:, part], atol=1e-9 * np.abs(first[:, part]).max()
        )
