"""Environment steps per second: flapgym by number of turbines and backend, Gymnasium's, MuJoCo's and envpool's."""

from __future__ import annotations

import contextlib
import importlib.util
import tempfile
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np

import flapgym  # noqa: F401 (registers the environments)
from benchmarks.environment.timing import best_of

FLAPGYM, PENDULUM, CARTPOLE, CHEETAH = "flapgym/NREL5MW-v1", "Pendulum-v1", "CartPole-v1", "HalfCheetah-v5"
JAX_PENDULUM = "phys2d/Pendulum-v0"
"""Gymnasium's own vector class of Pendulum, in JAX."""
STEPS_TOGETHER = 256
"""Steps of a single environment between two looks at the clock."""


@dataclass(frozen=True)
class Subject:
    """What is timed.

    Attributes
    ----------
    name : str
        Of the environment.
    count : int
        Environments stepped together.
    how : str
        "single" (through `make`), "native" (its own vector environment), "sync" (`SyncVectorEnv`) or "envpool".
    steps_per_action : int
        Plant steps of one environment step.
    backend, precision : str
        Of flapgym.
    """

    name: str
    count: int
    how: str
    steps_per_action: int = 1
    backend: str = ""
    precision: str = ""


COUNTS = (1, 16, 64, 256, 1024, 4096)
KERNELS = (("numba", "float64"), ("numba", "float32"), ("numpy", "float64"))


def all_subjects() -> list[Subject]:
    """Everything the benchmark knows."""
    single = [Subject(FLAPGYM, 1, "single", k, "numba", "float64") for k in (1, 5)]
    single += [
        Subject(FLAPGYM, 1, "single", 5, "numba", "float32"),
        Subject(FLAPGYM, 1, "single", 5, "numpy", "float64"),
        *(Subject(name, 1, "single") for name in (PENDULUM, CARTPOLE, CHEETAH)),
    ]
    native = [
        Subject(FLAPGYM, count, "native", 5, kernel, precision)
        for kernel, precision in KERNELS
        for count in COUNTS
    ]
    native += [Subject(FLAPGYM, count, "native", 1, "numba", "float64") for count in (64, 1024)]
    native += [
        Subject(name, count, "native") for name in (CARTPOLE, JAX_PENDULUM) for count in (64, 1024, 4096)
    ]
    sync = [Subject(name, count, "sync") for name in (PENDULUM, CARTPOLE) for count in (64, 1024)]
    pools = [Subject(name, count, "envpool") for name in (PENDULUM, CARTPOLE) for count in (64, 1024)]
    return single + native + sync + pools


def missing(subject: Subject) -> str | None:
    """The library a subject needs and this machine has not, if any."""
    needed = {"envpool": "envpool"}.get(subject.how)
    needed = {CHEETAH: "mujoco", JAX_PENDULUM: "flax"}.get(subject.name, needed)
    if subject.backend == "numba":
        needed = "numba"
    return needed if needed is not None and importlib.util.find_spec(needed) is None else None


def stepper(subject: Subject) -> Callable[[], Any]:
    """A call that advances the subject: a single environment by STEPS_TOGETHER steps, others by one."""
    keywords: dict[str, Any] = {}
    if subject.name == FLAPGYM:
        keywords = {
            "steps_per_action": subject.steps_per_action,
            "backend": subject.backend,
            "precision": subject.precision,
            "wind": {"pool": 16},
        }
    if subject.how == "envpool":
        return _envpool(subject)
    if subject.how == "single":
        # MuJoCo leaves a log of its warnings wherever it is started.
        with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
            single = gymnasium.make(subject.name, **keywords)
        return _single(single)
    mode = "vector_entry_point" if subject.how == "native" else "sync"
    env = gymnasium.make_vec(subject.name, subject.count, vectorization_mode=mode, **keywords)
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(16)]
    turn = 0

    def step() -> None:
        nonlocal turn
        turn = (turn + 1) % len(actions)
        # An array of NumPy, whatever it was: JAX returns before it has computed.
        np.asarray(env.step(actions[turn])[0])

    return step


def _single(env: Any) -> Callable[[], Any]:
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(STEPS_TOGETHER)]

    def steps() -> None:
        step = env.step
        for action in actions:
            _, _, terminated, truncated, _ = step(action)
            if terminated or truncated:
                env.reset()

    return steps


def _envpool(subject: Subject) -> Callable[[], Any]:
    import envpool

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        env = envpool.make(subject.name, env_type="gymnasium", num_envs=subject.count, num_threads=1)
    env.reset()
    rng = np.random.default_rng(0)
    space = env.action_space
    drawn: Any = (
        rng.uniform(-2.0, 2.0, (16, subject.count, 1)).astype(np.float32)
        if subject.name == PENDULUM
        else rng.integers(space.n, size=(16, subject.count))
    )
    actions, turn = list(drawn), 0

    def step() -> None:
        nonlocal turn
        turn = (turn + 1) % len(actions)
        env.step(actions[turn])

    return step


def rates(
    subjects: list[Subject], seconds: float, rounds: int, tell: Callable[[str], None]
) -> dict[Subject, float]:
    """Environment steps per second of processor time, counted over all environments; a word for what is missing."""
    calls = {}
    for subject in subjects:
        lacking = missing(subject)
        if lacking is None:
            calls[subject] = stepper(subject)
        else:
            tell(f"left out: {subject.name} {subject.how}, because {lacking} is not installed")
    best = best_of(calls, seconds, rounds, tell)
    return {
        subject: (STEPS_TOGETHER if subject.how == "single" else subject.count) / time
        for subject, time in best.items()
    }
