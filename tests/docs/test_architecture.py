"""docs/architecture.md tells the truth: its examples run, its picture and its tables are what the code imports."""

from __future__ import annotations

import contextlib
import io
import json
import re
import runpy
from pathlib import Path

import gymnasium
import numpy as np
import pytest

from benchmarks import architecture
from flapgym.envs import FlapEnv
from flapgym.wind.gusts import GUSTS, gust_of
from tests.test_import_rule import ORDER, PROGRAMS, import_graph

ROOT = Path(__file__).parents[2]
DOCS, EXAMPLES = ROOT / "docs", ROOT / "docs" / "examples"
PAGE = (DOCS / "architecture.md").read_text(encoding="utf-8")
FILES = {"case.toml", "model file", "table"}


@pytest.fixture(autouse=True)
def _nothing_stays_registered(monkeypatch):
    monkeypatch.setattr(gymnasium.envs.registration, "registry", dict(gymnasium.registry))
    monkeypatch.setattr(gymnasium, "registry", gymnasium.envs.registration.registry)
    kinds = dict(GUSTS)
    yield
    GUSTS.clear()
    GUSTS.update(kinds)


@pytest.fixture(scope="module")
def imports():
    """What each folder of the package imports of the others."""

    def folder(name, path):
        package, _, rest = name.partition(".")
        part = rest.partition(".")[0]
        return part if package == "flapgym" and part in ORDER else None

    return import_graph(folder)


def example(name):
    """The names an example leaves, and what it prints."""
    with contextlib.redirect_stdout(io.StringIO()) as said:
        found = runpy.run_path(str(EXAMPLES / f"{name}.py"))
    return found, said.getvalue()


def test_the_page_shows_the_examples_as_they_are():
    assert architecture.filled(PAGE, EXAMPLES) == PAGE, "run python -m benchmarks.architecture docs"


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.py")), ids=lambda path: path.stem)
def test_examples_are_on_the_page_short_and_tried(path):
    text = path.read_text(encoding="utf-8")
    assert text in PAGE
    assert sum(bool(line.strip()) for line in text.splitlines()) < 30
    assert f"test_the_{path.stem}_" in Path(__file__).read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def controller():
    return example("controller")


def test_the_controller_takes_load_off_and_stands_in_the_table(controller):
    found, said = controller
    scores = found["comparison"].scores
    assert list(scores) == ["open_loop", "leaning", "lqg"]
    assert scores["leaning"].rbm_rms_change.mean < -0.05
    assert "leaning" in said


def test_the_controller_treats_blades_alike_and_many_turbines_as_one(controller):
    agent = controller[0]["Leaning"]()
    seen = np.random.default_rng(0).normal(size=(4, 9)).astype(np.float32)
    together = agent.predict(seen)[0]
    np.testing.assert_array_equal(together, [agent.predict(each)[0] for each in seen])
    turned = seen.reshape(4, 3, 3)[:, :, [1, 2, 0]].reshape(4, 9)
    np.testing.assert_array_equal(agent.predict(turned)[0], together[:, [1, 2, 0]])


def test_the_wind_is_named_by_a_mapping_and_blows_in_an_environment():
    found, _ = example("wind")
    bell = gust_of({"kind": "bell", "size": 3.0})
    assert isinstance(bell, found["Bell"])
    with pytest.raises(ValueError, match=r"gust.size: expected .* 20"):
        found["Bell"](50.0)
    record = found["records"][0]
    time = record.time_step * np.arange(1, record.wind.shape[1] + 1)
    np.testing.assert_allclose(record.wind[0], bell.wind(time, 11.0), atol=1e-9)
    rest, controlled = (np.abs(record.rbm).max() for record in found["records"])
    assert controlled < 0.9 * rest


def test_the_wrapper_moves_all_flaps_alike():
    found, _ = example("wrapper")
    angle = found["info"]["flap_angle"]
    assert angle[0] > 0.0
    np.testing.assert_array_equal(angle, angle[0])


def test_the_environment_has_what_it_was_registered_with_and_stays_json():
    found, _ = example("environment")
    env = found["env"]
    settings = env.unwrapped.settings
    assert settings.task.observe == ("rbm", "flap_angle")
    assert settings.actuators.effectiveness == (1.0, 1.0, 0.6)
    assert found["many"].single_observation_space.shape == found["observation"].shape == (6,)
    assert json.loads(env.spec.to_json())["kwargs"]["wind"]["gust"]["size"] == 2.0
    # What the page says of families.
    other = gymnasium.make("mine/WeakFlapInGust-v0", wind={"pool": 2}).unwrapped.settings
    assert other.wind.gust is None
    assert other.sensors == settings.sensors


