"""docs/wind.md tells the truth: what it shows under "Your own box" runs."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

PAGE = (Path(__file__).parents[2] / "docs" / "wind.md").read_text(encoding="utf-8")


def test_your_own_box_is_written_and_flown_in(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (block,) = re.findall(r"```python\n(.*?)```", PAGE.partition("## Your own box")[2], flags=re.S)
    found: dict[str, object] = {}
    exec(block, found)
    assert (tmp_path / "wind.nc").is_file()
    assert np.abs(found["observation"]).max() > 0.0
    assert 0.0 < abs(found["info"]["wind_perturbation"]) < 1.0
