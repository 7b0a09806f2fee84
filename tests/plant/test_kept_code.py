"""Where compiled code is kept: nothing needs to be writable, and damaged files are mended."""

import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

numba = pytest.importorskip("numba")

from flapgym.plant.compiled import kept  # noqa: E402 (needs numba)
from flapgym.plant.compiled_plant import compile_kept  # noqa: E402

ROOT = Path(__file__).parents[2]
ARGUMENTS = (numba.types.float64, numba.types.float64)


def dispatcher(folder):
    """A function of a module in a folder, as one process after another finds it."""
    (folder / "tiny.py").write_text("def add(a, b):\n    return a + b\n")
    spec = importlib.util.spec_from_file_location("tiny", folder / "tiny.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return kept(module.add)


def compiled(folder):
    function = dispatcher(folder)
    assert compile_kept(function, numba.types.float64(*ARGUMENTS))(1.0, 2.0) == 3.0
    return function


@pytest.fixture
def writable(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    return tmp_path


@pytest.mark.parametrize("what", ["nbi", "nbc"])
@pytest.mark.parametrize("how", ["empty", "halved", "garbage"])
def test_a_damaged_file_is_compiled_anew_and_mended(writable, how, what):
    compiled(writable)
    (path,) = (writable / "__pycache__").glob(f"*.{what}")
    content = path.read_bytes()
    path.write_bytes({"empty": b"", "halved": content[: len(content) // 2], "garbage": b"\xff" * 99}[how])
    compiled(writable)
    assert sum(compiled(writable).stats.cache_hits.values()) == 1


def test_where_nothing_can_be_written_code_is_compiled_for_the_process(writable, monkeypatch):
    (writable / "__pycache__").write_text("no folder")
    monkeypatch.setenv("XDG_CACHE_HOME", "/dev/null/cache")
    monkeypatch.setenv("HOME", "/dev/null")
    assert compiled(writable).stats.cache_path is None


def test_code_that_cannot_be_kept_is_used_all_the_same(writable, monkeypatch):
    function = dispatcher(writable)
    shutil.rmtree(writable / "__pycache__")
    (writable / "__pycache__").write_text("no folder any more")
    assert compile_kept(function, numba.types.float64(*ARGUMENTS))(1.0, 2.0) == 3.0


def test_an_environment_is_made_where_package_and_home_are_read_only(tmp_path):
    shutil.copytree(ROOT / "flapgym", tmp_path / "flapgym", ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "flapgym" / "plant" / "__pycache__").write_text("no folder")
    program = "import gymnasium, flapgym; print(gymnasium.make('flapgym/NREL5MW-v0', kernel='numba').reset()[0].shape)"
    run = subprocess.run(
        [sys.executable, "-c", program],
        env={"PATH": os.environ["PATH"], "PYTHONPATH": str(tmp_path), "HOME": "/dev/null"},
        cwd=tmp_path,
        check=True,
        capture_output=True,
        text=True,
    )
    assert run.stdout == "(3,)\n"
    assert "for this process alone, since no folder keeps it (name one in NUMBA_CACHE_DIR)" in run.stderr
