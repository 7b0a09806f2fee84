"""An hour of the compiled plant beside an hour of the plainest stepping of the model's own matrices."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flapgym.model import load_model
from flapgym.plant import Start, Stepping, chosen_backend, make_plant
from flapgym.plant.disturbance import disturbance_system
from reference.plant import run

STEPS_PER_ACTION = 5
FORMS = (("numpy", "float64"), ("auto", "float64"), ("auto", "float32"))
"""Backend and precision."""


def agreement(seconds: float, tell: Callable[[str], None]) -> dict[str, float]:
    """Largest difference of moments, tip deflections and tower top over the largest value, per form of the plant.

    Turbulence from rest and random actions that reach the stops; both see the same wind and the same actions.
    """
    model = load_model()
    intervals = round(seconds / (STEPS_PER_ACTION * model.time_step))
    steps = intervals * STEPS_PER_ACTION
    rng = np.random.default_rng(0)
    actions = rng.uniform(-1.0, 1.0, (intervals, 3))
    white = rng.standard_normal(steps + 1)
    tell(f"agreement: {steps:,} plain steps")
    wind = _wind(white)
    acceleration = np.repeat(model.flaps[0].acceleration_limit * actions, STEPS_PER_ACTION, axis=0)
    plain = run(model, acceleration, wind, azimuth=0.5)
    found = {}
    for backend, precision in FORMS:
        stepping = Stepping(
            STEPS_PER_ACTION,
            intervals,
            model.length_scale,
            every_sample=True,
            record=True,
            precision=precision,
        )
        plant = make_plant(model, 1, stepping, backend)
        noise = np.zeros((1, plant.noise_count))
        noise[0, -steps - 1 :] = white
        rest = np.zeros((1, 3))
        start = Start(np.array([0.5]), rest, rest, np.array([model.turbulence_intensity]), noise)
        plant.reset(np.arange(1), start)
        series = np.concatenate([plant.step(action[None]).samples[0] for action in actions])
        places = plant.quantities.sample
        errors = [
            np.abs(series[:, places[name]] - expected[1:]).max() / np.abs(expected).max()
            for name, expected in plain.outputs.items()
        ]
        found[f"{chosen_backend(backend)}, {precision}"] = float(max(errors))
    return found


def _wind(white: np.ndarray) -> np.ndarray:
    """The wind of white noise from rest, by the filter's own matrices."""
    model = load_model()
    system = disturbance_system(model, model.length_scale).select(outputs=["wind"])
    # The wind depends on the filter's states alone, which come first and are driven by no other.
    order = system.order - model.turbine.order
    state, wind = np.zeros(order), np.empty(white.size)
    A, b, c, d = system.A[:order, :order], system.B[:order, 0], system.C[0, :order], system.D[0, 0]
    for n, now in enumerate(white.tolist()):
        wind[n] = c @ state + d * now
        state = A @ state + b * now
    return wind
