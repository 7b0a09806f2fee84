"""A shipped design on another model: the same law, weights and gains, softer where its loop would be short of margin.

So one design serves every wind speed: what is made anew are the observer, the regulator and the servo's place in them,
what is kept is how much they are asked for, as far as the disk margin allows.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import lru_cache
from typing import Any

from flapgym.control.agent import Agent
from flapgym.control.field_lqg import field_design
from flapgym.control.linear_loop import linear_loop
from flapgym.control.lqg import Weights, design_model, lqg_agent
from flapgym.control.pd import PDGains, pd_agent
from flapgym.control.pid import PIDGains, multiblade_pid_agent, pid_agent
from flapgym.core.wording import shown
from flapgym.model.turbine_model import TurbineModel
from flapgym.wind import Inflow, Kaimal

MARGIN = 0.54
"""Disk margin of the linear loop: what the shipped designs were tuned for."""
SOFTER = 0.5
"""By which gains and weights on the moment are multiplied until the loop has it."""
LEAST = 1e-3
"""Share of them below which there is nothing left of the design."""
FIELD = Kaimal(turbulence_class="B")
INFLOW = Inflow(shear_exponent=0.2, tower_shadow=True)
"""What those that know a field believe in: the normal turbulence and profile of IEC 61400-1 (2005), and a tower."""


@lru_cache(maxsize=32)
def _made(name: str, model: TurbineModel, design: tuple[tuple[str, float], ...]) -> Agent:
    make, share = _law(name, model, dict(design)), 1.0
    while share > LEAST:
        agent = make(share)
        loop = linear_loop(agent, model)
        if loop is not None and loop.stable and loop.margin is not None and loop.margin.alpha >= MARGIN:
            return agent
        share *= SOFTER
    raise ValueError(
        f"agent {name}: no softer design of it has a disk margin of {MARGIN} on the model {model.name}; tune it there"
    )


def agent_by_rule(name: str, model: TurbineModel, design: Mapping[str, Any]) -> Agent:
    """The agent of a name and a shipped design (`flapgym.control.agent_design`) for a model, made once a process.

    Raises
    ------
    ValueError
        If no such design has the margin on the model, or the name is none of `RULED`.
    """
    if name not in RULED:
        raise ValueError(f"by_rule.name: expected one of {', '.join(RULED)}, got {shown(name)}")
    numbers = ((key, float(value)) for key, value in design.items() if isinstance(value, int | float))
    return _made(name, model, tuple(numbers))


def _law(name: str, model: TurbineModel, design: Mapping[str, float]) -> Callable[[float], Agent]:
    """What makes the agent with a share of its gains, or of its weight on the moment."""

    def gains(cls: type[PDGains], share: float, prefix: str = "") -> Any:
        found = {each.name: design[f"{prefix}{each.name}"] for each in fields(cls)}
        return cls(**{**found, "proportional": share * found["proportional"]})

    def weights(share: float) -> Weights:
        found = {each.name: design[each.name] for each in fields(Weights)}
        return Weights(**{**found, "rbm": share * found["rbm"]})

    if name.startswith("lqg"):
        # Whatever the weights, what they weigh is prepared once.
        if name.startswith("lqg_field"):
            on = field_design(model, FIELD, INFLOW, multiblade=name.endswith("multiblade"))
        else:
            on = design_model(model, model.turbine if "multiblade" in name else None)
        return lambda share: lqg_agent(name, model, weights(share), on)
    laws: dict[str, Callable[[float], Agent]] = {
        "pd": lambda share: pd_agent(name, model, gains(PDGains, share)),
        "pid": lambda share: pid_agent(name, model, gains(PIDGains, share)),
        "individual_flap": lambda share: multiblade_pid_agent(
            name, model, gains(PIDGains, share, "collective_"), gains(PIDGains, share, "cyclic_")
        ),
    }
    return laws[name]


RULED = (
    "pd",
    "pid",
    "individual_flap",
    "lqg",
    "lqg_saturating",
    "lqg_multiblade_saturating",
    "lqg_field",
    "lqg_field_multiblade",
)
"""Names of designs that can be made for another model."""
