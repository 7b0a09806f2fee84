"""The rules by which PD, PID and LQG are tuned; every design is judged on the whole turbine (paper section IV.C)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any

import numpy as np
from scipy.optimize import brentq

from baselines.settings import FieldCandidate, LQGCandidate, PDCandidate, PIDCandidate, Tuning
from flapgym.control import (
    BladeController,
    DesignModel,
    PDGains,
    PIDGains,
    RotorController,
    Weights,
    closed_loop,
    design_model,
    lqg_agent,
    multiblade_pid_agent,
    pd_agent,
    pid_agent,
    stability,
    stationary_rms,
)
from flapgym.control.closed_loop import LARGEST_EFFECTIVENESS
from flapgym.control.field_lqg import field_design
from flapgym.control.margins import disk_margin
from flapgym.core.state_space import StateSpace
from flapgym.envs.registration import ENVIRONMENTS
from flapgym.evaluation import Metrics, measure, simulate
from flapgym.model.turbine_model import TurbineModel
from flapgym.wind import Inflow, turbulence_of
from flapgym.wind.turbulence import Turbulence

SITE = "flapgym/NREL5MWSite-v0"
"""Environment whose field, shear and gravity the designs for a field believe in and are tried in."""
STOPS_AWAY = 100.0
"""Factor on the flap's stops that takes them out of the way to measure the motion without them."""
PEAK_FACTOR = 4.0
"""First guess of the largest angle over its rms; a Gaussian signal of some thousand independent swings."""
TOLERANCE = 0.005
"""How closely the largest angle is brought to its stop."""

LinearController = BladeController | RotorController
Design = Callable[[float], LinearController]
"""A controller from the one number the rule raises."""


@dataclass(frozen=True)
class Tuned:
    """A controller and what was found about it on the tuning realisations.

    Attributes
    ----------
    agent : BladeController or RotorController
    design : dict
        Weights or gains, margins and measured values, plain numbers.
    """

    agent: LinearController
    design: dict[str, float]


@dataclass(frozen=True, eq=False)
class Bench:
    """The turbine and the realisations designs are tried on.

    Attributes
    ----------
    model : TurbineModel
    tuning : Tuning
    duration : float
        Of a realisation [s].
    advanced : callable
        Called with the agent's name at every design tried, for a progress bar.
    plant : StateSpace, optional
        What stands for the turbine where a controller in the blades' own frames asks for its Lyapunov equation: one
        frozen at an azimuth. Simulations are of the turning turbine all the same.
    surroundings : mapping
        Keywords of the environment in which designs are simulated; by default the model's own turbulence.
    """

    model: TurbineModel
    tuning: Tuning
    duration: float
    advanced: Callable[[str], None]
    plant: StateSpace | None = None
    surroundings: Mapping[str, Any] = field(default_factory=dict)

    @property
    def seeds(self) -> range:
        """Of the realisations."""
        return range(self.tuning.seed, self.tuning.seed + self.tuning.realisations)

    def measure(self, agent: LinearController, free: bool = False) -> Metrics:
        """Metrics on the tuning realisations; `free` takes the stops of angle and rate out of the way."""
        self.advanced(agent.name)
        model = self.model
        if free:
            freed = (
                replace(
                    flap, angle_limit=STOPS_AWAY * flap.angle_limit, rate_limit=STOPS_AWAY * flap.rate_limit
                )
                for flap in model.flaps
            )
            model = replace(model, flaps=tuple(freed))
        return measure(simulate(agent, model, self.seeds, self.duration, **self.surroundings))

    def stroke(self, agent: LinearController) -> float:
        """Largest use of the stops the controller would make: of the angle's or of the rate's, whichever is more."""
        free = self.measure(agent, free=True)
        angle = free.flap_angle_max.max() / self.model.flaps[0].angle_limit
        return float(max(angle, free.flap_rate_max.max() / self.model.flaps[0].rate_limit))

    def disk_margin(self, agent: LinearController) -> float:
        """Of the whole turbine's loop, stops left out; 0 if it is unstable."""
        return disk_margin(self.model, agent.system).alpha

    def robust(self, agent: LinearController) -> bool:
        """Whether the loop has the disk margin asked for."""
        return self.disk_margin(agent) >= self.tuning.disk_margin


