"""The pictures of docs/wind.md, what blade and lidar meet of a field: `python -m benchmarks.field FOLDER`.

Writes field.png: von Karman's field at the wind of the model nrel5mw-site, in time and as spectra. And lidar.png: what
a lidar's beams make of the mean over the disk at the site, in time and as coherence.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from flapgym.core.arrays import Array
from flapgym.core.atomic import write_picture
from flapgym.core.program import Parser, Work, run
from flapgym.evaluation import writable_folder
from flapgym.model import TurbineModel, load_model
from flapgym.model.nameplate import nameplate
from flapgym.wind import Kaimal, Lidar, VonKarman, disk_turbulence
from flapgym.wind.blade_field import blade_turbulence
from flapgym.wind.disk import annulus_weights
from flapgym.wind.field import harmonic_shares
from flapgym.wind.turbulence import Turbulence
from flapgym.wind.upwind import upwind_turbulence

BLADE, ROTOR, PALE = "#0b5394", "#c1651c", "#b7b7b7"
SPAN = np.array([0.1, 0.3, 0.5, 0.7, 0.9])
"""Middle of five rings of the same width, over the rotor's radius."""
SHOWN = 3
"""Of the rings, that of the blade's wind."""
DURATION, TIME_STEP = 40.0, 0.05
SEED = 1
HARMONICS = 40
"""Of the spectra: those beyond add less than a thousandth below 1 Hz."""
TEXT = 15
LIDARS = {
    "4 beams, 100 m": Lidar(range=100.0, radius=45.0),
    "4 beams, 200 m": Lidar(range=200.0, radius=45.0),
    "1 beam at the hub, 100 m": Lidar(range=100.0, radius=0.0, beams=1),
    "16 beams, frozen": Lidar(range=100.0, radius=45.0, beams=16, decay=0.0),
}
LIDAR_PERIOD = 400.0
"""Of the lidar's realisation [s]."""


def blade_and_rotor(model: TurbineModel) -> tuple[Array, Array, Array]:
    """Time (T,) [s]; wind (T,) [m/s] about the mean, that of the blade's point and the mean over the disk."""
    field, radii = _field(model), _radii(model)
    steps = round(DURATION / TIME_STEP) + 1
    prepared = disk_turbulence(field, radii, model.wind_speed, model.rotor_speed, TIME_STEP, steps)
    noise = np.random.default_rng(SEED).standard_normal(prepared.noise_count)
    wind = prepared.draw(noise, field.deviation(model.wind_speed))
    time = np.linspace(0.0, DURATION, steps)
    return time, wind.at(model.rotor_speed * time)[:, SHOWN], wind.rotor_average()


def spectra(model: TurbineModel, frequency: Array) -> tuple[Array, Array]:
    """One-sided spectra (F,) [m^2/s^2/Hz] of the same two at frequencies (F,) [Hz]."""
    field, radii, speed = _field(model), _radii(model), model.wind_speed
    turn = model.rotor_speed / (2.0 * np.pi)
    orders = np.arange(-HARMONICS, HARMONICS + 1)
    # A point that turns meets harmonic m about m times a turn.
    met = np.abs(frequency - turn * orders[:, None])
    ring = radii[SHOWN : SHOWN + 1]
    shares = harmonic_shares(field, ring, speed, met.ravel(), HARMONICS)[..., 0, 0]
    shares = shares.reshape(HARMONICS + 1, *met.shape)[np.abs(orders), np.arange(len(orders))]
    weights = radii / radii.sum()  # of rings of one width
    means = np.einsum("r,frs,s->f", weights, harmonic_shares(field, radii, speed, frequency, 1)[0], weights)
    variance = field.deviation(speed) ** 2
    blade = (shares * field.spectrum(met, speed)).sum(axis=0)
    return variance * blade, variance * means * field.spectrum(frequency, speed)


def _field(model: TurbineModel) -> Turbulence:
    return VonKarman().on_turbine(model.turbulence_intensity, model.length_scale, None)


def _radii(model: TurbineModel) -> Array:
    disk = nameplate(model.case).disk
    assert disk is not None  # of a shipped model
    return disk.radius * SPAN


