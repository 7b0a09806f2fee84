"""Plant steps per second of every form of the 258-state turbine: the paper's table, plain modes, numpy, compiled."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from benchmarks.environment.timing import best_of
from flapgym.aeroelastic.equations import periodic_equations
from flapgym.aeroelastic.periodic import PeriodicModel, periodic_model
from flapgym.core.modal import modal_form
from flapgym.model import TurbineModel, load_model
from flapgym.model.reduced import reduced_model
from flapgym.plant import Start, Stepping, make_plant
from flapgym.turbine import load_case
from studies.parts import Study

TABLE_ENTRIES = 24
"""Azimuths of the table that is timed: more entries cost memory, 0.5 MB each, and no less time."""
MOST_TABLED = 64
"""Turbines the table's batch is timed with; each step of each reads a matrix of its own, so more change nothing."""


@dataclass(frozen=True)
class Form:
    """One way to step.

    Attributes
    ----------
    name : str
    turbines : int
        Stepped together.
    states : int
        Of one turbine.
    steps : int
        Plant steps of each turbine in a call.
    """

    name: str
    turbines: int
    states: int
    steps: int


def table_of_azimuths(entries: int) -> PeriodicModel:
    """The paper's A(theta) of the shipped turbine, exact from its parts, at so many azimuths."""
    study = Study(load_case("nrel5mw-rated"))
    equations = periodic_equations(study.parts)
    return periodic_model(equations, study.seen(0.0), study.time_step, entries)


def by_table(table: PeriodicModel, turbines: int, steps: int) -> Callable[[], None]:
    """The paper's way: every turbine at an azimuth of its own looks up its own matrices in every step."""
    rng = np.random.default_rng(0)
    entries, order = len(table.A), table.A.shape[1]
    states, u = np.zeros((turbines, order)), rng.standard_normal((turbines, len(table.inputs)))
    outputs, at = np.empty((turbines, len(table.outputs))), rng.integers(entries, size=turbines)

    def call() -> None:
        for n in range(steps):
            for turbine in range(turbines):
                entry = (at[turbine] + n) % entries
                x, now = states[turbine], u[turbine]
                outputs[turbine] = table.C[entry] @ x + table.D[entry] @ now
                states[turbine] = table.A[entry] @ x + table.B[entry] @ now
        states[:] = 0.0

    return call


def by_modes(model: TurbineModel, steps: int) -> Callable[[], None]:
    """The time-invariant turbine in modal form, step by step, wind and flaps together."""
    modal = modal_form(model.turbine)
    u = np.random.default_rng(0).standard_normal((steps, len(modal.inputs)))

    def call() -> None:
        modal.simulate(u)

    return call


def by_plant(
    model: TurbineModel, turbines: int, steps_per_action: int, backend: str, precision: str, steps: int
) -> Callable[[], None]:
    """The plant as the environments step it, without their Python."""
    actions = steps // steps_per_action
    stepping = Stepping(
        steps_per_action, actions, model.length_scale, displacements=False, precision=precision, pool=16
    )
    plant = make_plant(model, turbines, stepping, backend)
    rng = np.random.default_rng(0)
    flaps = np.zeros((turbines, 3))
    start = Start(
        azimuth=rng.uniform(0.0, 2.0 * np.pi, turbines),
        angle=flaps,
        rate=flaps,
        intensity=np.full(turbines, model.turbulence_intensity),
        realisation=np.arange(turbines) % 16,
    )
    everyone = np.arange(turbines)
    commands = rng.uniform(-1.0, 1.0, (actions, turbines, 3)).astype(np.float32)
    plant.reset(everyone, start)

    def call() -> None:
        # Past the end of the episode a plant stays at its last interval: time is not spent on resets.
        for command in commands:
            plant.step(command)

    return call


def measure(
    counts: tuple[int, ...], seconds: float, rounds: int, tell: Callable[[str], None]
) -> dict[Form, float]:
    """Plant steps per second of processor time of every form, counted over all turbines."""
    model = load_model()
    tell("kernels: the table of azimuths")
    table = table_of_azimuths(TABLE_ENTRIES)
    order, states = table.A.shape[1], model.turbine.order
    calls: dict[Form, Callable[[], None]] = {
        Form("A(theta) table", 1, order, 500): by_table(table, 1, 500),
        Form("A(theta) table, individual azimuths", MOST_TABLED, order, 10): by_table(table, MOST_TABLED, 10),
        Form("modal, plain numpy", 1, states, 2000): by_modes(model, 2000),
    }
    backends = [("numpy", "float64"), ("numba", "float64"), ("numba", "float32")]
    for backend, precision in backends:
        if importlib.util.find_spec(backend) is None:
            tell(f"left out: {backend}, which is not installed")
            continue
        for count in counts:
            for k in (1, 5):
                steps = 20 * k if count > 16 else 100 * k
                name = f"plant, {backend} {precision}, {k} steps an action"
                calls[Form(name, count, states, steps)] = by_plant(model, count, k, backend, precision, steps)
    best = best_of(calls, seconds, rounds, tell)
    return {form: form.steps * form.turbines / time for form, time in best.items()}


def cost_by_order(
    tolerances: tuple[float, ...], seconds: float, rounds: int, tell: Callable[[str], None]
) -> list[tuple[str, int, float, float]]:
    """Tolerance, order, and plant steps per second of one turbine and of 1024 (five steps an action, float64)."""
    model = load_model()
    models = {"the shipped model": model} | {
        f"{100 * tolerance:g} % of rms": reduced_model(model, tolerance) for tolerance in tolerances
    }
    calls = {
        (name, count): by_plant(each, count, 5, "auto", "float64", 100)
        for name, each in models.items()
        for count in (1, 1024)
    }
    best = best_of(calls, seconds, rounds, tell)
    return [
        (name, each.turbine.order, 100 / best[name, 1], 100 * 1024 / best[name, 1024])
        for name, each in models.items()
    ]
