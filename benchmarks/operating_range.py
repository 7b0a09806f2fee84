"""The models from cut-in to cut-out: where each runs, how its rotor speed is held, and what the site's wind does to it.

`python -m benchmarks.operating_range PAGE` fills the tables of docs/range.md. Some ten minutes on one core.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.page import fill, table
from flapgym.aeroelastic.cache import cached_model
from flapgym.aeroelastic.trim import trim
from flapgym.control import OpenLoop
from flapgym.core.arrays import Array
from flapgym.core.atomic import write_atomically
from flapgym.core.program import Parser, Work, run
from flapgym.core.units import DEGREE
from flapgym.core.wording import number
from flapgym.envs.registration import ENVIRONMENTS
from flapgym.evaluation import Record, simulate
from flapgym.evaluation.metrics import damage_equivalent_load
from flapgym.model import ModelSet, TurbineModel, load_model_set
from flapgym.turbine import Case, load_case

NAME = "nrel5mw-range"
SEEDS = range(40, 46)
"""Of the winds, none of which is scored."""
DURATION = 600.0
BESIDE = (11.0, 15.0, 21.0)
"""Wind speeds at which the turbine is built with prescribed rotor speed, too [m/s]."""
SLOWEST, FASTEST = 0.2, 3.0
"""Between which the pole of the rotor's speed is looked for [rad/s]."""
OUTER = slice(4, None)
"""Strips of the outer two thirds of the blade."""


@dataclass(frozen=True)
class Point:
    """What is told of a model.

    Attributes
    ----------
    listed, pitch : float
        Collective pitch published and found [rad].
    thrust, power : float
        Of the trim [N, W].
    incidence : (strips,) float
        Of the sections [rad].
    pole : complex
        Of the rotor's speed [rad/s]; NaN where none oscillates.
    share_beyond : float
        Of the time in which the wind, as the mean over the rotor, departs by more than 0.3 of its mean.
    wind, speed, swing, swing_rate : float
        Rms of that wind over its mean, of rotor speed over its mean, of collective pitch and its rate [rad, rad/s].
    below_fine, too_fast : float
        Shares of the time in which the linear loop asks for pitch below zero, and faster than the actuator's limit.
    """

    wind_speed: float
    rotor_speed: float
    listed: float
    pitch: float
    thrust: float
    power: float
    incidence: Array
    pole: complex
    share_beyond: float
    wind: float
    speed: float
    swing: float
    swing_rate: float
    below_fine: float
    too_fast: float


def case_of(model: TurbineModel) -> Case:
    """What a model was built from."""
    return Case.from_dict(model.case)


def at_the_site() -> dict[str, Any]:
    """Wind and weight of the environment."""
    (keywords,) = (entry.keywords for entry in ENVIRONMENTS if entry.id == "flapgym/NREL5MWRange-v0")
    return {name: value for name, value in keywords.items() if name != "model"}


def speed_pole(model: TurbineModel) -> complex:
    """The least damped oscillation that the rotor's speed and the wind have most of, below blades and tower [rad/s]."""
    poles, shapes = np.linalg.eig(model.turbine.A)
    rates = np.log(poles.astype(complex)) / model.time_step
    row = model.turbine.C[model.turbine.outputs.index("rotor_speed")] @ shapes
    rms = np.abs(row) / np.linalg.norm(shapes, axis=0)
    mine = (rates.imag > SLOWEST) & (rates.imag < FASTEST) & (np.abs(rates) < FASTEST)
    if not mine.any():
        return complex("nan")
    return complex(rates[mine][int(np.argmax(rms[mine]))])


def point_of(model: TurbineModel) -> Point:
    """Trim, pole and ten minutes of six winds of a model, its flaps at rest."""
    case = case_of(model)
    listed = load_case(NAME).at_wind_speed(model.wind_speed).operating_point.pitch
    loads = trim(case).loads
    record = simulate(OpenLoop(), model, list(SEEDS), DURATION, **at_the_site())
    pitch = record.further["collective_pitch"]
    rate = np.diff(pitch, axis=1) / model.time_step
    actuator, mean = model.pitch_actuator, case.operating_point.pitch
    assert actuator is not None
    return Point(
        wind_speed=model.wind_speed,
        rotor_speed=model.rotor_speed,
        listed=listed,
        pitch=mean,
        thrust=loads.thrust,
        power=loads.power,
        incidence=loads.incidence,
        pole=speed_pole(model),
        share_beyond=float((np.abs(record.wind) > 0.3 * model.wind_speed).mean()),
        wind=float(record.wind.std()) / model.wind_speed,
        speed=float(record.further["rotor_speed"].std()) / model.rotor_speed,
        swing=float(pitch.std()),
        swing_rate=float(rate.std()),
        below_fine=float((mean + pitch < -1e-9).mean()) if mean > 0.0 else 0.0,
        too_fast=float((np.abs(rate) > actuator.rate_limit).mean()),
    )


