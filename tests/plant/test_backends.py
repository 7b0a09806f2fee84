"""Compiled code and numpy tell the same, whatever is asked of them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from flapgym.plant import Faults
from tests.plant.plants import BACKENDS, actions_of, assert_near, flown, model_of, plant_of, rest, start_of

INTERVALS = 12


def _assert_alike(got, expected, relative, at_bounds=False):
    """Every quantity to its own largest value.

    Commands at their bounds bring flaps to rest at the very stop; whether they have met it is anyone's word.
    """
    # Of blades that all do alike the tower's side-side motion is nothing but round-off of the fore-aft one.
    side_side, fore_aft = "tower_side_side", "tower_fore_aft"
    for name in expected.quantities.last:
        if not (at_bounds and name == "flap_stopped"):
            beside = np.nan_to_num(expected.last(fore_aft)) if name == side_side else 0.0
            assert_near(got.last(name), expected.last(name), relative, name, beside)
    if expected.loads.samples.size:
        for name in expected.quantities.sample:
            beside = expected.samples(fore_aft) if name == side_side else 0.0
            assert_near(got.samples(name), expected.samples(name), relative, name, beside)
    assert got.loads.samples.shape == expected.loads.samples.shape
    for name in ("rbm_square", "angle_square", "fixed_square"):
        of_loads, wanted = getattr(got.loads, name), getattr(expected.loads, name)
        assert of_loads.shape == wanted.shape
        for column in range(wanted[0, 0].size):
            every = wanted.reshape(*wanted.shape[:2], -1)[..., column]
            of_fore_aft = wanted[..., 0] if name == "fixed_square" and column == 1 else 0.0
            # A square is off by twice what its root is.
            assert_near(
                of_loads.reshape(*of_loads.shape[:2], -1)[..., column],
                every,
                2.0 * relative,
                name,
                of_fore_aft,
            )


def _both(count, steps, model, seed, **stepping):
    flights = []
    for backend in BACKENDS:
        plant = plant_of(count, steps, INTERVALS, model, backend, **stepping)
        # One action more than the episode has.
        actions = actions_of(plant, INTERVALS + 1, seed)
        flights.append(flown(plant, start_of(plant, seed), actions))
    return flights


@st.composite
def _setups(draw):
    flaps, single = draw(st.integers(1, 3)), draw(st.booleans())
    told = draw(st.sampled_from(["record", "every sample", "last sample", "moments"]))
    fraction = st.one_of(st.none(), st.floats(-0.05, 0.05))
    faults = Faults(
        effectiveness=draw(st.tuples(*[st.floats(0.0, 2.0)] * 3 * flaps)),
        stuck=draw(st.one_of(st.just((None,) * 3), st.tuples(*[fraction] * 3 * flaps))),
        lag=draw(st.sampled_from([0.0, 0.0, 1e-6, 0.01, 0.3, 1e7])),
    )
    return {
        "steps": draw(st.integers(1, 10)),
        "count": draw(st.integers(1, 40)),
        "model": (flaps, draw(st.booleans())),
        "single_blade": single,
        "faults": faults,
        "record": told == "record",
        "every_sample": told in ("record", "every sample"),
        "displacements": told != "moments",
        "seed": draw(st.integers(0, 1000)),
    }


ALIKE = Faults(stuck=(0.03125,) * 3)


# One turbine and many, which compiled code treats apart, with what is rarely drawn together.
@example(
    {
        "steps": 1,
        "count": 1,
        "model": (1, False),
        "faults": ALIKE,
        "record": True,
        "every_sample": True,
        "seed": 0,
    }
)
@example({"steps": 5, "count": 1, "model": (3, True), "record": True, "every_sample": True, "seed": 1})
@example({"steps": 5, "count": 39, "model": (2, True), "record": True, "every_sample": True, "seed": 2})
@example({"steps": 4, "count": 1, "model": (1, False), "record": False, "displacements": False, "seed": 3})
@settings(max_examples=120, deadline=None)
@given(_setups())
def test_both_tell_the_same_numbers(setup):
    given = dict(setup)
    model = model_of(*given.pop("model"))
    expected, got = _both(given.pop("count"), given.pop("steps"), model, given.pop("seed"), **given)
    _assert_alike(got, expected, 1e-12)


@pytest.mark.parametrize("count", [1, 2, 40, 300])
@pytest.mark.parametrize("flaps", [1, 3])
def test_both_tell_the_same_in_single_precision(count, flaps):
    expected, got = _both(count, 5, model_of(flaps, True), 4, precision="float32")
    _assert_alike(got, expected, 1e-5)


@pytest.mark.parametrize("backend", BACKENDS)
def test_single_precision_stays_within_a_hundred_thousandth_of_double(backend):
    flights = []
    for precision in ("float64", "float32"):
        plant = plant_of(9, 5, 400, backend=backend, precision=precision)
        flights.append(flown(plant, start_of(plant), actions_of(plant, 400, 3)))
    double, single = flights
    for name in ("rbm", "tip_deflection", "tower_fore_aft"):
        assert_near(single.samples(name), double.samples(name), 1e-5, name)
    for name in ("flap_angle", "flap_rate"):
        np.testing.assert_array_equal(single.last(name), double.last(name))


@pytest.mark.parametrize("count", [1, 2, 9])
def test_commands_at_their_bounds_leave_them_together(count):
    flights = []
    for backend in BACKENDS:
        plant = plant_of(count, 5, 600, backend=backend)
        actions = np.random.default_rng(2).choice([-1.0, 1.0], (600, count, 3))
        flights.append(flown(plant, start_of(plant), actions))
    expected, got = flights
    assert expected.last("flap_stopped").any()
    _assert_alike(got, expected, 1e-11, at_bounds=True)


@pytest.mark.parametrize("count", [1, 5])
def test_actions_of_single_precision_or_beyond_their_bounds_are_taken_alike(count):
    flights = []
    for backend in BACKENDS:
        plant = plant_of(count, 3, INTERVALS, model_of(2), backend)
        actions = actions_of(plant, INTERVALS, 3, 3.0).astype(np.float32)
        flights.append(flown(plant, start_of(plant), actions))
        clipped = flown(plant, start_of(plant), np.clip(actions.astype(float), -1.0, 1.0))
        np.testing.assert_array_equal(flights[-1].loads.last, clipped.loads.last)
    _assert_alike(*flights, 1e-12, at_bounds=True)


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("count", [1, 20])
@pytest.mark.parametrize("backend", BACKENDS)
def test_flaps_at_rest_leave_no_denormal_numbers_in_the_modes(backend, count, precision):
    plant = plant_of(count, 5, 4, backend=backend, record=False, precision=precision)
    plant.reset(np.arange(count), rest(plant))
    plant.step(np.ones((count, 3)))
    # Back at the centre: from there on the modes only decay. This is what a hundred thousand actions leave of them.
    modes, tiny = plant.state.modes, np.finfo(precision).tiny
    small = (modes * (8.0 * tiny / np.abs(modes).max())).astype(modes.dtype)
    plant.state = plant.state._replace(flaps=np.zeros(plant.state.flaps.shape), modes=small)
    for _ in range(1000):
        plant.step(np.zeros((count, 3)))
    left = np.abs(plant.state.modes)
    assert not ((left > 0.0) & (left < tiny)).any()
