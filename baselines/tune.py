"""Tune PD, PID, individual flap control and LQG on a model, save them as agents: `python -m baselines.tune --help`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from baselines.settings import load_tuning
from baselines.tuning import (
    Bench,
    Tuned,
    tune_field,
    tune_field_multiblade,
    tune_individual,
    tune_lqg,
    tune_multiblade_saturating,
    tune_pd,
    tune_pid,
    tune_saturating,
)
from flapgym.control import FIELD_AGENT_NAMES, save_agent
from flapgym.core.program import Parser, Work, run
from flapgym.core.progress import ProgressBar
from flapgym.evaluation import writable_folder
from flapgym.evaluation.comparison import PAPER_LENGTH
from flapgym.model.turbine_model import DEFAULT_MODEL, load_model

CONFIG = Path(__file__).parents[1] / "configs" / "tuning.toml"

CONTROLLERS: dict[str, tuple[Callable[[Bench], Tuned], str]] = {
    "pd": (tune_pd, "PD on each blade's root bending moment, gain raised until the flap just meets its stop"),
    "pid": (
        tune_pid,
        "PID on each blade's root bending moment, gain raised until the flap just meets its stop",
    ),
    "individual_flap": (
        tune_individual,
        "PID on collective, tilt and yaw moments: collective as `pid`, the others as the disk margin allows",
    ),
    "lqg": (
        tune_lqg,
        "LQG of the clamped blade, weight raised until the flap just meets its stop (the paper's rule)",
    ),
    "lqg_saturating": (
        tune_saturating,
        "LQG of the clamped blade, as heavy as the disk margin allows, stops in the loop",
    ),
    "lqg_multiblade_saturating": (
        tune_multiblade_saturating,
        "LQG of the whole turning turbine, as heavy as the disk margin allows, stops in the loop",
    ),
    "lqg_field": (
        tune_field,
        "LQG of the clamped blade in the field and the shear of a site, stops in the loop",
    ),
    "lqg_field_multiblade": (
        tune_field_multiblade,
        "LQG of the whole turning turbine in the field and the shear of a site, stops in the loop",
    ),
}
ANYWHERE = [name for name in CONTROLLERS if name not in FIELD_AGENT_NAMES]
"""Controllers for any model; those for a field take winds by strip, as nrel5mw-site has them."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns the exit code."""
    return run(_parser(), arguments)


def _door(options: argparse.Namespace) -> Work:
    unknown = [name for name in options.controllers if name not in CONTROLLERS]
    if unknown:
        raise ValueError(f"{unknown[0]}: unknown controller; expected some of {', '.join(CONTROLLERS)}")
    model = load_model(options.model)
    tuning = load_tuning(options.config)
    folder = writable_folder(options.output, (f"{name}.json" for name in options.controllers))
    duration = PAPER_LENGTH * model.length_scale / model.wind_speed

    def work() -> int:
        # How many designs a rule tries is not known beforehand: the bar counts them.
        with ProgressBar(unit=" designs", bar_format="{desc:<16} {n_fmt}{unit} tried, {elapsed}") as bar:

            def advanced(name: str) -> None:
                bar.set_description_str(name, refresh=False)
                bar.update()

            bench = Bench(model, tuning, duration, advanced)
            for name in options.controllers:
                tune, description = CONTROLLERS[name]
                try:
                    tuned = tune(bench)
                except ValueError as error:
                    raise ValueError(f"{name}: {error}") from None
                save_agent(folder / f"{name}.json", tuned.agent, model, description, tuned.design)
                ProgressBar.write(report(name, tuned))
        return 0

    return work


def report(name: str, tuned: Tuned) -> str:
    """One paragraph on a tuned controller."""
    design = tuned.design
    numbers = {key: value for key, value in design.items() if key not in _FOUND}
    return "\n".join(
        [
            f"{name}: " + ", ".join(f"{key} {value:.4g}" for key, value in numbers.items()),
            f"  full closed loop: spectral radius {design['spectral_radius']:.6f}, disk margin "
            f"{design['disk_margin']:.2f}, stable up to {design['effectiveness_margin']:.2f} times the flap's effect",
            f"  tuning realisations: RBM rms {design['tuning_rbm_rms'] / 1e6:.3f} MN m, flap at most "
            f"{np.rad2deg(design['tuning_flap_angle_max']):.2f} deg and "
            f"{np.rad2deg(design['tuning_flap_rate_max']):.1f} deg/s",
        ]
    )


_FOUND = (
    "spectral_radius",
    "disk_margin",
    "effectiveness_margin",
    "tuning_rbm_rms",
    "tuning_flap_angle_max",
    "tuning_flap_rate_max",
)


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="python -m baselines.tune", description=__doc__.split(":")[0] + ".")
    parser.set_defaults(door=_door, program="baselines.tune", kept="agents that were finished are saved")
    parser.add_argument(
        "controllers",
        nargs="*",
        default=ANYWHERE,
        help=f"which (default: all but those for a field, {', '.join(FIELD_AGENT_NAMES)})",
    )
    parser.add_argument("--model", default=DEFAULT_MODEL, help="a model's name or file")
    parser.add_argument(
        "--config", type=Path, default=CONFIG, help="the tuning file (default: configs/tuning.toml)"
    )
    parser.add_argument("--output", type=Path, default=Path("results/agents"), help="folder for the agents")
    return parser


if __name__ == "__main__":
    sys.exit(main())
