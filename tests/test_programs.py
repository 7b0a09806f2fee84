"""Every program ends in order: refused in one line before any work, interrupted with 130, whatever its streams are."""

import importlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from flapgym.aeroelastic import cache
from flapgym.core import program
from flapgym.model import save_model
from flapgym.turbine import load_case
from tests.synthetic import synthetic_model

ROOT = Path(__file__).parents[1]
PROGRAMS = {
    "flapgym": ["compare", "--realisations", "1000", "--duration", "3600"],
    "baselines.tune": ["lqg_multiblade_saturating"],
    "baselines.paper": ["turbine"],
    "baselines.rivals": [],
    "train.policies": [str(ROOT / "configs" / "train-ppo.toml")],
    "benchmarks.aerodynamics": [],
    "benchmarks.environment": ["--seconds", "100"],
    "benchmarks.field": ["docs"],
    "benchmarks.nonlinear": [],
    "benchmarks.predictive_solvers": [],
    "benchmarks.reduction": [],
    "benchmarks.scores": ["docs/scores.md"],
    "benchmarks.site": [],
    "benchmarks.turbine": ["full"],
    "benchmarks.variants": ["docs"],
    "benchmarks.conventions": ["docs"],
    "benchmarks.architecture": ["docs"],
    "benchmarks.manual": ["docs"],
}
"""Programs, and arguments that give them work for a while."""
QUICK = {
    "benchmarks.architecture",
    "benchmarks.conventions",
    "benchmarks.field",
    "benchmarks.manual",
    "benchmarks.predictive_solvers",
}
"""Those that are done before one could interrupt them."""
MINUTES = 120.0


def _environment(**more):
    return {**os.environ, "PYTHONPATH": str(ROOT), "MPLBACKEND": "agg", "TQDM_MININTERVAL": "0.1", **more}