def test_the_output_is_observed_as_the_model_tells_it():
    found, _ = example("output")
    model, env = found["model"], found["env"].unwrapped
    assert model.fixed_outputs[-1] == "tower_base_fore_aft"
    assert list(env.observed["tower_base_fore_aft"]) == [3]
    # A steady wind's moment on the foundation is the model's gain.
    still = {"turbulence_intensity": 0.0, "gust": {"kind": "step", "size": 1.0, "start": -1.0}}
    steady = FlapEnv(model=model, task={"observe": ["tower_base_fore_aft"]}, wind=still)
    row, column = model.turbine.outputs.index("tower_base_fore_aft"), model.turbine.inputs.index("wind")
    assert steady.reset(seed=0)[0][0] == pytest.approx(model.turbine.dc_gain()[row, column], rel=1e-4)


def test_the_backend_moves_the_turbines_as_numpy_does():
    found, said = example("backend")
    assert said == "equal to numpy: True\n"
    one, other = (plant.state for plant in found["plants"])
    for name, values in one._asdict().items():
        np.testing.assert_allclose(getattr(other, name), values, rtol=1e-9, atol=1e-9, err_msg=name)
    assert (one.elapsed == 20).all()


def test_every_arrow_of_the_picture_is_an_import(imports):
    for start, end in (*architecture.WAY, *architecture.BESIDE):
        assert FILES & {start, end} or start in imports[end], f"{end} does not import {start}"


def test_every_import_is_an_arrow_or_follows_from_them(imports):
    arrows = (*architecture.WAY, *architecture.BESIDE)
    assert set(architecture.BOXES) == FILES | set(ORDER) - {"core"}

    def behind(node):
        before = {start for start, end in arrows if end == node}
        return before.union(*(behind(each) for each in before))

    for folder in architecture.BOXES.keys() - FILES:
        exception = {"model"} if folder == "aeroelastic" else set()
        assert imports[folder] - {"core"} - exception <= behind(folder), folder


def test_the_table_of_folders_is_complete_in_order_and_tells_the_imports(imports):
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in PAGE.splitlines()]
    table = {row[0].strip("`"): row for row in rows if len(row) in (3, 4) and row[0].startswith("`")}
    folders = [name for name in table if name in (*ORDER, *PROGRAMS)]
    assert folders == [*ORDER, *PROGRAMS]
    for name in ORDER:
        told = re.findall(r"`(\w+)`", table[name][3])
        assert told == [other for other in ORDER if other in imports[name] - {"core"}], name
    for name in folders:
        home = ROOT / name if name in PROGRAMS else ROOT / "flapgym" / ("" if name == "cli" else name)
        for file in re.findall(r"`([\w./-]+\.\w+)`", table[name][2]):
            assert (home / file).is_file(), f"{name}: {file}"


def headings(page):
    """A page's places that links may name."""
    lines = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), flags=re.M)
    return {re.sub(r"[^\w\- ]", "", line.lower()).replace(" ", "-") for line in lines}


@pytest.mark.parametrize("name", ["docs/architecture.md", "CONTRIBUTING.md"])
def test_files_that_are_named_are_there(name):
    page = ROOT / name
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.S)
    for link in re.findall(r"\]\((?!https?:)([^)]+)", text):
        target, _, place = link.partition("#")
        assert (page.parent / target).exists(), link
        assert not place or place in headings(page.parent / target), link
    for file in re.findall(r"`([a-z]\w*/[\w/.-]+\.\w+)`", text):
        homes = (ROOT, *(ROOT / name for name in ("flapgym", *PROGRAMS)), *(ROOT / "flapgym").iterdir())
        assert any((home / file).exists() for home in homes), file


def test_the_picture_is_drawn_and_the_page_filled(tmp_path):
    (tmp_path / "examples").mkdir()
    (tmp_path / "figures").mkdir()
    (tmp_path / "examples" / "wind.py").write_text("blow()\n")
    (tmp_path / "architecture.md").write_text("before\n<!-- wind -->\nold\n<!-- end -->\nafter\n")
    assert architecture.main([str(tmp_path)]) == 0
    assert (tmp_path / "figures" / "architecture.png").read_bytes().startswith(b"\x89PNG")
    assert (
        tmp_path / "architecture.md"
    ).read_text() == "before\n<!-- wind -->\n```python\nblow()\n```\n<!-- end -->\nafter\n"
