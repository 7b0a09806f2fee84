"""Bars draw on a terminal and leave one line anywhere else."""

import io
import sys

import pytest

from flapgym.core.progress import ProgressBar


class _Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.parametrize("loop", [True, False], ids=["iterated", "updated"])
def test_without_a_terminal_only_the_last_state_is_printed(monkeypatch, loop):
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    if loop:
        assert list(ProgressBar(range(4), desc="work", mininterval=0.0)) == [0, 1, 2, 3]
    else:
        with ProgressBar(total=4, desc="work", mininterval=0.0) as bar:
            for _ in range(4):
                bar.set_postfix_str("at it")
                bar.update()
            assert sys.stderr.getvalue() == ""
    line, end = sys.stderr.getvalue().split("\n")
    assert line.startswith("work: 100%")
    assert "4/4" in line
    assert "\r" not in line
    assert end == ""


def test_a_terminal_sees_it_move(monkeypatch):
    monkeypatch.setattr(sys, "stderr", _Terminal())
    with ProgressBar(total=4, desc="work", mininterval=0.0) as bar:
        bar.update()
        assert "1/4" in sys.stderr.getvalue()


def test_one_that_is_not_wanted_says_nothing(monkeypatch):
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    with ProgressBar(total=4, disable=True) as bar:
        bar.update(4)
    assert sys.stderr.getvalue() == ""
