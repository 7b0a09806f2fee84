"""The comparison as one table in Markdown."""

from __future__ import annotations

from benchmarks.page import table
from benchmarks.validation.comparison import Comparison
from benchmarks.validation.rows import Near, Row

HEAD = ("quantity", "ours", "independent", "ours / independent", "held to", "outcome")


def comparison_table(comparison: Comparison) -> str:
    """All rows, each group under its heading."""
    lines: list[list[str]] = []
    for heading, rows in comparison.tables.items():
        lines.append([f"**{heading}**", *[""] * (len(HEAD) - 1)])
        lines += [cells(row) for row in rows]
    return table(HEAD, lines)


def cells(row: Row) -> list[str]:
    """One line of the table."""
    unit = f" [{row.unit.name}]" if row.unit.name else ""
    return [
        row.quantity + unit,
        row.unit.show(row.ours),
        ", ".join(f"{name} {row.unit.show(value)}" for name, value in row.independent.items()),
        ", ".join(f"{ratio:.2f}" for ratio in row.ratios.values()),
        str(row.limit or ""),
        outcome(row),
    ]


def outcome(row: Row) -> str:
    """Met, or by how much missed: as a share of the value it would have to be near, or in its unit."""
    beyond = row.beyond
    if beyond is None:
        return ""
    if beyond == 0.0:
        return "met"
    if isinstance(row.limit, Near) or not row.ratios:
        amount = f"{row.unit.show(abs(beyond))} {row.unit.name}".strip()
    else:
        nearest = min(row.independent.values(), key=lambda value: abs(row.ours - value))
        amount = f"{100 * abs(beyond / nearest):.0f} %"
    return f"**missed** by {amount}, {'low' if beyond < 0.0 else 'high'}"


def verdict(comparison: Comparison) -> str:
    """How many of the rows that are held to something are met, and which are not."""
    held = [(heading, row) for heading, rows in comparison.tables.items() for row in rows if row.limit]
    missed = [f"{heading}: {row.quantity}" for heading, row in held if not row.met]
    line = f"{comparison.model}: {len(held) - len(missed)} of {len(held)} met"
    return "\n".join([line, *(f"  missed  {each}" for each in missed)])