def tune_lqg(bench: Bench) -> Tuned:
    """The paper's rule, with the first candidate that has the disk margin."""
    found = []
    for candidate in bench.tuning.lqg:

        def design(weight: float, candidate: LQGCandidate = candidate) -> LinearController:
            return lqg_agent("lqg", bench.model, _weights(candidate, weight))

        weight = meet_the_stops(bench, design, 1e-3)
        if weight is None:
            continue
        agent = design(weight)
        found.append(bench.disk_margin(agent))
        if found[-1] >= bench.tuning.disk_margin:
            return _tuned(bench, agent, asdict(_weights(candidate, weight)))
    raise ValueError(
        f"lqg: no candidate reaches the stops with a disk margin of {bench.tuning.disk_margin} "
        f"(found: {', '.join(f'{margin:.2f}' for margin in found) or 'none stable'}); "
        "add one with more measurement noise"
    )


def tune_saturating(bench: Bench) -> Tuned:
    """The heaviest weight the disk margin allows, for each candidate; of these the least rms."""
    return _saturating(bench, "lqg_saturating", design_model(bench.model), bench.tuning.lqg_saturating)


def tune_multiblade_saturating(bench: Bench) -> Tuned:
    """The same on the whole turning turbine."""
    on = design_model(bench.model, bench.model.turbine)
    return _saturating(bench, "lqg_multiblade_saturating", on, bench.tuning.lqg_saturating)


def tune_field(bench: Bench) -> Tuned:
    """The same of a blade in the field of a site, and in its shear."""
    return _for_site(bench, "lqg_field", multiblade=False)


def tune_field_multiblade(bench: Bench) -> Tuned:
    """The same on the whole turning turbine."""
    return _for_site(bench, "lqg_field_multiblade", multiblade=True)


def _for_site(bench: Bench, name: str, multiblade: bool) -> Tuned:
    entry = next(each for each in ENVIRONMENTS if each.id == SITE)
    settings = {key: value for key, value in entry.keywords.items() if key != "model"}
    wind = settings["wind"]
    turbulence = turbulence_of(wind["field"])
    assert isinstance(turbulence, Turbulence)
    on = field_design(bench.model, turbulence, Inflow(**wind["inflow"]), multiblade)
    return _saturating(replace(bench, surroundings=settings), name, on, bench.tuning.lqg_field)


def _saturating(bench: Bench, name: str, on: DesignModel, candidates: Sequence[LQGCandidate]) -> Tuned:
    def designs() -> Iterable[tuple[LinearController, dict[str, float]]]:
        for candidate in candidates:

            def design(weight: float, candidate: LQGCandidate = candidate) -> LinearController:
                return lqg_agent(name, bench.model, _weights(candidate, weight), on)

            highest = candidate.heaviest if isinstance(candidate, FieldCandidate) else 1e4
            weight = largest_weight(bench, design, highest=highest)
            yield design(weight), asdict(_weights(candidate, weight))

    return _least_rms(bench, designs())


def tune_pd(bench: Bench) -> Tuned:
    """The paper's rule for every candidate; of those with the disk margin the least rms."""

    def designs() -> Iterable[tuple[LinearController, dict[str, float]]]:
        for candidate in bench.tuning.pd:

            def design(gain: float, candidate: PDCandidate = candidate) -> BladeController:
                return pd_agent("pd", bench.model, PDGains(gain, **asdict(candidate)))

            gain = meet_the_stops(bench, design, 1e-10)
            if gain is not None:
                yield design(gain), asdict(PDGains(gain, **asdict(candidate)))

    return _least_rms(bench, designs())


def tune_pid(bench: Bench) -> Tuned:
    """The same with the integral."""

    def designs() -> Iterable[tuple[LinearController, dict[str, float]]]:
        for candidate in bench.tuning.pid:

            def design(gain: float, candidate: PIDCandidate = candidate) -> BladeController:
                return pid_agent("pid", bench.model, PIDGains(gain, **asdict(candidate)))

            gain = meet_the_stops(bench, design, 1e-10)
            if gain is not None:
                yield design(gain), asdict(PIDGains(gain, **asdict(candidate)))

    return _least_rms(bench, designs())


def tune_individual(bench: Bench) -> Tuned:
    """Individual flap control: the tuned PID on the collective channel, on tilt and yaw what the disk margin allows.

    A homogeneous gust hardly loads those two, so no stop bounds their gain. Of the candidates the one that takes the
    heaviest integral.
    """
    found = tune_pid(bench).design
    collective = PIDGains(**{each.name: found[each.name] for each in fields(PIDGains)})
    best: tuple[float, LinearController, dict[str, float]] | None = None
    for candidate in bench.tuning.tilt_yaw:

        def design(gain: float, candidate: PIDCandidate = candidate) -> RotorController:
            cyclic = PIDGains(gain, **asdict(candidate))
            return multiblade_pid_agent("individual_flap", bench.model, collective, cyclic)

        gain = largest_weight(bench, design, 1e-10, 1e-4)
        numbers = {f"collective_{key}": value for key, value in asdict(collective).items()}
        numbers |= {
            f"cyclic_{key}": value for key, value in asdict(PIDGains(gain, **asdict(candidate))).items()
        }
        if best is None or gain * candidate.integral_gain / candidate.leak_time > best[0]:
            best = gain * candidate.integral_gain / candidate.leak_time, design(gain), numbers
    if best is None:
        raise ValueError("individual_flap: the tuning file has no candidate for tilt and yaw")
    _, agent, numbers = best
    return _tuned(bench, agent, numbers)


