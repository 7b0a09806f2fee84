"""The study: every rival and the bound on the scored realisations, in batches that an interrupt leaves on disk."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np

from baselines.cache import Cache
from baselines.duty import Duty, measure_duty
from baselines.effects import respond
from baselines.rivals.bound import CONSTANTS, HOLD, Bound, best_flap, flap_response
from baselines.rivals.contestants import PREVIEWS, SHIPPED, PlannedFlap, Rival, predictive, rivals
from baselines.rivals.equal_load import CALM, as_array, at_equal_load, shipped_gains
from baselines.robustness import margins
from baselines.scores import Trial, batches, joined, mark, measured, named, rebuilt
from baselines.shipped import loaded, shipped_weights
from flapgym.control import Agent, OpenLoop, PredictiveController, closed_loop
from flapgym.control.channels import MULTIBLADE
from flapgym.control.horizon import BLOCKS
from flapgym.core.arrays import Array
from flapgym.core.state_space import StateSpace
from flapgym.evaluation import (
    SCORED_SEED,
    Metrics,
    Record,
    damage_equivalent_load,
    measure,
    root_mean_square,
    simulate,
)
from flapgym.model.turbine_model import TurbineModel

NOISES = (0.0, 0.01, 0.05, 0.1)
"""Measurement noise of the comparison at equal load, over the open-loop rms moment."""
FEW = 5
"""Realisations of the bound on the clamped blade alone, and of other horizons."""
HORIZONS: tuple[tuple[tuple[int, ...], str], ...] = (
    (BLOCKS, ""),
    ((1, 1, 1, 1, 2, 4, 4), ""),
    (BLOCKS[:12], ""),
    ((1,) * 64, ", offsets step by step"),
    ((*BLOCKS, 64, 128), ""),
)
"""Steps for which the offsets of predictive control are held, the shipped ones first, and what is said of them."""
TUNING_SEED = 2_000_000
"""Of the realisation on which solving is timed."""
TIMED = 60.0
"""Its length [s]."""

Tell = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a rival did: arrays over the realisations."""

    metrics: Metrics
    duty: Duty


@dataclass(frozen=True, eq=False)
class Ideal:
    """The bound: what its motion did in the turbine, and what the programme says of it.

    Attributes
    ----------
    outcome : Outcome
        Of the motion played back on the whole turbine.
    gap, residual : (N,) float
        Relative duality gap, and violation of the optimality conditions.
    programme_rms : (N,) float
        Rms moment the programme promises [N m].
    """

    outcome: Outcome
    gap: Array
    residual: Array
    programme_rms: Array


@dataclass(frozen=True, eq=False)
class Findings:
    """All that the report tells; the methods of `Study` of these names say what each holds."""

    realisations: int
    duration: float
    time_step: float
    few: int
    all_outcomes: dict[str, tuple[Rival, Outcome]]
    ideal: Ideal
    single_blade: dict[str, Array]
    solve_times: Array
    horizons: dict[str, float]
    margins: dict[str, Array]
    steady_shares: dict[str, float]
    equal_load: Array


