"""Compiled code that is kept on disk: damaged files are mended, nothing needs to be writable, and who waits is told."""

from __future__ import annotations

import contextlib
import inspect
import sys
from functools import lru_cache
from pathlib import Path
from typing import Any

from numba import njit
from numba.core import event

OPTIONS: dict[str, Any] = {
    # Sums may be reordered and products fused; NaN and infinity keep their meaning, for a step must notice them.
    "fastmath": {"reassoc", "contract", "nsz"},
    "error_model": "numpy",
}


def kept(function: Any) -> Any:
    """Compile on demand and keep the code on disk; for this process alone where no folder takes it."""
    try:
        return njit(cache=True, **OPTIONS)(function)
    except RuntimeError:  # numba may write neither beside this file nor in the user's cache folder
        return njit(**OPTIONS)(function)


def first_cause(error: BaseException) -> BaseException:
    """What began it: an interrupt while results are handed to Python comes out as a SystemError, or one of that."""
    while error.__cause__ is not None:
        error = error.__cause__
    return error


def run_kept(function: Any, *arguments: Any) -> Any:
    """Call a pure function whose code is kept; files damaged there are removed, and nothing there is needed."""
    try:
        return function(*arguments)
    except SystemError as error:
        raise first_cause(error) from None
    except Exception:
        # Numba unpickles what it kept, and of a file that is empty or cut comes any error.
        source = inspect.getfile(function.py_func)
        with contextlib.suppress(OSError, TypeError):
            for damaged in Path(function.stats.cache_path).glob(f"{Path(source).stem}.*.nb?"):
                damaged.unlink()
    try:
        return function(*arguments)
    except OSError:  # the folder is gone since numba chose it
        return _for_this_process(function)(*arguments)


@lru_cache
def _for_this_process(function: Any) -> Any:
    """The same function, whose code is kept nowhere."""
    return njit(**OPTIONS)(function.py_func)


class _Announcement(event.Listener):
    """Says so when code of this package is compiled in earnest, not when it is read from where it is kept."""

    def __init__(self) -> None:
        super().__init__()
        self._depth = 0

    def on_start(self, event: Any) -> None:
        """One line for all functions that are compiled within the first."""
        function = event.data["dispatcher"]
        if self._depth == 0 and function.py_func.__module__.startswith("flapgym."):
            kept_at = function.stats.cache_path
            once = "once for this installation"
            if kept_at is None:
                once = "for this process alone, since no folder keeps it (name one in NUMBA_CACHE_DIR)"
            if sys.stderr is not None:
                sys.stderr.write(f"flapgym: compiling the turbine's step, {once} (some tens of seconds)\n")
                sys.stderr.flush()
        self._depth += 1

    def on_end(self, event: Any) -> None:
        """Count."""
        self._depth -= 1


event.register("numba:compile", _Announcement())
