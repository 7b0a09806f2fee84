"""The controllers of Section IV.C: on which model each is designed, and the weight the paper's rule gives it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from functools import cache, cached_property

import numpy as np
from scipy.linalg import block_diag

from baselines.cache import Cache
from baselines.scores import mark
from baselines.settings import Tuning
from baselines.shipped import loaded, shipped_weights
from baselines.tuning import Bench, LinearController, meet_the_stops
from flapgym.aerodynamics import Aerodynamics
from flapgym.aeroelastic.blade_lattice import reduce_component
from flapgym.aeroelastic.build import assemble_parts
from flapgym.aeroelastic.coupling import multiblade_aerodynamics
from flapgym.aeroelastic.equations import Parts
from flapgym.aeroelastic.trim import deflected_lattice
from flapgym.control import (
    DesignModel,
    design_model,
    lqg_agent,
    stationary_rms,
    white_wind,
)
from flapgym.control.lqg import FILTER_ORDER
from flapgym.core.arrays import Array
from flapgym.core.state_space import StateSpace, delayed
from flapgym.model.turbine_model import TurbineModel
from flapgym.reduction import ReducedSystem
from flapgym.turbine import Case
from flapgym.wind import von_karman_filter
from studies.design import clamped_rotor, frozen_turbine, hub_sway, moving_root_blade

FROZEN_AZIMUTH = 0.0
"""Of the frozen design model [rad]: blade 1 up."""
SWAY_FREQUENCY, SWAY_DAMPING = 0.32, 0.08
"""Of the root's motion [Hz], [-]: the first tower fore-aft mode with the rotor's damping."""

BOLD_NOISE = 0.02
"""Of the open-loop rms moment: what the observer expects that the disk margin refuses, the shipped one 5 %."""
START = 1.0 / 3.0
"""Of the base case's weight on the moment: where the search for another design's begins."""


@dataclass(frozen=True)
class Variant:
    """A row of the table.

    Attributes
    ----------
    name, label : str
        Of the agent, and what the report calls it.
    paper : str
        What the paper says of it.
    """

    name: str
    label: str
    paper: str


VARIANTS = (
    Variant("lqg", "single clamped blade (base case)", "RBM -22, tip -23, DEL -17"),
    Variant("lqg_unfiltered_same", "no filter in the model, same weights", "about 10 % worse"),
    Variant("lqg_unfiltered", "no filter in the model, weight raised again", "about 10 % worse"),
    Variant("lqg_clamped_rotor", "centralised, rotor clamped at the hub", "similar"),
    Variant("lqg_moving_root", "single blade with a moving root", "no better"),
    Variant("lqg_frozen", "whole turbine at a frozen azimuth", "less than 5 % different"),
    Variant("lqg_multiblade", "whole turbine, multi-blade coordinates", "not in the paper"),
    Variant("lqg_bold", "single clamped blade, observer expects 2 % of noise", "not in the paper"),
    Variant("lqg_saturating", "single blade, stops in the loop", "not in the paper"),
    Variant("pd", "PD, same rule", "not in the paper"),
)
SHIPPED = ("lqg", "lqg_saturating", "pd")


class Plants:
    """Design models that need the turbine's parts, made when first asked for and kept on disk.

    Parameters
    ----------
    model : TurbineModel
    case : Case
        What the model was built from.
    cache : Cache
    """

    def __init__(self, model: TurbineModel, case: Case, cache: Cache) -> None:
        if case.hash() != model.inputs_hash:
            raise ValueError(
                f"case {case.name}: the model {model.name} was built from other inputs; build it again"
            )
        self._model, self._case, self._cache = model, case, cache

    @cached_property
    def clamped(self) -> StateSpace:
        """Three blades clamped at the hub."""
        return self._kept("clamped_rotor", lambda: clamped_rotor(self._parts, self._on_rotor))

    @cached_property
    def frozen(self) -> StateSpace:
        """The whole turbine at ``FROZEN_AZIMUTH``."""
        return self._kept(
            "frozen_turbine", lambda: frozen_turbine(self._parts, self._on_rotor, FROZEN_AZIMUTH)
        )

    @cached_property
    def moving_root(self) -> StateSpace:
        """One blade whose root sways."""

        def make() -> StateSpace:
            lattice = deflected_lattice(self._case, self._parts.blade, blades=1)
            return moving_root_blade(self._parts, self._reduced(lattice, 0))

        return self._kept("moving_root_blade", make)

    def keep_all(self) -> None:
        """Make all of them now."""
        _ = self.clamped, self.frozen, self.moving_root

    def _kept(self, name: str, make: Callable[[], StateSpace]) -> StateSpace:
        late = self._case.discretisation.input_delay
        return self._cache.system(
            name, {"azimuth": FROZEN_AZIMUTH}, lambda: delayed(make()) if late else make()
        )

    @cached_property
    def _assembled(self) -> tuple[Parts, Aerodynamics]:
        return assemble_parts(self._case)

    @property
    def _parts(self) -> Parts:
        return self._assembled[0]

    @cached_property
    def _on_rotor(self) -> ReducedSystem:
        """The rotor's lattice in coordinates that turn with it."""
        collective, whirl = (self._reduced(self._assembled[1], m) for m in (0, 1))
        return multiblade_aerodynamics(collective, whirl, 0.0, self._case.discretisation.time_step)

    def _reduced(self, lattice: Aerodynamics, component: int) -> ReducedSystem:
        keep = self._case.reduction
        return reduce_component(
            lattice, self._parts.lattice, component, keep.aerodynamic_states, keep.aerodynamic_tolerance
        )


