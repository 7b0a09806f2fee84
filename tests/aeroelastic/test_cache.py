"""The cache: built once whoever asks, found again, and mended when damaged."""

import multiprocessing
import os
from dataclasses import replace

import numpy as np
import pytest

import flapgym.aeroelastic.cache as cache
from flapgym.aeroelastic import load_model
from flapgym.aeroelastic.cache import cache_folder, cached_model
from flapgym.aeroelastic.record import Flutter
from flapgym.turbine import load_case

CASE = load_case("nrel5mw-rated")
FLUTTER = Flutter(searched=1.0, speed=0.5, frequency=3.0)


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
