"""What the shipped agents reach in every registered environment of the whole turbine at one wind speed: for its page.

    python -m benchmarks.variants docs

writes `docs/environments/scores.json`, which `python -m benchmarks.manual docs` puts into the pages. The agents are
those of the base case, unchanged: a variant shows what they are worth where the turbine is not the one they know.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from flapgym.control import AGENT_NAMES, Agent, OpenLoop, individual_pitch_agent, load_agent
from flapgym.control.individual_pitch import CROSSOVER, INDIVIDUAL_PITCH
from flapgym.core.atomic import check_target, write_atomically
from flapgym.core.program import Parser, Work, run, whole
from flapgym.core.progress import ProgressBar
from flapgym.envs.registration import ENVIRONMENTS, Registered
from flapgym.evaluation.comparison import MOST_REALISATIONS, SCORED_SEED
from flapgym.evaluation.metrics import measure
from flapgym.evaluation.simulate import get_ready, simulate
from flapgym.model import DEFAULT_MODEL, TurbineModel, is_model_set, load_model

TURBULENT, GUST = 120.0, 20.0
"""Length of a realisation [s] in turbulence, and of a gust's episode."""


def scores(entry: Registered, agents: Sequence[str], realisations: int, seconds: float) -> dict[str, Any]:
    """Mean rms and damage-equivalent load of the root moment [N m] and travel of flaps and pitch [rad/s], by agent."""
    keywords = dict(entry.keywords)
    model = load_model(keywords.pop("model", DEFAULT_MODEL))
    playing = {
        name: load_agent(name if name == OpenLoop.name else f"{entry.agents}/{name}", model)
        for name in agents
    }
    if keywords.get("pitch"):
        playing |= _pitching(model, playing)
    result = {}
    for name, agent in playing.items():
        seeds = range(SCORED_SEED, SCORED_SEED + realisations)
        metrics = measure(simulate(agent, model, seeds, seconds, **keywords))
        result[name] = {
            "rbm_rms": float(np.mean(metrics.rbm_rms)),
            "rbm_del": float(np.mean(metrics.rbm_del)),
            "flap_travel": float(np.mean(metrics.flap_travel)),
            "pitch_travel": float(np.mean(metrics.pitch_travel)),
        }
    return result


def _scored(entry: Registered) -> bool:
    """Whether it is a turbine at one wind speed; docs/range.md has the loads over wind speed."""
    of_set = is_model_set(entry.keywords.get("model", DEFAULT_MODEL))
    return not (entry.keywords.get("single_blade") or of_set)


def _pitching(model: TurbineModel, flaps: Mapping[str, Agent]) -> dict[str, Agent]:
    """Individual pitch control alone, and beside the agents of flaps."""
    return {
        each: individual_pitch_agent(each, model, CROSSOVER, agent)
        for name, agent in flaps.items()
        for each in (INDIVIDUAL_PITCH if name == OpenLoop.name else f"{INDIVIDUAL_PITCH}+{name}",)
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns the exit code."""
    return run(_parser(), arguments)


def _door(options: argparse.Namespace) -> Work:
    if "open_loop" not in options.agents:
        raise ValueError("--agents: open_loop must be among them, the others are compared with it")
    path = check_target(options.folder / "environments" / "scores.json")

    def work() -> int:
        turbines = [entry for entry in ENVIRONMENTS if _scored(entry)]
        found = {}
        get_ready(load_model())
        for entry in ProgressBar(turbines):
            # A gust comes the same every time: only the azimuth differs.
            seconds = GUST if "gust" in entry.keywords.get("wind", {}) else TURBULENT
            found[entry.id] = {
                "seconds": seconds,
                "realisations": options.realisations,
                # Of the agents of the base case none moves several flaps a blade.
                "agents": scores(
                    entry,
                    options.agents if entry.agents else [OpenLoop.name],
                    options.realisations,
                    seconds,
                ),
            }
        write_atomically(path, (json.dumps(found, indent=1) + "\n").encode())
        return 0

    return work


def _parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="python -m benchmarks.variants",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.set_defaults(door=_door, program="benchmarks.variants")
    parser.add_argument("folder", type=Path, help="the documentation's folder")
    parser.add_argument(
        "--realisations", type=whole(1, MOST_REALISATIONS), default=5, help="default: %(default)s"
    )
    parser.add_argument("--agents", nargs="+", default=list(AGENT_NAMES), choices=AGENT_NAMES)
    return parser


if __name__ == "__main__":
    sys.exit(main())
