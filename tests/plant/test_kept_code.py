"""What goes into compiled code decides whether it is read again from disk."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("numba")

ROOT = Path(__file__).parents[2]
STEP = """
import numpy as np
from flapgym.model import load_model
from flapgym.plant import Start, Stepping, make_plant
from flapgym.plant.backends import numba
model = load_model()
plant = make_plant(model, 1, Stepping(5, 10, model.length_scale), "numba")
still = np.zeros((1, 3))
plant.reset(np.arange(1), Start(np.zeros(1), still, still, np.zeros(1)))
plant.step(np.full((1, 3), 0.5))
print(numba.EDITION, sum(numba._step.stats.cache_hits.values()), plant.flap_motion()[0][0, 0].hex())
"""


def _run(program, folder, **environment):
    """What a program prints that finds the package in a folder."""
    run = subprocess.run(
        [sys.executable, "-c", program],
        env={"PATH": os.environ["PATH"], "PYTHONPATH": str(folder), **environment},
        cwd=folder,
        capture_output=True,
        text=True,
    )
    assert run.returncode == 0, run.stderr
    return run.stdout.split()


@pytest.fixture
def package(tmp_path):
    """A copy of the package, whose files a test may change."""
    shutil.copytree(ROOT / "flapgym", tmp_path / "flapgym", ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path


def test_another_actuator_is_compiled_anew(package):
    actuator = package / "flapgym" / "plant" / "actuator.py"
    first, again = (_run(STEP, package, HOME=str(package)) for _ in range(2))
    assert first[1:] == ["0", again[2]]
    assert again[:2] == [first[0], "1"]
    text = actuator.read_text()
    assert text.count("going = angle + 0.5 * time_step") == 1
    actuator.write_text(text.replace("going = angle + 0.5 * time_step", "going = angle + 0.4 * time_step"))
    other = _run(STEP, package, HOME=str(package))
    assert other[1] == "0"
    assert other[0] != first[0]
    # From rest all of the way goes by the changed line.
    assert float.fromhex(other[2]) != float.fromhex(first[2])


@pytest.mark.parametrize("name", ["actuator.py", "parameters.py", "backends/numba.py"])
def test_the_edition_is_of_every_file_that_goes_into_the_code(package, name):
    program = "from flapgym.plant.backends.numba import EDITION; print(EDITION)"
    first = _run(program, package)
    with (package / "flapgym" / "plant" / name).open("a") as file:
        file.write("# another\n")
    assert _run(program, package) != first