@dataclass(frozen=True, eq=False)
class Controllers:
    """The agents of ``VARIANTS`` for a model, those that are not shipped tuned by the paper's rule.

    Attributes
    ----------
    model : TurbineModel
    plants : Plants
    tuning : Tuning
        Realisations to tune on.
    duration : float
        Of each [s].
    cache : Cache
    advanced : callable
        Told of every design tried.
    """

    model: TurbineModel
    plants: Plants
    tuning: Tuning
    duration: float
    cache: Cache
    advanced: Callable[[str], None]

    def agent(self, name: str) -> LinearController:
        """The agent of a variant, made once."""
        if name not in self._agents:
            self._agents[name] = self._made(name)
        return self._agents[name]

    def _made(self, name: str) -> LinearController:
        if name in SHIPPED:
            return loaded(name, self.model)
        base = shipped_weights("lqg", self.model)
        if name == "lqg_unfiltered_same":
            return self._lqg(name, base.rbm)
        settings = {
            "base": asdict(base),
            "design": mark(self._lqg(name, base.rbm)),
            "first": self.tuning.seed,
            "count": self.tuning.realisations,
            "duration": self.duration,
        }
        found = self.cache.arrays(f"weight-{name}", settings, lambda: {"rbm": self._tuned(name)})
        return self._lqg(name, float(found["rbm"]))

    def _tuned(self, name: str) -> Array:
        """Weight on the moment that brings the flap just to its stop on the tuning realisations."""
        in_blades = name in ("lqg_clamped_rotor", "lqg_frozen")
        bench = Bench(
            self.model, self.tuning, self.duration, self.advanced, self.plants.frozen if in_blades else None
        )
        # The search comes back to the weights it began with; a design on the whole turbine takes seconds.
        design = cache(lambda rbm: self._lqg(name, rbm))
        weight = meet_the_stops(bench, design, START * shipped_weights("lqg", self.model).rbm)
        if weight is None:
            raise ValueError(f"{name}: the loop turns unstable before the flap reaches its stop")
        return np.asarray(weight)

    def _lqg(self, name: str, rbm: float) -> LinearController:
        design, weights = self._designs(name), replace(shipped_weights("lqg", self.model), rbm=rbm)
        if name == "lqg_bold":
            weights = replace(weights, measurement_noise=BOLD_NOISE)
        agent = lqg_agent(name, self.model, weights, design)
        if name.startswith("lqg_unfiltered"):
            # White wind explains no steady load: begin as if the first one had stood for long, not with a throw.
            a = agent.system.A
            agent = replace(agent, start=np.asarray(np.linalg.solve(np.eye(a.shape[0]) - a, agent.system.B)))
        return agent

    def _designs(self, name: str) -> DesignModel:
        if name not in self._known:
            self._known[name] = self._design(name)
        return self._known[name]

    _known: dict[str, DesignModel] = field(default_factory=dict, init=False, repr=False)
    _agents: dict[str, LinearController] = field(default_factory=dict, init=False, repr=False)

    def _design(self, name: str) -> DesignModel:
        model = self.model
        if name.startswith("lqg_unfiltered"):
            return design_model(model, disturbance=white_wind(model))
        if name == "lqg_clamped_rotor":
            return design_model(model, self.plants.clamped)
        if name == "lqg_frozen":
            return design_model(model, self.plants.frozen)
        if name == "lqg_bold":
            return design_model(model)
        if name == "lqg_multiblade":
            return design_model(model, model.turbine)
        if name == "lqg_moving_root":
            return design_model(model, self.plants.moving_root, swaying_wind(model))
        raise ValueError(f"controllers: no design called {name}")


def swaying_wind(model: TurbineModel) -> StateSpace:
    """Turbulence and, independent of it, the root's motion at the hub's own rms."""
    wind = von_karman_filter(
        model.wind_speed, model.turbulence_intensity, model.length_scale, model.time_step, FILTER_ORDER
    )
    velocity = 2.0 * np.pi * SWAY_FREQUENCY * stationary_rms(model)["tower_fore_aft"]
    sway = hub_sway(SWAY_FREQUENCY, SWAY_DAMPING, velocity, model.time_step)
    joined = {key: block_diag(getattr(wind, key), getattr(sway, key)) for key in "ABCD"}
    return StateSpace(
        **joined,
        time_step=model.time_step,
        inputs=wind.inputs + sway.inputs,
        outputs=wind.outputs + sway.outputs,
    )
