"""Models built once and kept in the user's cache folder, safe with many processes at once."""

from __future__ import annotations

import hashlib
import os
import re
import sys
import warnings
from pathlib import Path

from filelock import FileLock

from flapgym.aeroelastic.build import Progress, build_model, tools
from flapgym.aeroelastic.model import FORMAT_VERSION, TurbineModel, load_model, save_model
from flapgym.turbine import Case


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


def cached_model(case: Case, progress: Progress | None = None) -> TurbineModel:
    """The model of a case: from the cache, or built and put there.

    A model is known by its name and every value of its case, by the versions of what builds models and by that of the
    file format. Whoever asks first builds, others wait for it; a file that is damaged is built again, with a warning.

    Parameters
    ----------
    case : Case
    progress : callable, optional
        As for ``build_model``; not called where nothing is built.

    Raises
    ------
    ValueError
        As ``build_model``.
    OSError
        If the cache folder cannot be written.
    """
    # A case may be named with what no file name takes, or with what leads out of the folder.
    readable = re.sub(r"[^\w-]+", "_", case.name)
    path = cache_folder() / f"{readable}-{_key(case)}.safetensors"
    if (model := _kept(path, case)) is not None:
        return model
    path.parent.mkdir(parents=True, exist_ok=True)
    with FileLock(path.with_suffix(".lock")):
        # Another process may have built it while this one waited.
        if (model := _kept(path, case)) is not None:
            return model
        model = build_model(case, progress)
        save_model(model, path)
    return model


def _key(case: Case) -> str:
    made = repr((case.name, case.hash(), sorted(tools().items()), FORMAT_VERSION))
    return hashlib.sha256(made.encode()).hexdigest()[:20]


def _kept(path: Path, case: Case) -> TurbineModel | None:
    if not path.is_file():
        return None
    try:
        model = load_model(path)
    except ValueError as error:
        warnings.warn(f"cached model is built anew: {error}", RuntimeWarning, stacklevel=3)
        return None
    if model.inputs_hash != case.hash():
        warnings.warn(f"cached model is built anew: {path} is another case's", RuntimeWarning, stacklevel=3)
        return None
    return model
