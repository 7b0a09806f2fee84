"""Tables as text and as Markdown, and how they show a change."""

from __future__ import annotations

import html
from collections.abc import Sequence

from flapgym.evaluation.bootstrap import Estimate

WIDTH = 120
"""Columns of a terminal, where it does not say how many it has."""
GAP = "  "


def markdown_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Lines of a table in Markdown; what would be markup in a cell is shown as it is."""
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return lines + [
        "| " + " | ".join(html.escape(cell).replace("|", "\\|") for cell in row) + " |" for row in rows
    ]


def text_table(
    header: Sequence[str], rows: Sequence[Sequence[str]], width: int = WIDTH, keys: int = 1
) -> list[str]:
    """Lines of a table for a terminal, in blocks that fit into its width; each begins with the first columns."""
    table = [header, *rows]
    widths = [max(len(row[i]) for row in table) for i in range(len(header))]
    blocks, room = [list[int]()], 0
    for column in range(keys, len(header)):
        room -= widths[column] + len(GAP)
        if room < 0:
            room = width - sum(widths[:keys]) - len(GAP) * keys - widths[column]
            blocks.append([*range(keys), column])
        else:
            blocks[-1].append(column)
    lines = []
    for block in blocks[1:]:
        shown = [GAP.join(row[column].ljust(widths[column]) for column in block).rstrip() for row in table]
        lines += [shown[0], GAP.join("-" * widths[column] for column in block), *shown[1:], ""]
    return lines[:-1]


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
