"""The command `flapgym`: build a model, score the agents, say what a model file holds.

Each command has a door, where everything a person gave is read and checked, and behind it the work. What is
refused at the door costs one line on standard error and exit code 2, and nothing has been touched.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import shutil
import sys
import tempfile
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from flapgym import __version__
from flapgym.aerodynamics.report import describe_aerodynamics
from flapgym.aeroelastic.cache import COMPLETE_STAGES, cached_model, cached_path
from flapgym.aeroelastic.operating import operating_case
from flapgym.control import AGENT_NAMES, FIELD_AGENT_NAMES, INDIVIDUAL_PITCH, INDIVIDUAL_PITCH_2P
from flapgym.core import program
from flapgym.core.atomic import check_target
from flapgym.core.program import Work, real, whole
from flapgym.core.progress import ProgressBar
from flapgym.core.state_space import StateSpace
from flapgym.core.wording import number, one_line
from flapgym.evaluation import (
    SCORED_SEED,
    as_text,
    lifetime_text,
    plan,
    plan_lifetime,
    run,
    run_lifetime,
    writable_folder,
    write_lifetime,
    write_report,
)
from flapgym.evaluation.comparison import LARGEST_SEED, LONGEST, MOST_REALISATIONS, STEEPEST
from flapgym.evaluation.lifetime_report import FILES as LIFETIME_FILES
from flapgym.evaluation.lifetime_study import DEFAULT_MODELS, DURATION, LONGEST_LIFE, MOST_SEEDS, SEEDS, YEARS
from flapgym.evaluation.metrics import FATIGUE_SLOPE
from flapgym.evaluation.report import FILES
from flapgym.evaluation.series import check_series, write_series
from flapgym.evaluation.tables import WIDTH
from flapgym.model import DEFAULT_MODEL, ModelSet, TurbineModel, load_model, save_model, save_model_set
from flapgym.model.nameplate import nameplate
from flapgym.structure.mode_plot import plot_modes
from flapgym.structure.modes import modes_table
from flapgym.structure.report import describe_modes
from flapgym.turbine import BUILT_IN, DEFAULT_CASE, Case, load_case
from flapgym.wind.iec import REFERENCE_INTENSITIES, REFERENCE_SPEEDS

PICTURES = (".pdf", ".png", ".svg")
NARROWEST = 80
"""Columns of a terminal to which the table is broken at most."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code: 0, 1 (not written), 2 (bad input) or 130 (interrupted)."""
    return program.run(_parser(), arguments)


def _parser() -> argparse.ArgumentParser:
    parser = program.Parser(prog="flapgym", description="Load alleviation with flaps on a wind turbine.")
    parser.add_argument("--version", action="version", version=f"flapgym {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, door, takes, text in (
        ("compare", _compare, _takes_comparison, "score agents on the same turbulence, against open loop"),
        (
            "lifetime",
            _lifetime,
            _takes_lifetime,
            "score agents over a turbine's life: every wind speed, weighted with how often it blows",
        ),
        ("build", _build, _takes_build, "build the model of a case and write it to a file"),
        ("aero", _aero, _takes_case, "print mean loads and gains of a case's vortex lattice"),
        (
            "modes",
            _modes,
            _takes_modes,
            "print the turbine's natural modes, nrel5mw's beside Table 1 of the paper",
        ),
        ("info", _info, _takes_model, "say what a model holds"),
    ):
        sub = commands.add_parser(name, help=text, description=f"{text[0].upper()}{text[1:]}.")
        sub.set_defaults(door=door, program=f"flapgym {name}")
        takes(sub)
    return parser