def draw(path: Path) -> None:
    """Write the picture."""
    from matplotlib.figure import Figure

    model = load_model("nrel5mw-site")
    figure = Figure(figsize=(11.0, 4.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    time, blade, rotor = blade_and_rotor(model)
    left.plot(time, blade, color=BLADE, linewidth=1.6, label=f"blade at {SPAN[SHOWN]:g} R")
    left.plot(time, rotor, color=ROTOR, linewidth=2.6, label="mean over the disk")
    left.axhline(0.0, color=PALE, linewidth=0.8, zorder=0)
    left.set_xlim(0.0, DURATION)
    left.set_xlabel("time [s]", fontsize=TEXT)
    left.set_ylabel("wind about its mean [m/s]", fontsize=TEXT)
    frequency = np.geomspace(0.01, 1.0, 600)
    blade, rotor = spectra(model, frequency)
    right.loglog(frequency, blade, color=BLADE, linewidth=2.0, label=f"blade at {SPAN[SHOWN]:g} R")
    right.loglog(frequency, rotor, color=ROTOR, linewidth=2.6, label="mean over the disk")
    right.set_xlim(frequency[0], frequency[-1])
    right.set_ylim(1e-3, 2.0 * float(blade.max()))
    turn = model.rotor_speed / (2.0 * np.pi)
    for times in (1, 2, 3):
        right.axvline(times * turn, color=PALE, linewidth=1.0, zorder=0)
        right.text(
            times * turn, 1.02, f"{times}P", transform=right.get_xaxis_transform(), ha="center", fontsize=TEXT
        )
    right.set_xlabel("frequency [Hz]", fontsize=TEXT)
    right.set_ylabel(r"spectrum [m$^2$/s$^2$/Hz]", fontsize=TEXT)
    right.legend(loc="lower left", fontsize=TEXT, frameon=False)
    for axis in (left, right):
        axis.tick_params(labelsize=TEXT - 1)
        axis.spines[["top", "right"]].set_visible(False)
    write_picture(path, figure, dpi=110)


def lidar_and_rotor(lidar: Lidar) -> tuple[Array, Array, Array]:
    """Times of arrival (T,) [s]; u_0 of a lidar at the site (T,), and the mean over the disk at those times [m/s]."""
    model = load_model("nrel5mw-site")
    field = Kaimal(turbulence_class="B").on_turbine(None, None, nameplate(model.case).hub_height)
    blades = blade_turbulence(field, _radii(model), model.wind_speed, model.rotor_speed, LIDAR_PERIOD)
    upwind = upwind_turbulence(field, blades, model.wind_speed, model.rotor_speed, lidar)
    rng = np.random.default_rng(SEED)
    noise, own = rng.standard_normal(blades.noise_count), rng.standard_normal(upwind.noise_count)
    time = np.arange(round(3.0 * DURATION * lidar.sample_rate)) / lidar.sample_rate
    seen = lidar.projection * upwind.seen(noise, own, time, 0.0) @ lidar.estimator[0]
    waves = (blades.root[:, 0] @ blades.parts(noise)[:, 0, :, None])[..., 0] @ annulus_weights(_radii(model))
    mean = (np.exp(2j * np.pi * np.outer(time, blades.frequencies)) @ waves).real
    deviation = field.deviation(model.wind_speed)
    return time, deviation * seen, deviation * mean


def coherence(lidar: Lidar, frequency: Array) -> Array:
    """Of the mean of a lidar's beams with the mean over the disk at the site, at frequencies (F,) [Hz]."""
    model = load_model("nrel5mw-site")
    field = Kaimal(turbulence_class="B").on_turbine(None, None, nameplate(model.case).hub_height)
    speed, radii = model.wind_speed, _radii(model)
    rings = np.append(radii, lidar.radius)
    own = harmonic_shares(field, rings, speed, frequency, 1)[0]
    weights = annulus_weights(radii)
    chords = 2.0 * lidar.radius * np.sin(0.5 * lidar.azimuths)
    beams = field.coherence(field.decay(frequency, speed)[:, None] * chords).mean(axis=1)
    shared = (own[:, -1, :-1] @ weights) * lidar.likeness(frequency, speed)
    return np.asarray(shared**2 / (np.einsum("r,frs,s->f", weights, own[:, :-1, :-1], weights) * beams))


def draw_lidar(path: Path) -> None:
    """The picture of what a lidar sees, as a PNG."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(14, 4.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    time, seen, mean = lidar_and_rotor(LIDARS["4 beams, 100 m"])
    left.plot(time, mean, color=ROTOR, linewidth=2.6, label="mean over the disk")
    left.plot(time, seen, color=BLADE, linewidth=2.0, label="lidar, told 9 s before")
    left.set_xlabel("time of arrival [s]", fontsize=TEXT)
    left.set_ylabel("wind about the mean [m/s]", fontsize=TEXT)
    left.legend(loc="best", fontsize=TEXT, frameon=False)
    frequency = np.geomspace(2e-3, 0.5, 80)
    for (label, lidar), color in zip(LIDARS.items(), (BLADE, ROTOR, PALE, "#444444"), strict=True):
        right.semilogx(frequency, coherence(lidar, frequency), color=color, linewidth=2.2, label=label)
    right.set_ylim(0.0, 1.0)
    right.set_xlabel("frequency [Hz]", fontsize=TEXT)
    right.set_ylabel("coherence with the disk's mean", fontsize=TEXT)
    right.legend(loc="lower left", fontsize=TEXT - 4, frameon=False)
    for axis in (left, right):
        axis.tick_params(labelsize=TEXT - 1)
        axis.spines[["top", "right"]].set_visible(False)
    write_picture(path, figure, dpi=110)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns the exit code."""
    return run(_parser(), arguments)


def _door(options: argparse.Namespace) -> Work:
    folder = writable_folder(options.folder)

    def work() -> int:
        draw(folder / "field.png")
        draw_lidar(folder / "lidar.png")
        return 0

    return work


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="python -m benchmarks.field", description=(__doc__ or "").splitlines()[0])
    parser.set_defaults(door=_door, program="benchmarks.field")
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="for the picture, such as docs/figures")
    return parser


if __name__ == "__main__":
    sys.exit(main())
