"""What no controller can beat in the environments of this package: `python -m baselines.bounds`.

Writes bounds.json on the realisations that `flapgym compare` scores. Finished realisations lie in the folder of parts
and are not computed again; an interrupted run goes on where it was. Both metrics on one realisation take two to six
minutes of one core's time.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import baselines.bounds.bound as settings_of_the_search
from baselines.bounds.bound import METRICS, Realisation, least_fatigue, least_rms, realisations
from baselines.bounds.optimum import ITERATIONS, PRICES
from baselines.cache import Cache
from flapgym.core.arrays import Array
from flapgym.core.atomic import write_atomically
from flapgym.core.program import Parser, Work, run, whole
from flapgym.core.progress import ProgressBar
from flapgym.envs.registration import ENVIRONMENTS
from flapgym.evaluation.comparison import MOST_REALISATIONS, PAPER_LENGTH, PAPER_REALISATIONS, SCORED_SEED
from flapgym.model.turbine_model import DEFAULT_MODEL, TurbineModel, load_model

BOUNDED = (
    "flapgym/NREL5MW-v0",
    "flapgym/NREL5MW-v1",
    "flapgym/NREL5MWField-v0",
    "flapgym/NREL5MWSite-v0",
    "flapgym/NREL5MWThreeFlaps-v0",
    "flapgym/NREL5MWPitch-v0",
)
"""Environments whose bounds are shipped."""
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
        entries = []
        total = len(options.environments) * options.realisations
        with ProgressBar(total=total, unit=" realisations") as bar:
            for name in options.environments:
                bar.set_description_str(name, refresh=False)
                entries += _environment(name, known[name], options.realisations, options.parts, bar)
        options.output.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(options.output, (json.dumps(entries, indent=1) + "\n").encode())
        return 0

    return work


def _environment(
    name: str, keywords: dict[str, Any], count: int, parts: Path, bar: ProgressBar
) -> list[dict[str, Any]]:
    """Entries of an environment, one a metric."""
    model = load_model(keywords.pop("model", DEFAULT_MODEL))
    duration = PAPER_LENGTH * model.length_scale / model.wind_speed
    cache, seeds = Cache(parts, model.hash), range(SCORED_SEED, SCORED_SEED + count)
    search = {
        "prices": PRICES,
        "iterations": ITERATIONS,
        **{
            key: getattr(settings_of_the_search, key)
            for key in ("HOLD", "ACTED", "ROUNDS", "EACH", "CHECKED")
        },
    }
    drawn: list[Realisation] = []
    found = []
    for index, seed in enumerate(seeds):

        def make(index: int = index) -> dict[str, Array]:
            # All at once, and only if one is wanted.
            drawn.extend([] if drawn else realisations(model, keywords, seeds, duration))
            return _both(drawn[index])

        inputs = {"environment": name, "seed": seed, "duration": duration, "search": search}
        found.append(cache.arrays("bound", inputs, make))
        bar.update()
    return [_entry(name, model, duration, metric, found) for metric in METRICS]


def _both(realisation: Realisation) -> dict[str, Array]:
    calm = least_rms(realisation)
    lasting = least_fatigue(realisation, calm.point)
    told: dict[str, Array] = {}
    for metric, each in zip(METRICS, (calm, lasting), strict=True):
        told |= {
            f"{metric}.value": np.asarray(each.value),
            f"{metric}.reached": np.asarray(each.reached),
            f"{metric}.actions": each.plan.actions,
        }
    return told


def _entry(
    name: str, model: TurbineModel, duration: float, metric: str, found: Sequence[dict[str, Array]]
) -> dict[str, Any]:
    """What the file tells of a metric: means over the realisations, and each of them."""
    value, reached = (
        np.array([float(each[f"{metric}.{key}"]) for each in found]) for key in ("value", "reached")
    )
    return {
        "environment": name,
        "model": model.name,
        "model_hash": model.hash,
        "seed": SCORED_SEED,
        "realisations": len(found),
        "duration": duration,
        "metric": metric,
        "kind": "bound",
        "value": round(float(value.mean()), 5),
        "gap": round(float((reached - value).mean()), 5),
        "reached": round(float(reached.mean()), 5),
        "value_of_each": value.round(5).tolist(),
        "reached_of_each": reached.round(5).tolist(),
    }


if __name__ == "__main__":
    sys.exit(main())