def _takes_comparison(sub: argparse.ArgumentParser) -> None:
    sub.add_argument(
        "--agents",
        nargs="+",
        metavar="AGENT",
        default=AGENT_NAMES,
        help=f"shipped ones ({', '.join(AGENT_NAMES)}), those for a field ({', '.join(FIELD_AGENT_NAMES)}), "
        f".json files, {INDIVIDUAL_PITCH} or {INDIVIDUAL_PITCH_2P} where blades pitch, either with +lqg and so on "
        "behind it; default: the first",
    )
    sub.add_argument(
        "--model",
        help="model file, or name of a shipped one, or a set of models over wind speed; default: the environment's, "
        f"or {DEFAULT_MODEL}",
    )
    sub.add_argument(
        "--env",
        dest="environment",
        metavar="ID",
        help="an environment's model, wind, sensors and actuators, as flapgym/NREL5MWSite-v0",
    )
    sub.add_argument(
        "--wind-speed",
        type=real(1.0, 100.0, "m/s"),
        metavar="M/S",
        help="which model of a set",
    )
    sub.add_argument(
        "--turbulence-intensity",
        type=_fraction,
        metavar="FRACTION",
        help="of the turbulence, as 0.14 or 14%%; default: the environment's",
    )
    sub.add_argument(
        "--length-scale",
        type=real(1.0, 1e4, "m"),
        metavar="METRES",
        help="of von Karman's turbulence; default: the environment's",
    )
    sub.add_argument(
        "--wind",
        metavar="FILE",
        help="in place of turbulence and gust: a recording (CSV), or a box (.bts, NetCDF, HAWC2 with the next two)",
    )
    sub.add_argument(
        "--box-shape",
        nargs=3,
        type=whole(2, 1 << 20),
        metavar=("NX", "NY", "NZ"),
        help="points of a HAWC2 box along the wind, to the left and up",
    )
    sub.add_argument(
        "--box-spacing",
        nargs=3,
        type=real(1e-3, 1e4, "m"),
        metavar=("DX", "DY", "DZ"),
        help="their distances in metres",
    )
    sub.add_argument(
        "--realisations",
        type=whole(1, MOST_REALISATIONS),
        metavar="N",
        default=5,
        help="signals of turbulence; default: %(default)s",
    )
    sub.add_argument(
        "--duration",
        type=real(1.0, LONGEST, "s"),
        metavar="SECONDS",
        help="of each; default: 20 length scales over wind speed, or what a file of wind lasts",
    )
    sub.add_argument(
        "--seed",
        type=whole(0, LARGEST_SEED),
        default=SCORED_SEED,
        help="of the first signal, the next follow; default: %(default)s",
    )
    sub.add_argument(
        "--output",
        metavar="DIR",
        default="results",
        help="folder for compare.json, .csv, .md and .png; default: %(default)s",
    )
    sub.add_argument(
        "--save-series",
        metavar="FILE.nc",
        help="every plant sample of all agents as NetCDF (needs flapgym[series])",
    )
    sub.add_argument(
        "--slope",
        type=real(1.0, STEEPEST),
        metavar="M",
        default=FATIGUE_SLOPE,
        help="S-N slope of the scored damage-equivalent load; default: %(default)g",
    )
    sub.add_argument(
        "--channels",
        action="store_true",
        help="score every load channel, too, at S-N slopes from 3 to 12: a second table",
    )


def _takes_lifetime(sub: argparse.ArgumentParser) -> None:
    sub.set_defaults(kept="finished wind speeds are kept, and the next run takes them up")
    sub.add_argument(
        "--agents",
        nargs="+",
        metavar="AGENT",
        help=f"shipped ones ({', '.join(AGENT_NAMES)}), .json files, {INDIVIDUAL_PITCH}, {INDIVIDUAL_PITCH}+lqg and so "
        "on; default: all shipped, and individual pitch where the blades pitch",
    )
    sub.add_argument(
        "--models",
        metavar="SET",
        default=DEFAULT_MODELS,
        help="file of a turbine's models at several wind speeds, or name of a shipped set; default: %(default)s",
    )
    sub.add_argument(
        "--wind-speeds",
        nargs="+",
        type=real(0.0, 100.0, "m/s"),
        metavar="SPEED",
        help="some of the models' [m/s]; default: all",
    )
    sub.add_argument(
        "--seeds",
        type=whole(1, MOST_SEEDS),
        metavar="N",
        default=SEEDS,
        help="realisations at each wind speed; default: %(default)s",
    )
    sub.add_argument(
        "--seed", type=whole(0, LARGEST_SEED), default=SCORED_SEED, help="of the first; default: %(default)s"
    )
    sub.add_argument(
        "--duration",
        type=real(10.0, LONGEST, "s"),
        metavar="SECONDS",
        default=DURATION,
        help="of each; default: %(default)s",
    )
    sub.add_argument(
        "--class",
        dest="turbulence_class",
        choices=tuple(REFERENCE_INTENSITIES),
        default="B",
        help="of the turbulence; default: %(default)s",
    )
    sub.add_argument(
        "--wind-class",
        choices=tuple(REFERENCE_SPEEDS),
        default="II",
        help="of the yearly wind, a mean of 10, 8.5 or 7.5 m/s; default: %(default)s",
    )
    sub.add_argument(
        "--years",
        type=real(0.01, LONGEST_LIFE, "years"),
        default=YEARS,
        help="the life; default: %(default)s",
    )
    sub.add_argument(
        "--output",
        metavar="DIR",
        default="results",
        help="folder for lifetime.json, .csv, .md and .png, and for what an interrupted run has found; "
        "default: %(default)s",
    )
    sub.add_argument(
        "--save-series",
        metavar="DIR",
        help="folder for every plant sample of each realisation as NetCDF, some 10 MB each (needs flapgym[series])",
    )


