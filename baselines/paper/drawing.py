"""Drawings as bytes, so that they can lie in the cache."""

from __future__ import annotations

import contextlib
import io
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from flapgym.core.arrays import Array
from flapgym.core.atomic import write_atomically


def drawn(draw: Callable[[Path], object]) -> Array:
    """The vector drawing a function writes to a path, as bytes; what it prints is dropped."""
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
        path = Path(folder) / "figure.svg"
        draw(path)
        return np.frombuffer(path.read_bytes(), dtype=np.uint8)


def kept(path: Path, drawing: Array) -> Path:
    """Write a drawing that came from the cache."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, drawing.tobytes())
    return path
