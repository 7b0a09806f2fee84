"""The site's model against the lattice with every circulation, in a field, shear and shadow, under gravity.

`python -m benchmarks.site` prints the table of docs/wind.md in Markdown. Some four minutes on one core, three marches
of 31 s.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence

import numpy as np
from scipy.constants import g as STANDARD_GRAVITY
from scipy.signal import butter, sosfiltfilt

from benchmarks.aerodynamics import table
from flapgym.aeroelastic.build import slow_wake
from flapgym.aeroelastic.coupling import couple, multiblade_aerodynamics
from flapgym.aeroelastic.equations import turbine_equations
from flapgym.core.arrays import Array
from flapgym.core.multiblade import blade_azimuths, to_components
from flapgym.core.program import Parser, Work, run
from flapgym.core.state_space import StateSpace, series
from flapgym.model import TurbineModel, load_model
from flapgym.model.nameplate import nameplate
from flapgym.model.signals import strip_inputs
from flapgym.turbine import load_case
from flapgym.wind import Inflow
from flapgym.wind.blade_field import blade_turbulence
from flapgym.wind.turbulence import Kaimal
from reference.by_azimuth import OUTPUTS
from reference.full import march_model_inputs, told_by_blade
from studies.parts import Study, reduce_rotor

NAME = "nrel5mw-site"
REVOLUTIONS = 6
"""Marched; during the first all that acts is faded in, and the others are compared."""
AZIMUTH = 0.3  # of blade 1 at the start [rad]
CUTOFF = 3.0  # Hz, of the comparison
PERIOD_STEPS = 40_000
"""After which the field repeats itself, 280 s."""
SEED = 1
INFLOW = Inflow(shear_exponent=0.2, tower_shadow=True)
TOLD = {
    "root moment": ("rbm_1", "rbm_2", "rbm_3"),
    "edgewise": ("rbm_edge_1", "rbm_edge_2", "rbm_edge_3"),
    "tip": ("tip_deflection_1", "tip_deflection_2", "tip_deflection_3"),
    "tower top fore-aft": ("tower_fore_aft",),
    "side-to-side": ("tower_side_side",),
    "tower base": ("tower_base_fore_aft",),
    "tower top's acceleration": ("tower_top_acceleration_fore_aft",),
}


def revolution(model: TurbineModel) -> int:
    """Steps of one."""
    return round(2.0 * np.pi / (model.rotor_speed * model.time_step))


def azimuths(model: TurbineModel, steps: int) -> Array:
    """Of blade 1 (T,) [rad]."""
    return AZIMUTH + model.rotor_speed * model.time_step * np.arange(steps, dtype=np.float64)


def field_winds(model: TurbineModel, steps: int) -> Array:
    """A drawn field in multi-blade components by strip (T, 3 R) [m/s]: its waves summed at every step."""
    field = Kaimal(turbulence_class="B", hub_height=nameplate(model.case).hub_height)
    period = PERIOD_STEPS * model.time_step
    turbulence = blade_turbulence(
        field, nameplate(model.case).strip_radii, model.wind_speed, model.rotor_speed, period
    )
    noise = np.random.default_rng(SEED).standard_normal(turbulence.noise_count)
    waves = turbulence.waves(noise) * field.deviation(model.wind_speed)
    summed = np.fft.ifft(waves, PERIOD_STEPS, axis=0, norm="forward").real
    return np.asarray(summed[:steps].reshape(steps, -1))


def inflow_winds(model: TurbineModel, steps: int) -> Array:
    """The same of shear and tower, which each blade meets on the disk itself."""
    disk, theta = nameplate(model.case).disk, azimuths(model, steps)
    assert disk is not None  # of a shipped model
    radii = nameplate(model.case).strip_radii
    met = [INFLOW.on_disk(radii, each, disk, model.wind_speed) for each in blade_azimuths(theta).T]
    components = to_components(np.stack(met, axis=-1), theta)
    return components.swapaxes(0, 1).reshape(steps, -1)


def actions(model: TurbineModel, steps: int) -> dict[str, Array]:
    """Inputs (T, nu) of the model for each that acts alone, faded in over the first revolution."""
    names = model.turbine.inputs
    fade = 0.5 - 0.5 * np.cos(np.pi * np.minimum(np.arange(steps) / revolution(model), 1.0))
    strips = [names.index(name) for name in strip_inputs(model.strips)]
    field, inflow, gravity = np.zeros((3, steps, len(names)))
    field[:, strips] = field_winds(model, steps)
    inflow[:, strips] = inflow_winds(model, steps)
    gravity[:, names.index("gravity")] = STANDARD_GRAVITY
    return {
        name: fade[:, None] * u
        for name, u in (("field", field), ("shear, shadow", inflow), ("gravity", gravity))
    }


def low_passed(signals: Array, time_step: float) -> Array:
    """Signals (T, n) below `CUTOFF`, their phase kept."""
    filtered = sosfiltfilt(butter(8, CUTOFF, fs=1.0 / time_step, output="sos"), signals, axis=0)
    return np.asarray(filtered)


def errors(modelled: Array, marched: Array) -> list[float]:
    """Rms of the difference over rms (both (T, 13)), the worst of the blades, for each of `TOLD`."""
    share = np.sqrt(((modelled - marched) ** 2).mean(axis=0) / (marched**2).mean(axis=0))
    return [float(share[[OUTPUTS.index(name) for name in names]].max()) for names in TOLD.values()]


def blade_by_blade(turbine: StateSpace, u: Array, azimuth: Array) -> Array:
    """Outputs (T, 13) of a turbine in multi-blade components, those and in the order of the march."""
    told = told_by_blade(turbine.outputs, turbine.simulate(u), azimuth)
    return np.stack([told[name] for name in OUTPUTS], axis=1)


def with_states(study: Study, states: int) -> StateSpace:
    """The site's turbine with so many states of each component of the lattice."""
    components = reduce_rotor(study.parts, study.rotor, states)
    aerodynamics = multiblade_aerodynamics(*components, study.case.rotor_speed, study.time_step)
    return series(
        slow_wake(study.parts), couple(turbine_equations(study.parts), aerodynamics, study.time_step)
    )


