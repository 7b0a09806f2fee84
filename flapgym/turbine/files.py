"""Where turbines and cases come from: the TOML files of this package, or a user's own.

A file may say `base = "nrel5mw-rated"` (a built-in name, or a path relative to the file) and then holds only what
differs: tables are merged key by key, anything else is replaced. `name` is never inherited, so that no two cases
share one. A case names its turbine the same way.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar

from flapgym.core.fields import Text, read
from flapgym.core.files import LARGEST_SETTINGS, read_toml, regular_file
from flapgym.core.wording import shown
from flapgym.turbine.case import Case
from flapgym.turbine.machine import Turbine

T = TypeVar("T")

DEFAULT_CASE = "nrel5mw-corrected"
BUILT_IN = {
    "turbine": ("nrel5mw",),
    "case": (
        DEFAULT_CASE,
        "nrel5mw-corrected-heavy-blade",
        "nrel5mw-site",
        "nrel5mw-range",
        "nrel5mw-three-flaps",
        "nrel5mw-rated",
        "nrel5mw-heavy-blade",
    ),
}
LONGEST_CHAIN = 10
"""Files that derive from each other, one after another."""


def load_turbine(name_or_path: str | os.PathLike[str] = "nrel5mw") -> Turbine:
    """Read a turbine by its built-in name or from a TOML file.

    Raises
    ------
    FileNotFoundError
        If it is neither; the message lists the built-in names.
    ValueError
        If the file says anything that is not understood; the message names the field and the file.
    """
    return _load(Turbine, _find(name_or_path, "turbine", Path()), "turbine")


def load_case(name_or_path: str | os.PathLike[str] = DEFAULT_CASE) -> Case:
    """Read a case by its built-in name or from a TOML file; raises as `load_turbine`."""
    return _load(Case, _find(name_or_path, "case", Path()), "case")


def _find(name_or_path: str | os.PathLike[str], kind: str, folder: Path) -> Path:
    """Return the file of a built-in name, or of a path relative to `folder`."""
    text = os.fspath(name_or_path)
    if text in BUILT_IN[kind]:
        # The package is installed as plain files, so the resource is a path.
        return Path(str(resources.files("flapgym.turbine").joinpath("data", f"{text}.toml")))
    try:
        # An empty text would be the folder itself.
        return regular_file(folder / (text or "''"), LARGEST_SETTINGS)
    except FileNotFoundError:
        known = ", ".join(BUILT_IN[kind])
        raise FileNotFoundError(
            f"{kind} {shown(text)}: no such file; give a TOML file or a built-in name ({known})"
        ) from None


def _load(cls: type[T], path: Path, kind: str) -> T:
    table = _merged(path, kind, ())
    with _named(path):
        return read(cls, table)


def _merged(path: Path, kind: str, derived: tuple[Path, ...]) -> dict[str, Any]:
    """Parse a file and lay it over its base; `derived` are the files that led here."""
    document = read_toml(path)
    with _named(path):
        if kind == "case" and "turbine" in document:
            turbine = _find(Text().check(document["turbine"], "turbine"), "turbine", path.parent)
            document["turbine"] = _load(Turbine, turbine, "turbine")
        if "base" not in document:
            if kind == "case" and "turbine" not in document:
                raise ValueError(
                    'base: missing; give the case this one differs from, such as base = "nrel5mw-rated", or a turbine'
                )
            return document
        base = _find(Text().check(document.pop("base"), "base"), kind, path.parent)
        chain = (*derived, path.resolve())
        if base.resolve() in chain or len(chain) > LONGEST_CHAIN:
            raise ValueError(
                f"base: expected a file that does not lead back here, within {LONGEST_CHAIN} files, got {base}"
            )
    inherited = _merged(base, kind, chain)
    inherited.pop("name", None)
    return _overlaid(inherited, document)


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """Say in which file the field stands that an error is about."""
    try:
        yield
    except (ValueError, FileNotFoundError) as error:
        raise type(error)(f"{error} (in {path})") from None


def _overlaid(base: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """Merge nested tables, the second over the first."""
    both = {**base, **over}
    for key in base.keys() & over.keys():
        if isinstance(base[key], dict) and isinstance(over[key], dict):
            both[key] = _overlaid(base[key], over[key])
    return both
