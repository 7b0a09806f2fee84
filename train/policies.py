"""Train policies and write them as agents: `python -m train.policies [CONFIG ...]`, or `make train`.

An agent is scored with `flapgym compare --agents open_loop lqg runs/ppo.json`. Ctrl-C ends a run early and keeps what
was learnt under a name of its own.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from flapgym.control.agent_files import save_agent
from flapgym.core.atomic import check_target
from flapgym.core.program import Parser, Work, run, whole
from flapgym.evaluation import writable_folder
from flapgym.model.turbine_model import TurbineModel, load_model
from train.settings import Training, load_training

if TYPE_CHECKING:
    from train.learning import Outcome

DEFAULT_CONFIGS = (Path("configs/train-ppo.toml"), Path("configs/train-sac.toml"))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns the exit code."""
    return run(_parser(), arguments)


def _door(options: argparse.Namespace) -> Work:
    trainings = [load_training(path) for path in options.configs]
    if options.steps is not None:
        trainings = [replace(training, total_timesteps=options.steps) for training in trainings]
    models = [load_model(training.model) for training in trainings]
    folder = writable_folder(options.output)
    if options.tensorboard is not None:
        writable_folder(options.tensorboard)
    runs = [
        (training, model, seed, folder / f"{stem(training.name, seed, options.seeds)}.json")
        for training, model in zip(trainings, models, strict=True)
        for seed in range(options.seed, options.seed + options.seeds)
    ]
    for *_, path in runs:
        check_target(path)
    # Imported only now: everything above is checked before PyTorch takes its seconds to load.
    from train.learning import learn

    def work() -> int:
        for training, model, seed, path in runs:
            outcome = learn(training, model, seed, options.tensorboard)
            record = outcome.record
            if record["interrupted"]:
                keep(outcome, training, model, path)
                raise KeyboardInterrupt
            save(outcome, training, model, path)
            print(f"{path}: {record['steps']:,} steps in {record['seconds']:.0f} s, seed {seed}")
        return 0

    return work


def stem(name: str, seed: int, seeds: int) -> str:
    """Name of an agent and of its file."""
    return name if seeds == 1 else f"{name}-seed{seed}"


def keep(outcome: Outcome, training: Training, model: TurbineModel, path: Path) -> None:
    """Save what an interrupted run has learnt beside the place of a whole one, which stays what it was."""
    steps = outcome.record["steps"]
    if steps:
        path = path.with_name(f"{path.stem}-after-{steps}-steps.json")
        save(outcome, training, model, path)
        print(f"{path}: {steps:,} of {training.total_timesteps:,} steps, interrupted")


def save(outcome: Outcome, training: Training, model: TurbineModel, path: Path) -> None:
    """Write a policy as an agent of its file's name."""
    algorithm = type(training.algorithm).__name__.removesuffix("Settings")
    policy = replace(outcome.policy, name=path.stem)
    save_agent(path, policy, model, f"{algorithm}, one policy shared by the blades", outcome.record)


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="python -m train.policies", description=(__doc__ or "").splitlines()[0])
    kept = "what was learnt is kept, further runs are left out"
    parser.set_defaults(door=_door, program="train.policies", kept=kept)
    parser.add_argument("configs", nargs="*", type=Path, default=DEFAULT_CONFIGS, metavar="CONFIG")
    parser.add_argument(
        "--output", type=Path, default=Path("runs"), help="folder of the agents (default: runs)"
    )
    parser.add_argument(
        "--seed", type=whole(0, 2**31), default=0, help="of the first run of each config (default: 0)"
    )
    parser.add_argument(
        "--seeds",
        type=whole(1, 1000),
        default=1,
        help="runs of each config, with seeds that follow (default: 1)",
    )
    parser.add_argument("--steps", type=whole(1), help="instead of the config's total_timesteps")
    parser.add_argument("--tensorboard", metavar="FOLDER", help="write TensorBoard logs there")
    return parser


if __name__ == "__main__":
    sys.exit(main())
