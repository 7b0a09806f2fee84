"""The door that every program shares: arguments are read and checked first, then comes the work, and it ends in order.

A program is a parser whose namespace holds `door`: called with the namespace, it reads and checks everything a person
gave and returns the work. What is refused there costs one line on standard error, and nothing has been touched.
"""

from __future__ import annotations

import argparse
import math
import os
import signal
import sys
from collections.abc import Callable, Sequence
from typing import Any, NoReturn, TextIO

from flapgym.core.wording import number, one_line

Work = Callable[[], int]
"""Returns the exit code."""
Door = Callable[[argparse.Namespace], Work]

NOT_WRITTEN, REFUSED, INTERRUPTED = 1, 2, 130
KEPT = "what was written before stays"


class Parser(argparse.ArgumentParser):
    """Refuses wrong arguments in one line, where argparse repeats the whole usage."""

    def error(self, message: str) -> NoReturn:
        """End the program."""
        name = self.get_default("program") or self.prog
        raise SystemExit(complain(name, f"{message} (see {self.prog} --help)", REFUSED))


def run(parser: argparse.ArgumentParser, arguments: Sequence[str] | None = None) -> int:
    """Run a program and return its exit code.

    0 if the work is done; 1 if what it made could not be written, be it on standard output; 2 if something is refused;
    130 if it was interrupted.

    Parameters
    ----------
    parser : ArgumentParser
        Its defaults hold `door`; they may hold `program`, the name before messages, and `kept`, what an interrupt
        leaves.
    arguments : sequence of str, optional
        By default the command line's.
    """
    _restore_interrupt()
    output_closed = usable_streams()
    try:
        options = parser.parse_args(arguments)
    except SystemExit as leaving:  # help is printed, or an argument refused
        return int(leaving.code or 0)
    except KeyboardInterrupt:
        return complain(parser.prog, f"interrupted; {KEPT}", INTERRUPTED)
    name = getattr(options, "program", parser.prog)
    try:
        code = _check_then_work(name, options)
        sys.stdout.flush()
    except KeyboardInterrupt:
        return complain(name, f"interrupted; {getattr(options, 'kept', KEPT)}", INTERRUPTED)
    except BrokenPipeError:  # the reader has seen enough
        _discard(sys.stdout)
        return NOT_WRITTEN
    except OSError as error:
        _discard(sys.stdout)
        return complain(name, error, NOT_WRITTEN)
    if output_closed and code == 0:
        return complain(name, "done, but standard output is closed: nothing was shown", NOT_WRITTEN)
    return code


def complain(name: str, reason: object, code: int) -> int:
    """Say in one line why a program ends, where there is somebody to hear it; returns the exit code."""
    try:
        print(f"{name}: {one_line(reason)}", file=sys.stderr, flush=True)
    except (OSError, ValueError):
        _discard(sys.stderr)
    return code


def whole(lowest: int, highest: int | None = None) -> Callable[[str], int]:
    """For an argument's `type`: a whole number of a range."""
    wanted = f"of at least {lowest}" if highest is None else f"from {lowest} to {highest}"

    def read(text: str) -> int:
        try:
            value = int(text)
        except ValueError:
            value = lowest - 1
        if value < lowest or (highest is not None and value > highest):
            raise argparse.ArgumentTypeError(f"expected a whole number {wanted}, got {one_line(text, 60)}")
        return value

    return read


def real(lowest: float, highest: float, unit: str = "") -> Callable[[str], float]:
    """For an argument's `type`: a number of a range, in a unit."""
    wanted = f"from {number(lowest)} to {number(highest)} {unit}".rstrip()

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not lowest <= value <= highest:
            raise argparse.ArgumentTypeError(f"expected a number {wanted}, got {one_line(text, 60)}")
        return value

    return read


def usable_streams() -> bool:
    """Make standard output and error such that printing never raises for what is printed; whether output is closed.

    A closed stream's number would be given to the next file that is opened, a model perhaps; a stream of few characters
    gets escapes for the others.
    """
    output_closed = sys.stdout is None
    for name in ("stdout", "stderr"):
        stream: Any = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115 (for the program's life)
        elif hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")
    return output_closed


def leave_at_interrupt(name: str) -> None:
    """Let Ctrl-C end the program in order also while its modules are imported, until `run` sees to it."""
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        return  # someone else listens, or it is ignored on purpose, as in the background of a shell

    def leave(number: int, frame: Any) -> NoReturn:
        raise SystemExit(complain(name, "interrupted; nothing was begun", INTERRUPTED))

    _interrupt_handlers.add(leave)
    signal.signal(signal.SIGINT, leave)


def leave_programs_at_interrupt(package: str) -> None:
    """The same for whichever program of a package Python was started with, as `python -m package.program`."""
    if sys.argv[:1] == ["-m"]:  # what it says while Python still looks for the program
        leave_at_interrupt(next((each for each in sys.orig_argv if each.startswith(f"{package}.")), package))


_interrupt_handlers: set[Any] = set()


def _restore_interrupt() -> None:
    """Let Ctrl-C raise KeyboardInterrupt again."""
    if signal.getsignal(signal.SIGINT) in _interrupt_handlers:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _check_then_work(name: str, options: argparse.Namespace) -> int:
    try:
        work = options.door(options)
    except (ValueError, ImportError, OSError) as error:
        return complain(name, error, REFUSED)
    try:
        return int(work())
    except (ValueError, ImportError) as error:  # of this input comes nothing
        return complain(name, error, REFUSED)


def _discard(stream: TextIO) -> None:
    """Let nothing that is left in a stream's buffer be written at exit, where it would fail once more."""
    try:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    except (OSError, ValueError, AttributeError):
        return