def loads_of(record: Record) -> tuple[float, float, float, float]:
    """Rms and damage-equivalent load of the flapwise root moment, of the tower's base: means over all [N m]."""
    base = record.further["tower_base_fore_aft"]
    moments = np.moveaxis(record.rbm, -1, 1).reshape(-1, record.rbm.shape[1])
    return (
        float(moments.std(axis=1).mean()),
        float(np.mean([damage_equivalent_load(each, record.time_step) for each in moments])),
        float(base.std(axis=1).mean()),
        float(np.mean([damage_equivalent_load(each, record.time_step) for each in base])),
    )


def beside_prescribed(models: ModelSet) -> str:
    """What the loop changes: the same turbine with its rotor speed prescribed, in the same winds."""
    rows = []
    for wind_speed in BESIDE:
        model = models.at(wind_speed)
        case = case_of(model)
        told = tuple(
            name for name in case.signals.outputs if name in load_case("nrel5mw-site").signals.outputs
        )
        fixed = replace(
            case,
            name=f"{case.name}-prescribed",
            speed_control=None,
            signals=replace(case.signals, outputs=told),
        )
        found = [
            loads_of(simulate(OpenLoop(), each, list(SEEDS), DURATION, **at_the_site()))
            for each in (cached_model(fixed), model)
        ]
        rows.append(
            [number(wind_speed)]
            + [f"{before / 1e6:.2f}, {after / 1e6:.2f}" for before, after in zip(*found, strict=True)]
        )
    head = [
        "wind speed [m/s]",
        "RBM rms [MN m], prescribed, controlled",
        "RBM DEL",
        "tower base rms",
        "tower base DEL",
    ]
    return table(head, rows)


def tables(points: Sequence[Point]) -> dict[str, str]:
    """Those of the page, by name, but for `beside_prescribed`."""
    where = table(
        [
            "wind speed [m/s]",
            "rotor [rpm]",
            "pitch, listed [deg]",
            "thrust [kN]",
            "power [MW]",
            "incidence outside, inside [deg]",
        ],
        [
            [
                number(p.wind_speed),
                f"{p.rotor_speed * 30 / np.pi:.2f}",
                f"{p.pitch / DEGREE:.2f}, {p.listed / DEGREE:.2f}",
                f"{p.thrust / 1e3:.0f}",
                f"{p.power / 1e6:.2f}",
                f"{p.incidence[OUTER].min() / DEGREE:.1f} to {p.incidence[OUTER].max() / DEGREE:.1f}, "
                f"{p.incidence.max() / DEGREE:.1f}",
            ]
            for p in points
        ],
    )
    held = table(
        [
            "wind speed [m/s]",
            "speed's pole [Hz], damping",
            "wind rms [%]",
            "beyond 0.3 U [%]",
            "rotor speed rms [%]",
            "pitch rms [deg], rate [deg/s]",
            "pitch below zero [%]",
            "faster than its limit [%]",
        ],
        [
            [
                number(p.wind_speed),
                "-"
                if np.isnan(p.pole)
                else f"{abs(p.pole) / (2 * np.pi):.3f}, {-p.pole.real / abs(p.pole):.2f}",
                f"{100 * p.wind:.1f}",
                f"{100 * p.share_beyond:.1f}",
                f"{100 * p.speed:.1f}",
                f"{p.swing / DEGREE:.2f}, {p.swing_rate / DEGREE:.2f}",
                f"{100 * p.below_fine:.1f}",
                f"{100 * p.too_fast:.2f}",
            ]
            for p in points
        ],
    )
    return {"where": where, "held": held}


def _page(options: argparse.Namespace) -> Work:
    page = options.page.read_text()
    models = load_model_set(options.models)

    def work() -> int:
        points = []
        for model in models:
            points.append(point_of(model))
            print(f"{number(model.wind_speed)} m/s", file=sys.stderr)
        filled = fill(page, tables(points) | {"beside": beside_prescribed(models)})
        write_atomically(options.page, filled.encode())
        return 0

    return work


def main(arguments: Sequence[str] | None = None) -> int:
    """Fill the page's tables."""
    parser = Parser(
        prog="python -m benchmarks.operating_range", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("page", type=Path, help="docs/range.md")
    parser.add_argument("--models", default=NAME, help="set of models; default: %(default)s")
    parser.set_defaults(door=_page, program=parser.prog)
    return run(parser, arguments)


if __name__ == "__main__":
    sys.exit(main())
