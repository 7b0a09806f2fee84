"""Load thousands of mutated files of every kind: `python -m benchmarks.fuzz`, or `make fuzz`."""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from benchmarks.fuzz.kinds import kinds
from benchmarks.fuzz.run import fuzz
from flapgym.core.progress import ProgressBar


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns 1 if anything went wrong."""
    parser = argparse.ArgumentParser(prog="benchmarks.fuzz", description=(__doc__ or "").split(":")[0])
    parser.add_argument(
        "--count", type=int, default=10_000, help="mutations of each kind (default: %(default)s)"
    )
    parser.add_argument(
        "--seed", type=int, default=0, help="another seed, other mutations (default: %(default)s)"
    )
    parser.add_argument("--kinds", nargs="+", help="some of model, agent, case and recording (default: all)")
    options = parser.parse_args(arguments)
    faults: list[str] = []
    with tempfile.TemporaryDirectory() as name:
        for kind in kinds(Path(name)):
            if options.kinds and kind.name not in options.kinds:
                continue
            with ProgressBar(total=options.count, desc=kind.name, mininterval=1.0) as bar:
                outcome = fuzz(kind, options.count, Path(name), options.seed, bar.update)
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
            print(
                f"{kind.name}: {outcome.refused} refused, {outcome.taken} taken, slowest {outcome.slowest:.2f} s, "
                f"at most {peak:.0f} MB until here, {len(outcome.faults)} faults"
            )
            faults += outcome.faults
    print("\n".join(faults[:200]), file=sys.stderr)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
