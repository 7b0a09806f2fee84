"""The cache: built once whoever asks, found again, and mended when damaged."""

import multiprocessing
import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import flapgym.aeroelastic.cache as cache
from flapgym.aeroelastic.cache import cache_folder, cached_model, cached_path
from flapgym.aeroelastic.sources import PACKAGE, files_behind
from flapgym.model import load_model
from flapgym.model.record import Flutter
from flapgym.turbine import load_case

CASE = load_case("nrel5mw-rated")
FLUTTER = Flutter(searched=1.0, speed=0.5, frequency=3.0)
SMALL_CASE = """
base = "nrel5mw-rated"
name = "small"
[discretisation]
chordwise_panels = 1
wake_length = "0.02 rotor diameters"
time_step = "60 ms"
[reduction]
blade_modes = 2
tower_modes = 2
aerodynamic_states = 4
[blades]
mass_factor = [1.0, 1.0, 1.02]
"""


@pytest.fixture
def kept(tmp_path, monkeypatch):
    """An empty cache and a builder that only counts: it hands out the shipped matrices under the case's hash."""
    monkeypatch.setenv("FLAPGYM_CACHE_DIR", str(tmp_path / "cache"))
    built = []

    def build(case, progress=None):
        built.append(case.name)
        return replace(
            load_model("nrel5mw-rated"), name=case.name, inputs_hash=case.hash(), case=case.to_dict()
        )

    monkeypatch.setattr(cache, "build_model", build)
    monkeypatch.setattr(cache, "find_flutter", lambda case: FLUTTER)
    return built


def test_folder_is_the_one_named_or_the_user_s(monkeypatch, tmp_path):
    monkeypatch.setenv("FLAPGYM_CACHE_DIR", str(tmp_path))
    assert cache_folder() == tmp_path
    monkeypatch.delenv("FLAPGYM_CACHE_DIR")
    assert cache_folder().name in ("flapgym", "Cache")


def test_second_call_builds_nothing_and_other_inputs_do(kept):
    first, again = cached_model(CASE), cached_model(CASE)
    np.testing.assert_array_equal(first.turbine.A, again.turbine.A)
    assert kept == [CASE.name]
    cached_model(replace(CASE, turbulence=replace(CASE.turbulence, intensity=0.2)))
    assert len(kept) == 2


def test_other_version_of_the_tool_builds_anew(kept, monkeypatch):
    cached_model(CASE)
    monkeypatch.setattr(cache, "tools", lambda: {"flapgym": "99.0"})
    cached_model(CASE)
    assert len(kept) == 2


def test_other_source_code_builds_anew(kept, monkeypatch):
    cached_model(CASE)
    monkeypatch.setattr(cache, "_sources", lambda: "changed")
    cached_model(CASE)
    assert len(kept) == 2


def test_kept_model_knows_its_flutter(kept):
    cached_model(CASE)
    assert cached_model(CASE).record.flutter == FLUTTER


def test_model_that_cannot_be_kept_is_built_with_a_word(kept, monkeypatch, tmp_path):
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv("FLAPGYM_CACHE_DIR", str(tmp_path / "file"))
    with pytest.warns(RuntimeWarning, match=r"cannot write in .*file .*FLAPGYM_CACHE_DIR"):
        model = cached_model(CASE)
    assert model.inputs_hash == CASE.hash()


def test_damaged_file_is_built_anew_with_a_word(kept):
    cached_model(CASE)
    (path,) = cache_folder().glob("*.safetensors")
    path.write_bytes(path.read_bytes()[:1000])
    with pytest.warns(RuntimeWarning, match=r"cached model is built anew: .*damaged"):
        model = cached_model(CASE)
    assert model.inputs_hash == CASE.hash()
    assert len(kept) == 2
    load_model(path)


def test_a_name_that_leads_elsewhere_stays_in_the_folder(kept):
    cached_model(replace(CASE, name="../my case/a"))
    (path,) = cache_folder().glob("*.safetensors")
    assert path.name.startswith("_my_case_a-")


def _worker(folder, log, barrier):
    os.environ["FLAPGYM_CACHE_DIR"] = str(folder)

    def build(case, progress=None):
        with open(log, "a") as file:
            file.write("built\n")
        return replace(load_model("nrel5mw-rated"), inputs_hash=case.hash())

    cache.build_model, cache.find_flutter = build, lambda case: FLUTTER
    barrier.wait()
    assert cached_model(CASE).inputs_hash == CASE.hash()


def test_processes_that_ask_at_once_build_once(tmp_path):
    context = multiprocessing.get_context("fork")
    barrier = context.Barrier(4)
    workers = [context.Process(target=_worker, args=(tmp_path, tmp_path / "log", barrier)) for _ in range(4)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert [worker.exitcode for worker in workers] == [0] * 4
    assert (tmp_path / "log").read_text() == "built\n"


def test_all_code_that_runs_in_a_build_is_known_to_the_cache_and_none_of_what_comes_after(tmp_path):
    path = tmp_path / "small.toml"
    path.write_text(SMALL_CASE)
    case, ran = load_case(path), set()
    sys.setprofile(lambda frame, *_: ran.add(frame.f_code.co_filename))
    try:
        cache._complete_model(case, None)
    finally:
        sys.setprofile(None)
    known = {str(file) for file in files_behind("flapgym.aeroelastic.build", "flapgym.aeroelastic.flutter")}
    assert {name for name in ran if name.startswith(str(PACKAGE))} - known <= {cache.__file__}
    names = {Path(name).relative_to(PACKAGE).as_posix() for name in known}
    assert {"aeroelastic/equations.py", "wind/shaping_filter.py", "structure/beam.py"} <= names
    after = (
        "cli.py",
        "envs/",
        "plant/",
        "control/",
        "evaluation/",
        "aeroelastic/cache.py",
        "wind/gusts.py",
    )
    assert not [name for name in names if name.startswith(after)]


def test_a_model_that_cannot_be_kept_is_built_once_in_a_process(kept, monkeypatch, tmp_path):
    (tmp_path / "no folder").write_text("")
    monkeypatch.setenv("FLAPGYM_CACHE_DIR", str(tmp_path / "no folder"))
    with pytest.warns(RuntimeWarning, match="cannot write"):
        first = cached_model(CASE)
    assert cached_model(CASE) is first
    assert kept == [CASE.name]


@pytest.mark.parametrize("damage", ["nonsense", "folder", "pipe", "empty"])
def test_a_cache_entry_of_any_kind_of_damage_is_built_anew(kept, damage):
    path = cached_path(CASE)
    path.parent.mkdir()
    if damage == "folder":
        path.mkdir()
    elif damage == "pipe":
        os.mkfifo(path)
    else:
        path.write_bytes(b"" if damage == "empty" else b"nonsense")
    with pytest.warns(RuntimeWarning):
        assert cached_model(CASE).inputs_hash == CASE.hash()


def test_a_name_longer_than_a_file_s_may_be_is_kept(kept):
    cached_model(replace(CASE, name=300 * "n"))
    cached_model(replace(CASE, name=300 * "n"))
    assert len(kept) == 1
