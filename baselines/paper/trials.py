"""The shipped agents, stops in the loop, on turbines, winds and measurements they were not made for."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from baselines.cache import Cache
from baselines.models import VARIATIONS, built
from baselines.robustness import DELAYS, EFFECTIVENESS, LENGTHS, NOISES
from baselines.scores import Trial, measured_together, metrics_of, named
from baselines.tuning import LinearController
from flapgym.control import Agent, OpenLoop, closed_loop
from flapgym.control.closed_loop import with_effectiveness
from flapgym.control.growth import Growth, growth
from flapgym.control.margins import late_measurement
from flapgym.evaluation import Estimate, Metrics, measure, paired_change
from flapgym.model.turbine_model import TurbineModel
from flapgym.turbine import Case
from studies.document import Section, Table

AGENTS = ("pd", "lqg", "lqg_saturating", "lqg_multiblade_saturating", "ppo", "sac")
REALISATIONS = 40
SHARE = 0.25
"""Of the paper's length, of each: short ones side by side cost least, and together last as long as ten long ones."""
UNSTABLE = "*"
UNSTABLE_HEAD = ("condition", "agent", "frequency [Hz]", "doubles in [s]")


@dataclass(frozen=True, eq=False)
class Condition:
    """What the agents are run on.

    Attributes
    ----------
    label : str
    model : TurbineModel
    settings : mapping
        Keywords of the environment, by family.
    """

    label: str
    model: TurbineModel
    settings: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Outcome:
    """An agent under a condition: changes against open loop there, travel [rad/s], and what grows in its linear loop.

    What grows is told with the stops left out; None where all decays or the agent is not linear.
    """

    rbm_rms: Estimate
    rbm_del: Estimate
    flap_travel: float
    grows: Growth | None


def conditions(
    model: TurbineModel, case: Case, tell: Callable[[str], None]
) -> dict[str, Callable[[], Condition]]:
    """As designed, then one thing changed at a time, by label; turbines are built when called for."""
    found: dict[str, Callable[[], Condition]] = {}

    def add(label: str, turbine: Callable[[], TurbineModel], **settings: Any) -> None:
        found[label] = lambda: Condition(label, turbine(), settings)

    add("as designed", lambda: model)
    for label, change in VARIATIONS.items():
        add(label, partial(lambda change: built(change(case), tell), change))
    for factor in EFFECTIVENESS:
        if factor != 1.0:
            weaker = replace(model, turbine=with_effectiveness(model.turbine, factor))
            add(f"flap's effect x {factor:g}", partial(lambda weaker: weaker, weaker))
    for length in LENGTHS:
        if length != model.length_scale:
            add(f"L = {length:g} m", lambda: model, wind={"length_scale": length})
    for noise in NOISES:
        add(f"noise {100 * noise:g} %", lambda: model, sensors={"noise": noise * model.rbm_rms})
    for delay in DELAYS[1:]:
        late = delay * model.time_step
        add(f"delay {delay} step{'s' * (delay > 1)}", lambda: model, sensors={"delay": late})
    return found


def outcomes(
    agents: Mapping[str, Agent], condition: Condition, trial: Trial, cache: Cache, tell: Callable[[str], None]
) -> dict[str, Outcome]:
    """What agents do under a condition, by name; open loop meets the same wind on the same turbine."""
    model, settings = condition.model, condition.settings
    # Flaps at rest feel neither noise nor what they could do, but the wind.
    wind = {name: value for name, value in settings.items() if name == "wind"}

    def taken(flyers: Sequence[Agent], settings: Mapping[str, Any]) -> list[Metrics]:
        own = replace(trial, settings=settings)
        found = measured_together(
            flyers, model, own, cache, tell, lambda record: named(metrics=measure(record))
        )
        return [metrics_of(each) for each in found]

    (reference,) = taken([OpenLoop()], wind)
    flown = dict(zip(agents, taken(list(agents.values()), settings), strict=True))
    delay = round(settings.get("sensors", {}).get("delay", 0.0) / model.time_step)
    return {
        name: Outcome(
            paired_change(flown[name].rbm_rms, reference.rbm_rms),
            paired_change(flown[name].rbm_del, reference.rbm_del),
            float(flown[name].flap_travel.mean()),
            _grows(agent, model, delay),
        )
        for name, agent in agents.items()
    }


def _grows(agent: Agent, model: TurbineModel, delay: int) -> Growth | None:
    """What grows in the linear loop of an agent whose measurements are so many steps late."""
    if not isinstance(agent, LinearController):
        return None
    return growth(closed_loop(model, late_measurement(agent.system, delay, model.rotor_speed)))


def trials_section(found: Mapping[str, Mapping[str, Outcome]], trial: Trial) -> Section:
    """Tables of outcomes by condition and agent."""
    agents = list(next(iter(found.values())))
    loads, travel = [], []
    for label, row in found.items():
        loads.append((label, *(_cell(row[name]) for name in agents)))
        travel.append((label, *(f"{np.rad2deg(row[name].flap_travel):.2f}" for name in agents)))
    unstable = tuple(
        (label, name, f"{one.grows.frequency:.2f}", f"{one.grows.doubling_time:.0f}")
        for label, row in found.items()
        for name, one in row.items()
        if one.grows is not None
    )
    growing: tuple[str | Table, ...] = ()
    if unstable:
        growing = ("What grows in the loops with an asterisk:", Table(UNSTABLE_HEAD, unstable))
    first = next(iter(found.values()))
    worst = {name: max(found, key=lambda label: found[label][name].rbm_rms.mean) for name in agents}
    lines = [
        f"{name} loses most under {worst[name]}: {_percent(found[worst[name]][name].rbm_rms.mean)} % of RBM "
        f"rms instead of {_percent(first[name].rbm_rms.mean)} %."
        for name in agents
    ]
    return Section(
        "Robustness: the shipped agents on other turbines, winds and measurements",
        (
            f"Simulated behind the stops on {trial.realisations} realisations of {trial.duration:.0f} s; change of RBM "
            "rms / RBM DEL against open loop on the same turbine in the same wind [%], mean of the ratios over "
            "blades and realisations. The agents stay as shipped, only what the row names is changed. Turbines are "
            "built anew from the changed case, trim included; in another wind tip-speed ratio and pitch stay, and so "
            "does the turbulence intensity. An asterisk: the linear loop is unstable there, which a run as short as "
            "this need not show.",
            Table(("condition", *agents), tuple(loads)),
            *growing,
            "Path of a flap [deg/s]:",
            Table(("condition", *agents), tuple(travel)),
        ),
        conclusions=(" ".join(lines),),
    )


def _cell(outcome: Outcome) -> str:
    mark = "" if outcome.grows is None else UNSTABLE
    return f"{_percent(outcome.rbm_rms.mean)} / {_percent(outcome.rbm_del.mean)}{mark}"


def _percent(change: float) -> str:
    return f"{100.0 * change:+.1f}"
