"""Environment steps per second for 1, 64 and 1024 turbines, beside Gymnasium's Pendulum-v1 in the same run.

`python -m benchmarks.environment`, or `make bench`: prints a table and writes `results/bench.json`. Each figure is the
best of several rounds, which take turns so that a busy moment of the machine hits all alike; resets are counted
separately.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import flapgym
from flapgym.atomic import write_atomically

FLAPGYM = "flapgym/NREL5MW-v0"
PENDULUM = "Pendulum-v1"


@dataclass(frozen=True)
class Subject:
    """What is timed.

    Attributes
    ----------
    name : str
        Of the environment.
    turbines : int
        Environments stepped together.
    kind : str
        "single" (through `make`), "native" (its own vector environment) or "sync" (`SyncVectorEnv`).
    steps_per_action : int
        Plant steps of one environment step.
    """

    name: str
    turbines: int
    kind: str
    steps_per_action: int


@dataclass(frozen=True)
class Figure:
    """What was measured of a subject.

    Attributes
    ----------
    subject : Subject
    steps_per_second, plant_steps_per_second : float
        Environment steps, counted over all turbines, and plant steps.
    reset_milliseconds : float
        Of one reset of all turbines, 20-second episodes for flapgym.
    """

    subject: Subject
    steps_per_second: float
    plant_steps_per_second: float
    reset_milliseconds: float


SUBJECTS = (
    Subject(FLAPGYM, 1, "single", 1),
    Subject(FLAPGYM, 1, "single", 5),
    Subject(FLAPGYM, 64, "native", 5),
    Subject(FLAPGYM, 1024, "native", 5),
    Subject(PENDULUM, 1, "single", 1),
    Subject(PENDULUM, 64, "sync", 1),
    Subject(PENDULUM, 1024, "sync", 1),
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the benchmark; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="benchmarks.environment", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument("--seconds", type=float, default=0.5, help="of each round (default: 0.5)")
    parser.add_argument("--rounds", type=int, default=5, help="of which the best counts (default: 5)")
    parser.add_argument("--output", type=Path, default=Path("results/bench.json"))
    options = parser.parse_args(arguments)
    if options.seconds <= 0.0 or options.rounds < 1:
        parser.error("--seconds and --rounds: expected positive numbers")
    figures = measure(SUBJECTS, options.seconds, options.rounds)
    print(table(figures))
    options.output.parent.mkdir(parents=True, exist_ok=True)
    report = {"machine": machine(), "figures": [asdict(figure) for figure in figures]}
    write_atomically(options.output, (json.dumps(report, indent=2) + "\n").encode())
    print(f"written: {options.output}")
    return 0


def measure(subjects: Sequence[Subject], seconds: float, rounds: int) -> list[Figure]:
    """Time every subject; rounds take turns."""
    benches = [_bench(subject) for subject in subjects]
    best = [0.0] * len(subjects)
    for _ in range(rounds):
        for index, (step, _) in enumerate(benches):
            best[index] = max(best[index], _rate(step, seconds))
    return [
        Figure(
            subject,
            steps_per_second=rate * subject.turbines,
            plant_steps_per_second=rate * subject.turbines * subject.steps_per_action,
            reset_milliseconds=1e3 * min(reset() for _ in range(3)),
        )
        for subject, rate, (_, reset) in zip(subjects, best, benches, strict=True)
    ]


def _bench(subject: Subject) -> tuple[Callable[[], Any], Callable[[], float]]:
    """A call that steps the subject once, and one that resets it and returns the seconds that took."""
    keywords: dict[str, Any] = {}
    if subject.name == FLAPGYM:
        keywords = {"steps_per_action": subject.steps_per_action}
    if subject.kind == "single":
        env: Any = gymnasium.make(subject.name, **keywords)
    else:
        mode = "vector_entry_point" if subject.kind == "native" else "sync"
        env = gymnasium.make_vec(subject.name, subject.turbines, vectorization_mode=mode, **keywords)
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(64)]
    turn = 0

    def step() -> None:
        nonlocal turn
        turn = (turn + 1) % len(actions)
        _, _, _, truncated, _ = env.step(actions[turn])
        if subject.kind == "single" and truncated:
            env.reset()

    def reset() -> float:
        began = time.perf_counter()
        env.reset()
        return time.perf_counter() - began

    return step, reset


def _rate(step: Callable[[], Any], seconds: float) -> float:
    """Calls per second over a round."""
    began, calls = time.perf_counter(), 0
    while True:
        for _ in range(10):
            step()
        calls += 10
        passed = time.perf_counter() - began
        if passed > seconds:
            return calls / passed


def table(figures: Sequence[Figure]) -> str:
    """The figures in columns, with the ratio to the same number of pendulums."""
    pendulum = {f.subject.turbines: f.steps_per_second for f in figures if f.subject.name == PENDULUM}
    lines = [
        f"{'environment':22}{'n':>6}  {'how':8}{'steps an action':>16}{'steps/s':>14}{'plant steps/s':>15}"
        f"{'/ Pendulum':>12}{'reset [ms]':>12}"
    ]
    for figure in figures:
        subject = figure.subject
        ratio = (
            figure.steps_per_second / pendulum[subject.turbines] if subject.turbines in pendulum else np.nan
        )
        lines.append(
            f"{subject.name:22}{subject.turbines:>6}  {subject.kind:8}{subject.steps_per_action:>16}"
            f"{figure.steps_per_second:>14,.0f}{figure.plant_steps_per_second:>15,.0f}{ratio:>12.2f}"
            f"{figure.reset_milliseconds:>12.2f}"
        )
    return "\n".join(lines)


def machine() -> dict[str, Any]:
    """What the figures were taken on."""
    return {
        "processors": os.cpu_count(),
        "architecture": platform.machine(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "gymnasium": gymnasium.__version__,
        "flapgym": flapgym.__version__,
        "threads": os.environ.get("OMP_NUM_THREADS", "default"),
    }


if __name__ == "__main__":
    sys.exit(main())
