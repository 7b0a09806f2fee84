"""The environments' manual pages, made from what is registered and from the docstrings of the classes.

    python -m benchmarks.manual docs

writes `docs/environment.md`, which lists them, and one page for each in `docs/environments/`.
"""

from __future__ import annotations

import argparse
import ast
import inspect
import json
import sys
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from flapgym.core.atomic import write_together
from flapgym.core.program import Parser, Work, run
from flapgym.envs import FlapEnv
from flapgym.envs.registration import ENVIRONMENTS, Registered

_MADE = "<!-- Made by `python -m benchmarks.manual docs`; edit the docstrings and flapgym/envs/registration.py. -->"


WRAPPERS = (
    "flapgym.wrappers.single.TargetAngle",
    "flapgym.wrappers.single.Residual",
    "flapgym.wrappers.vector.VectorTargetAngle",
    "flapgym.wrappers.vector.VectorResidual",
    "flapgym.adapters.sb3.FlapVecEnv",
)
"""What the index lists beside the environments."""
CONVENTIONS = """\
## Where things are, and signs

The azimuth is zero when blade 1 points straight up, and grows as the rotor turns: clockwise for one who stands upwind
and looks downwind. Blades 2 and 3 are 120 and 240 deg ahead of blade 1: they pass the top in the order 1, 3, 2.
`azimuth` in `info` is that of blade 1 in radians, 0 to 2 pi; the observation of that name is its cosine and sine.

![The rotor from upwind, the turbine from its side, and a section of blade 1](figures/conventions.png)

| quantity | positive | zero |
|---|---|---|
| wind | along the shaft, downwind | mean wind |
| action, flap acceleration, rate, angle | trailing edge to the upwind, pressure side: more lift | along the chord |
| root bending moment `rbm` | bends the blade downwind: more lift | steady, in the mean wind with flaps at rest |
| tip deflection | downwind | steady |
| tower top, first entry (fore-aft) | downwind | steady |
| tower top, second entry (sideways) | to the left of one who looks downwind | steady |

More wind and a positive flap angle on all blades raise moment, tip deflection and fore-aft displacement, and push the
tower top to the right, by the torque on the shaft: its second entry falls. The tower top is told in the fixed frame,
moments and tip deflections in that of their blade, across the rotor's plane. Nothing comes once a revolution by itself
unless it is asked for: by `gravity`, `wind.inflow` or `wind.field`, see [wind](wind.md).""".splitlines()


def pages(folder: Path) -> dict[str, str]:
    """Text of every page by its path under the documentation's folder, which may hold scores."""
    file = folder / "environments" / "scores.json"
    scores = json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}
    made = {
        f"environments/{page_name(entry)}": environment_page(entry, scores.get(entry.id))
        for entry in ENVIRONMENTS
    }
    return {"environment.md": index_page()} | made


def page_name(entry: Registered) -> str:
    """File of an environment's page."""
    return entry.id.split("/")[1] + ".md"


def index_page() -> str:
    """The list of all environments, and what can be put around them."""
    environments = [
        f"| [`{entry.id}`](environments/{page_name(entry)}) | {entry.summary.split('. ')[0].rstrip('.')}"
        f"{'' if entry.agents in ('', ENVIRONMENTS[0].agents) else '; as the paper reads the turbine'} |"
        for entry in ENVIRONMENTS
    ]
    wrappers = [f"| `{path}` | {_first_line(path)} |" for path in WRAPPERS]
    return "\n".join(
        [
            _MADE,
            "",
            "# Environments",
            "",
            "`import flapgym` registers these with Gymnasium; `gymnasium.make` gives one turbine, `gymnasium.make_vec`",
            "many. All take the same keywords, so a variant is only a name for some of them.",
            "",
            "| id | what it is |",
            "|---|---|",
            *environments,
            "",
            *CONVENTIONS,
            "",
            "## Around them fit",
            "",
            "| class | what it does |",
            "|---|---|",
            *wrappers,
            "",
            "[recipes](recipes) are short programs that train on them and plan with them from another project.",
            "",
        ]
    )


