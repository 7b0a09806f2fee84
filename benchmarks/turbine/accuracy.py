"""Reduced forms of the turbine against the march of every state, for gusts and flaps below 2 Hz.

The march keeps the azimuth-dependent joint and every circulation; the time-invariant form is the one every model file
holds, the table is the paper's A(theta).
"""

from __future__ import annotations

import numpy as np

from benchmarks.aerodynamics import table
from flapgym.aeroelastic.coupling import couple
from flapgym.aeroelastic.equations import periodic_equations, turbine_equations
from flapgym.aeroelastic.periodic import PeriodicModel, periodic_model
from flapgym.core.arrays import Array
from flapgym.core.multiblade import to_blades, to_components
from flapgym.core.state_space import StateSpace
from flapgym.wind import von_karman_spectrum
from reference.full import march_turbine
from studies.parts import Study, Tell

STEPS = 1500  # 10.5 s, two revolutions
AZIMUTH = 0.3  # of blade 1 at the start [rad]
REFRESH = 5
OUTPUTS = {
    "root moment": slice(0, 3),
    "tip": slice(3, 6),
    "tower fore-aft": slice(6, 7),
    "tower side-to-side": slice(7, 8),
}


def signals(study: Study, steps: int) -> dict[str, Array]:
    """Inputs (steps, 7) blade by blade, from rest: a gust of the turbulence's spectrum, and three unlike flaps.

    Ten sines of random phase between 0.2 and 2 Hz each, faded in over a second.
    """
    case, rng = study.case, np.random.default_rng(5)
    time = study.time_step * np.arange(steps)
    frequency = np.linspace(0.2, 2.0, 10)
    fade = 0.5 - 0.5 * np.cos(np.pi * np.clip(time, 0.0, 1.0))

    def sines(count: int, weight: Array) -> Array:
        phase = rng.uniform(0.0, 2.0 * np.pi, (count, len(frequency)))
        waves = np.sin(2.0 * np.pi * frequency * time[:, None, None] + phase)
        return np.asarray(fade[:, None] * (waves @ weight))

    turbulence = case.turbulence
    spectrum = von_karman_spectrum(
        frequency, case.operating_point.wind_speed, turbulence.intensity, turbulence.length_scale
    )
    gust, flaps = np.zeros((2, steps, 7))
    gust[:, 6] = sines(1, np.sqrt(2.0 * 0.2 * spectrum))[:, 0]
    flaps[:, :3] = sines(
        3, np.full(len(frequency), 0.3 * case.flaps[0].angle_limit / np.sqrt(len(frequency)))
    )
    flaps[:, 3:6] = np.gradient(flaps[:, :3], study.time_step, axis=0)
    return {"gust": gust, "flaps": flaps}


def table_of_azimuths(study: Study) -> PeriodicModel:
    """A(theta) for every step of a revolution: 734 matrices, 0.8 GB while it is made."""
    entries = round(2.0 * np.pi / (study.case.rotor_speed * study.time_step))
    return periodic_model(periodic_equations(study.parts), study.seen(0.0), study.time_step, entries)


def time_invariant(study: Study) -> StateSpace:
    """The multi-blade form."""
    return couple(turbine_equations(study.parts), study.seen(study.case.rotor_speed), study.time_step)


def on_blades(system: StateSpace, u: Array, speed: float) -> Array:
    """Outputs (T, 8) blade by blade of the time-invariant form for inputs (T, 7) blade by blade."""
    azimuth = AZIMUTH + speed * system.time_step * np.arange(len(u), dtype=np.float64)
    flap, rate = (to_components(u[:, first : first + 3], azimuth) for first in (0, 3))
    y = system.simulate(np.hstack([flap, rate, u[:, 6:]]))
    return np.hstack([to_blades(y[:, 0:3], azimuth), to_blades(y[:, 3:6], azimuth), y[:, 6:]])


def errors(ours: Array, full: Array) -> list[float]:
    """Rms error over rms, the worst of the blades, for each of OUTPUTS."""
    return [
        float(
            np.sqrt(((ours[:, of] - full[:, of]) ** 2).mean(axis=0) / (full[:, of] ** 2).mean(axis=0)).max()
        )
        for of in OUTPUTS.values()
    ]


def reduced_against_full(study: Study, azimuths: PeriodicModel, tell: Tell, steps: int = STEPS) -> None:
    """Print the table."""
    still = time_invariant(study)
    rows = []
    for name, u in signals(study, steps).items():
        tell(f"every state marched: {name}")
        full = march_turbine(study.parts, study.rotor, u, AZIMUTH)
        forms = {
            "time-invariant": on_blades(still, u, study.case.rotor_speed),
            "A(theta), every step": azimuths.simulate(u, AZIMUTH),
            f"A(theta), every {REFRESH} steps": azimuths.simulate(u, AZIMUTH, refresh=REFRESH),
        }
        for form, y in forms.items():
            rows.append([name, form, *(f"{100.0 * error:.3f}" for error in errors(y, full))])
    title = f"Rms error against the march of every state over {steps * study.time_step:.1f} s [%]"
    table(title, ["inputs", "form", *OUTPUTS], rows)
