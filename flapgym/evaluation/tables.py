"""Tables as text and as Markdown, and how they show a change."""

from __future__ import annotations

import html
from collections.abc import Sequence

from flapgym.evaluation.bootstrap import Estimate


def markdown_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Lines of a table in Markdown; what would be markup in a cell is shown as it is."""
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return lines + [
        "| " + " | ".join(html.escape(cell).replace("|", "\\|") for cell in row) + " |" for row in rows
    ]


def text_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Lines of a table for a terminal."""
    table = [header, *rows]
    widths = [max(len(row[i]) for row in table) for i in range(len(header))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in table]
    lines.insert(1, "  ".join("-" * width for width in widths))
    return [line.rstrip() for line in lines]


def percent(change: Estimate) -> str:
    """A change and its interval in percent."""
    if change.low is None or change.high is None:
        return f"{100 * change.mean:+.1f}"
    if change.low == change.high == change.mean == 0.0:
        return "0"
    return f"{100 * change.mean:+.1f} [{100 * change.low:+.1f}, {100 * change.high:+.1f}]"


def plain_name(name: str) -> str:
    """A name for a spreadsheet, which would compute what begins like a formula."""
    return f"'{name}" if name.startswith(("=", "+", "-", "@")) else name
