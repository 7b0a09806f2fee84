"""The paper's Section IV beside ours, in one report: `python -m baselines.paper [PART ...]`.

Writes paper.md, paper.html and the figures. Finished parts lie in the folder `parts` beside them and are not computed
again; an interrupted run goes on where it was. All parts take about half an hour on an idle core.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from tqdm import tqdm

from baselines.paper import figures
from baselines.paper.cache import Cache
from baselines.paper.control_sections import gust_alleviation, robustness
from baselines.paper.controllers import VARIANTS, Controllers, Plants
from baselines.paper.document import Section, Table, as_html, as_markdown
from baselines.paper.robustness import sensitivity
from baselines.paper.scores import metrics, score
from baselines.settings import load_tuning
from baselines.tune import CONFIG
from flapgym.aeroelastic.model import TurbineModel, load_model
from flapgym.atomic import write_atomically
from flapgym.control import OpenLoop
from flapgym.evaluation import writable_folder
from flapgym.evaluation.compare import PAPER_LENGTH
from flapgym.turbine import load_case

TITLE = "Load alleviation on the NREL 5 MW turbine: Section IV of the paper beside ours"
REALISATIONS = 50
ROBUST = ("lqg", "lqg_unfiltered", "lqg_moving_root", "lqg_multiblade", "pd", "lqg_saturating")
QUICK = {"lqg", "lqg_unfiltered_same", "pd"}
"""Controllers of a quick run: none of them is tuned or needs the turbine's parts."""
QUICK_DURATION = 20.0


class Study:
    """What the parts share.

    Parameters
    ----------
    model : TurbineModel
    folder : Path
    realisations : int
    quick : bool
        Few controllers, two short realisations.
    bar : tqdm
    """

    def __init__(self, model: TurbineModel, folder: Path, realisations: int, quick: bool, bar: tqdm) -> None:
        self.model, self.folder, self.case = model, folder, load_case(model.name)
        self.cache = Cache(folder / "parts", model.hash)
        self.duration = QUICK_DURATION if quick else PAPER_LENGTH * model.length_scale / model.wind_speed
        self.realisations = 2 if quick else realisations
        self.bar = bar
        names = [variant.name for variant in VARIANTS]
        self.names = [name for name in names if name in QUICK] if quick else names
        self.controllers = Controllers(
            model,
            Plants(model, self.case, self.cache),
            load_tuning(CONFIG),
            self.duration,
            self.cache,
            self.told,
        )

    def told(self, what: str) -> None:
        """Show what a long part is at."""
        self.bar.set_postfix_str(what)

    def gust_alleviation(self) -> Section:
        """Section IV.C."""
        open_loop = self._metrics(OpenLoop())
        scores = {
            name: score(self._metrics(self.controllers.agent(name)), open_loop, self.model)
            for name in self.names
        }
        return gust_alleviation(scores, self.realisations, self.duration)

    def _metrics(self, agent: Any) -> Any:
        return metrics(agent, self.model, self.realisations, self.duration, self.cache, self.told)

    def robustness(self) -> Section:
        """Sensitivities and margins."""
        names = [name for name in ROBUST if name in self.names]
        return robustness(
            {
                name: sensitivity(self.controllers.agent(name), self.model, self.cache, self.told)
                for name in names
            }
        )

    def table1(self) -> Section:
        """Natural frequencies."""
        return figures.table_1(self.case, self.cache)

    def figure8(self) -> Section:
        """Impulsive gust."""
        return figures.figure_8(self.case, self.folder, self.cache)

    def figure12(self) -> Section:
        """Hankel singular values."""
        return figures.figure_12(self.case, self.folder, self.cache)

    def turbine(self) -> Section:
        """Responses of the turbine."""
        return figures.turbine_figures(self.case, self.folder, self.cache, self.told)

    def figure15(self) -> Section:
        """Time series."""
        return figures.figure_15(self.model, self.folder, self.cache, self.duration)


PARTS: dict[str, Callable[[Study], Section]] = {
    "gust_alleviation": Study.gust_alleviation,
    "robustness": Study.robustness,
    "table1": Study.table1,
    "figure8": Study.figure8,
    "figure12": Study.figure12,
    "turbine": Study.turbine,
    "figure15": Study.figure15,
}
LONG = ("figure8", "figure12", "turbine")
"""Left out of a quick run."""


def parameters(model: TurbineModel) -> Section:
    """What was computed, in the case's own words."""
    rows = []
    for group in ("operating_point", "discretisation", "flap", "reduction", "turbulence"):
        for name, value in model.case[group].items():
            rows.append((f"{group}.{name}", f"{value:.6g}" if isinstance(value, float) else str(value)))
    return Section(
        "Case",
        (
            f"Model {model.name}, hash {model.hash[:16]}; SI units and radians.",
            Table(("parameter", "value"), tuple(rows)),
        ),
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; return the exit code: 0, or 2 for bad input."""
    options = _parser().parse_args(arguments)
    names = options.parts or [name for name in PARTS if not (options.quick and name in LONG)]
    try:
        unknown = [name for name in names if name not in PARTS]
        if unknown:
            raise ValueError(f"{unknown[0]}: unknown part; expected some of {', '.join(PARTS)}")
        if options.realisations < 2:
            raise ValueError(f"realisations: expected at least 2, got {options.realisations}")
        model, folder = load_model(options.model), writable_folder(options.output)
        with tqdm(total=len(names), unit=" parts") as bar:
            study = Study(model, folder, options.realisations, options.quick, bar)
            sections = [parameters(model)]
            for name in names:
                bar.set_description(name)
                sections.append(PARTS[name](study))
                bar.update()
    except (ValueError, OSError) as error:
        print(f"baselines.paper: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    write_atomically(folder / "paper.md", as_markdown(TITLE, sections, folder).encode())
    write_atomically(folder / "paper.html", as_html(TITLE, sections).encode())
    print(f"wrote {folder / 'paper.md'} and {folder / 'paper.html'}")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m baselines.paper", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)} (default: all)")
    parser.add_argument("--model", default="nrel5mw-rated", help="a model's name or file")
    parser.add_argument(
        "--realisations",
        type=int,
        default=REALISATIONS,
        help="scored realisations (default: %(default)s; paper: 5)",
    )
    parser.add_argument("--quick", action="store_true", help="a trial run of under a minute")
    parser.add_argument(
        "--output", type=Path, default=Path("results/paper"), help="folder for report and figures"
    )
    return parser


if __name__ == "__main__":
    sys.exit(main())
