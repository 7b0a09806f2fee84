"""Messages keep the digits that matter, stay short and on one line, and send no terminal anything it would obey."""

import numpy as np
import pytest

from flapgym.core.wording import number, one_line, shown


@pytest.mark.parametrize(
    "value, text",
    [
        (11.000001, "11.000001"),
        (11.0, "11"),
        (1704067200.0, "1704067200"),
        (1704067200.5, "1704067200.5"),
        (571 * 5 * 0.007, "19.985"),
        (0.1 + 0.2, "0.3"),
        (0.007, "0.007"),
        (1e300, "1e+300"),
        (-1e-9, "-1e-09"),
        (np.float32(0.007), "0.00700000021607"),
        (float("nan"), "nan"),
        (120, "120"),
    ],
)
def test_a_number_has_the_digits_it_was_given_and_none_of_rounding(value, text):
    assert number(value) == text


@pytest.mark.parametrize("value", [11.000001, 1704067200.123, 0.1745329252, 7.5e-7, 123456.789012345])
def test_a_number_of_up_to_fifteen_digits_is_read_back_as_it_was(value):
    assert float(number(value)) == value


@pytest.mark.parametrize(
    "value",
    [
        "x" * 10_000,
        b"\x00\x1b" * 500,
        list(range(10_000)),
        {str(index): "y" * 100 for index in range(100)},
        np.zeros(100_000),
        10**5000,
        [10**5000],
        "two\nlines \x1b[2J and a bell \x07 \u202e \ud800",
    ],
    ids=lambda value: type(value).__name__,
)
def test_whatever_was_given_is_shown_in_one_short_harmless_line(value):
    text = shown(value)
    assert len(text) <= 120
    assert text.isprintable()
    assert "\\x00\\x1b\\x00" not in text
    text.encode("utf-8")


def test_a_text_differs_from_a_number_of_the_same_digits():
    assert (shown("11"), shown(11), shown(11.0), shown(True), shown(None)) == (
        "'11'",
        "11",
        "11.0",
        "True",
        "None",
    )


def test_a_message_becomes_one_line():
    assert one_line("no\nsuch \x1b[31m file") == "no such \\x1b[31m file"
    assert len(one_line("x" * 100_000)) <= 1000
