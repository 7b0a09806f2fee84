"""The study: every rival and the bound on the scored realisations, in batches that an interrupt leaves on disk."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields

import numpy as np

from baselines.paper.cache import Cache, fingerprint
from baselines.paper.effects import respond
from baselines.rivals.bound import HOLD, Bound, best_flap, flap_response
from baselines.rivals.contestants import PlannedFlap, Rival, rivals, shipped_weights
from baselines.rivals.duty import Duty, as_array, at_equal_load, measure_duty
from flapgym.aeroelastic.model import TurbineModel
from flapgym.control import Agent, OpenLoop, PredictiveController
from flapgym.evaluation import (
    SCORED_SEED,
    Metrics,
    Record,
    damage_equivalent_load,
    measure,
    root_mean_square,
    simulate,
)
from flapgym.state_space import Array

BATCH = 25
"""Realisations simulated side by side, and lost at most to an interrupt; 0.3 GB."""
NOISES = (0.0, 0.01, 0.05, 0.1)
"""Measurement noise of the comparison at equal load, over the open-loop rms moment."""
BLADE_REALISATIONS = 5
"""Of the bound on the clamped blade alone."""
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
    def rounds(self) -> int:
        """How often `all_outcomes`, `ideal` and `single_blade` tell of something."""
        blade = min(self.realisations, BLADE_REALISATIONS)
        return len(self._batches()) * (len(rivals(self.model)) + 1) + blade

    def all_outcomes(self) -> dict[str, tuple[Rival, Outcome]]:
        """Every rival's outcome, by name, open loop first."""
        return {each.agent.name: (each, self._outcome(each.agent)) for each in rivals(self.model)}

    def ideal(self) -> Ideal:
        """The bound on every realisation, by the collective flap against the mean moment of the blades."""
        response = flap_response(self.model, self.model.turbine)

        def of(seeds: Sequence[int]) -> dict[str, Array]:
            free = simulate(OpenLoop(), self.model, seeds, self.duration).rbm.mean(axis=2)
            plans = [best_flap(each, response, self.model) for each in free]
            played = simulate(PlannedFlap(self.model, plans, HOLD), self.model, seeds, self.duration)
            return self._arrays(played) | {
                "gap": np.array([plan.gap for plan in plans]),
                "residual": np.array([plan.residual for plan in plans]),
                "programme_rms": np.array([_rms(plan) for plan in plans]),
            }

        found = self._joined("bound", {"hold": HOLD}, of)
        extra = {key: found[key] for key in ("gap", "residual", "programme_rms")}
        return Ideal(_outcome(found), **extra)

    def single_blade(self) -> dict[str, Array]:
        """Rms of moment and tip and DEL of the clamped blade, (realisations, 2): without the flap, and at its bound."""
        model, blade = self.model, self.model.blade
        seeds = range(SCORED_SEED, SCORED_SEED + min(self.realisations, BLADE_REALISATIONS))

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

        return self.cache.arrays("blade-bound", {"count": len(seeds), "duration": self.duration}, make)

    def equal_load(self) -> Array:
        """(noises, controllers, columns): LQG, PD, PID and calm LQG at the LQG's load; columns of `EqualLoad`."""
        weights = shipped_weights("lqg")

        def make() -> dict[str, Array]:
            return {
                "found": np.array([as_array(at_equal_load(self.model, weights, noise)) for noise in NOISES])
            }

        return self.cache.arrays("equal-load", {"noises": NOISES, "weights": asdict(weights)}, make)["found"]

    def solve_times(self) -> Array:
        """Seconds by the clock of each constrained optimum of predictive control on a minute of wind, with its call."""

        def make() -> dict[str, Array]:
            agent = PredictiveController("mpc", self.model, shipped_weights("lqg_saturating"))
            spent: list[float] = []
            solve = agent.within

            def timed(action: float, rows: Array, rate: float) -> float:
                begin = time.perf_counter()
                found = solve(action, rows, rate)
                spent.append(time.perf_counter() - begin)
                return found

            agent.within = timed  # type: ignore[method-assign]
            simulate(agent, self.model, [TUNING_SEED], TIMED)
            return {"spent": np.array(spent)}

        return self.cache.arrays("solve-times", {"seconds": TIMED}, make)["spent"]

    def _outcome(self, agent: Agent) -> Outcome:
        settings = {"agent": _mark(agent), "preview": getattr(agent, "preview", 0)}
        return _outcome(
            self._joined(
                agent.name,
                settings,
                lambda seeds: self._arrays(simulate(agent, self.model, seeds, self.duration)),
            )
        )

    def _arrays(self, record: Record) -> dict[str, Array]:
        duty = measure_duty(record, self.model.flap_angle_limit)
        return {f"metrics_{key}": value for key, value in asdict(measure(record)).items()} | {
            f"duty_{key}": value for key, value in asdict(duty).items()
        }

    def _joined(
        self, name: str, settings: dict[str, object], make: Callable[[Sequence[int]], dict[str, Array]]
    ) -> dict[str, Array]:
        parts = []
        for seeds in self._batches():
            key = settings | {"first": seeds[0], "count": len(seeds), "duration": self.duration}
            parts.append(self.cache.arrays(f"rival-{name}", key, lambda seeds=seeds: make(seeds)))  # type: ignore[misc]
            self.tell(name)
        return {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}

    def _batches(self) -> list[range]:
        last = SCORED_SEED + self.realisations
        return [range(first, min(first + BATCH, last)) for first in range(SCORED_SEED, last, BATCH)]


def _outcome(found: dict[str, Array]) -> Outcome:
    return Outcome(
        Metrics(**{each.name: found[f"metrics_{each.name}"] for each in fields(Metrics)}),
        Duty(**{each.name: found[f"duty_{each.name}"] for each in fields(Duty)}),
    )


def _rms(plan: Bound) -> float:
    return float(np.sqrt(np.mean(plan.rbm**2)))


def _mark(agent: Agent) -> str:
    """What tells one agent's results from another's of the same name."""
    if isinstance(agent, PredictiveController):
        system = agent.unconstrained
    elif hasattr(agent, "system"):
        system = agent.system
    else:
        return agent.name
    return fingerprint(system.A, system.B, system.C, system.D)
