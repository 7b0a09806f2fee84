"""The environments' manual pages, made from what is registered and from the docstrings of the classes.

    python -m flapgym.envs.page docs

writes `docs/environment.md`, which lists them, and one page for each in `docs/environments/`.
"""

from __future__ import annotations

import inspect
import json
import sys
from collections.abc import Sequence
from pathlib import Path

import gymnasium
import numpy as np
from gymnasium.envs.registration import load_env_creator

from flapgym.envs.registration import ENVIRONMENTS, Registered

_MADE = "<!-- Made by `python -m flapgym.envs.page docs`; edit the docstrings and flapgym/envs/registration.py. -->"


def pages() -> dict[str, str]:
    """Text of every page by its path under the documentation's folder."""
    made = {f"environments/{page_name(entry)}": environment_page(entry) for entry in ENVIRONMENTS}
    return {"environment.md": index_page()} | made


def page_name(entry: Registered) -> str:
    """File of an environment's page."""
    return entry.id.split("/")[1] + ".md"


def index_page() -> str:
    """The list of all environments."""
    rows = [
        f"| [`{entry.id}`](environments/{page_name(entry)}) | {entry.summary.split('. ')[0].rstrip('.')} |"
        for entry in ENVIRONMENTS
    ]
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
            *rows,
            "",
            "[recipes](recipes) are short programs that train on them from another project.",
            "",
        ]
    )


def environment_page(entry: Registered) -> str:
    """The page of one environment: how to make it, its spaces, what differs, and the manual of its class."""
    env = gymnasium.make(entry.id)
    text = [
        _MADE,
        "",
        f"# {entry.id}",
        "",
        entry.summary,
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
    first = next(other for other in ENVIRONMENTS if other.single == entry.single)
    if first is entry:
        text += [inspect.cleandoc(load_env_creator(entry.single).__doc__ or "")]
    else:
        text += [f"Everything else is as in [`{first.id}`]({page_name(first)})."]
    return "\n".join(text) + "\n"


def _described(space: gymnasium.Space) -> str:  # type: ignore[type-arg]
    assert isinstance(space, gymnasium.spaces.Box)
    bounds = np.unique(space.high)
    bound = ", ".join(f"{value:.4g}" for value in bounds)
    return f"`Box`, shape {space.shape}, {space.dtype}, bounds ±{bound}"


def _keywords(entry: Registered) -> str:
    if not entry.keywords:
        return "none"
    return ", ".join(f"`{name}={json.dumps(value)}`" for name, value in entry.keywords.items())


def write(folder: Path) -> None:
    """Write all pages below a folder, and remove those of environments that are gone."""
    made = pages()
    (folder / "environments").mkdir(parents=True, exist_ok=True)
    for old in (folder / "environments").glob("*.md"):
        if f"environments/{old.name}" not in made:
            old.unlink()
    for name, text in made.items():
        (folder / name).write_text(text, encoding="utf-8")


def main(arguments: Sequence[str] | None = None) -> None:
    """Write the pages below the folder named."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if len(given) != 1 or not Path(given[0]).is_dir():
        raise SystemExit("usage: python -m flapgym.envs.page FOLDER (an existing one, such as docs)")
    write(Path(given[0]))


if __name__ == "__main__":
    main()