def _start(name, arguments, folder, **streams):
    """A program running by itself in an empty folder, deaf to no signal."""
    (folder / "docs" / "environments").mkdir(parents=True, exist_ok=True)
    return subprocess.Popen(
        [sys.executable, "-m", name, *arguments],
        cwd=folder,
        env=_environment(FLAPGYM_CACHE_DIR=str(folder / "cache")),
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
        **{"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **streams},
    )


def _main(name):
    """The program as a function of its arguments."""
    if name == "flapgym":
        return importlib.import_module("flapgym.cli").main
    found = importlib.import_module(name)
    return importlib.import_module(f"{name}.__main__").main if hasattr(found, "__path__") else found.main


@pytest.mark.parametrize(
    "name, seconds",
    [
        *((name, 4.0) for name in PROGRAMS if name not in QUICK),
        ("benchmarks.environment", 9.0),  # within the library that takes the times
    ],
)
def test_an_interrupt_ends_a_program_with_one_line_and_130(name, seconds, tmp_path):
    running = _start(name, PROGRAMS[name], tmp_path)
    time.sleep(seconds)
    running.send_signal(signal.SIGINT)
    _, error = running.communicate(timeout=MINUTES)
    # Where a library ran code by itself, Python ends by the signal: to a shell that is 130 too.
    assert running.returncode in (130, -signal.SIGINT), error.decode()
    # A bar may stand before it, which ends with a carriage return.
    last = error.decode().replace("\r", "\n").strip().splitlines()[-1]
    assert last.startswith(f"{name}")
    assert "interrupted; " in last
    assert "Traceback" not in error.decode()


@pytest.mark.parametrize(
    "name, arguments, part",
    [
        ("train.policies", ["--steps", "0"], "--steps: expected a whole number of at least 1, got 0"),
        ("train.policies", ["--steps", "-1"], "--steps: expected a whole number of at least 1, got -1"),
        ("train.policies", ["--seeds", "0"], "--seeds: expected a whole number from 1 to 1000, got 0"),
        ("train.policies", ["--seed", "-1"], "--seed"),
        ("train.policies", ["--output", "taken"], "taken"),
        ("train.policies", ["--tensorboard", "taken"], "taken"),
        ("baselines.tune", ["lqr"], "lqr"),
        ("baselines.tune", ["--output", "taken"], "taken"),
        (
            "baselines.paper",
            ["--realisations", "0"],
            "--realisations: expected a whole number from 2 to 1000, got 0",
        ),
        (
            "baselines.rivals",
            ["--duration", "nan"],
            "--duration: expected a number from 10 to 3600 s, got nan",
        ),
        ("baselines.rivals", ["--output", "taken"], "taken"),
        ("benchmarks.environment", ["--seconds", "nan"], "--seconds"),
        ("benchmarks.environment", ["--rounds", "0"], "--rounds"),
        ("benchmarks.environment", ["--endurance", "-5"], "--endurance"),
        ("benchmarks.environment", ["--output", "taken/bench.json"], "taken"),
        ("benchmarks.environment", ["--docs", "missing.md"], "missing.md"),
        ("benchmarks.nonlinear", ["--duration", "0"], "--duration"),
        ("benchmarks.nonlinear", ["--output", "taken"], "taken"),
        ("benchmarks.scores", ["no/scores.md"], "no/scores.md"),
        ("benchmarks.variants", ["nowhere"], "nowhere"),
        ("benchmarks.variants", ["docs", "--realisations", "0"], "--realisations"),
        ("benchmarks.turbine", ["figure12"], "figure12"),
        ("benchmarks.aerodynamics", ["--output", "taken"], "taken"),
        ("benchmarks.reduction", ["--output", "taken"], "taken"),
        ("flapgym", ["compare", "--realisations", "-1"], "--realisations"),
        ("flapgym", ["compare", "--agents", "open_loop", "--output", "taken"], "taken"),
        ("benchmarks.manual", ["nowhere"], "nowhere"),
        ("benchmarks.architecture", ["nowhere"], "nowhere"),
    ],
)
def test_what_is_impossible_is_refused_in_one_line_before_any_work(
    name, arguments, part, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "taken").write_text("mine")
    (tmp_path / "docs" / "environments").mkdir(parents=True)
    arguments = (
        [str(ROOT / "configs" / "train-ppo.toml"), *arguments] if name == "train.policies" else arguments
    )
    assert _main(name)(arguments) == 2
    output, error = capsys.readouterr()
    assert output == ""
    assert error.count("\n") == 1, error
    assert part in error
    assert (tmp_path / "taken").read_text() == "mine"


@pytest.mark.parametrize("name", PROGRAMS)
def test_help_says_how_to_start_the_program(name, capsys):
    assert _main(name)(["--help"]) == 0
    output, error = capsys.readouterr()
    usage = "flapgym" if name == "flapgym" else f"python -m {name}"
    assert output.startswith(f"usage: {usage}")
    assert error == ""


def _info(tmp_path, shell, **more):
    return subprocess.run(
        ["sh", "-c", f"{sys.executable} -m flapgym info {shell}"],
        cwd=tmp_path,
        env=_environment(**more),
        capture_output=True,
        timeout=MINUTES,
    )


@pytest.mark.parametrize("shell", [">&-", "> /dev/full"])
def test_output_that_goes_nowhere_is_told_once_and_is_no_success(shell, tmp_path):
    if "full" in shell and not Path("/dev/full").exists():
        pytest.skip("this system has no device that is always full")
    ended = _info(tmp_path, shell)
    assert ended.returncode == 1
    assert ended.stderr.decode().count("\n") == 1
    assert ended.stderr.decode().startswith("flapgym info: ")


@pytest.mark.parametrize("shell", ["2>&-", "2> /dev/full", ">&- 2>&-"])
def test_errors_that_nobody_hears_do_not_raise(shell, tmp_path):
    ended = subprocess.run(
        ["sh", "-c", f"{sys.executable} -m flapgym info nowhere {shell}"],
        cwd=tmp_path,
        env=_environment(),
        capture_output=True,
        timeout=MINUTES,
    )
    assert ended.returncode == 2
    assert (ended.stdout, ended.stderr) == (b"", b"")


def test_a_closed_error_stream_is_not_mixed_into_the_output(tmp_path):
    fine, deaf = _info(tmp_path, ""), _info(tmp_path, "2>&-")
    assert (fine.returncode, deaf.returncode) == (0, 0)
    assert fine.stdout == deaf.stdout


def test_a_stream_of_few_characters_gets_escapes(tmp_path):
    (tmp_path / "böe.toml").write_text(
        'base = "nrel5mw-rated"\nname = "Böe"\n[flap]\nangle_limit = "0 deg"\n'
    )
    ended = subprocess.run(
        [sys.executable, "-m", "flapgym", "build", "böe.toml", "--output", "böe.safetensors"],
        cwd=tmp_path,
        env=_environment(PYTHONIOENCODING="ascii", PYTHONUTF8="0"),
        capture_output=True,
        timeout=MINUTES,
    )
    assert ended.returncode == 2
    assert ended.stderr.decode("ascii").count("\n") == 1
    assert "b\\xf6e.toml" in ended.stderr.decode("ascii")


@pytest.mark.parametrize("name", ["x" * 900, "風" * 300], ids=["long", "long in bytes"])
def test_a_long_name_of_a_case_still_has_a_place_in_the_cache(name, tmp_path, monkeypatch):
    from dataclasses import replace

    monkeypatch.setenv("FLAPGYM_CACHE_DIR", str(tmp_path))
    path = cache.cached_path(replace(load_case(), name=name))
    path.write_text("")  # the file system takes it
    path.with_suffix(".lock").write_text("")


def test_an_interrupt_while_a_program_s_modules_are_imported_ends_it_with_a_line_and_130(capsys):
    before = signal.getsignal(signal.SIGINT)
    try:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        program.leave_at_interrupt("baselines.tune")
        with pytest.raises(SystemExit) as ended:
            signal.raise_signal(signal.SIGINT)
        assert ended.value.code == 130
        assert capsys.readouterr().err == "baselines.tune: interrupted; nothing was begun\n"
        # The door hears it as an exception again.
        assert program.run(program.Parser(prog="none"), ["--help"]) == 0
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
        # Where a shell's background ignores it, it stays ignored.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        program.leave_at_interrupt("baselines.tune")
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


def test_a_message_is_one_line_without_what_a_terminal_obeys(capsys):
    assert program.complain("flapgym", "no \x1b[2J such\nfile", 2) == 2
    assert capsys.readouterr().err == "flapgym: no \\x1b[2J such file\n"


def test_an_interrupted_second_training_leaves_the_first_run_s_policy(tmp_path, monkeypatch, capsys):
    from train import policies
    from train.learning import Progress

    save_model(synthetic_model(), tmp_path / "model.safetensors")
    text = (ROOT / "configs" / "train-ppo.toml").read_text(encoding="utf-8")
    text = text.replace('"nrel5mw-rated"', f'"{tmp_path / "model.safetensors"}"')
    text = text.replace("turbines = 64", "turbines = 2").replace("n_steps = 64", "n_steps = 8")
    (tmp_path / "run.toml").write_text(text.replace("batch_size = 2048", "batch_size = 48"), encoding="utf-8")
    arguments = [str(tmp_path / "run.toml"), "--output", str(tmp_path / "runs"), "--steps", "96"]
    assert policies.main(arguments) == 0
    whole = {path.name: path.read_bytes() for path in (tmp_path / "runs").iterdir()}

    def interrupt(self):
        raise KeyboardInterrupt

    monkeypatch.setattr(Progress, "_on_training_start", interrupt)
    assert policies.main(arguments) == 130
    assert {path.name: path.read_bytes() for path in (tmp_path / "runs").iterdir()} == whole

    monkeypatch.undo()
    monkeypatch.setattr(Progress, "_on_step", interrupt)
    assert policies.main(arguments) == 130
    after = {path.name: path.read_bytes() for path in (tmp_path / "runs").iterdir()}
    assert {name: after[name] for name in whole} == whole
    assert any(name.startswith("ppo-after-") and name.endswith("-steps.json") for name in after)
    assert "train.policies: interrupted; what was learnt is kept" in capsys.readouterr().err
