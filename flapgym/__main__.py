"""The command `flapgym`, before anything heavy is loaded: `python -m flapgym`, or the script of that name."""

from __future__ import annotations

import sys

from flapgym.core.program import leave_at_interrupt


def main() -> int:
    """Run the command line; returns the exit code."""
    leave_at_interrupt("flapgym")
    from flapgym import cli  # a second of numerical libraries, in which Ctrl-C is heard too

    return cli.main()


if __name__ == "__main__":
    sys.exit(main())
