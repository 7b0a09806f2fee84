"""One natural way through the code: a module imports what stands above it in this list and nothing below it."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ORDER = [
    "core",
    "turbine",
    "wind",
    "structure",
    "aerodynamics",
    "reduction",
    "model",
    "aeroelastic",
    "plant",
    "control",
    "envs",
    "wrappers",
    "adapters",
    "evaluation",
    "cli",
]
PROGRAMS = ["reference", "studies", "baselines", "benchmarks", "train"]
"""Beside the package, in their order: a program may import those before it, none after it, and none imports train."""


def imported_modules(path):
    """Dotted names of all that a file imports, also inside functions; relative imports resolved."""
    package = path.relative_to(ROOT).with_suffix("").parts[:-1]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            prefix = package[: len(package) + 1 - node.level] if node.level else ()
            module = ".".join([*prefix, *([node.module] if node.module else [])])
            yield module
            yield from (f"{module}.{alias.name}" for alias in node.names)


def all_modules():
    """Files of the package and the programs by dotted name; a package by its `__init__`."""
    found = {}
    for folder in ("flapgym", *PROGRAMS):
        for path in sorted((ROOT / folder).rglob("*.py")):
            parts = path.relative_to(ROOT).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def import_graph(group):
    """What each group of modules imports of the others; `group` tells a module's, None for none."""
    modules, graph = all_modules(), {}
    for name, path in modules.items():
        imports = graph.setdefault(group(name, path), set())
        known = modules.keys() & set(imported_modules(path))
        for module in known:
            # `from package import module` takes the module, and nothing of the package's own.
            if not any(other.startswith(f"{module}.") for other in known):
                imports.add(group(module, modules[module]))
    graph.pop(None, None)
    return {node: others - {node, None} for node, others in graph.items()}


def circles(graph):
    """Sets of nodes that import each other, also by way of others."""

    def reached(start):
        seen, ahead = set(), [start]
        while ahead:
            for node in graph.get(ahead.pop(), ()):
                if node not in seen:
                    seen.add(node)
                    ahead.append(node)
        return seen

    reach = {node: reached(node) for node in graph}
    return {
        frozenset({node, *(other for other in reach[node] if node in reach.get(other, ()))})
        for node in graph
        if node in reach[node]
    }


def files_importing(*libraries, folders=("flapgym", "baselines")):
    sources = [path for folder in folders for path in sorted((ROOT / folder).rglob("*.py"))]
    return {
        path.relative_to(ROOT).as_posix()
        for path in sources
        if any(module.split(".")[0] in libraries for module in imported_modules(path))
    }


def layer(path):
    part = path.relative_to(ROOT / "flapgym").parts[0]
    return ORDER.index(part.removesuffix(".py"))


def test_every_module_stands_in_the_order():
    parts = {p.name.removesuffix(".py") for p in (ROOT / "flapgym").iterdir()}
    assert parts - {"__init__", "__main__", "__pycache__", "py.typed"} <= set(ORDER)


def test_modules_import_only_what_stands_above_them():
    offences = []
    for path in sorted((ROOT / "flapgym").rglob("*.py")):
        if path.parent == ROOT / "flapgym" and path.stem.startswith("__"):
            continue
        for module in imported_modules(path):
            top, _, rest = module.partition(".")
            inner = rest.split(".")[0]
            if top == "flapgym" and inner in ORDER and ORDER.index(inner) > layer(path):
                offences.append(f"{path.relative_to(ROOT)} imports {module}")
    assert not offences


def test_circles_are_found_also_by_way_of_others():
    graph = {"a": {"b"}, "b": {"c"}, "c": {"a", "d"}, "d": {"d2"}, "d2": set()}
    assert circles(graph) == {frozenset("abc")}


def test_no_modules_import_each_other():
    assert circles(import_graph(lambda name, path: name)) == set()


def test_no_folders_import_each_other():
    """Files right in `flapgym` stand for the whole and belong to no folder; the plant's backends are a part of it."""

    def folder(name, path):
        parent = path.relative_to(ROOT).parent.as_posix()
        return None if parent == "flapgym" else parent.removesuffix("/backends")

    assert circles(import_graph(folder)) == set()


def test_programs_import_only_those_before_them():
    def top(name, path):
        return name.split(".")[0]

    graph = import_graph(top)
    for program in PROGRAMS:
        before = PROGRAMS[: PROGRAMS.index(program)] if program != "train" else []
        assert graph[program] <= {"flapgym", *before}, program
    assert not any("train" in others for others in graph.values())


@pytest.mark.parametrize("program", [*PROGRAMS, "tests"])
def test_the_package_does_not_import_the_programs_on_top_of_it(program):
    assert not {name for name in files_importing(program) if name.startswith("flapgym/")}


def test_only_the_environments_import_gymnasium():
    homes = ("flapgym/envs/", "flapgym/wrappers/", "flapgym/adapters/")
    assert all(name.startswith(homes) for name in files_importing("gymnasium"))


def test_only_training_and_its_adapter_import_torch_and_stable_baselines():
    assert files_importing("torch", "stable_baselines3", "sb3_contrib") <= {"flapgym/adapters/sb3.py"}


def test_only_compiled_code_and_what_keeps_it_import_numba_and_none_llvmlite():
    everywhere = ("flapgym", *PROGRAMS)
    assert files_importing("numba", folders=everywhere) == {
        "flapgym/core/kept.py",
        "flapgym/envs/compiled.py",
        "flapgym/plant/backends/numba.py",
        "baselines/bounds/modes.py",  # a march of thousands of steps, thousands of times
        "benchmarks/environment/limits.py",  # what the compiler makes of the machine, for comparison
    }
    assert files_importing("llvmlite", folders=everywhere) == set()


def test_importing_the_package_and_its_program_loads_no_heavy_library():
    heavy = ["torch", "stable_baselines3", "control", "matplotlib", "tensorboard", "rich", "numba"]
    program = f"import sys, flapgym, flapgym.cli; print([m for m in {heavy!r} if m in sys.modules])"
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"
