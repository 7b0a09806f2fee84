"""Models built once and kept in the user's cache folder, safe with many processes at once."""

from __future__ import annotations

import hashlib
import os
import re
import sys
import warnings
from dataclasses import replace
from functools import cache
from pathlib import Path

from filelock import FileLock

from flapgym.aeroelastic.build import STAGES, Progress, build_model, tools
from flapgym.aeroelastic.flutter import find_flutter
from flapgym.aeroelastic.sources import PACKAGE, files_behind
from flapgym.model.turbine_model import FORMAT_VERSION, TurbineModel, load_model, save_model
from flapgym.turbine import Case

FLUTTER = "flutter"
READABLE = 80
"""Characters of a case's name in the name of its file, which file systems take 255 bytes of."""
COMPLETE_STAGES = (*STAGES, FLUTTER)
"""Stages of a model that is not in the cache."""
_not_kept: dict[Path, TurbineModel] = {}  # models of this process that no folder takes


def cache_folder() -> Path:
    """Where built models are kept: ``FLAPGYM_CACHE_DIR``, or the user's cache folder of the system."""
    chosen = os.environ.get("FLAPGYM_CACHE_DIR")
    if chosen:
        return Path(chosen)
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local")) / "flapgym" / "Cache"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "flapgym"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "flapgym"


def cached_path(case: Case) -> Path:
    """Where the cache keeps the model of a case, by its name and all that the model depends on."""
    # A case may be named with what no file name takes, or with what leads out of the folder.
    readable = re.sub(r"[^\w-]+", "_", case.name, flags=re.ASCII)[:READABLE]
    made = repr((case.name, case.hash(), sorted(tools().items()), _sources(), FORMAT_VERSION))
    key = hashlib.sha256(made.encode()).hexdigest()[:20]
    return cache_folder() / f"{readable}-{key}.safetensors"


def cached_model(case: Case, progress: Progress | None = None) -> TurbineModel:
    """The model of a case with its flutter: from the cache, or built and put there.

    A model is known by its name and every value of its case, by the versions and the source code of what builds models
    and by the version of the file format. Whoever asks first builds, others wait for it; a file that is damaged is
    built again, and a model that cannot be kept is built all the same, once in a process, both with a warning.

    Parameters
    ----------
    case : Case
    progress : callable, optional
        As for ``build_model``, and called with "flutter" last; not called where nothing is built.

    Raises
    ------
    ValueError
        As ``build_model``.
    """
    path = cached_path(case)
    if path in _not_kept:
        return _not_kept[path]
    if (model := _kept(path, case)) is not None:
        return model
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        lock = FileLock(path.with_suffix(".lock")).acquire()
    except OSError as error:
        _warn_not_kept(path, error)
        _not_kept[path] = _complete_model(case, progress)
        return _not_kept[path]
    with lock:
        # Another process may have built it while this one waited.
        if (model := _kept(path, case)) is not None:
            return model
        model = _complete_model(case, progress)
        try:
            save_model(model, path)
        except OSError as error:
            _warn_not_kept(path, error)
            _not_kept[path] = model
    return model


def _complete_model(case: Case, progress: Progress | None) -> TurbineModel:
    """The model of a case, built, with its flutter looked for."""
    model = build_model(case, progress)
    if progress is not None:
        progress(FLUTTER)
    return replace(model, record=replace(model.record, flutter=find_flutter(case.of_mean_blade())))


def _warn_not_kept(path: Path, error: OSError) -> None:
    warnings.warn(
        f"cache: cannot write in {path.parent} ({error.strerror or error}); the model is not kept, "
        "name another folder in FLAPGYM_CACHE_DIR",
        RuntimeWarning,
        stacklevel=3,
    )


@cache
def _sources() -> str:
    """Digest of the source code that builds models: one built before a change to it is another model."""
    digest = hashlib.sha256()
    for file in files_behind("flapgym.aeroelastic.build", "flapgym.aeroelastic.flutter"):
        digest.update(f"{file.relative_to(PACKAGE).as_posix()}\0".encode() + file.read_bytes())
    return digest.hexdigest()


def _kept(path: Path, case: Case) -> TurbineModel | None:
    try:
        model = load_model(path)
    except FileNotFoundError:
        return None
    except (ValueError, OSError) as error:
        warnings.warn(f"cached model is built anew: {error}", RuntimeWarning, stacklevel=3)
        return None
    if model.inputs_hash != case.hash():
        warnings.warn(f"cached model is built anew: {path} is another case's", RuntimeWarning, stacklevel=3)
        return None
    return model
