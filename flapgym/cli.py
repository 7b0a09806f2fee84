"""The command `flapgym`: build a model, score the agents, say what a model file holds.

What a person gave is read and checked before any work; what is refused costs one line on standard error and exit
code 2.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NoReturn

import numpy as np
from tqdm import tqdm

from flapgym import __version__
from flapgym.aeroelastic import TurbineModel, load_model, save_model
from flapgym.aeroelastic.build import STAGES, build_model
from flapgym.control import AGENT_NAMES
from flapgym.evaluation import SCORED_SEED, as_text, compare
from flapgym.state_space import StateSpace
from flapgym.turbine import load_case


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code: 0, 2 for bad input, 130 when interrupted."""
    options = _parser().parse_args(arguments)
    run: Callable[[argparse.Namespace], None] = options.run
    try:
        run(options)
    except np.linalg.LinAlgError:
        raise  # a ValueError by its class, but a fault of the program
    except (ValueError, OSError) as error:
        print(f"flapgym {options.command}: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"flapgym {options.command}: interrupted; what was written before stays", file=sys.stderr)
        return 130
    return 0


class _Parser(argparse.ArgumentParser):
    """Refuses wrong arguments in one line, where argparse repeats the whole usage."""

    def error(self, message: str) -> NoReturn:
        print(f"{self.prog}: {message} (see {self.prog} --help)", file=sys.stderr)
        raise SystemExit(2)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="flapgym", description="Load alleviation with flaps on a wind turbine.")
    parser.add_argument("--version", action="version", version=f"flapgym {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    def command(name: str, run: Callable[[argparse.Namespace], None], text: str) -> argparse.ArgumentParser:
        sub = commands.add_parser(name, help=text, description=f"{text[0].upper()}{text[1:]}.")
        sub.set_defaults(run=run)
        return sub

    sub = command("compare", _compare, "score agents on the same turbulence, against open loop")
    sub.add_argument(
        "--agents",
        nargs="+",
        metavar="AGENT",
        default=AGENT_NAMES,
        help=f"shipped ones ({', '.join(AGENT_NAMES)}) or .json files; default: all shipped",
    )
    sub.add_argument(
        "--model", default="nrel5mw-rated", help="model file, or name of a shipped one; default: %(default)s"
    )
    sub.add_argument(
        "--realisations", type=int, metavar="N", default=5, help="signals of turbulence; default: %(default)s"
    )
    sub.add_argument(
        "--duration", type=float, metavar="SECONDS", help="of each; default: 20 length scales over wind speed"
    )
    sub.add_argument(
        "--seed",
        type=int,
        default=SCORED_SEED,
        help="of the first signal, the next follow; default: %(default)s",
    )
    sub.add_argument(
        "--output",
        metavar="DIR",
        default="results",
        help="folder for compare.json, .csv, .md and .png; default: %(default)s",
    )

    sub = command("build", _build, "build the model of a case and write it to a file")
    sub.add_argument("config", metavar="CONFIG", help="a case's TOML file, or a built-in one: nrel5mw-rated")
    sub.add_argument("--output", metavar="FILE", type=Path, required=True, help="the model file to write")

    sub = command("info", _info, "say what a model holds")
    sub.add_argument(
        "model",
        metavar="MODEL",
        nargs="?",
        default="nrel5mw-rated",
        help="model file, or name of a shipped one; default: %(default)s",
    )
    return parser


def _compare(options: argparse.Namespace) -> None:
    comparison = compare(
        agents=options.agents,
        model=options.model,
        realisations=options.realisations,
        seed=options.seed,
        duration=options.duration,
        output=options.output,
        progress=True,
    )
    print(as_text(comparison))
    print(f"\nwrote compare.* in {options.output}")


def _build(options: argparse.Namespace) -> None:
    case = load_case(options.config)
    _check_writable(options.output)
    with tqdm(total=len(STAGES), bar_format="{desc:<24}{bar:30} {n}/{total} {elapsed}") as bar:

        def begin(stage: str) -> None:
            bar.update(STAGES.index(stage) - bar.n)
            bar.set_description_str(stage)

        model = build_model(case, progress=begin)
        save_model(model, options.output)
        bar.update(len(STAGES) - bar.n)
    print(f"wrote {options.output}\n{describe(model)}")


def _info(options: argparse.Namespace) -> None:
    print(describe(load_model(options.model)))


def _check_writable(target: Path) -> None:
    """Refuse an output file that could not be written at the end."""
    if target.is_dir():
        raise ValueError(f"--output: expected a file, got the folder {target}")
    if not target.parent.is_dir():
        raise ValueError(f"--output: no folder {target.parent}; make it first")
    try:
        with tempfile.TemporaryFile(dir=target.parent):
            pass
    except OSError as error:
        raise ValueError(f"--output: cannot write in {target.parent} ({error.strerror})") from None


def describe(model: TurbineModel) -> str:
    """What a model holds, as text: operating point, size, steady gains and lightly damped modes."""
    turbine, blade, degree = model.turbine, model.blade, np.pi / 180.0
    gain = dict(zip(turbine.inputs, turbine.dc_gain()[turbine.outputs.index("rbm_0")], strict=True))
    limits = (model.flap_angle_limit, model.flap_rate_limit, model.acceleration_limit)
    angle, rate, acceleration = (value / degree for value in limits)
    lines = [
        f"model            {model.name} (format {model.format_version}, inputs {model.hash[:12]})",
        f"operating point  wind {model.wind_speed:g} m/s, rotor {model.rotor_speed:.4f} rad/s",
        f"turbulence       intensity {model.turbulence_intensity:.1%}, length scale {model.length_scale:g} m",
        f"time step        {model.time_step:g} s",
        f"flap             {angle:g} deg, {rate:g} deg/s, {acceleration:g} deg/s^2 to either side",
        f"turbine          {turbine.order} states, spectral radius {turbine.spectral_radius():.6f}",
        f"single blade     {blade.order} states, spectral radius {blade.spectral_radius():.6f}",
        f"root moment      {gain['wind'] / 1e6:.3f} MN m per m/s of wind, "
        f"{gain['flap_angle_0'] * degree / 1e6:.4f} MN m per deg of flap (steady, blades alike)",
        f"                 rms {model.rbm_rms / 1e6:.3f} MN m in that turbulence, flaps still",
        "lightly damped modes of the turbine in the fixed frame, below 5 Hz:",
        *(f"  {frequency:6.3f} Hz  {damping:6.2%}" for frequency, damping in lightly_damped(turbine)),
    ]
    return "\n".join(lines)


def lightly_damped(
    system: StateSpace, highest: float = 5.0, damping: float = 0.05
) -> list[tuple[float, float]]:
    """Frequency [Hz] and damping ratio of the oscillating modes below these bounds, by frequency."""
    poles = np.log(np.linalg.eigvals(system.A).astype(complex)) / system.time_step
    poles = poles[(poles.imag > 0.0) & (-poles.real < damping * np.abs(poles))]
    pairs = [(float(abs(pole) / (2 * np.pi)), float(-pole.real / abs(pole))) for pole in poles]
    return sorted(pair for pair in pairs if pair[0] < highest)
