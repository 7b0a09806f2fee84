"""The paper's Section IV beside ours, in one report: `python -m baselines.paper [PART ...]`.

Writes paper.md and paper.html, and the figures into the folder `paper` beside them. Finished parts lie in its folder
`parts` and are not computed again; an interrupted run goes on where it was. All parts take 27 minutes of
one core's time and 3.5 GB, for the full turbine of the figures. The report of some parts alone is paper-part.md and
.html; `--quick` is a trial run of a minute, which says so and writes paper-trial.md, .html and a folder of its own.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from functools import cached_property
from pathlib import Path

import numpy as np

from baselines.cache import Cache
from baselines.duty import Duty, measure_duty
from baselines.effects import Effects, measure_effects
from baselines.models import VARIATIONS, built, paper_case, unscaled_flap
from baselines.paper.aerodynamics_sections import figure_8, figure_12
from baselines.paper.control_sections import LABELS, SETTLED, gust_alleviation, robustness
from baselines.paper.controllers import VARIANTS, Controllers, Plants
from baselines.paper.effects_section import effects_section
from baselines.paper.readings import reading, readings_section
from baselines.paper.structure_sections import figure_9, table_1, table_2
from baselines.paper.trials import AGENTS, SHARE, conditions, outcome, trials_section
from baselines.paper.trials import REALISATIONS as TRIALS
from baselines.paper.turbine_sections import figure_15, turbine_figures, turbine_responses
from baselines.rivals import study as rivals
from baselines.rivals.section import rivals_section
from baselines.robustness import growths, margins, sensitivity
from baselines.scores import Trial, first, measured, metrics_of, named, rebuilt, score
from baselines.settings import load_tuning
from baselines.shipped import loaded, shipped_weights
from baselines.tune import CONFIG
from flapgym.aerodynamics.downwash import glauert_scale
from flapgym.control import Agent, OpenLoop, load_agent
from flapgym.control.channels import ROTOR
from flapgym.core.arrays import Array
from flapgym.core.atomic import write_together
from flapgym.core.program import Parser, Work, run, whole
from flapgym.core.progress import ProgressBar
from flapgym.core.state_space import StateSpace
from flapgym.evaluation import Record, measure, writable_folder
from flapgym.evaluation.comparison import MOST_REALISATIONS, PAPER_LENGTH, PAPER_REALISATIONS
from flapgym.model.nameplate import nameplate
from flapgym.model.turbine_model import TurbineModel, load_model
from reference.study import study_turbine
from studies.document import Section, Table, summary
from studies.render import as_html, as_markdown

TITLE = "Load alleviation on the NREL 5 MW turbine: Section IV of the paper beside ours"
REALISATIONS = 50
BESIDE = {
    "pid": "PID, same rule",
    "individual_flap": "collective, tilt and yaw PID",
    "lqg_multiblade_saturating": "whole turbine, stops in the loop",
    "ppo": "PPO, trained",
    "sac": "SAC, trained",
}
"""Shipped agents beside those of Section IV.C, and what tables call them."""
LINEAR = ("pid", "individual_flap", "lqg_multiblade_saturating")
"""Those of them whose loops have margins."""
QUICK = {"lqg", "lqg_unfiltered_same", "pd"}
"""Controllers of a quick run: none of them is tuned or needs the turbine's parts."""
QUICK_DURATION = 20.0
RIVALS = 10
"""Realisations of the rivals, whose optima take long: `python -m baselines.rivals` runs fifty."""


