"""A flap that is stuck loads its blade steadily: marching the modes leaves them where they were found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flapgym.core.modal import modal_form
from flapgym.core.multiblade import to_components
from flapgym.model import load_model
from flapgym.model.harmonics import PeriodicPart
from flapgym.plant import Faults
from flapgym.plant.stuck import stuck_modes
from reference.plant import run
from tests.plant.plants import BACKENDS, assert_near, flown, model_of, plant_of, rest


def _flap_modes(model):
    return modal_form(model.turbine.select(inputs=model.turbine.inputs[: 6 * len(model.flaps)]))


@pytest.mark.parametrize("model", [load_model("nrel5mw-rated"), model_of(3)], ids=["shipped", "three flaps"])
def test_the_steady_motion_under_stuck_flaps_is_the_one_that_marching_keeps(model):
    flap, flaps = _flap_modes(model), len(model.flaps)
    turn, theta = model.rotor_speed * model.time_step, 0.7
    angle = np.random.default_rng(0).uniform(-0.08, 0.08, (3, flaps))
    z = stuck_modes(flap, angle, np.array([theta]), turn)[0]
    steps = 200
    for step in range(steps):
        components = to_components(angle.T, np.array(theta + step * turn)).ravel()
        z = flap.values * z + flap.B[:, : 3 * flaps] @ components
    expected = stuck_modes(flap, angle, np.array([theta + steps * turn]), turn)[0]
    np.testing.assert_allclose(z, expected, atol=1e-10 * np.abs(expected).max())


def test_equal_stuck_flaps_load_the_turbine_as_its_steady_gain_says():
    model = load_model("nrel5mw-rated")
    flap = _flap_modes(model)
    turn, azimuth = model.rotor_speed * model.time_step, np.array([0.3, 2.0])
    z = stuck_modes(flap, np.full((3, 1), 0.05), azimuth, turn)
    outputs = (z @ flap.C.T).real + 0.05 * flap.D[:, 0]
    steady = 0.05 * model.turbine.dc_gain()[:, 0]
    # Each quantity by its largest component: symmetry makes some of them zero but for round-off.
    for part in (slice(0, 3), slice(3, 6), slice(6, 8)):
        error = np.abs(outputs[:, part] - steady[part]).max()
        assert error <= 1e-9 * np.abs(steady[part]).max()


def _revolving(model, steps):
    """The model with a revolution of a whole number of actions, so that samples can be compared, and that number."""
    actions = round(2.0 * np.pi / (model.rotor_speed * model.time_step)) // steps
    return replace(model, rotor_speed=2.0 * np.pi / (steps * actions) / model.time_step), actions


def _periodic(model):
    """The same as a model of unequal blades whose blades do not differ."""
    n, inputs, outputs = model.turbine.order, len(model.turbine.inputs), len(model.turbine.outputs)
    part = PeriodicPart(
        np.zeros((n + outputs, 1)),
        np.zeros((1, 1, 1), complex),
        np.zeros((1, n + inputs)),
        np.zeros((2, n + outputs), complex),
    )
    return replace(model, periodic=part)


@pytest.mark.parametrize("backend", [*BACKENDS, "periodic"])
@pytest.mark.parametrize("flaps", [1, 2])
@pytest.mark.parametrize("count", [2, 9])
def test_plants_start_in_the_steady_motion_under_their_stuck_flaps(backend, count, flaps):
    faults = Faults(effectiveness=(0.5, 1.0, 1.0), stuck=(0.03, None, -0.02))
    model, actions = _revolving(model_of(flaps, True), 5)
    if backend == "periodic":
        model, backend = _periodic(model), "auto"
    plant = plant_of(count, 5, 200, model, backend, faults=faults)
    first = plant.reset(np.arange(count), rest(plant)).last
    flight = flown(plant, rest(plant), np.zeros((actions, count, 3 * flaps)))
    assert np.abs(first[:, :3]).max() > 2e4
    for name in (*model.blade_outputs, *model.fixed_outputs):
        assert_near(flight.last(name)[-1], first[:, plant.quantities.last[name]], 1e-9, name)


def test_the_steady_motion_is_where_the_plain_simulation_ends_up():
    # Without a tower, whose motion would take hours to fade.
    model, actions = _revolving(model_of(2, True, tower_coupling=0.0), 5)
    plant = plant_of(1, 5, 4, model, faults=Faults(stuck=(0.03, None, -0.02)))
    first = plant.reset(np.arange(1), rest(plant, azimuth=np.array([0.6]))).last[0]
    steps = 10 * 5 * actions
    stuck = np.array([0.03, 0.03, 0.0, 0.0, -0.02, -0.02])
    plain = run(model, np.zeros((steps, 6)), np.zeros(steps + 1), azimuth=0.6, flap_angle=stuck)
    for name in (*model.blade_outputs, "tilt", "yaw"):
        assert_near(first[plant.quantities.last[name]], plain.outputs[name][-1], 1e-9, name)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_single_blade_starts_in_its_steady_motion(backend):
    model = model_of(2)
    plant = plant_of(1, 5, 40, model, backend, single_blade=True, faults=Faults(stuck=(0.03, None, None)))
    flight = flown(plant, rest(plant), np.ones((40, 1, 2)))
    steady = model.blade.dc_gain()[:, :2] @ np.full(2, 0.03)
    for value, name in zip(steady, model.blade.outputs, strict=True):
        np.testing.assert_allclose(flight.samples(name), value, rtol=1e-9)
