"""What no controller can beat in the environments of this package: `python -m baselines.bounds`.

Writes bounds.json on the realisations that `flapgym compare` scores. Finished realisations lie in the folder of parts
and are not computed again; an interrupted run goes on where it was. One takes a quarter of a minute of one core's
time for the rms, half a minute for fatigue.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from baselines.bounds.bound import (
    ACTED,
    EACH,
    HOLD,
    METRICS,
    ROUNDS,
    Bound,
    Realisation,
    least_fatigue,
    least_rms,
    realisations,
)
from baselines.bounds.optimum import ITERATIONS, PRICES, Point
from baselines.cache import Cache
from flapgym.core.arrays import Array
from flapgym.core.atomic import write_atomically
from flapgym.core.program import Parser, Work, run, whole
from flapgym.core.progress import ProgressBar
from flapgym.envs.registration import ENVIRONMENTS
from flapgym.evaluation.comparison import MOST_REALISATIONS, PAPER_LENGTH, PAPER_REALISATIONS, SCORED_SEED
from flapgym.model.turbine_model import DEFAULT_MODEL, load_model

BOUNDED = (
    "flapgym/NREL5MW-v0",
    "flapgym/NREL5MW-v1",
    "flapgym/NREL5MWField-v0",
    "flapgym/NREL5MWSite-v0",
    "flapgym/NREL5MWThreeFlaps-v0",
    "flapgym/NREL5MWPitch-v0",
)
"""Environments whose bounds are shipped."""
SEARCH = {"hold": HOLD, "acted": ACTED, "rounds": [ROUNDS, EACH], "prices": PRICES, "iterations": ITERATIONS}
"""All a bound depends on beside wind and turbine."""
DATA = Path("flapgym/evaluation/data/bounds.json")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns the exit code."""
    return run(_parser(), arguments)


def _parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="python -m baselines.bounds",
        description="Bound what any controller can do in the environments of this package.",
    )
    parser.add_argument("environments", nargs="*", metavar="ENVIRONMENT", default=list(BOUNDED), help="ids")
    parser.add_argument(
        "--realisations", type=whole(1, MOST_REALISATIONS), default=PAPER_REALISATIONS, metavar="N"
    )
    parser.add_argument("--parts", type=Path, default=Path("results/bounds"), help="folder of finished parts")
    parser.add_argument("--output", type=Path, default=DATA, help="file to write")
    parser.set_defaults(door=_door, kept="finished realisations stay in the folder of parts")
    return parser


def _door(options: argparse.Namespace) -> Work:
    known = {entry.id: dict(entry.keywords) for entry in ENVIRONMENTS}
    for name in options.environments:
        if name not in known:
            raise ValueError(f"environments: expected ids such as {BOUNDED[0]}, got {name}")

    def work() -> int:
        entries = list[dict[str, Any]]()
        options.output.parent.mkdir(parents=True, exist_ok=True)
        total = len(METRICS) * len(options.environments) * options.realisations
        with ProgressBar(total=total, unit=" bounds") as bar:
            for metric in METRICS:
                for name in options.environments:
                    bar.set_description_str(f"{name} {metric}", refresh=False)
                    entries.append(
                        _entry(name, dict(known[name]), metric, options.realisations, options.parts, bar)
                    )
                    # What is finished is of use before the rest is.
                    write_atomically(options.output, (json.dumps(entries, indent=1) + "\n").encode())
        return 0

    return work


def _entry(
    name: str, keywords: dict[str, Any], metric: str, count: int, parts: Path, bar: ProgressBar
) -> dict[str, Any]:
    """What the file tells of a metric in an environment: means over the realisations, and each of them."""
    model = load_model(keywords.pop("model", DEFAULT_MODEL))
    duration = PAPER_LENGTH * model.length_scale / model.wind_speed
    cache, seeds = Cache(parts, model.hash), range(SCORED_SEED, SCORED_SEED + count)
    drawn: list[Realisation] = []
    found = []

    def one(index: int) -> Realisation:
        # All at once, and only if one is wanted.
        drawn.extend([] if drawn else realisations(model, keywords, seeds, duration))
        return drawn[index]

    for index, seed in enumerate(seeds):
        inputs = {"environment": name, "seed": seed, "duration": duration, "search": SEARCH}

        def calm(index: int = index) -> dict[str, Array]:
            return _told(least_rms(one(index)))

        def lasting(index: int = index, inputs: dict[str, Any] = inputs) -> dict[str, Array]:
            start = cache.arrays("rbm_rms", inputs, calm)
            point = Point(start["variables"].astype(float), start["multipliers"].astype(float))
            return _told(least_fatigue(one(index), point))

        found.append(cache.arrays(metric, inputs, calm if metric == "rbm_rms" else lasting))
        bar.update()
    value, reached = (np.array([float(each[key]) for each in found]) for key in ("value", "reached"))
    return {
        "environment": name,
        "model": model.name,
        "model_hash": model.hash,
        "seed": SCORED_SEED,
        "realisations": count,
        "duration": duration,
        "metric": metric,
        "kind": "bound",
        "value": round(float(value.mean()), 5),
        "gap": round(float((reached - value).mean()), 5),
        "reached": round(float(reached.mean()), 5),
        "value_of_each": value.round(5).tolist(),
        "reached_of_each": reached.round(5).tolist(),
    }


def _told(found: Bound) -> dict[str, Array]:
    return {
        "value": np.asarray(found.value),
        "reached": np.asarray(found.reached),
        "actions": found.plan.actions,
        "variables": found.point.variables.astype(np.float32),
        "multipliers": found.point.multipliers.astype(np.float32),
    }


if __name__ == "__main__":
    sys.exit(main())
