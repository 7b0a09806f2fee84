"""Both kernels' plants under one name, and starts for them."""

from __future__ import annotations

import numpy as np

from flapgym.plant import Setup, Start, Task, layout, make_plant
from tests.synthetic import synthetic_model

LENGTH_SCALE = 147.0
KERNELS = ("numpy", "numba")


def plain_task(model, observed=3):
    """The moments in MN m, and their mean square as the reward's loss."""
    return Task(
        columns=np.arange(observed),
        factors=np.full(observed, 1e-6),
        bounds=np.full(observed, 50.0),
        noisy=np.arange(observed),
        rbm_weight=1.0 / model.rbm_rms**2,
        angle_weight=3.0,
        tower_weight=0.5,
    )


def plant_of(count, steps, intervals, model=None, every_sample=True, **setup):
    model = synthetic_model() if model is None else model
    return make_plant(
        model, count, Setup(steps, intervals, LENGTH_SCALE, every_sample, **setup), plain_task(model)
    )


def start_of(plant, seed=0, **given):
    """Everything random but the intensity of the first turbine."""
    rng = np.random.default_rng(seed)
    n = plant.count
    start = {
        "noise": rng.standard_normal((n, plant.noise_count)),
        "intensity": np.linspace(0.10, 0.0, n) if n > 1 else np.array([0.10]),
        "azimuth": rng.uniform(0, 2 * np.pi, n),
        "flap_angle": rng.uniform(-0.1, 0.1, (n, 3)),
        "flap_rate": rng.uniform(-0.5, 0.5, (n, 3)),
    }
    return Start(**(start | given))


def rest(count, **given):
    """Still air, flaps at rest."""
    start = {
        "azimuth": np.zeros(count),
        "flap_angle": np.zeros((count, 3)),
        "flap_rate": np.zeros((count, 3)),
        "intensity": np.zeros(count),
    }
    return Start(**(start | given))


def fly(plant, actions):
    """Rows (T, n, ROW), samples (T k, n, SAMPLE) and last observation under actions (T, n, blades)."""
    n, k = plant.count, plant.setup.steps_per_action
    rows, samples = [], []
    observation = np.empty((n, plant.task.size), np.float32)
    for action in actions:
        rows.append(np.empty((n, layout.ROW)))
        room = np.empty((n, k, layout.SAMPLE)) if plant.setup.every_sample else None
        samples.append(np.empty((n, 0, layout.SAMPLE)) if room is None else room)
        status = plant.step(action.reshape(-1), observation.reshape(-1), rows[-1].reshape(-1), room)
        assert status >= 0
    joined = np.concatenate([part.transpose(1, 0, 2) for part in samples])
    return np.stack(rows), joined, observation


def series(samples, name):
    """(T, n, 3 or 2) of a quantity from joined samples."""
    column, width = {
        "rbm": (layout.SAMPLE_RBM, 3),
        "tip_deflection": (layout.SAMPLE_TIP, 3),
        "tower": (layout.SAMPLE_TOWER, 2),
        "wind": (layout.SAMPLE_WIND, 1),
        "flap_angle": (layout.SAMPLE_ANGLE, 3),
        "flap_rate": (layout.SAMPLE_RATE, 3),
    }[name]
    return samples[:, :, column : column + width]
