"""Another project installs the wheel into a folder of its own, far from this repository, and runs the recipes there."""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
RECIPES = {"sb3_ppo.py": "2000", "cleanrl_ppo.py": "1000", "planner.py": "3"}


@pytest.fixture(scope="session")
def wheel(tmp_path_factory):
    if importlib.util.find_spec("hatchling") is None:
        pytest.skip("hatchling is missing: pip install -c constraints.txt -e .[test]")
    folder = tmp_path_factory.mktemp("wheel")
    build = [
        sys.executable,
        "-m",
        "pip",
        "wheel",
        "--quiet",
        "--no-deps",
        "--no-build-isolation",
        "--no-index",
    ]
    subprocess.run([*build, "--wheel-dir", folder, ROOT], check=True, capture_output=True, text=True)
    (built,) = folder.glob("flapgym-*.whl")
    return built


@pytest.fixture(scope="session")
def project(tmp_path_factory, wheel):
    """A folder outside the repository, and the environment in which the wheel's flapgym is found, and no numba.

    The plain installation has none; it would also have to compile once more there.
    """
    folder = tmp_path_factory.mktemp("project")
    install = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--target"]
    subprocess.run([*install, folder / "site", wheel], check=True, capture_output=True, text=True)
    (folder / "site" / "sitecustomize.py").write_text("import sys; sys.modules['numba'] = None")
    return folder, {**os.environ, "PYTHONPATH": str(folder / "site"), "OMP_NUM_THREADS": "1"}


def _run(project, *arguments):
    folder, environ = project
    # Of wind beyond the linear range, three standard deviations of the base case's, a run is warned rightly.
    strict = [sys.executable, "-W", "error", "-W", "ignore:wind"]
    done = subprocess.run([*strict, *arguments], cwd=folder, env=environ, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_wheel_holds_the_package_and_its_data_and_nothing_else(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    assert {name.split("/")[0] for name in names if not name.startswith("flapgym-")} == {"flapgym"}
    for needed in ("flapgym/py.typed", "flapgym/model/data/nrel5mw-rated.safetensors"):
        assert needed in names


def test_another_project_imports_and_makes(project):
    code = (
        "import gymnasium, flapgym; env = gymnasium.make('flapgym/NREL5MW-v1'); env.reset(seed=0); "
        "env.step(env.action_space.sample()); print(flapgym.__file__)"
    )
    assert Path(_run(project, "-c", code).strip()) == project[0] / "site" / "flapgym" / "__init__.py"


@pytest.mark.parametrize("recipe", sorted(RECIPES))
def test_recipes_run_in_another_project(project, recipe):
    shutil.copy(ROOT / "docs" / "recipes" / recipe, project[0])
    assert "flaps at rest" in _run(project, recipe, RECIPES[recipe])


def test_every_recipe_is_tried():
    assert {path.name for path in (ROOT / "docs" / "recipes").glob("*.py")} == set(RECIPES)
