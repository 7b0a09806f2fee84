"""The linear turbine beside the non-linear beams: `python -m benchmarks.nonlinear [--only SCENARIO] [--duration S]`.

Prints the table of docs/nonlinear.md in Markdown. The non-linear series are kept in results/ as they grow
and continued from there; several scenarios may run side by side. A step of 7 ms takes some 12 ms on one core.
"""

from __future__ import annotations

import argparse
import hashlib
import io
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from flapgym.aeroelastic.blade_lattice import reduce_component
from flapgym.aeroelastic.build import assemble_parts
from flapgym.aeroelastic.coupling import multiblade_aerodynamics
from flapgym.control import Agent, OpenLoop, load_agent
from flapgym.control.agent import OBSERVATION_SCALES
from flapgym.core.arrays import Array
from flapgym.core.atomic import write_atomically
from flapgym.core.multiblade import to_blades, to_components
from flapgym.core.program import Parser, Work, real, run, whole
from flapgym.core.progress import ProgressBar
from flapgym.evaluation import writable_folder
from flapgym.evaluation.comparison import LONGEST
from flapgym.evaluation.metrics import damage_equivalent_load, root_mean_square
from flapgym.model import TurbineModel, load_model
from flapgym.plant.actuator import flap_step
from flapgym.turbine import load_case
from flapgym.wind import realise, von_karman_filter
from reference.nonlinear import nonlinear_turbine
from reference.nonlinear_march import NonlinearMarch

SCENARIOS = ("gust", "turbulence", "lqg")
RAMP = (
    5.0  # s over which turbulence grows, since the beams start from their steady state; scored from then on
)
GUST_SPEED, GUST_DURATION, GUST_RUN = 0.11, 5.0, 15.0  # m/s, s, s: one per cent of the mean wind
SEED = 20
PART = 200  # steps between two savings of the non-linear series
Step = Callable[[Array], Array]


@dataclass(eq=False)
class LinearMarch:
    """The shipped turbine stepped blade by blade, with the calls of `NonlinearMarch`."""

    model: TurbineModel
    _state: Array = field(init=False)
    _azimuth: float = field(init=False, default=0.0)

    def __post_init__(self) -> None:
        self._state = np.zeros(self.model.turbine.order)

    def step(self, inputs: Array) -> Array:
        """Return the outputs (8,) of a sample with flap angles, flap rates and wind (7,), and go on to the next."""
        system, azimuth = self.model.turbine, self._azimuth
        flaps = [to_components(inputs[part], azimuth) for part in (slice(0, 3), slice(3, 6))]
        u = np.concatenate([*flaps, inputs[6:]])
        y = system.C @ self._state + system.D @ u
        self._state = system.A @ self._state + system.B @ u
        self._azimuth += self.model.rotor_speed * self.model.time_step
        return np.concatenate([to_blades(y[:3], azimuth), to_blades(y[3:6], azimuth), y[6:]])


def nonlinear_march() -> NonlinearMarch:
    """The non-linear turbine of the shipped model's case."""
    case = load_case("nrel5mw-rated")
    parts, rotor = assemble_parts(case)
    collective, whirl = (
        reduce_component(rotor, parts.lattice, component, case.reduction.aerodynamic_states)
        for component in (0, 1)
    )
    on_rotor = multiblade_aerodynamics(collective, whirl, 0.0, case.discretisation.time_step)
    return NonlinearMarch(nonlinear_turbine(parts, on_rotor))


def wind_of(scenario: str, model: TurbineModel, duration: float, seed: int = SEED) -> Array:
    """Wind (T,) of a scenario [m/s]."""
    if scenario == "gust":
        time = model.time_step * np.arange(round(GUST_RUN / model.time_step))
        rise = 0.5 * GUST_SPEED * (1.0 - np.cos(2.0 * np.pi * time / GUST_DURATION))
        return np.where(time < GUST_DURATION, rise, 0.0)
    steps = round((RAMP + duration) / model.time_step)
    shaping = von_karman_filter(
        model.wind_speed, model.turbulence_intensity, model.length_scale, model.time_step
    )
    time = model.time_step * np.arange(steps)
    grown = 0.5 * (1.0 - np.cos(np.pi * np.minimum(time / RAMP, 1.0)))
    return grown * realise(shaping, steps, np.random.default_rng(seed))[0]


@dataclass(eq=False)
class Loop:
    """A turbine and an agent that acts on every sample; `series` (t, 11) are outputs and flap angles so far."""

    step: Step
    agent: Agent
    model: TurbineModel
    series: Array = field(default_factory=lambda: np.empty((0, 11)))
    angle: Array = field(default_factory=lambda: np.zeros(3))
    rate: Array = field(default_factory=lambda: np.zeros(3))
    state: Array | None = None

    def run(self, wind: Array) -> None:
        """Go on under further samples of the wind."""
        model, agent = self.model, self.agent
        flap = model.flaps[0]
        out = np.empty((len(wind), 11))
        for n in range(len(wind)):
            y = self.step(np.concatenate([self.angle, self.rate, wind[n : n + 1]]))
            out[n] = np.concatenate([y, self.angle])
            seen = {"rbm": y[:3], "flap_angle": self.angle, "flap_rate": self.rate}
            observation = np.concatenate([seen[name] / OBSERVATION_SCALES[name] for name in agent.observe])
            action, self.state = agent.predict(observation, self.state)
            acceleration = flap.acceleration_limit * action
            self.angle, self.rate, *_ = flap_step(
                self.angle, self.rate, acceleration, model.time_step, flap.angle_limit, flap.rate_limit
            )
        self.series = np.concatenate([self.series, out])


