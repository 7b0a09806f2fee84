"""The compiled plant: nothing needs to be writable, damaged files are mended, and who waits is told so first."""

import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from flapgym.plant import chosen_backend

numba = pytest.importorskip("numba")

from flapgym.core.kept import kept, run_kept  # noqa: E402 (needs numba)

ROOT = Path(__file__).parents[1]
MAKE = "import gymnasium, flapgym; print(gymnasium.make('flapgym/NREL5MW-v1', backend='numba').reset(seed=1)[0].shape)"


def dispatcher(folder):
    """A function of a module in a folder, as one process after another finds it."""
    (folder / "tiny.py").write_text("def add(a, b):\n    return a + b\n")
    spec = importlib.util.spec_from_file_location("tiny", folder / "tiny.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return kept(module.add)


def called(folder):
    function = dispatcher(folder)
    assert run_kept(function, 1.0, 2.0) == 3.0
    return function


@pytest.fixture
def writable(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    return tmp_path


@pytest.mark.parametrize("what", ["nbi", "nbc"])
@pytest.mark.parametrize("how", ["empty", "halved", "garbage"])
def test_a_damaged_file_is_compiled_anew_and_mended(writable, how, what):
    called(writable)
    (path,) = (writable / "__pycache__").glob(f"*.{what}")
    content = path.read_bytes()
    path.write_bytes({"empty": b"", "halved": content[: len(content) // 2], "garbage": b"\xff" * 99}[how])
    called(writable)
    assert sum(called(writable).stats.cache_hits.values()) == 1


def test_where_nothing_can_be_written_code_is_compiled_for_the_process(writable, monkeypatch):
    (writable / "__pycache__").write_text("no folder")
    monkeypatch.setenv("XDG_CACHE_HOME", "/dev/null/cache")
    monkeypatch.setenv("HOME", "/dev/null")
    assert called(writable).stats.cache_path is None


def test_code_that_cannot_be_kept_is_used_all_the_same(writable):
    function = dispatcher(writable)
    shutil.rmtree(writable / "__pycache__")
    (writable / "__pycache__").write_text("no folder any more")
    assert run_kept(function, 1.0, 2.0) == 3.0


def test_an_environment_is_made_where_package_and_home_are_read_only_and_says_why_it_takes_long(tmp_path):
    shutil.copytree(ROOT / "flapgym", tmp_path / "flapgym", ignore=shutil.ignore_patterns("__pycache__"))
    for folder in ("plant/backends", "envs"):
        (tmp_path / "flapgym" / folder / "__pycache__").write_text("no folder")
    run = subprocess.run(
        [sys.executable, "-c", MAKE],
        env={"PATH": os.environ["PATH"], "PYTHONPATH": str(tmp_path), "HOME": "/dev/null"},
        cwd=tmp_path,
        check=True,
        capture_output=True,
        text=True,
    )
    assert run.stdout == "(3,)\n"
    (line,) = run.stderr.splitlines()
    assert line.startswith("flapgym: compiling the turbine's step, for this process alone")
    assert "name one in NUMBA_CACHE_DIR" in line


def test_code_that_is_kept_is_not_announced():
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    runs = [
        subprocess.run(
            [sys.executable, "-c", MAKE], env=environment, check=True, capture_output=True, text=True
        )
        for _ in range(2)
    ]
    assert runs[1].stderr == ""


def test_without_numba_numpy_steps_the_plant(monkeypatch):
    monkeypatch.setitem(sys.modules, "flapgym.plant.backends.numba", None)
    assert chosen_backend("auto") == "numpy"
    with pytest.raises(ImportError, match="backend: numba cannot be imported .*; pip install numba, or take"):
        chosen_backend("numba")


INTERRUPTED = """
import signal, gymnasium, flapgym
def interrupt(*_):
    raise KeyboardInterrupt
signal.signal(signal.SIGALRM, interrupt)
for env in (gymnasium.make("flapgym/NREL5MW-v1"), gymnasium.make_vec("flapgym/NREL5MW-v1", num_envs=64)):
    for _ in range(100):
        env.reset(seed=0)
        action = env.action_space.sample()
        try:
            signal.setitimer(signal.ITIMER_REAL, 0.003)
            while not env.step(action)[3] is True:
                pass
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        except KeyboardInterrupt:
            pass
"""


def test_an_interrupt_in_the_midst_of_a_step_stays_one():
    """Numba calls Python for what it returns; where an interrupt met named tuples the process came to its end."""
    subprocess.run(
        [sys.executable, "-c", INTERRUPTED], env={**os.environ, "PYTHONPATH": str(ROOT)}, check=True
    )
