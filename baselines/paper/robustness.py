"""Loads and margins of the linear loops off their design conditions, exact from Lyapunov equations."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from baselines.paper.cache import Cache, fingerprint
from baselines.tuning import LinearController
from flapgym.aeroelastic.model import TurbineModel
from flapgym.control import closed_loop, stability, stationary_rms
from flapgym.control.margins import delay_margin, disk_margin, late_measurement
from flapgym.state_space import Array, StateSpace

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
MARGINS = (
    "disk margin",
    "at [Hz]",
    "gain up to",
    "phase [deg]",
    "flap's effect up to",
    "delay up to [ms] (420 tried)",
)


def sensitivity(
    agent: LinearController,
    model: TurbineModel,
    others: Mapping[str, TurbineModel],
    cache: Cache,
    advanced: Callable[[str], None],
) -> tuple[Array, Array]:
    """Loads and stroke of the linear loop under each of ``CONDITIONS`` and on other turbines; then ``MARGINS``.

    Returns
    -------
    changes : (5, conditions + others) float
        Change of the moment's and the tip's rms against open loop on that turbine in the same wind, fractions; rms
        flap angle [rad]; NaN where the loop is unstable. Then frequency [Hz] and doubling time [s] of what grows
        fastest, NaN where nothing does.
    margins : (6,) float
        In the order of ``MARGINS``; infinite without bound.
    """
    system = agent.system
    mark = {"agent": fingerprint(system.A, system.B, system.C, system.D)}

    def changes() -> dict[str, Array]:
        cases: list[dict[str, float]] = [{"effectiveness": factor} for factor in EFFECTIVENESS]
        cases += [{"length_scale": length} for length in LENGTHS]
        cases += [{"measurement_noise": noise * model.rbm_rms} for noise in NOISES]
        columns = [_change(model, agent, 0, **case) for case in cases]
        columns += [_change(model, agent, delay) for delay in DELAYS]
        columns += [_change(other, agent, 0) for other in others.values()]
        return {"changes": np.array(columns).T}

    turbines = {"others": [other.hash for other in others.values()]}
    found = cache.arrays(f"sensitivity-{agent.name}", mark | turbines, changes)["changes"]
    advanced(agent.name)
    return found, margins(agent, model, cache)


def margins(agent: LinearController, model: TurbineModel, cache: Cache) -> Array:
    """``MARGINS`` of the full closed loop (6,), in their order; infinite without bound."""
    system = agent.system

    def make() -> dict[str, Array]:
        disk = disk_margin(model, system)
        found = [
            disk.alpha,
            disk.frequency,
            disk.gain[1],
            np.rad2deg(disk.phase),
            stability(model, system).effectiveness_margin,
            1e3 * model.time_step * delay_margin(model, system),
        ]
        return {"margins": np.array(found)}

    mark = {"agent": fingerprint(system.A, system.B, system.C, system.D)}
    return cache.arrays(f"margins-{agent.name}", mark, make)["margins"]


def growth(loop: StateSpace) -> tuple[float, float] | None:
    """Frequency [Hz] and doubling time [s] of the fastest growing mode; None if all decay."""
    values = np.linalg.eigvals(loop.A)
    fastest = values[np.abs(values).argmax()]
    if abs(fastest) < 1.0:
        return None
    rate = np.log(fastest + 0j) / loop.time_step
    return abs(rate.imag) / (2.0 * np.pi), float(np.log(2.0) / rate.real) if rate.real > 0.0 else np.inf


def _change(model: TurbineModel, agent: LinearController, delay: int, **case: float) -> list[float]:
    system = late_measurement(agent.system, delay, model.rotor_speed)
    grows = growth(closed_loop(model, system, case.get("effectiveness", 1.0)))
    if grows is not None:
        return [np.nan, np.nan, np.nan, *grows]
    reference = stationary_rms(model, length_scale=case.get("length_scale"))
    ours = stationary_rms(model, system, **case)  # type: ignore[arg-type]
    return [
        ours["rbm"] / reference["rbm"] - 1.0,
        ours["tip_deflection"] / reference["tip_deflection"] - 1.0,
        ours["flap_angle"],
        np.nan,
        np.nan,
    ]
