"""Speed of the environment and its plant: prints tables and writes `results/bench.json`.

`python -m benchmarks.environment`, or `make bench`; `--docs docs/speed.md` puts the tables into the page. Every figure
is processor time of one core (OMP_NUM_THREADS=1), taken by pytest-benchmark, the best of rounds that take turns.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import importlib.util
import json
import platform
import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from benchmarks.environment import agreement, endurance, kernels, limits, peers, report, startup
from benchmarks.page import fill
from flapgym.core.atomic import check_target, write_atomically
from flapgym.core.program import Parser, Work, real, run, whole
from flapgym.model import load_model

PARTS = ("peers", "kernels", "order", "startup")
ORDERS = (0.001, 0.01, 0.1)
BATCH = 1024


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns the exit code."""
    return run(_parser(), arguments)


def _door(options: argparse.Namespace) -> Work:
    wanted = options.parts or list(PARTS)
    unknown = [name for name in wanted if name not in PARTS]
    if unknown:
        raise ValueError(f"{unknown[0]}: unknown part; expected some of {', '.join(PARTS)}")
    options.output.parent.mkdir(parents=True, exist_ok=True)
    check_target(options.output)
    if options.docs is not None:
        check_target(options.docs)
        options.docs.read_text(encoding="utf-8")

    def work() -> int:
        found = measure(wanted, options.seconds, options.rounds, _tell)
        if options.agreement:
            found["agreement"] = agreement.agreement(options.agreement, _tell)
            found["tables"]["agreement"] = report.agreement_table(found["agreement"], options.agreement)
        if options.endurance:
            results = endurance.endure(options.endurance, _tell)
            found["endurance"] = [asdict(result) for result in results]
            found["tables"]["endurance"] = report.endurance_table(results)
        for name, text in found["tables"].items():
            print(f"\n{name}\n\n{text}")
        write_atomically(options.output, (json.dumps(found, indent=2) + "\n").encode())
        print(f"\nwritten: {options.output}")
        if options.docs is not None:
            filled = fill(options.docs.read_text(encoding="utf-8"), found["tables"])
            write_atomically(options.docs, filled.encode())
            print(f"written: {options.docs}")
        return 0

    return work


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="python -m benchmarks.environment", description=(__doc__ or "").splitlines()[0])
    parser.set_defaults(door=_door, program="benchmarks.environment")
    parser.add_argument("parts", nargs="*", metavar="part", help=f"of {', '.join(PARTS)} (default: all)")
    parser.add_argument(
        "--seconds", type=real(1e-3, 3600.0, "s"), default=0.15, help="of each round (default: 0.15)"
    )
    parser.add_argument("--rounds", type=whole(1), default=5, help="of which the best counts (default: 5)")
    parser.add_argument(
        "--endurance", type=whole(0), default=0, metavar="STEPS", help="plant steps of a long run"
    )
    parser.add_argument(
        "--agreement", type=real(0.0, 1e5, "s"), default=0.0, metavar="SECONDS", help="simulated, compared"
    )
    parser.add_argument("--output", type=Path, default=Path("results/bench.json"))
    parser.add_argument("--docs", type=Path, help="page whose tables are replaced")
    return parser


def measure(parts: Sequence[str], seconds: float, rounds: int, tell: Callable[[str], None]) -> dict[str, Any]:
    """Numbers and tables of the parts wanted."""
    model = load_model()
    found: dict[str, Any] = {"machine": machine(), "tables": {}}
    tables = found["tables"]
    tables["machine"] = report.machine_line(found["machine"])
    if "peers" in parts:
        rates = peers.rates(peers.all_subjects(), seconds, rounds, tell)
        found["peers"] = [{**asdict(subject), "rate": rate} for subject, rate in rates.items()]
        tables["peers"] = report.peers_table(rates)
    if "kernels" in parts:
        forms = kernels.measure(peers.COUNTS, seconds, rounds, tell)
        found["kernels"] = [{**asdict(form), "rate": rate} for form, rate in forms.items()]
        tables["kernels"] = report.kernels_table(forms, model.time_step)
        if importlib.util.find_spec("numba") is not None:
            found["limits"] = limits.limits(seconds, rounds, tell)
            work = limits.work_per_step(model, 5)
            tables["limits"] = report.limits_table(found["limits"], forms, work, BATCH)
    if "order" in parts:
        orders = kernels.cost_by_order(ORDERS, seconds, rounds, tell)
        found["order"], tables["order"] = orders, report.order_table(orders)
    if "startup" in parts:
        tell("start-up")
        found["startup"] = startup.startup(3)
        tables["startup"] = report.startup_table(found["startup"])
    return found


def machine() -> dict[str, Any]:
    """What the figures were taken on."""
    libraries = ("numpy", "gymnasium", "numba", "mujoco", "envpool", "flapgym")
    versions: dict[str, str | None] = {}
    for name in libraries:
        try:
            versions[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            versions[name] = None
    return {"processor": _processor(), "python": platform.python_version(), **versions}


def _processor() -> str:
    """Its name, where the system tells, else its architecture."""
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        return platform.machine()
    names = re.findall(r"^model name\s*:\s*(.+)$", text, flags=re.M)
    return f"{names[0]}" if names else platform.machine()


def _tell(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
