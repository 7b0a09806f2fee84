"""What a person or a file gave, written so that a message stays one short, harmless line."""

from __future__ import annotations

LONGEST = 60
"""Characters of a value that a message repeats."""


def shown(value: object) -> str:
    """The value as Python writes it, in one line, cut where it is long."""
    if isinstance(value, int) and abs(value) >= 10**LONGEST:  # Python writes none of more than 4300 digits
        return f"an integer of some {round(0.30103 * value.bit_length())} digits"
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # such an integer within, or nesting too deep
        return f"a {type(value).__name__}"
    return one_line(text, LONGEST)


def one_line(message: object, longest: int = 200) -> str:
    """A text in one line without what a terminal would obey, cut where it is long."""
    text = " ".join(str(message).split())
    if not text.isprintable():
        text = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)
    return text if len(text) <= longest else f"{text[: longest - 1]}…"