class Study:
    """What the parts share.

    Parameters
    ----------
    model : TurbineModel
    folder : Path
    realisations : int
    quick : bool
        Few controllers, two short realisations.
    bar : ProgressBar
    """

    def __init__(
        self, model: TurbineModel, folder: Path, realisations: int, quick: bool, bar: ProgressBar
    ) -> None:
        self.model, self.folder, self.case = model, folder, paper_case(model)
        self.cache = Cache(folder / "parts", model.hash)
        self.duration = QUICK_DURATION if quick else PAPER_LENGTH * model.length_scale / model.wind_speed
        self.quick = quick
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

    @cached_property
    def study_turbine(self) -> StateSpace:
        """The turbine with edgewise root moments and the tower's base among its outputs."""
        return self.cache.system(
            "study_turbine", {"case": self.case.hash()}, lambda: study_turbine(self.case)
        )

    def told(self, what: str) -> None:
        """Show what a long part is at."""
        self.bar.set_postfix_str(what)

    def gust_alleviation(self) -> Section:
        """Section IV.C."""
        metrics = {name: metrics_of(self._measured(self.controllers.agent(name))) for name in self.names}
        open_loop = metrics_of(self._measured(OpenLoop()))
        scores = {name: score(each, open_loop, metrics["lqg"], self.model) for name, each in metrics.items()}
        base, reference = (first(each, PAPER_REALISATIONS) for each in (metrics["lqg"], open_loop))
        few = score(base, reference, base, self.model)
        return gust_alleviation(
            scores,
            few.changes,
            self.model,
            self.realisations,
            self.duration,
            self.controllers.tuning.realisations,
            shipped_weights("lqg", self.model).measurement_noise,
            self._settled_rate(),
        )

    def _settled_rate(self) -> float:
        """Largest rate of the base case's flap once an episode is settled [rad/s]."""
        first = round(SETTLED / self.model.time_step)

        def take(record: Record) -> dict[str, Array]:
            return {"rate": np.abs(record.flap_rate[:, first:]).max(axis=(1, 2))}

        trial = Trial("settled", self.realisations, self.duration)
        found = measured(self.controllers.agent("lqg"), self.model, trial, self.cache, self.told, take)
        return float(found["rate"].max())

    def readings(self) -> Section:
        """The base case with the lattice's own flap, and tuned on what it is scored on."""
        flaps = {"scaled": self.model, "unscaled": built(unscaled_flap(self.case), self.told)}
        trial = Trial("reading", self.realisations, self.duration)
        found = [
            reading(flap, own, model, self.controllers.tuning, trial, self.cache, self.told)
            for flap, model in flaps.items()
            for own in (False, True)
        ]
        flap, panels = self.case.flap, self.case.discretisation.chordwise_panels
        carried = 1.0 / glauert_scale(panels, flap.chord_fraction)
        return readings_section(found, self.realisations, self.controllers.tuning.realisations, carried)

    def effects(self) -> Section:
        """Tower, edgewise motion and duty, of the learned agents too."""
        agents: dict[str, Agent] = {name: self.controllers.agent(name) for name in self.names}
        agents |= {name: load_agent(name, self.model) for name in BESIDE}
        found: dict[str, tuple[Effects, Duty]] = {}
        for name, agent in agents.items():
            arrays = self._measured(agent)
            found[name] = rebuilt(Effects, "effects", arrays), rebuilt(Duty, "duty", arrays)
        still = rebuilt(Effects, "effects", self._measured(OpenLoop()))
        return effects_section(found, LABELS | BESIDE, still, self.realisations)

    def _measured(self, agent: Agent) -> dict[str, Array]:
        """Metrics, side effects and duty of an agent, from one simulation."""

        def take(record: Record) -> dict[str, Array]:
            return named(
                metrics=measure(record),
                effects=measure_effects(record, self.study_turbine, self.model.rotor_speed),
                duty=measure_duty(record, self.model.flap_angle_limit),
            )

        trial = Trial("score", self.realisations, self.duration)
        return measured(agent, self.model, trial, self.cache, self.told, take)

    def rivals(self) -> Section:
        """PID, individual flaps, predictive control and the bound."""
        study = rivals.Study(self.model, RIVALS, self.duration, self.cache, self.told)
        return rivals_section(study)

    def trials(self) -> Section:
        """The shipped agents where they were not made for."""
        trial = Trial("trial", TRIALS, SHARE * self.duration)
        agents = {name: load_agent(name, self.model) for name in AGENTS}
        found = {}
        for condition in conditions(self.model, self.case, self.told):
            self.told(condition.label)
            found[condition.label] = {
                name: outcome(agent, condition, trial, self.cache, self.told)
                for name, agent in agents.items()
            }
        return trials_section(found, trial)

    def robustness(self) -> Section:
        """Sensitivities and margins."""
        turbines = {} if self.quick else VARIATIONS
        others = {label: built(change(self.case), self.told) for label, change in turbines.items()}
        agents = {LABELS[name]: self.controllers.agent(name) for name in self.names}
        if not self.quick:
            agents |= {BESIDE[name]: loaded(name, self.model) for name in LINEAR}
        changes: dict[str, Array] = {}
        growing: dict[str, Array] = {}
        borne: dict[str, Array] = {}
        for label, agent in agents.items():
            self.told(agent.name)
            borne[label] = margins(agent.name, agent.system, self.model, self.cache)
            if agent.system.inputs == ROTOR.inputs:
                growing[label] = growths(agent, self.model, others, self.cache)
            else:
                changes[label] = sensitivity(agent, self.model, others, self.cache)
        return robustness(changes, growing, borne, tuple(others), self.model)

    def table1(self) -> Section:
        """Natural frequencies."""
        return table_1(self.case, self.cache)

    def table2(self) -> Section:
        """Blade properties."""
        return table_2(self.case, self.cache)

    def figure8(self) -> Section:
        """Impulsive gust."""
        return figure_8(self.case, self.folder, self.cache)

    def figure9(self) -> Section:
        """Mode shapes."""
        return figure_9(self.case, self.folder, self.cache)

    def figure12(self) -> Section:
        """Hankel singular values."""
        return figure_12(self.case, self.folder, self.cache)

    def turbine(self) -> Section:
        """Responses of the turbine."""
        found = turbine_responses(self.case, self.model, self.cache, self.told)
        return turbine_figures(found, self.case, self.model, self.folder)

    def figure15(self) -> Section:
        """Time series."""
        return figure_15(self.model, self.folder, self.cache, self.duration)


