"""What the parts of the report share, and each part from its numbers to its section."""

from __future__ import annotations

from collections.abc import Callable
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
from baselines.paper.readings import FLAPS, Reading, reading, readings_section
from baselines.paper.structure_sections import figure_9, table_1, table_2
from baselines.paper.trials import AGENTS, SHARE, Condition, Outcome, conditions, outcomes, trials_section
from baselines.paper.trials import REALISATIONS as TRIALS
from baselines.paper.turbine_sections import Responses, figure_15, turbine_figures, turbine_responses
from baselines.rivals.section import rivals_section
from baselines.rivals.study import Study as Rivals
from baselines.robustness import growths, margins, sensitivity
from baselines.scores import Trial, first, measured, measured_together, metrics_of, named, rebuilt, score
from baselines.settings import load_tuning
from baselines.shipped import loaded, shipped_weights
from baselines.tune import CONFIG
from flapgym.aerodynamics.downwash import glauert_scale
from flapgym.control import Agent, OpenLoop, load_agent
from flapgym.control.channels import ROTOR
from flapgym.core.arrays import Array
from flapgym.core.state_space import StateSpace
from flapgym.evaluation import Record, measure
from flapgym.evaluation.comparison import PAPER_LENGTH, PAPER_REALISATIONS
from flapgym.model.turbine_model import TurbineModel
from reference.study import study_turbine
from studies.document import Section

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
    told : callable
        Told what a long part is at.
    """

    def __init__(
        self, model: TurbineModel, folder: Path, realisations: int, quick: bool, told: Callable[[str], None]
    ) -> None:
        self.model, self.folder, self.case, self.told = model, folder, paper_case(model), told
        self.cache = Cache(folder / "parts", model.hash)
        self.duration = QUICK_DURATION if quick else PAPER_LENGTH * model.length_scale / model.wind_speed
        self.quick = quick
        self.realisations = 2 if quick else realisations
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

    def further_loads(self) -> StateSpace:
        """`study_turbine`, as a job."""
        return self.study_turbine

    def design_models(self) -> None:
        """Those of Section IV.C that need the turbine's parts."""
        self.controllers.plants.keep_all()

    def responses(self) -> Responses:
        """Of the whole turbine: Figures 10, 11, 13 and 14."""
        return turbine_responses(self.case, self.model, self.cache, self.told)

    def gust_alleviation(self) -> Section:
        """Section IV.C."""
        metrics = {name: metrics_of(self.scored(name)) for name in self.names}
        open_loop = metrics_of(self.scored(OpenLoop.name))
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
            self.settled_rate(),
        )

    def settled_rate(self) -> float:
        """Largest rate of the base case's flap once an episode is settled [rad/s]."""
        first = round(SETTLED / self.model.time_step)

        def take(record: Record) -> dict[str, Array]:
            return {"rate": np.abs(record.flap_rate[:, first:]).max(axis=(1, 2))}

        trial = Trial("settled", self.realisations, self.duration)
        found = measured(self.controllers.agent("lqg"), self.model, trial, self.cache, self.told, take)
        return float(found["rate"].max())

    def readings(self) -> Section:
        """The base case with the lattice's own flap, and tuned on what it is scored on."""
        found = [self.reading(flap, own) for flap in FLAPS for own in (False, True)]
        flap, panels = self.case.flaps[0], self.case.discretisation.chordwise_panels
        carried = 1.0 / glauert_scale(panels, flap.chord_fraction)
        return readings_section(found, self.realisations, self.controllers.tuning.realisations, carried)

    def reading(self, flap: str, own: bool) -> Reading:
        """The base case with a flap of `FLAPS`, tuned on what it is scored on or on others."""
        model = self.model if flap == "scaled" else self.unscaled()
        trial = Trial("reading", self.realisations, self.duration)
        return reading(flap, own, model, self.controllers.tuning, trial, self.cache, self.told)

    def unscaled(self) -> TurbineModel:
        """The turbine with the lattice's own flap."""
        return built(unscaled_flap(self.case), self.told)

    def agent(self, name: str) -> Agent:
        """Open loop, one of Section IV.C or a shipped one beside them."""
        if name == OpenLoop.name:
            return OpenLoop()
        return load_agent(name, self.model) if name in BESIDE else self.controllers.agent(name)

    def effects(self) -> Section:
        """Tower, edgewise motion and duty, of the learned agents too."""
        found: dict[str, tuple[Effects, Duty]] = {}
        for name in (*self.names, *BESIDE):
            arrays = self.scored(name)
            found[name] = rebuilt(Effects, "effects", arrays), rebuilt(Duty, "duty", arrays)
        still = rebuilt(Effects, "effects", self.scored(OpenLoop.name))
        return effects_section(found, LABELS | BESIDE, still, self.realisations)

    def scored(self, name: str) -> dict[str, Array]:
        """Metrics, side effects and duty of an agent, from one simulation."""
        (found,) = self.scored_together(name)
        return found

    def scored_together(self, *names: str) -> list[dict[str, Array]]:
        """The same of several agents."""

        def take(record: Record) -> dict[str, Array]:
            return named(
                metrics=measure(record),
                effects=measure_effects(record, self.study_turbine, self.model.rotor_speed),
                duty=measure_duty(record, self.model.flaps[0].angle_limit),
            )

        trial = Trial("score", self.realisations, self.duration)
        agents = [self.agent(name) for name in names]
        return measured_together(agents, self.model, trial, self.cache, self.told, take)

    def rivals(self) -> Section:
        """PID, individual flaps, predictive control and the bound."""
        return rivals_section(self.rival_study.findings())

    def rival_number(self, name: str) -> object:
        """One of the rivals' figures, by the method that finds it."""
        return getattr(self.rival_study, name)()

    def rival(self, name: str) -> object:
        """What a rival did, by its agent's name."""
        return self.rival_study.outcome(name)

    @property
    def rival_study(self) -> Rivals:
        """The rivals by themselves."""
        return Rivals(self.model, RIVALS, self.duration, self.cache, self.told)

    def trials(self) -> Section:
        """The shipped agents where they were not made for."""
        found = {label: self.outcomes(label) for label in self.conditions}
        return trials_section(found, self._trial)

    @cached_property
    def conditions(self) -> dict[str, Callable[[], Condition]]:
        """Of the trials, by label."""
        return conditions(self.model, self.case, self.told)

    @property
    def _trial(self) -> Trial:
        return Trial("trial", TRIALS, SHARE * self.duration)

    def outcomes(self, label: str) -> dict[str, Outcome]:
        """What the shipped agents do under a condition."""
        self.told(label)
        condition = self.conditions[label]()
        agents = {name: load_agent(name, self.model) for name in AGENTS}
        return outcomes(agents, condition, self._trial, self.cache, self.told)

    def robustness(self) -> Section:
        """Sensitivities and margins."""
        changes: dict[str, Array] = {}
        growing: dict[str, Array] = {}
        borne: dict[str, Array] = {}
        for name in self.linear:
            label = (LABELS | BESIDE)[name]
            borne[label], found, turning = self.judged(name)
            (growing if turning else changes)[label] = found
        return robustness(changes, growing, borne, tuple(self.others), self.model)

    @property
    def linear(self) -> tuple[str, ...]:
        """Names of those whose loops have margins."""
        return (*self.names, *(() if self.quick else LINEAR))

    @cached_property
    def others(self) -> dict[str, TurbineModel]:
        """The turbine with one thing changed, by what it is."""
        return {label: self.variation(label) for label in (() if self.quick else VARIATIONS)}

    def variation(self, label: str) -> TurbineModel:
        """One of ``VARIATIONS``."""
        return built(VARIATIONS[label](self.case), self.told)

    def judged(self, name: str) -> tuple[Array, Array, bool]:
        """Margins of a linear loop, and its sensitivity or, of a periodic loop, its growth; whether it is periodic."""
        agent = loaded(name, self.model) if name in BESIDE else self.controllers.agent(name)
        self.told(name)
        borne = margins(agent.name, agent.system, self.model, self.cache)
        turning = agent.system.inputs == ROTOR.inputs
        found = (growths if turning else sensitivity)(agent, self.model, self.others, self.cache)
        return borne, found, turning

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
        return turbine_figures(self.responses(), self.case, self.model, self.folder)

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
