"""Processor time of calls by pytest-benchmark, in rounds that take turns: a busy moment hits all subjects alike."""

from __future__ import annotations

import contextlib
import json
import os
import tempfile
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import pytest

Key = TypeVar("Key")
TESTS = Path(__file__).with_name("timed.py")


class _Turns:
    """A plugin that gives the one test its calls: all of them once, then all of them again, and so on."""

    def __init__(
        self, calls: Sequence[Callable[[], object]], rounds: int, tell: Callable[[str], None]
    ) -> None:
        self._calls, self._rounds, self._tell = calls, rounds, tell

    def pytest_generate_tests(self, metafunc: pytest.Metafunc) -> None:
        """Every call in every round."""
        ids = [f"{turn}-{place}" for turn in range(self._rounds) for place in range(len(self._calls))]
        metafunc.parametrize("call", [*self._calls] * self._rounds, ids=ids)

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        """A word when a round begins."""
        turn, _, place = nodeid.rpartition("[")[2].rstrip("]").partition("-")
        if place == "0":
            self._tell(f"round {int(turn) + 1} of {self._rounds}")

    @pytest.hookimpl(tryfirst=True)
    def pytest_keyboard_interrupt(self) -> None:
        """Ctrl-C ends the program: pytest would end the tests in order and say so in its own words."""
        raise KeyboardInterrupt


def best_of(
    calls: Mapping[Key, Callable[[], object]], seconds: float, rounds: int, tell: Callable[[str], None]
) -> dict[Key, float]:
    """Processor time of one call of each subject: the mean over the calls of a round, the best of the rounds.

    Parameters
    ----------
    calls : mapping
    seconds : float
        Of each round; all threads of the process count.
    rounds : int
    tell : callable
        Told when a round begins.

    Raises
    ------
    RuntimeError
        If a call failed.
    """
    if not calls:
        return {}
    with tempfile.TemporaryDirectory() as folder:
        found = Path(folder) / "benchmark.json"
        options = [
            *(str(TESTS), f"--rootdir={folder}", "-c", os.devnull, "--import-mode=importlib", "-x"),
            *("-p", "no:cacheprovider", "-p", "no:xdist", "-p", "no:randomly", "-s", "-q", "--no-header"),
            *(f"--benchmark-json={found}", "--benchmark-timer=time.process_time", "--benchmark-disable-gc"),
            *(f"--benchmark-max-time={seconds}", "--benchmark-min-rounds=1", "--benchmark-quiet"),
        ]
        with (
            open(os.devnull, "w", encoding="utf-8") as nowhere,
            contextlib.redirect_stdout(nowhere),
            warnings.catch_warnings(action="ignore"),
        ):
            code = pytest.main(options, plugins=[_Turns(list(calls.values()), rounds, tell)])
        if code != pytest.ExitCode.OK:
            raise RuntimeError(f"pytest-benchmark ended with {code}; run the call that failed by itself")
        if not found.exists():
            # Ctrl-C while the library writes its file ends that writing, and nothing else.
            raise KeyboardInterrupt
        times = json.loads(found.read_text(encoding="utf-8"))["benchmarks"]
    return dict(zip(calls, _best(times, len(calls)), strict=True))


def _best(times: Iterable[Mapping[str, Any]], count: int) -> list[float]:
    """The least mean of each of the calls."""
    best = [float("inf")] * count
    for each in times:
        place = int(each["param"].partition("-")[2])
        best[place] = min(best[place], each["stats"]["mean"])
    return best
