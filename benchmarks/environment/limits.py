"""What the machine can do at most: multiply-adds and memory, by the compiler the plant is made with.

An action of k steps takes a turbine three products: modes to rows (rows x 2 M), what decides the flaps' motion to rows
(rows x Q) and to modes (2 M x Q), and four multiply-adds a mode for its decay. So the plant's distance from the machine
is a quotient of two measurements.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.environment.timing import best_of
from flapgym.model import TurbineModel
from flapgym.plant import Stepping
from flapgym.plant.kernel import parameters_of, prepare
from flapgym.plant.parameters import Parameters

LENGTH = 1 << 22
"""Numbers of the arrays whose sum is taken: more than the caches of a core hold."""


def limits(seconds: float, rounds: int, tell: Callable[[str], None]) -> dict[str, float]:
    """Multiply-adds per second in registers and bytes per second from memory, in both precisions."""
    from numba import njit

    from flapgym.core.kept import OPTIONS

    @njit(**OPTIONS)
    def multiply_add(x: Any, turns: int) -> Any:
        total = np.zeros(256, x.dtype)
        factor, addend = x[0], x[1]
        for start in range(0, 256, 128):
            part = total[start : start + 128]
            for _ in range(turns):
                for i in range(128):
                    # Sixteen in a row on what is in a register: loads and stores do not count.
                    value = part[i]
                    value = value * factor + addend
                    value = value * factor + addend
                    value = value * factor + addend
                    value = value * factor + addend
                    value = value * factor + addend
                    value = value * factor + addend
                    value = value * factor + addend
                    value = value * factor + addend
                    value = value * factor + addend
                    value = value * factor + addend
                    value = value * factor + addend
                    value = value * factor + addend
                    value = value * factor + addend
                    value = value * factor + addend
                    value = value * factor + addend
                    value = value * factor + addend
                    part[i] = value
        return total.sum()

    @njit(**OPTIONS)
    def triad(a: Any, b: Any, c: Any) -> None:
        for i in range(a.size):
            a[i] = b[i] + c[i]

    turns, calls = 200, {}
    for precision in ("float64", "float32"):
        x = np.array([0.5, 0.1], dtype=precision)
        arrays = [np.zeros(LENGTH, dtype=precision) for _ in range(3)]
        multiply_add(x, 1)
        triad(*arrays)
        calls[f"multiply-adds {precision}"] = _bound(multiply_add, x, turns)
        calls[f"bytes {precision}"] = _bound(triad, *arrays)
    best = best_of(calls, seconds, rounds, tell)
    work = {"multiply-adds": 256.0 * 16 * turns, "bytes": 0.0}
    result = {}
    for name, time in best.items():
        kind, precision = name.split()
        amount = work[kind] or 3.0 * LENGTH * np.dtype(precision).itemsize
        result[name] = amount / time
    return result


def _bound(function: Callable[..., Any], *arguments: Any) -> Callable[[], Any]:
    return lambda: function(*arguments)


def work_per_step(model: TurbineModel, steps_per_action: int) -> float:
    """Multiply-adds of a plant step of one turbine that meets no stop."""
    p = constants(model, steps_per_action)
    free = p.D[: p.sizes.given].size + p.B[: p.sizes.given].size  # the rest is for stops
    return (p.C.size + free + 2 * p.decay.size) / steps_per_action


def memory_per_turbine(model: TurbineModel, intervals: int, steps_per_action: int, precision: str) -> int:
    """Bytes of a turbine's modes, flaps and response to the wind."""
    p = constants(model, steps_per_action)
    rows = p.sizes.rows + p.sizes.kept
    return np.dtype(precision).itemsize * (p.sizes.modes + intervals * rows) + 8 * 4 * p.angle_limit.size


def constants(model: TurbineModel, steps_per_action: int) -> Parameters:
    """The constants of a step that tells root moments and wind alone, as the plant is timed."""
    stepping = Stepping(steps_per_action, 1, model.length_scale, displacements=False)
    return parameters_of(model, stepping, prepare(model, stepping))