def _takes_build(sub: argparse.ArgumentParser) -> None:
    known = ", ".join(BUILT_IN["case"])
    sub.add_argument("config", metavar="CONFIG", help=f"a case's TOML file, or a built-in one: {known}")
    sub.add_argument("--output", metavar="FILE", type=Path, required=True, help="the model file to write")
    sub.add_argument(
        "--wind-speeds",
        metavar="M/S",
        nargs="+",
        type=real(0.1, 100.0, "m/s"),
        help="build a set of models, one at each of these wind speeds of the case's schedule",
    )


def _takes_case(sub: argparse.ArgumentParser) -> None:
    sub.add_argument(
        "config",
        metavar="CONFIG",
        nargs="?",
        default=DEFAULT_CASE,
        help="a case's TOML file, or a built-in one; default: %(default)s",
    )


def _takes_modes(sub: argparse.ArgumentParser) -> None:
    _takes_case(sub)
    sub.add_argument(
        "--blade-elements",
        type=int,
        metavar="N",
        help="12, or one less than the turbine's documented stations (48 for nrel5mw); default: the case's",
    )
    sub.add_argument("--rotating", action="store_true", help="the turning rotor, not the parked one")
    sub.add_argument("--json", action="store_true", help="print a list of modes in JSON, frequencies in Hz")
    sub.add_argument(
        "--plot",
        metavar="FILE",
        nargs="?",
        type=Path,
        const=Path("modes.png"),
        help="draw the parked turbine's mode shapes to a file; default: %(const)s",
    )


def _takes_model(sub: argparse.ArgumentParser) -> None:
    sub.add_argument(
        "model",
        metavar="MODEL",
        nargs="?",
        default=DEFAULT_MODEL,
        help="model file, or name of a shipped one; default: %(default)s",
    )


def _fraction(text: str) -> float:
    """For an argument's `type`: a fraction, also in percent."""
    share = text.strip().removesuffix("%")
    try:
        return real(0.0, 0.99)(text if share == text.strip() else repr(float(share) / 100.0))
    except (ValueError, argparse.ArgumentTypeError):
        raise argparse.ArgumentTypeError(
            f"expected a fraction from 0 to 0.99, such as 0.14 or 14%, got {one_line(text, 60)}"
        ) from None


def _compare(options: argparse.Namespace) -> Work:
    planned = plan(
        agents=options.agents,
        model=options.model,
        realisations=options.realisations,
        seed=options.seed,
        duration=options.duration,
        channels=options.channels,
        environment=options.environment,
        wind_speed=options.wind_speed,
        turbulence_intensity=options.turbulence_intensity,
        length_scale=options.length_scale,
        wind=options.wind,
        box_shape=options.box_shape,
        box_spacing=options.box_spacing,
        slope=options.slope,
        series=options.save_series is not None,
    )
    series = None if options.save_series is None else check_series(planned, options.save_series)
    folder = writable_folder(options.output, FILES)

    def work() -> int:
        comparison = run(planned, progress=True)
        write_report(comparison, folder)
        wrote = f"wrote compare.* in {folder}"
        if series is not None:
            write_series(comparison, series)
            wrote += f" and {series}"
        print(f"{as_text(comparison, _width())}\n\n{wrote}")
        return 0

    return work


