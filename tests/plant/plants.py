"""Plants of every backend under one name, starts for them, and flights under given actions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from flapgym.core.arrays import Array
from flapgym.plant import Loads, Quantities, Start, Stepping, make_plant
from tests.synthetic import synthetic_model

LENGTH_SCALE = 147.0
BACKENDS = ("numpy", "numba")


@cache
def model_of(
    flaps: int = 1, further: bool = False, tower_coupling: float = 1.0, strips: int = 0, pitch: bool = False
):
    """The synthetic model, made once."""
    return synthetic_model(tower_coupling, flaps, further, strips, pitch)


def plant_of(count, steps, intervals, model=None, backend="auto", record=True, **stepping):
    """With every sample unless told otherwise."""
    model = model_of() if model is None else model
    stepping = {"every_sample": record, **stepping}
    return make_plant(
        model, count, Stepping(steps, intervals, LENGTH_SCALE, record=record, **stepping), backend
    )


def flaps_of(plant):
    """Stops of every flap, and of pitch where it moves: angle, rate (blades A,) [rad, rad/s]."""
    limits = [(flap.angle_limit, flap.rate_limit) for flap in plant.model.flaps] * plant.stepping.blades
    pitch = plant.model.pitch_actuator
    if plant.stepping.pitch:
        limits += [(pitch.angle_limit, pitch.rate_limit)] * plant.stepping.blades
    return np.array(limits).T


def start_of(plant, seed=0, **given):
    """Everything random; the last turbine of several in still air."""
    rng = np.random.default_rng(seed)
    n, (angle, rate) = plant.count, flaps_of(plant)
    start = {
        "noise": rng.standard_normal((n, plant.noise_count)),
        "intensity": np.linspace(0.10, 0.0, n) if n > 1 else np.array([0.10]),
        "azimuth": rng.uniform(0, 2 * np.pi, n),
        "angle": rng.uniform(-0.6, 0.6, (n, angle.size)) * angle,
        "rate": rng.uniform(-0.3, 0.3, (n, rate.size)) * rate,
    }
    return Start(**(start | given))


def rest(plant, **given):
    """Still air, flaps at rest."""
    n, (angle, _) = plant.count, flaps_of(plant)
    start = {
        "azimuth": np.zeros(n),
        "angle": np.zeros((n, angle.size)),
        "rate": np.zeros((n, angle.size)),
        "intensity": np.zeros(n),
    }
    return Start(**(start | given))


def chosen(start, turbines):
    """The start of some of the turbines."""
    given = {name: value if value is None else value[turbines] for name, value in vars(start).items()}
    return Start(**given)


def actions_of(plant, intervals, seed=1, size=1.0):
    """(T, n, blades F), uniform up to a size."""
    shape = (intervals, plant.count, flaps_of(plant).shape[1])
    return np.random.default_rng(seed).uniform(-size, size, shape)


@dataclass(frozen=True, eq=False)
class Flight:
    """What n turbines did under T actions, one after another along the first axis."""

    quantities: Quantities
    loads: Loads

    def last(self, name: str) -> Array:
        """(T, n, size) of a quantity at the last sample of each action."""
        return self.loads.last[:, :, self.quantities.last[name]]

    def samples(self, name: str) -> Array:
        """(T k, n, size) of a quantity at every sample."""
        return self.loads.samples[:, :, self.quantities.sample[name]]


def fly(plant, actions):
    """Step under actions (T, n, blades F)."""
    told = [plant.step(action) for action in actions]
    parts = {name: np.stack([getattr(each, name) for each in told]) for name in Loads._fields}
    n, k, width = parts["samples"].shape[1:]
    parts["samples"] = parts["samples"].transpose(0, 2, 1, 3).reshape(len(told) * k, n, width)
    return Flight(plant.quantities, Loads(**parts))


def flown(plant, start, actions):
    """Reset all turbines and fly."""
    plant.reset(np.arange(plant.count), start)
    return fly(plant, actions)


def assert_near(got, expected, relative, what="", beside=0.0):
    """Within a share of the largest value expected, or of one `beside` it; the same entries NaN."""
    missing = np.isnan(expected)
    np.testing.assert_array_equal(np.isnan(got), missing)
    got, expected = got[~missing], expected[~missing]
    largest = max(np.abs(expected).max(initial=0.0), np.abs(beside).max())
    error = np.abs(got - expected).max(initial=0.0)
    assert error <= relative * largest, f"{what}: {error / max(largest, 1e-300):.1e} relative"
