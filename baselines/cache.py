"""Finished parts of the study on disk, found again by what they were made from; an interrupt loses one part at most."""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import zipfile
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from flapgym.core.arrays import Array
from flapgym.core.atomic import write_atomically
from flapgym.core.state_space import StateSpace

Arrays = Mapping[str, Array]
Data = TypeVar("Data")

DAMAGED = (OSError, ValueError, EOFError, zipfile.BadZipFile, zlib.error)
"""What a file that is missing, cut or no archive raises: its part is computed again."""
VERSION = 5
"""Raised when what a part computes changes though its settings do not."""


class Cache:
    """Arrays by part and settings, in a folder.

    Parameters
    ----------
    folder : Path
        Made if missing.
    stamp : str
        Hash of the model: another model finds nothing.
    """

    def __init__(self, folder: Path, stamp: str) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder, self._stamp = folder, stamp

    def path(self, part: str, settings: Mapping[str, Any]) -> Path:
        """Where a part with these settings (plain JSON values) lies."""
        key = json.dumps([VERSION, self._stamp, part, dict(settings)], sort_keys=True)
        return self._folder / f"{part}-{hashlib.sha256(key.encode()).hexdigest()[:16]}.npz"

    def arrays(self, part: str, settings: Mapping[str, Any], make: Callable[[], Arrays]) -> dict[str, Array]:
        """What `make` returned for this part and these settings, now or in an earlier run."""
        path = self.path(part, settings)
        with contextlib.suppress(*DAMAGED), path.open("rb") as file, np.load(file) as stored:
            return dict(stored)
        made = {name: np.asarray(value) for name, value in make().items()}
        content = io.BytesIO()
        np.savez_compressed(content, **made)  # type: ignore[arg-type]
        write_atomically(path, content.getvalue())
        return made

    def data(
        self, kind: type[Data], part: str, settings: Mapping[str, Any], make: Callable[[], Data]
    ) -> Data:
        """The same for a dataclass of arrays."""
        return kind(**self.arrays(part, settings, lambda: vars(make())))

    def system(self, part: str, settings: Mapping[str, Any], make: Callable[[], StateSpace]) -> StateSpace:
        """The same for a state space."""

        def matrices() -> dict[str, Array]:
            made = make()
            return {key: getattr(made, key) for key in "ABCD"} | {
                "time_step": np.asarray(made.time_step),
                "inputs": np.asarray(made.inputs),
                "outputs": np.asarray(made.outputs),
            }

        found = self.arrays(part, settings, matrices)
        inputs, outputs = (tuple(str(name) for name in found[key]) for key in ("inputs", "outputs"))
        step = float(found["time_step"])
        return StateSpace(found["A"], found["B"], found["C"], found["D"], step, inputs, outputs)


def fingerprint(*systems: Array) -> str:
    """Short hash of matrices."""
    digest = hashlib.sha256()
    for matrix in systems:
        digest.update(np.ascontiguousarray(matrix).tobytes())
    return digest.hexdigest()[:16]
