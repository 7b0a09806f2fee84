"""A report as data: sections of sentences, tables and figures; `studies.render` writes it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from flapgym.evaluation import Estimate


@dataclass(frozen=True)
class Table:
    """Head and rows of text."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Section:
    """A heading and what follows it: a sentence or paragraph, a table, or the path of a figure.

    `conclusions` are sentences that judge what was found, at its end; `verdict` is what the report's first table says
    of it.
    """

    title: str
    content: tuple[str | Table | Path, ...]
    verdict: str = ""
    conclusions: tuple[str, ...] = ()

    @property
    def parts(self) -> tuple[str | Table | Path, ...]:
        """All that stands under the heading."""
        return (*self.content, *self.conclusions)

    def on_trial(self, notice: str) -> Section:
        """The section of a trial run: a notice before its numbers, and nothing concluded from them."""
        return Section(self.title, (notice, *self.content))


def summary(sections: Sequence[Section]) -> Section:
    """The verdicts of all sections that have one."""
    rows = tuple((section.title, section.verdict) for section in sections if section.verdict)
    return Section("At a glance", (Table(("of the paper", "ours beside it"), rows),))


def percent(change: Estimate) -> str:
    """A change in percent with its interval, if it has one."""
    if change.low is None or change.high is None:
        return f"{100 * change.mean:+.1f}"
    return f"{100 * change.mean:+.1f} [{100 * change.low:+.1f}, {100 * change.high:+.1f}]"