def _width() -> int:
    """Columns for tables: as many as the screen has, but no fewer than a table bears."""
    return max(NARROWEST, shutil.get_terminal_size((WIDTH, 0)).columns)


def _lifetime(options: argparse.Namespace) -> Work:
    study = plan_lifetime(
        agents=options.agents,
        models=options.models,
        wind_speeds=options.wind_speeds,
        seeds=options.seeds,
        seed=options.seed,
        duration=options.duration,
        turbulence_class=options.turbulence_class,
        wind_class=options.wind_class,
        years=options.years,
        save_series=options.save_series,
    )
    folder = writable_folder(options.output, LIFETIME_FILES)

    def work() -> int:
        life = run_lifetime(study, progress=True, folder=folder)
        write_lifetime(life, folder)
        print(f"{lifetime_text(life, _width())}\n\nwrote lifetime.* in {folder}")
        return 0

    return work


def _build(options: argparse.Namespace) -> Work:
    case = load_case(options.config)
    _check_writable(options.output)
    if options.wind_speeds is not None:
        return _build_set(case, options)

    def work() -> int:
        if case.blades.unequal:
            names = ", ".join(f"blades.{name}" for name in case.blades.unequal)
            print(f"{names}: blades differ, the model takes its periodic form", file=sys.stderr)
        stages, begun = COMPLETE_STAGES, list[str]()
        with ProgressBar(total=len(stages), bar_format="{desc:<24}{bar:30} {n}/{total} {elapsed}") as bar:

            def begin(stage: str) -> None:
                begun.append(stage)
                bar.update(stages.index(stage) - bar.n)
                bar.set_description_str(stage)

            model = cached_model(case, progress=begin)
            save_model(model, options.output)
            bar.update(len(stages) - bar.n)
        if not begun:
            print(f"built before, copied from the cache: {cached_path(case)}", file=sys.stderr)
        print(f"wrote {options.output}\n{describe(model)}")
        return 0

    return work


def _build_set(case: Case, options: argparse.Namespace) -> Work:
    speeds = sorted(options.wind_speeds)
    for slower, faster in pairwise(speeds):
        if slower == faster:
            raise ValueError(f"--wind-speeds: expected each once, got {number(slower)} m/s twice")
    for speed in speeds:
        case.at_wind_speed(speed)  # refuses what the schedule does not reach

    def work() -> int:
        models = []
        with ProgressBar(total=len(speeds), bar_format="{desc:<24}{bar:30} {n}/{total} {elapsed}") as bar:
            for speed in speeds:
                bar.set_description_str(f"{number(speed)} m/s")
                models.append(cached_model(operating_case(case, speed)))
                bar.update(1)
        save_model_set(ModelSet.of(models), options.output)
        print(
            f"wrote {options.output}: {len(models)} models of {case.name}, {', '.join(map(number, speeds))} m/s"
        )
        return 0

    return work


def _aero(options: argparse.Namespace) -> Work:
    case = load_case(options.config).alike()

    def work() -> int:
        print(f"turbine          {nameplate(case.to_dict()).size}\n{describe_aerodynamics(case)}")
        return 0

    return work


def _modes(options: argparse.Namespace) -> Work:
    case = load_case(options.config).alike()
    turbine = case.turbine
    elements = (
        case.discretisation.blade_elements if options.blade_elements is None else options.blade_elements
    )
    turbine.blade_sections(elements)  # refuses a number of elements it has no sections for
    speed = case.rotor_speed if options.rotating else 0.0
    if options.plot is not None:
        if options.rotating:
            raise ValueError("--plot: draws the parked turbine; leave out --rotating")
        if options.plot.suffix not in PICTURES:
            raise ValueError(
                f"--plot: expected a file that ends in {', '.join(PICTURES)}, got {options.plot}"
            )
        if importlib.util.find_spec("matplotlib") is None:
            raise ValueError("--plot: matplotlib is not installed (pip install 'flapgym[baselines]')")
        _check_writable(options.plot, "--plot")

    def work() -> int:
        if options.json:
            print(json.dumps(modes_table(turbine, elements, speed), indent=2))
        else:
            print(describe_modes(turbine, elements, speed))
        if options.plot is not None:
            plot_modes(turbine, options.plot, elements)
            print(f"wrote {options.plot}", file=sys.stderr)
        return 0

    return work