def meet_the_stops(bench: Bench, design: Design, start: float) -> float | None:
    """The number that brings the flap just to a stop on the tuning realisations, or None if no stable design does.

    The Lyapunov equation gives the rms at any number in a moment; the ratio of the largest angle to the rms hardly
    depends on it. So a few realisations of the ratio replace the many of a bisection.
    """
    model, factor = bench.model, PEAK_FACTOR
    for _ in range(8):
        number = _for_rms(bench, design, model.flaps[0].angle_limit / factor, start)
        if number is None:
            return None
        stroke = bench.stroke(design(number))
        if abs(stroke - 1.0) < TOLERANCE:
            return number
        factor *= stroke
    raise RuntimeError(f"the largest flap angle does not settle at its stop (last stroke {stroke:.3f})")


def _for_rms(bench: Bench, design: Design, angle: float, start: float) -> float | None:
    """The number at which the flap angle has the rms given; None if the loop turns unstable before."""

    def excess(log_number: float) -> float:
        system = design(float(np.exp(log_number))).system
        if closed_loop(bench.model, system, plant=bench.plant).spectral_radius() >= 1.0:
            return np.inf
        return stationary_rms(bench.model, system, plant=bench.plant)["flap_angle"] / angle - 1.0

    low = high = float(np.log(start))
    while (value := excess(high)) < 0.0:
        low, high = high, high + 1.0
    if np.isinf(value):
        # Stable below, unstable above: is the rms reached between?
        for _ in range(12):
            middle = 0.5 * (low + high)
            value = excess(middle)
            if 0.0 <= value < np.inf:
                high = middle
                break
            low, high = (middle, high) if value < 0.0 else (low, middle)
        else:
            return None
    return float(np.exp(brentq(excess, low, high, xtol=1e-4)))


def largest_weight(bench: Bench, design: Design, lowest: float = 0.1, highest: float = 1e4) -> float:
    """The largest weight, to 3 %, at which the loop keeps the disk margin; the highest if it does there."""
    if not bench.robust(design(lowest)):
        raise ValueError(
            f"no disk margin of {bench.tuning.disk_margin} even at a weight of {lowest} on the moment"
        )
    if bench.robust(design(highest)):
        return highest
    while highest / lowest > 1.03:
        middle = float(np.sqrt(lowest * highest))
        lowest, highest = (middle, highest) if bench.robust(design(middle)) else (lowest, middle)
    return lowest


def _least_rms(bench: Bench, designs: Iterable[tuple[LinearController, dict[str, float]]]) -> Tuned:
    best: Tuned | None = None
    for agent, numbers in designs:
        if not bench.robust(agent):
            continue
        tuned = _tuned(bench, agent, numbers)
        if best is None or tuned.design["tuning_rbm_rms"] < best.design["tuning_rbm_rms"]:
            best = tuned
    if best is None:
        raise ValueError(f"no candidate has a disk margin of {bench.tuning.disk_margin}")
    return best


def _tuned(bench: Bench, agent: LinearController, numbers: dict[str, float]) -> Tuned:
    """Numbers of the design with its margins and what it does behind the real stops."""
    metrics, margins = bench.measure(agent), stability(bench.model, agent.system)
    return Tuned(
        agent,
        numbers
        | {
            "spectral_radius": margins.spectral_radius,
            "disk_margin": bench.disk_margin(agent),
            "effectiveness_margin": min(margins.effectiveness_margin, LARGEST_EFFECTIVENESS),
            "tuning_rbm_rms": float(metrics.rbm_rms.mean()),
            "tuning_flap_angle_max": float(metrics.flap_angle_max.max()),
            "tuning_flap_rate_max": float(metrics.flap_rate_max.max()),
        },
    )


def _weights(candidate: LQGCandidate, rbm: float) -> Weights:
    return Weights(rbm, candidate.flap_angle, candidate.acceleration, candidate.measurement_noise)
