"""Progress bars on standard error: alive on a terminal; elsewhere, as in a log, one line once the work is done."""

from __future__ import annotations

import io
import sys
from typing import Any

from tqdm import tqdm


class _Nowhere(io.TextIOBase):
    """Takes what a bar draws where nobody watches it."""

    def write(self, text: str) -> int:
        return len(text)


class ProgressBar(tqdm):  # type: ignore[misc]
    """A bar of tqdm, with its arguments but for the file.

    Without a terminal every redraw would be a line of its own in the log: there only the last state is printed.
    """

    def __init__(self, *arguments: Any, **keywords: Any) -> None:
        self._alive = sys.stderr.isatty()
        super().__init__(*arguments, file=sys.stderr if self._alive else _Nowhere(), **keywords)

    def close(self) -> None:
        """End the bar, where it stands."""
        open_yet = not self.disable
        super().close()
        if open_yet and not self._alive:
            print(self, file=sys.stderr, flush=True)
