"""Flaps that float, are stuck, or answer late; and entries that hold for a blade or for each of its flaps."""

from __future__ import annotations

import numpy as np
import pytest

from flapgym.plant import Faults
from tests.plant.plants import BACKENDS, actions_of, assert_near, flown, model_of, plant_of, rest


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_floating_flap_carries_no_load_and_a_stuck_one_does_not_move(backend):
    faults = Faults(effectiveness=(0.0, 1.0, 1.0), stuck=(None, 0.02, -0.03))
    plant = plant_of(1, 5, 50, backend=backend, faults=faults)
    still = flown(plant, rest(plant), np.zeros((50, 1, 3)))
    moved = flown(plant, rest(plant), np.ones((50, 1, 3)))
    assert moved.samples("flap_angle")[-1, 0, 0] == plant.model.flaps[0].angle_limit
    np.testing.assert_array_equal(moved.samples("flap_angle")[:, 0, 1:], np.tile([0.02, -0.03], (250, 1)))
    assert not moved.samples("flap_rate")[:, 0, 1:].any()
    assert np.abs(still.samples("rbm")).max() > 1e4
    np.testing.assert_allclose(moved.samples("rbm"), still.samples("rbm"), rtol=1e-12)


@pytest.mark.parametrize("backend", BACKENDS)
def test_one_entry_a_blade_holds_for_all_its_flaps(backend):
    flights = []
    for faults in (
        Faults(effectiveness=(0.5, 1.0, 1.5), stuck=(None, 0.02, None)),
        Faults(effectiveness=(0.5, 0.5, 1.0, 1.0, 1.5, 1.5), stuck=(None, None, 0.02, 0.02, None, None)),
    ):
        plant = plant_of(2, 5, 20, model_of(2), backend, faults=faults)
        flights.append(flown(plant, rest(plant), actions_of(plant, 20)))
    np.testing.assert_array_equal(flights[0].loads.last, flights[1].loads.last)


@pytest.mark.parametrize("backend", BACKENDS)
def test_each_flap_of_a_blade_can_have_its_own(backend):
    stuck = [None] * 9
    stuck[4] = 0.03
    effectiveness = [1.0] * 9
    effectiveness[7] = 0.0
    plant = plant_of(2, 5, 30, model_of(3), backend, faults=Faults(tuple(effectiveness), tuple(stuck)))
    actions = actions_of(plant, 30)
    flight = flown(plant, rest(plant), actions)
    moves = np.ptp(flight.samples("flap_angle"), axis=0).min(axis=0) > 0.0
    np.testing.assert_array_equal(moves, np.arange(9) != 4)
    # What the floating one and the stuck one are told changes no load.
    others = actions.copy()
    others[:, :, [4, 7]] *= -1.0
    for name in ("rbm", "tower_fore_aft"):
        assert_near(flown(plant, rest(plant), others).samples(name), flight.samples(name), 1e-12, name)
    others[:, :, 8] *= -1.0
    changed = flown(plant, rest(plant), others).samples("rbm") - flight.samples("rbm")
    assert np.abs(changed).max() > 1e4


@pytest.mark.parametrize("backend", BACKENDS)
def test_half_the_effectiveness_is_half_the_load(backend):
    flights = []
    for share in (1.0, 0.5):
        plant = plant_of(2, 5, 40, model_of(2, True), backend, faults=Faults((share,) * 3))
        flights.append(flown(plant, rest(plant), actions_of(plant, 40)))
    assert flights[0].last("flap_stopped").any()
    for name in (*plant.model.blade_outputs, *plant.model.fixed_outputs):
        assert_near(2.0 * flights[1].samples(name), flights[0].samples(name), 1e-12, name)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("lag", [1e-6, 0.014, 0.7])
def test_a_flap_follows_a_command_as_late_as_its_lag(backend, lag):
    plant = plant_of(1, 5, 4, backend=backend, faults=Faults(lag=lag))
    size = 0.01
    flight = flown(plant, rest(plant), np.full((4, 1, 3), size))
    time = plant.model.time_step * np.arange(1, 21)
    command = size * plant.model.flaps[0].acceleration_limit
    expected = command * (time - lag * (1.0 - np.exp(-time / lag)))
    for blade in range(3):
        assert_near(flight.samples("flap_rate")[:, 0, blade], expected, 1e-12, "rate")
    np.testing.assert_allclose(
        plant.state.flaps[2], command * -np.expm1(-time[-1] / lag) * np.ones((3, 1)), rtol=1e-12
    )


def test_a_number_of_entries_that_fits_neither_blades_nor_flaps_is_refused():
    with pytest.raises(ValueError, match="faults.effectiveness: expected 3 entries, one a blade, or 6"):
        plant_of(1, 5, 4, model_of(2), faults=Faults(effectiveness=(1.0,) * 4))
    with pytest.raises(ValueError, match="faults.stuck: expected 3 entries, one a blade, or 6"):
        plant_of(1, 5, 4, model_of(2), "numpy", faults=Faults(stuck=(None,) * 9))


@pytest.mark.parametrize(
    "field, value",
    [
        ("effectiveness", (1.0, np.nan, 1.0)),
        ("effectiveness", ()),
        ("effectiveness", 0.5),
        ("stuck", (0.0, np.inf, None)),
        ("stuck", (None, "jammed", None)),
        ("lag", -0.1),
        ("lag", np.nan),
    ],
)
def test_impossible_faults_are_refused_by_name(field, value):
    with pytest.raises(ValueError, match=f"faults.{field}"):
        Faults(**{field: value})
