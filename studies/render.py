"""Reports as text: `studies.document`'s data through the templates beside this file, to Markdown or one HTML file."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from pathlib import Path

from studies.document import Section, Table


def as_markdown(title: str, sections: Sequence[Section], folder: Path) -> str:
    """The report in Markdown; figures are linked relative to `folder`."""
    return _rendered("report.md", title=title, sections=sections, folder=folder)


def as_html(title: str, sections: Sequence[Section], notice: str = "") -> str:
    """The report as one file that needs no other: figures are inside.

    A notice stays on the screen, and its first words lie across every printed page: browsers repeat what is fixed.
    """
    return _rendered("report.html", title=title, sections=sections, notice=notice)


def markdown_table(table: Table) -> str:
    """A table in Markdown."""
    lines = [table.head, tuple("---" for _ in table.head), *table.rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def embedded(picture: Path) -> str:
    """A picture as an address that holds it."""
    kind = "svg+xml" if picture.suffix == ".svg" else picture.suffix[1:]
    return f"data:image/{kind};base64,{base64.b64encode(picture.read_bytes()).decode()}"


def _rendered(template: str, **report: object) -> str:
    try:
        import jinja2
    except ImportError:
        raise ImportError("reports need jinja2: pip install 'flapgym[baselines]'") from None
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).with_name("templates")),
        # Markdown takes its cells as they are, HTML must not.
        autoescape=jinja2.select_autoescape(["html"]),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.tests |= {
        "table": lambda part: isinstance(part, Table),
        "picture": lambda part: isinstance(part, Path),
    }
    environment.filters |= {"rows": markdown_table, "embedded": embedded}
    return environment.get_template(template).render(**report)
