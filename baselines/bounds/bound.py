"""What no controller can beat on one realisation, for one metric, and the best motion that was found beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baselines.bounds.certificate import least
from baselines.bounds.metrics import equivalent_load, rms, swing_load, worst_chain
from baselines.bounds.optimum import Plan, Point, Programme, plan
from baselines.bounds.response import response_of
from flapgym.control import OpenLoop
from flapgym.control.agent import Floats
from flapgym.core.arrays import Array
from flapgym.core.fields import Choice, Count, Quantity
from flapgym.core.wording import shown
from flapgym.evaluation import simulate
from flapgym.model.turbine_model import TurbineModel

METRICS = ("rbm_rms", "rbm_del")
"""Of `flapgym.evaluation.Metrics`, that are bounded."""
KNOWN = ("wind", "gravity", "pitch", "sensors", "backend")
"""Keywords of an environment under which a bound holds; actuators with faults have other stops."""
HOLD = 10
"""Steps over which a plan holds its commands; the bound is of commands that change at every step."""
ACTED = 5
"""Steps between actions of the agent that plays a plan, as of the shipped policies: the length of an episode in a field
depends on it, and so does the field."""
ROUNDS, EACH = 30, 12
"""Of the bound for fatigue: how often the swings that count are mixed anew, and steps of the search in between."""


@dataclass(frozen=True, eq=False)
class Realisation:
    """A turbine in a wind that is known from beginning to end.

    Attributes
    ----------
    model : TurbineModel
    pitch : bool
        Whether each blade's pitch moves, too.
    free : (T, 3) float
        Root moments with flaps and pitch at rest, at samples 1 to T [N m].
    azimuth : float
        Of blade 1 one time step before the first sample [rad].
    """

    model: TurbineModel
    pitch: bool
    free: Array
    azimuth: float

    def programme(self, hold: int = HOLD) -> Programme:
        """Of commands held over so many steps."""
        response = response_of(self.model, self.pitch, self.azimuth, len(self.free), hold)
        return Programme(response, self.free)


@dataclass(frozen=True, eq=False)
class Bound:
    """How far a metric can fall below open loop, mean of the blades' ratios as `flapgym.evaluation.compare` has it.

    Attributes
    ----------
    value : float
        Change against open loop below which no motion within the stops comes, a fraction; weak duality proves it.
    reached : float
        Change that the plan reaches.
    plan : Plan
        The best motion found.
    point : Point
        Where the search for it ended.
    """

    value: float
    reached: float
    plan: Plan
    point: Point

    @property
    def gap(self) -> float:
        """Between what is proved impossible and what is done."""
        return self.reached - self.value


class _Still(OpenLoop):
    """Open loop in the very wind that agents meet who act as seldom."""

    steps_per_action = ACTED


def realisations(
    model: TurbineModel, settings: Mapping[str, Any], seeds: Sequence[int], duration: float
) -> list[Realisation]:
    """One for each seed, as `flapgym.evaluation.simulate` has it.

    Parameters
    ----------
    model : TurbineModel
    settings : mapping
        Keywords of the environment without the model, of `KNOWN`.
    seeds : sequence of int
    duration : float
        [s].

    Raises
    ------
    ValueError
        If a keyword is another, the model's blades are unequal, or nothing loads them.
    """
    for name in settings:
        if name not in KNOWN:
            raise ValueError(f"settings: expected no others than {', '.join(KNOWN)}, got {shown(name)}")
    if model.periodic is not None:
        raise ValueError(f"model: expected equal blades, got {model.name}: {model.form}")
    record = simulate(_Still(), model, seeds, duration, **settings)
    if not np.ptp(record.rbm, axis=1).all():
        raise ValueError("settings.wind: expected one that loads the blades, got none")
    return [
        Realisation(model, bool(settings.get("pitch")), moments, float(azimuth))
        for moments, azimuth in zip(record.rbm, record.azimuth, strict=True)
    ]


def bound(
    model: TurbineModel,
    settings: Mapping[str, Any],
    seed: int,
    duration: float,
    metric: str = "rbm_rms",
    rounds: int = ROUNDS,
) -> Bound:
    """The bound on one realisation.

    Parameters
    ----------
    model, settings, duration
        As of `realisations`.
    seed : int
    metric : str
        "rbm_rms" or "rbm_del".
    rounds : int
        Of the bound for fatigue; more bring it nearer to what is reached.

    Raises
    ------
    ValueError
        Naming what is wrong.
    """
    Choice(METRICS).check(metric, "metric")
    Quantity("time", above=0.0).check(duration, "duration")
    Count(at_least=1).check(rounds, "rounds")
    (one,) = realisations(model, settings, [seed], duration)
    calm = least_rms(one)
    return calm if metric == "rbm_rms" else least_fatigue(one, calm.point, rounds)


def least_rms(realisation: Realisation) -> Bound:
    """For the rms: a convex programme."""
    programme, metric = realisation.programme(), rms(realisation.free)
    point = programme.solve(metric)
    where = programme.total(programme.motion(point.variables))
    best = plan(programme, point.variables)
    return Bound(
        value=_change(least(metric, where, realisation.free, realisation.programme(1).response)),
        reached=metric(programme.total(best.motion))[0] - 1.0,
        plan=best,
        point=point,
    )


def least_fatigue(realisation: Realisation, start: Point, rounds: int = ROUNDS) -> Bound:
    """For the damage-equivalent load: the convex load of swings that lies below it, the swings mixed for the most.

    Least over motions and most over mixtures of chains: each round adds the chain that does most damage to the motion
    that does best against those before (Frank and Wolfe's method on the dual). The bound is that of any mixture; the
    motions do well under rainflow counting, too, which is what `reached` counts.

    Parameters
    ----------
    realisation : Realisation
    start : Point
        Such as the least rms.
    rounds : int
    """
    free, dt = realisation.free, realisation.model.time_step
    programme, metric = realisation.programme(), equivalent_load(free, dt)

    def moments(point: Point) -> Array:
        return programme.total(programme.motion(point.variables))

    point = best = programme.solve(metric, start, prices=(1.0,))
    mixture = [worst_chain(blade) for blade in moments(point).T]
    for turn in range(rounds):
        point = programme.solve(swing_load(free, dt, mixture), point, prices=(1.0,), iterations=EACH)
        found = moments(point)
        if metric(found)[0] < metric(moments(best))[0]:
            best = point
        mixture = [
            old.mixed(worst_chain(blade), 2.0 / (turn + 3.0))
            for old, blade in zip(mixture, found.T, strict=True)
        ]
    swings = swing_load(free, dt, mixture)
    point = programme.solve(swings, point, prices=(1.0,))
    plans = [plan(programme, each.variables) for each in (best, programme.solve(metric, best, prices=(1.0,)))]
    reached = [metric(programme.total(each.motion))[0] - 1.0 for each in plans]
    return Bound(
        value=_change(least(swings, moments(point), free, realisation.programme(1).response)),
        reached=min(reached),
        plan=plans[int(np.argmin(reached))],
        point=best,
    )


def _change(lowest: float) -> float:
    """Of a share of open loop that is proved; no load is less than none, whatever a tangent says."""
    return max(lowest, 0.0) - 1.0


class PlannedMotion:
    """Plays plans, one a realisation in the order of the batch; at rest beyond their end.

    Parameters
    ----------
    plans : sequence of Plan
    """

    name = "plan"
    observe: tuple[str, ...] = ("flap_angle",)
    steps_per_action = ACTED
    model_hash: str | None = None

    def __init__(self, plans: Sequence[Plan], pitches: bool = False) -> None:
        self.pitches = pitches
        # Of one more interval, at rest.
        self._actions = np.stack([np.vstack([each.actions, 0.0 * each.actions[:1]]) for each in plans])

    def predict(
        self,
        observation: Floats,
        state: Array | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], Array | None]:
        """Planned actions (N, n) of the interval counted in the state."""
        count = 0 if state is None else int(state[0])
        interval = min(count * ACTED // HOLD, self._actions.shape[1] - 1)
        return np.asarray(self._actions[:, interval], dtype=np.float32), np.array([count + 1.0])
