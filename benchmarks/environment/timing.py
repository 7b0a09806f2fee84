"""Time by the processor's clock, in rounds that take turns: a busy moment of the machine then hits all alike."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

Key = TypeVar("Key")


def seconds_per_call(call: Callable[[], object], seconds: float) -> float:
    """Processor time of one call, from as many as fill `seconds`; all threads of the process count."""
    calls = 1
    while True:
        began = time.process_time()
        for _ in range(calls):
            call()
        passed = time.process_time() - began
        if passed >= seconds:
            return passed / calls
        calls = max(calls + 1, int(1.2 * calls * seconds / max(passed, 1e-4)))
        calls = min(calls, 1_000_000)


def best_of(
    calls: Mapping[Key, Callable[[], object]], seconds: float, rounds: int, tell: Callable[[str], None]
) -> dict[Key, float]:
    """Processor time of one call of each subject, the best of rounds that take turns."""
    best: dict[Key, list[float]] = {key: [] for key in calls}
    for turn in range(rounds):
        tell(f"round {turn + 1} of {rounds}")
        for key, call in calls.items():
            best[key].append(seconds_per_call(call, seconds))
    return {key: min(times) for key, times in best.items()}


def repeated(step: Callable[[], object], times: int) -> Callable[[], None]:
    """A call that does many steps: the clock is read seldom."""

    def call() -> None:
        for _ in range(times):
            step()

    return call


def median(values: Sequence[float]) -> float:
    """Middle of the values."""
    ordered = sorted(values)
    return 0.5 * (ordered[(len(ordered) - 1) // 2] + ordered[len(ordered) // 2])