PARTS: dict[str, Callable[[Study], Section]] = {
    "table1": Study.table1,
    "table2": Study.table2,
    "figure8": Study.figure8,
    "figure9": Study.figure9,
    "turbine": Study.turbine,
    "figure12": Study.figure12,
    "gust_alleviation": Study.gust_alleviation,
    "readings": Study.readings,
    "figure15": Study.figure15,
    "rivals": Study.rivals,
    "effects": Study.effects,
    "robustness": Study.robustness,
    "trials": Study.trials,
}
"""In the order of the report: the paper's own, then what goes beyond."""
LONG = ("figure8", "turbine", "figure12", "readings", "rivals", "trials")
"""Left out of a quick run."""


ANGLES = {"pitch": "deg", "angle_limit": "deg", "rate_limit": "deg/s", "acceleration_limit": "deg/s^2"}


def parameters(model: TurbineModel, parts: Sequence[str]) -> Section:
    """What was computed, in the case's own words."""
    rows = []
    for group in ("operating_point", "discretisation", "airloads", "flap", "reduction", "turbulence"):
        for name, value in model.case[group].items():
            angle = isinstance(value, float) and name in ANGLES
            shown = np.rad2deg(value) if angle else value
            number = f"{shown:.6g}" if isinstance(value, float) else str(value)
            rows.append((f"{group}.{name}", f"{number} {ANGLES[name]}" if angle else number))
    return Section(
        "Case",
        (
            f"Model {model.name}, hash {model.hash[:16]}; {nameplate(model.case).size}; SI units where none is given.",
            f"Parts of the report: {', '.join(parts)}; {len(parts)} of {len(PARTS)}.",
            Table(("parameter", "value"), tuple(rows)),
        ),
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns the exit code."""
    return run(_parser(), arguments)


def _door(options: argparse.Namespace) -> Work:
    names = options.parts or [name for name in PARTS if not (options.quick and name in LONG)]
    unknown = [name for name in names if name not in PARTS]
    if unknown:
        raise ValueError(f"{unknown[0]}: unknown part; expected some of {', '.join(PARTS)}")
    stem = "paper-trial" if options.quick else "paper" if set(names) == set(PARTS) else "paper-part"
    model, output = load_model(options.model), writable_folder(options.output, (f"{stem}.md", f"{stem}.html"))
    # A trial's numbers, figures and finished parts stay apart from those of the full report.
    folder = writable_folder(output / ("paper-trial" if options.quick else "paper"))

    def work() -> int:
        with ProgressBar(total=len(names), unit=" parts") as bar:
            study = Study(model, folder, options.realisations, options.quick, bar)
            sections = []
            for name in names:
                bar.set_description(name)
                sections.append(PARTS[name](study))
                bar.update()
        notice, title = "", TITLE
        if options.quick:
            notice, title = trial_notice(study), f"Trial run: {TITLE}"
            sections = [section.on_trial(notice) for section in (parameters(model, names), *sections)]
        else:
            glance = [summary(sections)] if any(section.verdict for section in sections) else []
            sections = [*glance, parameters(model, names), *sections]
        write_together(
            {
                output / f"{stem}.md": as_markdown(title, sections, output).encode(),
                output / f"{stem}.html": as_html(title, sections, notice).encode(),
            }
        )
        print(f"wrote {output / stem}.md and .html{'; ' + notice if notice else ''}")
        return 0

    return work


def trial_notice(study: Study) -> str:
    """What a trial run says on every page."""
    full = PAPER_LENGTH * study.model.length_scale / study.model.wind_speed
    return (
        f"Trial run: {study.realisations} realisations of {study.duration:.3g} s in place of {REALISATIONS} of "
        f"{full:.0f} s, and few controllers; a test of the program, no result."
    )


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="python -m baselines.paper", description=(__doc__ or "").splitlines()[0])
    parser.set_defaults(
        door=_door, program="baselines.paper", kept="what is finished is kept, run it again to go on"
    )
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)} (default: all)")
    parser.add_argument("--model", default="nrel5mw-rated", help="a model's name or file")
    parser.add_argument(
        "--realisations",
        type=whole(2, MOST_REALISATIONS),
        default=REALISATIONS,
        help="scored realisations (default: %(default)s; paper: 5)",
    )
    parser.add_argument("--quick", action="store_true", help="a trial run of a minute: paper-trial.*")
    parser.add_argument(
        "--output", type=Path, default=Path("results"), help="folder for the report (default: %(default)s)"
    )
    return parser


if __name__ == "__main__":
    sys.exit(main())