def beams_under(wind: Array, agent: Agent, model: TurbineModel, path: Path) -> Array:
    """Series (T, 11) of the non-linear turbine; kept in a file as it grows, and continued from there."""
    kept: dict[str, Array] = {}
    if path.exists():
        with np.load(path) as file:
            kept = dict(file)
        if len(kept["series"]) >= len(wind):
            return kept["series"][: len(wind)]
    march = nonlinear_march()
    loop = Loop(march.step, agent, model)
    if kept:
        march.restore(kept)
        loop.series, loop.angle, loop.rate = (kept[name] for name in ("series", "angle", "rate"))
        loop.state = kept["agent"] if kept["agent"].size else None
    with ProgressBar(total=len(wind), initial=len(loop.series), desc=path.stem, mininterval=2.0) as bar:
        while (done := len(loop.series)) < len(wind):
            loop.run(wind[done : done + PART])
            held = np.empty(0) if loop.state is None else loop.state
            own: dict[str, Any] = {
                "series": loop.series,
                "angle": loop.angle,
                "rate": loop.rate,
                "agent": held,
            }
            buffer = io.BytesIO()
            np.savez_compressed(buffer, **{**own, **march.snapshot()})
            path.parent.mkdir(exist_ok=True)
            write_atomically(path, buffer.getvalue())
            bar.update(len(loop.series) - done)
    return loop.series


def pair(scenario: str, model: TurbineModel, duration: float, seed: int, folder: Path) -> tuple[Array, Array]:
    """Scored series (T, 11) of the linear and of the non-linear turbine."""
    agent: Agent = load_agent("lqg", model) if scenario == "lqg" else OpenLoop()
    wind = wind_of(scenario, model, duration, seed)
    linear = Loop(LinearMarch(model).step, agent, model)
    linear.run(wind)
    # The linear turbine's answer knows model, agent and wind: a change of any of them begins another file.
    known = hashlib.sha256(linear.series[:PART].tobytes()).hexdigest()[:12]
    beams = beams_under(wind, agent, model, folder / f"nonlinear-{scenario}-{known}.npz")
    first = 0 if scenario == "gust" else round(RAMP / model.time_step)
    return linear.series[first:], beams[first:]


def measures(series: Array, time_step: float) -> dict[str, float]:
    """Rms and damage-equivalent load of a series, mean over the blades, in displayed units."""
    loads = [damage_equivalent_load(blade, time_step) for blade in series[:, :3].T]
    return {
        "RBM rms [MN m]": 1e-6 * float(root_mean_square(series[:, :3], axis=0).mean()),
        "RBM DEL [MN m]": 1e-6 * float(np.mean(loads)),
        "tip rms [m]": float(root_mean_square(series[:, 3:6], axis=0).mean()),
        "tower fore-aft rms [m]": float(root_mean_square(series[:, 6])),
        "tower side-to-side rms [m]": float(root_mean_square(series[:, 7])),
        "mean RBM [MN m]": 1e-6 * float(series[:, :3].mean()),
        "flap angle rms [deg]": float(np.rad2deg(root_mean_square(series[:, 8:], axis=0).mean())),
    }


COLUMNS = {
    "RBM rms [MN m]": slice(0, 3),
    "tip rms [m]": slice(3, 6),
    "tower fore-aft rms [m]": slice(6, 7),
    "tower side-to-side rms [m]": slice(7, 8),
    "flap angle rms [deg]": slice(8, 11),
}


def table(scenario: str, linear: Array, beams: Array, time_step: float) -> str:
    """Rows of the table: linear, non-linear, their difference, and the rms of the difference of the two series."""
    ours, theirs = measures(linear, time_step), measures(beams, time_step)
    rows = []
    for name, value in ours.items():
        if name == "flap angle rms [deg]" and value == 0.0:
            continue
        change, apart = f"{100.0 * (theirs[name] / value - 1.0):+.2f}", ""
        if name in COLUMNS:
            error = root_mean_square((beams - linear)[:, COLUMNS[name]].ravel())
            apart = f"{100.0 * error / root_mean_square(linear[:, COLUMNS[name]].ravel()):.2f}"
        if name.startswith("mean"):
            change = ""
        rows.append(f"| {scenario} | {name} | {value:.4g} | {theirs[name]:.4g} | {change} | {apart} |")
    return "\n".join(rows)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns the exit code."""
    return run(_parser(), arguments)


def _door(options: argparse.Namespace) -> Work:
    model, folder = load_model("nrel5mw-rated"), writable_folder(options.output)

    def work() -> int:
        print("| scenario | measure | linear | non-linear | difference [%] | rms of difference [%] |")
        print("|---|---|---|---|---|---|")
        for scenario in [options.only] if options.only else SCENARIOS:
            linear, beams = pair(scenario, model, options.duration, options.seed, folder)
            print(table(scenario, linear, beams, model.time_step), flush=True)
        return 0

    return work


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="python -m benchmarks.nonlinear", description=__doc__)
    parser.set_defaults(door=_door, program="benchmarks.nonlinear")
    parser.add_argument("--only", choices=SCENARIOS, help="one scenario instead of all")
    parser.add_argument(
        "--duration", type=real(1.0, LONGEST, "s"), default=60.0, help="scored seconds of turbulence"
    )
    parser.add_argument("--seed", type=whole(0), default=SEED, help="of the turbulence")
    parser.add_argument("--output", type=Path, default=Path("results"), help="folder of the kept series")
    return parser


if __name__ == "__main__":
    sys.exit(main())
