"""A report as data: sections of sentences, tables and figures, written as Markdown and as one HTML file."""

from __future__ import annotations

import base64
import html
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from flapgym.evaluation import Estimate

STYLE = """
body { font: 16px/1.5 Georgia, serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; color: #222; }
table { border-collapse: collapse; margin: 1rem 0; font-size: 0.85rem; }
th, td { border-bottom: 1px solid #ccc; padding: 0.25rem 0.7rem; text-align: left; }
th { border-bottom: 2px solid #666; }
img { max-width: 100%; }
.notice { position: sticky; top: 0; margin: 0; padding: 0.3rem 0.7rem; background: #b00020; color: #fff; }
.watermark { position: fixed; top: 40%; left: 0; width: 100%; margin: 0; text-align: center; font-size: 6rem;
  color: #b00020; opacity: 0.15; transform: rotate(-30deg); pointer-events: none; }
@page { size: A4 landscape; margin: 15mm; }
@media print {
  body { font-size: 10pt; max-width: none; margin: 0; padding: 0; }
  table { font-size: 7pt; }
  th, td { padding: 0.1rem 0.35rem; }
  h2, thead tr, p:has(+ p img), p:has(+ table) { break-after: avoid; }
  tr, img, p { break-inside: avoid; }
  img { max-height: 140mm; }
}
"""


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


def as_markdown(title: str, sections: list[Section], folder: Path) -> str:
    """The report in Markdown; figures are linked relative to `folder`."""
    blocks = [f"# {title}"]
    for section in sections:
        blocks.append(f"## {section.title}")
        for part in section.parts:
            if isinstance(part, Table):
                lines = [part.head, tuple("---" for _ in part.head), *part.rows]
                blocks.append("\n".join(f"| {' | '.join(line)} |" for line in lines))
            elif isinstance(part, Path):
                blocks.append(f"![{part.stem}]({part.relative_to(folder).as_posix()})")
            else:
                blocks.append(part)
    return "\n\n".join(blocks) + "\n"


def from_markdown(text: str) -> list[str | Table]:
    """Paragraphs and tables of plain Markdown, as the benchmarks print it."""
    parts: list[str | Table] = []
    for block in filter(None, (block.strip() for block in text.split("\n\n"))):
        lines = block.splitlines()
        if lines[0].startswith("|"):
            head, _, *rows = (tuple(cell.strip() for cell in line.strip("|").split("|")) for line in lines)
            parts.append(Table(head, tuple(rows)))
        else:
            parts.append(" ".join(lines))
    return parts


def as_html(title: str, sections: list[Section], notice: str = "") -> str:
    """The report as one file that needs no other: figures are inside.

    A notice stays on the screen, and its first words lie across every printed page: browsers repeat what is fixed.
    """
    body = [f"<h1>{html.escape(title)}</h1>"]
    if notice:
        words = html.escape(notice.partition(":")[0])
        body = [f'<p class="notice">{html.escape(notice)}</p>\n<p class="watermark">{words}</p>', *body]
    for section in sections:
        body.append(f"<h2>{html.escape(section.title)}</h2>")
        for part in section.parts:
            if isinstance(part, Table):
                body.append(_table(part))
            elif isinstance(part, Path):
                kind = "svg+xml" if part.suffix == ".svg" else part.suffix[1:]
                data = base64.b64encode(part.read_bytes()).decode()
                body.append(
                    f'<p><img alt="{html.escape(part.stem)}" src="data:image/{kind};base64,{data}"></p>'
                )
            else:
                body.append(f"<p>{html.escape(part)}</p>")
    head = f'<meta charset="utf-8"><title>{html.escape(title)}</title><style>{STYLE}</style>'
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head>{head}</head>\n<body>\n'
        + "\n".join(body)
        + "\n</body></html>\n"
    )


def percent(change: Estimate) -> str:
    """A change in percent with its interval, if it has one."""
    if change.low is None or change.high is None:
        return f"{100 * change.mean:+.1f}"
    return f"{100 * change.mean:+.1f} [{100 * change.low:+.1f}, {100 * change.high:+.1f}]"


def _table(table: Table) -> str:
    def row(cells: tuple[str, ...], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in cells) + "</tr>"

    # A head that is one is repeated where print breaks the table.
    body = "\n".join(row(cells, "td") for cells in table.rows)
    return f"<table>\n<thead>\n{row(table.head, 'th')}\n</thead>\n<tbody>\n{body}\n</tbody>\n</table>"
