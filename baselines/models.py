"""The case studied, and its turbine with one thing changed, built once: what the shipped designs are flown on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from flapgym.aeroelastic.cache import cached_model
from flapgym.model.turbine_model import TurbineModel
from flapgym.turbine import Case, load_case, load_turbine

JUDGED = "nrel5mw-rated"
"""Case whose numbers and figures were looked at by those who wrote the report's fixed remarks."""


def was_judged(inputs_hash: str) -> bool:
    """Whether the fixed remarks are on a case of this hash."""
    return inputs_hash == load_case(JUDGED).hash()


def paper_case(model: TurbineModel) -> Case:
    """The case a model was built from.

    Raises
    ------
    ValueError
        If this flapgym does not understand it, or if its turbine is not the paper's.
    """
    try:
        case = Case.from_dict(model.case)
    except ValueError as error:
        raise ValueError(f"model {model.name}: {error} (in the case it holds; build it again)") from None
    case.turbine.require(load_turbine("nrel5mw"))
    return case


def heavier(case: Case, factor: float) -> Case:
    """Blades of so many times the mass and inertia."""
    return replace(case, turbine=case.turbine.with_blade(factor, 1.0))


def stiffer(case: Case, factor: float) -> Case:
    """Blades of so many times the stiffness, in bending, torsion and tension."""
    return replace(case, turbine=case.turbine.with_blade(1.0, factor))


def windier(case: Case, speed: float) -> Case:
    """Another mean wind [m/s] below rated: tip-speed ratio and pitch stay, so the rotor turns in proportion."""
    return replace(case, operating_point=replace(case.operating_point, wind_speed=speed))


def unscaled_flap(case: Case) -> Case:
    """The lattice's own flap, 0.89 of thin-aerofoil theory's: what the paper most likely had."""
    return replace(case, flaps=tuple(replace(flap, effectiveness=1.0) for flap in case.flaps))


VARIATIONS: dict[str, Callable[[Case], Case]] = {
    "blade mass -10 %": lambda case: heavier(case, 0.9),
    "blade mass +10 %": lambda case: heavier(case, 1.1),
    "blade stiffness -10 %": lambda case: stiffer(case, 0.9),
    "blade stiffness +10 %": lambda case: stiffer(case, 1.1),
    "wind 8 m/s": lambda case: windier(case, 8.0),
    "wind 9 m/s": lambda case: windier(case, 9.0),
    "wind 10 m/s": lambda case: windier(case, 10.0),
}


def built(case: Case, tell: Callable[[str], None]) -> TurbineModel:
    """The model of a case, from the user's cache of models if it was ever built."""
    return cached_model(case, lambda stage: tell(f"build: {stage}"))
