"""The one test that pytest-benchmark runs; benchmarks.environment.timing gives it what is called."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


def test_speed(benchmark: Callable[[Callable[[], object]], Any], call: Callable[[], object]) -> None:
    """Time a call."""
    benchmark(call)
