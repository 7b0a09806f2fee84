"""Seconds per time step of every form of the turbine, in one run: the paper's claim of two orders of magnitude.

Each figure is the difference of a long and a short run, so that preparation does not count, and the best of rounds that
take turns. For one core: OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from benchmarks.aerodynamics import table
from benchmarks.turbine.accuracy import AZIMUTH, REFRESH, signals, time_invariant
from flapgym.aeroelastic.equations import periodic_equations
from flapgym.aeroelastic.periodic import PeriodicModel, step_matrices
from flapgym.core.arrays import Array
from flapgym.core.modal import modal_form
from flapgym.model import TurbineModel, load_model
from flapgym.plant import Start, Stepping, make_plant
from reference.full import march_turbine
from studies.parts import Study, Tell

ROUNDS = 3
STEPS_PER_ACTION = 5
BATCH = 256


@dataclass(frozen=True)
class Subject:
    """What is timed.

    Attributes
    ----------
    name : str
    states : int
        Of one turbine.
    run : callable
        Takes so many time steps.
    steps : int
        Of the short run; the long one takes four times as many.
    turbines : int
        Advanced together in a step.
    """

    name: str
    states: int
    run: Callable[[int], object]
    steps: int
    turbines: int = 1


def assembled(study: Study, u: Array, refresh: int) -> Array:
    """A(theta) put together anew every so many steps, none stored."""
    equations, aerodynamics, dt = periodic_equations(study.parts), study.seen(0.0), study.time_step
    x, y = np.zeros(0), np.empty((len(u), 8))
    for n, now in enumerate(u):
        if n % refresh == 0:
            azimuth = AZIMUTH + n * study.case.rotor_speed * dt
            A, B, C, D = step_matrices(equations, aerodynamics, dt, azimuth, equations.rotor_speed * dt)
            x = x if n else np.zeros(len(A))
        y[n] = C @ x + D @ now
        x = A @ x + B @ now
    return y


def fly(model: TurbineModel, turbines: int, steps: int) -> None:
    """Step so many turbines as the environment does: flaps' actuators, turbulence's response computed at reset."""
    actions = steps // STEPS_PER_ACTION
    plant = make_plant(model, turbines, Stepping(STEPS_PER_ACTION, actions, model.length_scale))
    rng = np.random.default_rng(0)
    still = np.zeros((turbines, 3))
    noise = rng.standard_normal((turbines, plant.noise_count))
    start = Start(np.zeros(turbines), still, still, np.full(turbines, 0.1), noise)
    plant.reset(np.arange(turbines), start)
    push = rng.uniform(-1.0, 1.0, (turbines, 3))
    for _ in range(actions):
        plant.step(push)
        push = -push


def subjects(study: Study, azimuths: PeriodicModel) -> list[Subject]:
    """From every state marched to many turbines in modal form."""
    model, still = load_model(study.case.name), time_invariant(study)
    modal = modal_form(still)
    u = signals(study, 40_000)["flaps"]
    reduced, rotor = azimuths.A.shape[1], study.rotor
    bound = rotor.blades * rotor.lattice.strips * (rotor.lattice.chordwise + rotor.wake_rows)
    structure = reduced - 3 * study.case.reduction.aerodynamic_states
    return [
        Subject(
            "every state marched",
            bound + structure,
            lambda n: march_turbine(study.parts, rotor, u[:n], AZIMUTH),
            20,
        ),
        Subject("A(theta) put together every step", reduced, lambda n: assembled(study, u[:n], 1), 10),
        Subject(
            f"A(theta) put together every {REFRESH} steps",
            reduced,
            lambda n: assembled(study, u[:n], REFRESH),
            50,
        ),
        Subject(
            "A(theta) from the table, every step", reduced, lambda n: azimuths.simulate(u[:n], 0.0), 1000
        ),
        Subject(
            f"A(theta) from the table, every {REFRESH} steps",
            reduced,
            lambda n: azimuths.simulate(u[:n], 0.0, refresh=REFRESH),
            1000,
        ),
        Subject("time-invariant, dense", reduced, lambda n: still.simulate(u[:n]), 2000),
        Subject("time-invariant, modal, step by step", reduced, lambda n: modal.simulate(u[:n]), 5000),
        Subject(f"plant, {STEPS_PER_ACTION} steps an action", reduced, lambda n: fly(model, 1, n), 5000),
        Subject(
            f"plant, {STEPS_PER_ACTION} steps an action, {BATCH} turbines",
            reduced,
            lambda n: fly(model, BATCH, n),
            1000,
            BATCH,
        ),
    ]


def seconds_per_step(subject: Subject, rounds: list[tuple[float, float]]) -> float:
    """Of one turbine, from the best short and the best long run."""
    short, long = np.min(rounds, axis=0)
    return float((long - short) / (3 * subject.steps * subject.turbines))


def speed(study: Study, azimuths: PeriodicModel, tell: Tell) -> None:
    """Time every subject and print the table."""
    wanted = subjects(study, azimuths)
    timed: list[list[tuple[float, float]]] = [[] for _ in wanted]
    fly(load_model(study.case.name), 1, STEPS_PER_ACTION)  # prepares the plant's matrices
    for turn in range(ROUNDS):
        tell(f"speed: round {turn + 1} of {ROUNDS}")
        for subject, times in zip(wanted, timed, strict=True):
            times.append((_seconds(subject, 1), _seconds(subject, 4)))
    each = [seconds_per_step(subject, times) for subject, times in zip(wanted, timed, strict=True)]
    rows = [
        [
            subject.name,
            f"{subject.states:,}",
            f"{1e6 * seconds:,.3g}" if seconds < 1e-3 else f"{1e6 * seconds:,.0f}",
            f"{each[0] / seconds:,.3g}" if each[0] / seconds < 1e3 else f"{each[0] / seconds:,.0f}",
            f"{study.time_step / seconds:,.3g}"
            if study.time_step / seconds < 1e3
            else f"{study.time_step / seconds:,.0f}",
        ]
        for subject, seconds in zip(wanted, each, strict=True)
    ]
    head = ["form", "states", "microseconds a step", "times faster than every state", "times real time"]
    table("Time a step takes one turbine", head, rows)


def _seconds(subject: Subject, times: int) -> float:
    began = time.perf_counter()
    subject.run(times * subject.steps)
    return time.perf_counter() - began
