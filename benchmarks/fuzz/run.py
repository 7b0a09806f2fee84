"""Mutations one after another: what was refused, what was taken, and what went wrong."""

from __future__ import annotations

import signal
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.fuzz.kinds import Kind

LONGEST = 10.0
"""Time for one file [s], after which it counts as hanging."""
LONGEST_MESSAGE = 1200
"""Characters."""


@dataclass
class Outcome:
    """What became of the mutations of a kind.

    Attributes
    ----------
    refused, taken : int
    slowest : float
        [s]
    faults : list of str
        Tracebacks, hangs, messages of more than a line, and what was taken though it is not sound; each with the
        mutation's number.
    """

    refused: int = 0
    taken: int = 0
    slowest: float = 0.0
    faults: list[str] = field(default_factory=list)


def fuzz(
    kind: Kind, count: int, folder: Path, seed: int = 0, told: Callable[[], Any] = lambda: None
) -> Outcome:
    """Load so many mutations of a kind; mutation i has a generator of its own, so that it can be made again."""
    outcome, path = Outcome(), folder / f"mutation{kind.suffix}"
    with warnings.catch_warnings(), _limited():
        warnings.simplefilter("error")
        for index in range(count):
            path.write_bytes(mutation(kind, seed, index))
            began = time.perf_counter()
            signal.setitimer(signal.ITIMER_REAL, LONGEST)
            try:
                if fault := _fault(kind, path, outcome):
                    outcome.faults.append(f"{kind.name} {index}: {fault}")
            except _HangError:
                outcome.faults.append(f"{kind.name} {index}: took more than {LONGEST} s")
            finally:
                signal.setitimer(signal.ITIMER_REAL, 0.0)
            outcome.slowest = max(outcome.slowest, time.perf_counter() - began)
            told()
    return outcome


def mutation(kind: Kind, seed: int, index: int) -> bytes:
    """Mutation `index` of a kind."""
    random = np.random.default_rng([seed, index])
    return kind.spoil(kind.examples[index % len(kind.examples)], random)


def _fault(kind: Kind, path: Path, outcome: Outcome) -> str | None:
    try:
        found = kind.load(path)
    except (ValueError, OSError) as error:
        outcome.refused += 1
        # Errors of other libraries are ValueErrors, too, with words of their own.
        if type(error) not in (ValueError, FileNotFoundError):
            return f"leaks {error!r}"
        message = str(error)
        if not message.isprintable() or len(message) > LONGEST_MESSAGE or not message:
            return f"no line for people: {message!r}"
        return None
    except _HangError:
        raise
    except Exception as error:
        return f"raises {error!r}"
    outcome.taken += 1
    try:
        kind.check(found)
    except _HangError:
        raise
    except Exception as error:
        return f"was taken and is not sound: {error!r}"
    return None


class _HangError(BaseException):
    """The time is up."""


@contextmanager
def _limited() -> Iterator[None]:
    def hang(*_: Any) -> None:
        raise _HangError

    before = signal.signal(signal.SIGALRM, hang)
    try:
        yield
    finally:
        signal.signal(signal.SIGALRM, before)
