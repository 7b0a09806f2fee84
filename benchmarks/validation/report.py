"""The comparison of some models as one table in Markdown."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.page import table
from benchmarks.validation.comparison import Comparison
from benchmarks.validation.rows import Near, Row

OVER = "over independent"


def comparison_table(comparisons: Sequence[Comparison]) -> str:
    """All rows, each group under its heading; two columns a model."""
    names = [comparison.model for comparison in comparisons]
    head = ["quantity", "independent", "held to", *(word for name in names for word in (f"`{name}`", OVER))]
    first = comparisons[0].tables
    lines: list[list[str]] = []
    for heading in first:
        lines.append([f"**{heading}**", *[""] * (len(head) - 1)])
        beside = zip(*(comparison.tables[heading] for comparison in comparisons), strict=True)
        lines += [cells(rows) for rows in beside]
    return table(head, lines)


def cells(rows: Sequence[Row]) -> list[str]:
    """One line of the table: a quantity of every model, whose independent values are the same."""
    row = rows[0]
    unit = f" [{row.unit.name}]" if row.unit.name else ""
    return [
        row.quantity + unit,
        ", ".join(f"{name} {row.unit.show(value)}" for name, value in row.independent.items()),
        str(row.limit or ""),
        *(cell for each in rows for cell in (each.unit.show(each.ours), beside_independent(each))),
    ]


def beside_independent(row: Row) -> str:
    """Ours over the independent values, and whether that will do."""
    ratios = ", ".join(f"{ratio:.2f}" for ratio in row.ratios.values())
    return ": ".join(part for part in (ratios, outcome(row)) if part)


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
        amount = f"{100 * abs(beyond / nearest):.1f} %"
    return f"**{amount} too {'low' if beyond < 0.0 else 'high'}**"


def verdict(comparison: Comparison) -> str:
    """How many of the rows that are held to something are met, and which are not."""
    held = [(heading, row) for heading, rows in comparison.tables.items() for row in rows if row.limit]
    missed = [f"{heading}: {row.quantity}" for heading, row in held if not row.met]
    line = f"{comparison.model}: {len(held) - len(missed)} of {len(held)} met"
    return "\n".join([line, *(f"  missed  {each}" for each in missed)])