def _info(options: argparse.Namespace) -> Work:
    model = load_model(options.model)

    def work() -> int:
        print(describe(model))
        return 0

    return work


def _check_writable(target: Path, option: str = "--output") -> None:
    """Refuse an output file that could not be written at the end."""
    try:
        real = check_target(target)
        with tempfile.TemporaryFile(dir=real.parent):  # a file system may be read-only or full
            pass
    except OSError as error:
        raise ValueError(f"{option}: {error.strerror or error}") from None


def describe(model: TurbineModel) -> str:
    """What a model holds, as text: turbine, operating point, size, steady gains, modes, and how it was made."""
    turbine, blade, record, degree = model.turbine, model.blade, model.record, np.pi / 180.0
    plate = nameplate(model.case)
    spans = [", from {:.1%} to {:.1%} of the rotor radius".format(*span) for span in plate.flap_spans] or [
        ""
    ] * len(model.flaps)
    gain = dict(zip(turbine.inputs, turbine.dc_gain()[turbine.outputs.index("rbm_0")], strict=True))
    lines = [
        f"model            {model.name} (format {model.format_version}, hash {model.hash[:12]})",
        f"turbine          {plate.size}",
        f"operating point  wind {number(model.wind_speed)} m/s, rotor {model.rotor_speed:.4f} rad/s",
        f"turbulence       intensity {model.turbulence_intensity:.1%}, length scale {number(model.length_scale)} m",
        f"time step        {number(model.time_step)} s",
        f"form             {model.form}",
        f"airloads         {plate.loads}",
        *(
            f"{flap.name:<17}{number(flap.angle_limit / degree)} deg, {number(flap.rate_limit / degree)} deg/s, "
            f"{number(flap.acceleration_limit / degree)} deg/s^2 to either side{span}"
            for flap, span in zip(model.flaps, spans, strict=True)
        ),
        f"whole turbine    {turbine.order} states, spectral radius {turbine.spectral_radius():.6f}",
        f"single blade     {blade.order} states, spectral radius {blade.spectral_radius():.6f}",
        f"root moment      {gain['wind'] / 1e6:.3f} MN m per m/s of wind, "
        + ", ".join(
            f"{gain[f'{flap.name}_angle_0'] * degree / 1e6:.4f} MN m per deg of {flap.name}"
            for flap in model.flaps
        )
        + " (steady, blades alike)",
        f"                 rms {model.rbm_rms / 1e6:.3f} MN m in that turbulence, flaps still",
        f"flutter          {record.flutter.describe() if record.flutter else 'not looked for'}",
        "lightly damped modes of the turbine in the fixed frame, below 5 Hz:",
        *(f"  {frequency:6.3f} Hz  {damping:6.2%}" for frequency, damping in lightly_damped(turbine)),
        f"built by         {', '.join(f'{name} {version}' for name, version in sorted(record.tools.items()))}",
        *(f"error            {name}: {value:.1e}" for name, value in sorted(record.errors.items())),
        *(f"reading          {reading}" for reading in record.readings),
    ]
    return "\n".join(lines)


def lightly_damped(
    system: StateSpace, highest: float = 5.0, damping: float = 0.05
) -> list[tuple[float, float]]:
    """Frequency [Hz] and damping ratio of the oscillating modes below these bounds, by frequency."""
    values = np.linalg.eigvals(system.A).astype(complex)
    poles = (
        np.log(values[values != 0.0]) / system.time_step
    )  # a delay is a pole at zero, which does not oscillate
    poles = poles[(poles.imag > 0.0) & (-poles.real < damping * np.abs(poles))]
    pairs = [(float(abs(pole) / (2 * np.pi)), float(-pole.real / abs(pole))) for pole in poles]
    return sorted(pair for pair in pairs if pair[0] < highest)
