"""Loads and margins of the linear loops off their design conditions, exact from Lyapunov equations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from baselines.cache import Cache, fingerprint
from baselines.scores import mark
from baselines.tuning import LinearController
from flapgym.control import closed_loop, growth_per_turn, peak_gain, periodic, stability, stationary_rms
from flapgym.control.channels import ROTOR
from flapgym.control.closed_loop import LARGEST_EFFECTIVENESS, with_effectiveness
from flapgym.control.growth import growth
from flapgym.control.margins import delay_margin, disk_margin, late_measurement
from flapgym.core.arrays import Array
from flapgym.core.state_space import StateSpace
from flapgym.model.turbine_model import TurbineModel

EFFECTIVENESS = (0.7, 1.0, 1.3)
LENGTHS = (73.5, 147.0, 340.0)
NOISES = (0.01, 0.05, 0.10)
DELAYS = (0, 1, 2, 3, 4, 5)

CONDITIONS = (
    *(f"flap x {factor:g}" for factor in EFFECTIVENESS),
    *(f"L {length:g} m" for length in LENGTHS),
    *(f"noise {100 * noise:g} %" for noise in NOISES),
    *(f"delay {delay}" for delay in DELAYS),
)
PERIODIC_CONDITIONS = ("as designed", "flap x 0.7", "flap x 1.3", "delay 5")
MARGINS = (
    "disk margin",
    "at [Hz]",
    "gain up to",
    "phase [deg]",
    "flap's effect up to",
    "more grows at [Hz]",
    "delay up to [ms]",
    "longer grows at [Hz]",
)
LONGEST = 60
"""Steps of delay tried."""


def sensitivity(
    agent: LinearController,
    model: TurbineModel,
    others: Mapping[str, TurbineModel],
    cache: Cache,
) -> Array:
    """Loads and stroke of the linear loop under each of ``CONDITIONS``, then on other turbines.

    Returns
    -------
    (5, conditions + others) float
        Change of the moment's and the tip's rms against open loop on that turbine in the same wind, fractions; rms
        flap angle [rad]; NaN where the loop is unstable. Then frequency [Hz] and doubling time [s] of what grows
        fastest, NaN where nothing does.
    """

    def changes() -> dict[str, Array]:
        cases: list[dict[str, float]] = [{"effectiveness": factor} for factor in EFFECTIVENESS]
        cases += [{"length_scale": length} for length in LENGTHS]
        cases += [{"measurement_noise": noise * model.rbm_rms} for noise in NOISES]
        columns = [_change(model, agent, 0, **case) for case in cases]
        columns += [_change(model, agent, delay) for delay in DELAYS]
        columns += [_change(other, agent, 0) for other in others.values()]
        return {"changes": np.array(columns).T}

    inputs = {
        "agent": mark(agent),
        "conditions": CONDITIONS,
        "others": [other.hash for other in others.values()],
    }
    return cache.arrays(f"sensitivity-{agent.name}", inputs, changes)["changes"]


def growths(
    agent: LinearController, model: TurbineModel, others: Mapping[str, TurbineModel], cache: Cache
) -> Array:
    """Growth over a turn of a loop that is periodic, under ``PERIODIC_CONDITIONS`` and then on other turbines."""

    def found() -> dict[str, Array]:
        late = late_measurement(agent.system, 5, model.rotor_speed)
        values = [growth_per_turn(model, agent.system)]
        values += [growth_per_turn(_with_effect(model, factor), agent.system) for factor in (0.7, 1.3)]
        values += [growth_per_turn(model, late)]
        values += [growth_per_turn(other, agent.system) for other in others.values()]
        return {"growth": np.array(values)}

    inputs = {
        "agent": mark(agent),
        "conditions": PERIODIC_CONDITIONS,
        "others": [other.hash for other in others.values()],
    }
    return cache.arrays(f"growth-{agent.name}", inputs, found)["growth"]


def margins(name: str, system: StateSpace, model: TurbineModel, cache: Cache) -> Array:
    """``MARGINS`` of the full closed loop (8,), in their order; infinite without bound, NaN where nothing grows.

    A controller in the blades' own frames, ROTOR's, has a periodic loop: lifted for the disk margin, and for the other
    two followed over turns, which does not tell the frequency.
    """
    turns = system.inputs == ROTOR.inputs

    def make() -> dict[str, Array]:
        disk = periodic.periodic_disk_margin(model, system) if turns else disk_margin(model, system)
        effect, delay = _periodic_limits(model, system) if turns else _limits(model, system)
        found = [disk.alpha, disk.frequency, disk.gain[1], np.rad2deg(disk.phase)]
        return {"margins": np.array([*found, *effect, *delay])}

    inputs = {
        "controller": fingerprint(system.A, system.B, system.C, system.D),
        "longest": LONGEST,
        "tolerance": peak_gain.TOLERANCE,
        "periodic": [periodic.HARMONICS, periodic.RESOLUTION, periodic.TOLERANCE],
    }
    return cache.arrays(f"margins-{name}", inputs, make)["margins"]


def _limits(model: TurbineModel, system: StateSpace) -> tuple[tuple[float, float], tuple[float, float]]:
    """Factor on the flap's effect and delay [ms] borne, each with the frequency of what grows beyond it [Hz].

    Of a loop that is unstable as it is both are 0, and the frequency is that of what grows in it.
    """
    effect = stability(model, system).effectiveness_margin
    delay = delay_margin(model, system, LONGEST)
    late = late_measurement(system, delay + 1, model.rotor_speed)
    unstable = growth(closed_loop(model, system))
    beyond = (
        unstable or growth(closed_loop(model, system, 1.02 * effect)),
        unstable or (None if delay == LONGEST else growth(closed_loop(model, late))),
    )
    first, second = (np.nan if one is None else one.frequency for one in beyond)
    return (_bounded(effect), first), (_late(model, delay), second)


def _periodic_limits(
    model: TurbineModel, system: StateSpace
) -> tuple[tuple[float, float], tuple[float, float]]:
    """The same of a periodic loop, the factor to a hundredth."""
    if growth_per_turn(model, system) >= 1.0:
        return (0.0, np.nan), (0.0, np.nan)
    low, high = 1.0, 1.25
    while high < LARGEST_EFFECTIVENESS and growth_per_turn(_with_effect(model, high), system) < 1.0:
        low, high = high, 1.25 * high
    while high - low > 0.01:
        middle = 0.5 * (low + high)
        stable = growth_per_turn(_with_effect(model, middle), system) < 1.0
        low, high = (middle, high) if stable else (low, middle)
    delay = 0
    while delay < LONGEST:
        late = late_measurement(system, delay + 1, model.rotor_speed)
        if growth_per_turn(model, late) >= 1.0:
            break
        delay += 1
    return (_bounded(low), np.nan), (_late(model, delay), np.nan)


def _bounded(factor: float) -> float:
    return factor if factor < LARGEST_EFFECTIVENESS else np.inf


def _late(model: TurbineModel, delay: int) -> float:
    """In milliseconds."""
    return 1e3 * model.time_step * delay if delay < LONGEST else np.inf


def _with_effect(model: TurbineModel, factor: float) -> TurbineModel:
    return replace(model, turbine=with_effectiveness(model.turbine, factor))


def _change(model: TurbineModel, agent: LinearController, delay: int, **case: float) -> list[float]:
    system = late_measurement(agent.system, delay, model.rotor_speed)
    grows = growth(closed_loop(model, system, case.get("effectiveness", 1.0)))
    if grows is not None:
        return [np.nan, np.nan, np.nan, grows.frequency, grows.doubling_time]
    reference = stationary_rms(model, length_scale=case.get("length_scale"))
    ours = stationary_rms(model, system, **case)  # type: ignore[arg-type]
    return [
        ours["rbm"] / reference["rbm"] - 1.0,
        ours["tip_deflection"] / reference["tip_deflection"] - 1.0,
        ours["flap_angle"],
        np.nan,
        np.nan,
    ]
