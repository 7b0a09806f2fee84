"""The source files behind a function: the modules it imports from, and those these import from, in this package."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).parents[1]


def files_behind(*modules: str) -> list[Path]:
    """Files of modules, named as "flapgym.aeroelastic.build", and of all that they import, sorted.

    A name that a package only hands on leads to the module it comes from: a package's front is not followed, for it
    shows much that whoever imports one name from it never uses.
    """
    waiting, found = list(modules), set[Path]()
    while waiting:
        path = _file(waiting.pop())
        if path is not None and path not in found:
            found.add(path)
            waiting += _imported(path)
    return sorted(found)


def _imported(path: Path) -> Iterator[str]:
    """Modules of this package that a file imports, also within functions."""
    for node in ast.walk(_parsed(path)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            yield from (_origin(node.module, alias.name) for alias in node.names)


def _origin(module: str, name: str) -> str:
    """Module from which `from module import name` takes its name in the end."""
    if _file(f"{module}.{name}") is not None:
        return f"{module}.{name}"
    front = _front(module)
    if front is not None:
        for node in _parsed(front).body:
            if (
                isinstance(node, ast.ImportFrom)
                and node.module
                and name in (a.asname or a.name for a in node.names)
            ):
                return _origin(node.module, name)
    return module


@cache
def _parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_bytes())


def _front(module: str) -> Path | None:
    """`__init__.py` of a package within this one."""
    top, *parts = module.split(".")
    path = PACKAGE.joinpath(*parts, "__init__.py")
    return path if top == PACKAGE.name and path.is_file() else None


def _file(module: str) -> Path | None:
    """File of a module within this package; None of a package and of other people's modules."""
    top, *parts = module.split(".")
    path = PACKAGE.joinpath(*parts).with_suffix(".py")
    return path if top == PACKAGE.name and parts and path.is_file() else None