def marched(study: Study, given: dict[str, Array]) -> dict[str, Array]:
    """Outputs (T, 13) of the march for what acts alone."""
    return {name: march_model_inputs(study.parts, study.rotor, u, AZIMUTH) for name, u in given.items()}


def rows(
    model: TurbineModel, turbine: StateSpace, given: dict[str, Array], full: dict[str, Array]
) -> list[list[str]]:
    """Of the table, for what acts alone and together: errors about the trim and, in brackets, about the means."""
    first, azimuth = revolution(model), azimuths(model, len(full["field"]))
    pairs = {name: np.stack([blade_by_blade(turbine, u, azimuth), full[name]]) for name, u in given.items()}
    # All are linear: what acts together is the sum.
    pairs["all"] = np.sum(list(pairs.values()), axis=0)
    out = []
    for name, pair in pairs.items():
        ours, theirs = (low_passed(signals, model.time_step)[first:] for signals in pair)
        about = errors(ours - ours.mean(axis=0), theirs - theirs.mean(axis=0))
        whole = errors(ours, theirs)
        out.append([name, *(f"{100 * w:.2f} ({100 * a:.2f})" for w, a in zip(whole, about, strict=True))])
    return out


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns the exit code."""
    return run(_parser(), arguments)


def _door(options: argparse.Namespace) -> Work:
    def work() -> int:
        model, study = load_model(NAME), Study(load_case(NAME))
        given = actions(model, REVOLUTIONS * revolution(model))
        started = time.process_time()
        full = marched(study, given)
        cost = (time.process_time() - started) / (len(given) * len(full["field"]))
        head = ["what acts", *TOLD]
        table(f"Rms error of {NAME} against the march [%]", head, rows(model, model.turbine, given, full))
        twice = 2 * study.case.reduction.aerodynamic_states
        title = f"The same with {twice} states of each component of the lattice"
        table(title, head, rows(model, with_states(study, twice), given, full))
        print(f"\nThe march took {1e3 * cost:.1f} ms of one core a step.")
        return 0

    return work


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="python -m benchmarks.site", description=(__doc__ or "").splitlines()[0])
    parser.set_defaults(door=_door, program="benchmarks.site")
    return parser


if __name__ == "__main__":
    sys.exit(main())