@dataclass(frozen=True, eq=False)
class Study:
    """What is compared on what.

    Attributes
    ----------
    model : TurbineModel
    realisations : int
    duration : float
        Of each [s].
    cache : Cache
    tell : callable
        Told of every finished batch.
    """

    model: TurbineModel
    realisations: int
    duration: float
    cache: Cache
    tell: Tell

    @property
    def trial(self) -> Trial:
        """The scored realisations."""
        return Trial("rival", self.realisations, self.duration)

    @property
    def few(self) -> Trial:
        """The first of them."""
        return replace(self.trial, name="few", realisations=min(self.realisations, FEW))

    @property
    def rounds(self) -> int:
        """How often `tell` is told of something."""
        runs = len(rivals(self.model)) + 1
        some = len(batches(self.few.realisations, self.duration)) * (len(HORIZONS) + 1)
        tried = len(margins_of(self.model))
        return len(batches(self.realisations, self.duration)) * runs + self.few.realisations + some + tried

    def findings(self) -> Findings:
        """Everything; what is in the cache is not computed again."""
        return Findings(
            self.realisations,
            self.duration,
            self.model.time_step,
            self.few.realisations,
            self.all_outcomes(),
            self.ideal(),
            self.single_blade(),
            self.solve_times(),
            self.horizons(),
            self.margins(),
            self.steady_shares(),
            self.equal_load(),
        )

    def all_outcomes(self) -> dict[str, tuple[Rival, Outcome]]:
        """Every rival's outcome, by name, open loop first."""
        return {each.agent.name: (each, self._outcome(each.agent)) for each in rivals(self.model)}

    def outcome(self, name: str) -> Outcome:
        """That of the rival whose agent has this name."""
        return self._outcome(next(each.agent for each in rivals(self.model) if each.agent.name == name))

    def ideal(self) -> Ideal:
        """The bound on every realisation, by the collective flap against the mean moment of the blades."""
        response = flap_response(self.model, self.model.turbine)

        def of(seeds: Sequence[int]) -> dict[str, Array]:
            free = simulate(OpenLoop(), self.model, seeds, self.duration).rbm.mean(axis=2)
            plans = [best_flap(each, response, self.model) for each in free]
            played = simulate(PlannedFlap(self.model, plans, HOLD), self.model, seeds, self.duration)
            return self._taken(played) | {
                "gap": np.array([plan.gap for plan in plans]),
                "residual": np.array([plan.residual for plan in plans]),
                "programme_rms": np.array([_rms(plan) for plan in plans]),
            }

        found = joined("bound", {"constants": CONSTANTS}, self.trial, self.cache, self.tell, of)
        extra = {key: found[key] for key in ("gap", "residual", "programme_rms")}
        return Ideal(_outcome(found), **extra)

    def single_blade(self) -> dict[str, Array]:
        """Rms of moment and tip and DEL of the clamped blade, (realisations, 2): without the flap, and at its bound."""
        model, blade = self.model, self.model.blade
        seeds = range(SCORED_SEED, SCORED_SEED + self.few.realisations)

        def make() -> dict[str, Array]:
            response = flap_response(model, blade)
            wind = simulate(OpenLoop(), model, seeds, self.duration).wind
            still = np.zeros((*wind.shape, 2))
            free = respond(blade, np.concatenate([still, wind[..., None]], axis=2))
            best = []
            for one, gust in zip(free, wind, strict=True):
                motion = best_flap(one[:, 0], response, model).motion(HOLD, model.time_step)
                inputs = np.concatenate([motion, gust[: len(motion), None]], axis=1)
                best.append(respond(blade, inputs[None])[0])
                self.tell("blade")
            pairs = [(one[: len(two)], two) for one, two in zip(free, best, strict=True)]
            rms = np.array([[root_mean_square(each, axis=0) for each in pair] for pair in pairs])
            fatigue = [
                [damage_equivalent_load(each[:, 0], model.time_step) for each in pair] for pair in pairs
            ]
            return {"rbm_rms": rms[..., 0], "tip_rms": rms[..., 1], "rbm_del": np.array(fatigue)}

        inputs = {"first": seeds[0], "count": len(seeds), "duration": self.duration, "constants": CONSTANTS}
        return self.cache.arrays("blade-bound", inputs, make)

    def equal_load(self) -> Array:
        """(noises, controllers, columns): LQG, PD, PID and calm LQG at the LQG's load; columns of `EqualLoad`."""
        weights = shipped_weights("lqg", self.model)

        def make() -> dict[str, Array]:
            return {
                "found": np.array([as_array(at_equal_load(self.model, weights, noise)) for noise in NOISES])
            }

        pd, pid = shipped_gains(self.model)
        designs = [asdict(weights), asdict(CALM), asdict(pd), asdict(pid)]
        inputs = {"noises": NOISES, "designs": designs}
        return self.cache.arrays("equal-load", inputs, make)["found"]

    def horizons(self) -> dict[str, float]:
        """Change of the RBM rms of MPC against open loop on the first realisations, by label of the horizon."""

        def of(agent: Agent) -> Metrics:
            found = measured(
                agent,
                self.model,
                self.few,
                self.cache,
                self.tell,
                lambda record: named(metrics=measure(record)),
            )
            return rebuilt(Metrics, "metrics", found)

        still, weights = of(OpenLoop()).rbm_rms, shipped_weights("lqg_saturating", self.model)
        agents = {
            f"{sum(blocks) * self.model.time_step:.2g} s{remark}": PredictiveController(
                "mpc", self.model, weights, blocks=blocks
            )
            for blocks, remark in HORIZONS
        }
        return {label: float((of(each).rbm_rms / still).mean() - 1.0) for label, each in agents.items()}

    def margins(self) -> dict[str, Array]:
        """``MARGINS`` of the loops with the saturating LQG and with MPC, no stop in sight, by label."""
        found = {}
        for label, (name, system) in margins_of(self.model).items():
            found[label] = margins(name, system, self.model, self.cache)
            self.tell(name)
        return found

    def steady_shares(self) -> dict[str, float]:
        """What the shipped linear loops leave of a steady tilting or yawing moment, the worst direction, by name."""
        cyclic = MULTIBLADE.suffixes[1:]
        found = {}
        for name in SHIPPED:
            loop = closed_loop(self.model, loaded(name, self.model).system)
            asked = loop.select(
                [f"noise{suffix}" for suffix in cyclic], [f"rbm{suffix}" for suffix in cyclic]
            )
            # Of noise on the measurement the loop sees S n, and the true moment is S n - n.
            found[name] = float(np.linalg.norm(asked.dc_gain() + np.eye(2), 2))
        return found

    def solve_times(self) -> Array:
        """Seconds by the clock of each constrained optimum of predictive control on a minute of wind, with its call."""
        agent = predictive(self.model)

        def make() -> dict[str, Array]:
            spent: list[float] = []
            solve = agent.within

            def timed(action: Array, rows: Array, rate: Array) -> Array:
                begin = time.perf_counter()
                found = solve(action, rows, rate)
                spent.append(time.perf_counter() - begin)
                return found

            agent.within = timed  # type: ignore[method-assign]
            simulate(agent, self.model, [TUNING_SEED], TIMED)
            return {"spent": np.array(spent)}

        inputs = {"agent": mark(agent), "seed": TUNING_SEED, "seconds": TIMED}
        return self.cache.arrays("solve-times", inputs, make)["spent"]

    def _outcome(self, agent: Agent) -> Outcome:
        return _outcome(measured(agent, self.model, self.trial, self.cache, self.tell, self._taken))

    def _taken(self, record: Record) -> dict[str, Array]:
        return named(metrics=measure(record), duty=measure_duty(record, self.model.flaps[0].angle_limit))


def margins_of(model: TurbineModel) -> dict[str, tuple[str, StateSpace]]:
    """Names and linear controllers, by label, whose margins the report compares."""
    saturating = loaded("lqg_saturating", model)
    found = {"LQG, stops cut it": (saturating.name, saturating.system)}
    for seconds in (0.0, *PREVIEWS):
        agent = predictive(model, seconds)
        label = f"MPC, {seconds:g} s of wind ahead" if seconds else "MPC, knows the stops"
        found[label] = (agent.name, agent.unconstrained)
    return found


def _outcome(found: Mapping[str, Array]) -> Outcome:
    return Outcome(rebuilt(Metrics, "metrics", found), rebuilt(Duty, "duty", found))


def _rms(plan: Bound) -> float:
    return float(np.sqrt(np.mean(plan.rbm**2)))
