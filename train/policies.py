"""Train policies and write them as agents: `python -m train.policies [CONFIG ...]`, or `make train`.

An agent is scored with `flapgym compare --agents open_loop lqg runs/ppo.json`. Ctrl-C ends a run early and keeps what
was learnt.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from flapgym.aeroelastic.model import load_model
from flapgym.control.agent_files import save_agent
from flapgym.evaluation import writable_folder
from train.settings import Training, load_training

DEFAULT_CONFIGS = (Path("configs/train-ppo.toml"), Path("configs/train-sac.toml"))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit code."""
    options = _parser().parse_args(arguments)
    try:
        runs = [load_training(path) for path in options.configs]
        models = [load_model(run.model) for run in runs]
        writable_folder(options.output, (f"{run.name}.json" for run in runs))
    except (ValueError, OSError) as error:
        print(f"train: {error}", file=sys.stderr)
        return 2
    for run, model in zip(runs, models, strict=True):
        # Imported here: everything above is checked before PyTorch takes its seconds to load.
        from train.learning import learn

        shorter = run if options.steps is None else _shortened(run, options.steps)
        for seed in range(options.seed, options.seed + options.seeds):
            outcome = learn(shorter, model, seed, options.tensorboard)
            stem = run.name if options.seeds == 1 else f"{run.name}-seed{seed}"
            path = options.output / f"{stem}.json"
            algorithm = type(run.algorithm).__name__.removesuffix("Settings")
            save_agent(
                path, outcome.policy, model, f"{algorithm}, one policy shared by the blades", outcome.record
            )
            print(
                f"{path}: {outcome.record['steps']:,} steps in {outcome.record['seconds']:.0f} s, seed {seed}"
            )
            if outcome.record["interrupted"]:
                print("interrupted: what was learnt is kept, further runs are left out")
                return 130
    return 0


def _shortened(run: Training, steps: int) -> Training:

    return replace(run, total_steps=steps)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="train.policies", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("configs", nargs="*", type=Path, default=DEFAULT_CONFIGS, metavar="CONFIG")
    parser.add_argument(
        "--output", type=Path, default=Path("runs"), help="folder of the agents (default: runs)"
    )
    parser.add_argument("--seed", type=int, default=0, help="of the first run of each config (default: 0)")
    parser.add_argument(
        "--seeds", type=int, default=1, help="runs of each config, with seeds that follow (default: 1)"
    )
    parser.add_argument("--steps", type=int, help="instead of the config's total_steps")
    parser.add_argument("--tensorboard", metavar="FOLDER", help="write TensorBoard logs there")
    return parser


if __name__ == "__main__":
    sys.exit(main())
