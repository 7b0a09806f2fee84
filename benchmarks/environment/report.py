"""The benchmark's numbers as tables in Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from benchmarks.environment.endurance import Endurance
from benchmarks.environment.kernels import Form
from benchmarks.environment.peers import FLAPGYM, JAX_PENDULUM, PENDULUM, Subject
from benchmarks.page import table


def peers_table(rates: Mapping[Subject, float]) -> str:
    """Environment steps per second beside Pendulum's, single and vector."""
    pendulum = {
        "single": max(
            rate for subject, rate in rates.items() if subject.name == PENDULUM and subject.count == 1
        )
        if any(subject.name == PENDULUM and subject.count == 1 for subject in rates)
        else float("nan")
    }
    best = [
        rate
        for subject, rate in rates.items()
        if subject.name in (PENDULUM, JAX_PENDULUM) and subject.count > 1
    ]
    pendulum["vector"] = max(best, default=float("nan"))
    rows = []
    for subject, rate in rates.items():
        form = "single" if subject.how == "single" else "vector"
        what = (
            subject.name if subject.name != FLAPGYM else f"{FLAPGYM}, {subject.backend} {subject.precision}"
        )
        rows.append(
            [
                what,
                str(subject.count),
                subject.how,
                str(subject.steps_per_action),
                f"{rate:,.0f}",
                f"{rate * subject.steps_per_action:,.0f}",
                f"{rate / pendulum[form]:.2f}",
            ]
        )
    head = [
        "environment",
        "number",
        "how",
        "plant steps an action",
        "environment steps / s",
        "plant steps / s",
        "over Pendulum",
    ]
    return table(head, rows)


def kernels_table(rates: Mapping[Form, float], time_step: float) -> str:
    """Plant steps per second, beside the paper's table and real time."""
    tables = {form.turbines > 1: rate for form, rate in rates.items() if form.name.startswith("A(theta)")}
    rows = [
        [
            form.name,
            str(form.turbines),
            str(form.states),
            f"{rate:,.0f}",
            f"{rate / tables[form.turbines > 1]:,.1f}",
            f"{rate * time_step:,.0f}",
        ]
        for form, rate in rates.items()
    ]
    head = ["form", "turbines", "states", "plant steps / s", "over the table", "simulated s / s"]
    return table(head, rows)


def order_table(rows: Sequence[tuple[str, int, float, float]]) -> str:
    """Cost against the order of the model."""
    head = ["error of the model", "states", "one turbine, plant steps / s", "1024 turbines, plant steps / s"]
    return table(head, [[name, str(order), f"{one:,.0f}", f"{many:,.0f}"] for name, order, one, many in rows])


def limits_table(limits: Mapping[str, float], rates: Mapping[Form, float], work: float, count: int) -> str:
    """The batch's multiply-adds beside the machine's."""
    rows = []
    for precision in ("float64", "float32"):
        wanted = [
            rate
            for form, rate in rates.items()
            if form.turbines == count and f"numba {precision}, 5 " in form.name
        ]
        if wanted:
            done, most = wanted[0] * work, limits[f"multiply-adds {precision}"]
            rows.append(
                [
                    precision,
                    f"{done / 1e9:.1f}",
                    f"{most / 1e9:.1f}",
                    f"{most / done:.2f}",
                    f"{limits[f'bytes {precision}'] / 1e9:.1f}",
                ]
            )
    head = [
        "precision",
        "plant, 10^9 multiply-adds / s",
        "the machine's most",
        "quotient",
        "memory, GB / s",
    ]
    return table(head, rows)


def startup_table(times: Mapping[str, float]) -> str:
    """Milliseconds a user waits."""
    return table(["what", "ms"], [[name, f"{1e3 * time:,.2f}"] for name, time in times.items()])


def agreement_table(errors: Mapping[str, float], seconds: float) -> str:
    """How far the plant is from the plainest stepping."""
    head = ["plant", "simulated s", "largest difference over the largest value"]
    return table(head, [[name, f"{seconds:,.0f}", f"{error:.1e}"] for name, error in errors.items()])


def endurance_table(results: Sequence[Endurance]) -> str:
    """What long runs found."""
    rows = [
        [
            each.name,
            f"{each.plant_steps:,}",
            "yes" if each.finite else "NO",
            f"{each.drift:.3f}",
            f"{each.megabytes:.1f}",
        ]
        for each in results
    ]
    head = ["environment", "plant steps", "all finite", "rms of the moments, end over beginning", "MB gained"]
    return table(head, rows)


def machine_line(machine: Mapping[str, Any]) -> str:
    """What the figures were taken on, in a sentence."""
    names = ("processor", "python", "numpy", "gymnasium", "numba", "mujoco", "envpool", "flapgym")
    return ", ".join(f"{name} {machine[name]}" for name in names if machine.get(name))