def environment_page(entry: Registered, scores: Mapping[str, Any] | None) -> str:
    """The page of one environment: how to make it, its spaces, what differs, scores, and the manual of its class."""
    env = gymnasium.spec(entry.id).make()  # by its specification, so that no version is called out of date
    text = [
        _MADE,
        "",
        f"# {entry.id}",
        "",
        *textwrap.wrap(entry.summary, 120),
        "",
        "```python",
        "import gymnasium",
        "import flapgym",
        "",
        f'env = gymnasium.make("{entry.id}")',
        f'envs = gymnasium.make_vec("{entry.id}", num_envs=64)',
        "```",
        "",
        "| | |",
        "|---|---|",
        f"| action space | {_described(env.action_space)} |",
        f"| observation space | {_described(env.observation_space)} |",
        f"| keywords set | {_keywords(entry)} |",
        "",
    ]
    env.close()
    if scores:
        text += _scored(scores)
    # The first of its kind has the manual: that of the class, or its own beside that of the class.
    first = next(other for other in ENVIRONMENTS if other.manual == entry.manual)
    if first is ENVIRONMENTS[0] is entry:
        text += [inspect.cleandoc(FlapEnv.__doc__ or "")]
    elif first is entry:
        text += [entry.manual, "", _as_in(ENVIRONMENTS[0])]
    else:
        text += [_as_in(first)]
    return "\n".join(text) + "\n"


def _as_in(entry: Registered) -> str:
    return f"Everything else is as in [`{entry.id}`]({page_name(entry)})."


def _scored(scores: Mapping[str, Any]) -> list[str]:
    """What the shipped agents reach, as a table."""
    agents = scores["agents"]
    still, pitches = agents["open_loop"], any(each["pitch_travel"] for each in agents.values())
    rows = [
        f"| `{name}` | {100.0 * (each['rbm_rms'] / still['rbm_rms'] - 1.0):+.1f} "
        f"| {100.0 * (each['rbm_del'] / still['rbm_del'] - 1.0):+.1f} | {np.rad2deg(each['flap_travel']):.1f} |"
        + (f" {np.rad2deg(each['pitch_travel']):.2f} |" if pitches else "")
        for name, each in agents.items()
        if name != "open_loop"
    ]
    text = (
        f"With flaps at rest the root moments have an rms of {still['rbm_rms'] * 1e-6:.3f} MN m and a damage "
        f"equivalent load (DEL) of {still['rbm_del'] * 1e-6:.2f} MN m: means over blades and "
        f"{scores['realisations']} episodes of {scores['seconds']:g} s."
    )
    if not rows:
        return [*textwrap.wrap(f"{text} Agents that move so many flaps stand in docs/scores.md.", 120), ""]
    text = f"{text} The shipped agents, made for the base case and unchanged, change these means by:"
    return [
        *textwrap.wrap(text, 120),
        "",
        "| agent | RBM rms [%] | RBM DEL [%] | flap travel [deg/s] |"
        + (" pitch travel [deg/s] |" if pitches else ""),
        "|---|---|---|---|" + ("---|" if pitches else ""),
        *rows,
        "",
    ]


def _first_line(path: str) -> str:
    """First sentence of a class's docstring."""
    module, name = path.rsplit(".", 1)
    source = (Path(__file__).parents[1] / Path(*module.split("."))).with_suffix(".py")
    # Read, not imported: the adapter needs Stable-Baselines3.
    body = ast.parse(source.read_text(encoding="utf-8")).body
    (found,) = (node for node in body if isinstance(node, ast.ClassDef) and node.name == name)
    return " ".join((ast.get_docstring(found) or "").split("\n\n")[0].split()).rstrip(".")


def _described(space: gymnasium.Space) -> str:  # type: ignore[type-arg]
    assert isinstance(space, gymnasium.spaces.Box)
    bounds = np.unique(space.high)
    bound = ", ".join(f"{value:.4g}" for value in bounds)
    return f"`Box`, shape {space.shape}, {space.dtype}, bounds ±{bound}"


def _keywords(entry: Registered) -> str:
    if not entry.keywords:
        return "none"
    return ", ".join(f"`{name}={value!r}`" for name, value in entry.keywords.items())


def write(folder: Path) -> None:
    """Write all pages below a folder, and remove those of environments that are gone."""
    made = pages(folder)
    (folder / "environments").mkdir(parents=True, exist_ok=True)
    for old in (folder / "environments").glob("*.md"):
        if f"environments/{old.name}" not in made:
            old.unlink()
    write_together({folder / name: text.encode() for name, text in made.items()})


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the pages below the folder named; returns the exit code."""
    return run(_parser(), arguments)


def _door(options: argparse.Namespace) -> Work:
    if not options.folder.is_dir():
        raise ValueError(f"folder: expected an existing one, such as docs, got {options.folder}")

    def work() -> int:
        write(options.folder)
        return 0

    return work


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="python -m benchmarks.manual", description=(__doc__ or "").splitlines()[0])
    parser.set_defaults(door=_door, program="benchmarks.manual")
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="of the documentation, such as docs")
    return parser


if __name__ == "__main__":
    sys.exit(main())
