"""Campbell and damping diagram of the turning turbine over tip-speed ratio at the case's wind."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.aerodynamics import table
from benchmarks.turbine.accuracy import time_invariant
from flapgym.core.atomic import write_picture
from reference.damping import CoupledMode, coupled_modes
from studies.parts import Study, Tell

TIP_SPEED_RATIOS = (4.0, 5.0, 6.0, 7.0, 8.0, 9.0)
TOWER_MODES = 6
LIGHT = 2.6  # damping ratio [%] up to which a mode is drawn in the panel of the lightly damped
BROAD = 35.0  # damping ratio [%] from which a mode is drawn by marks alone: the wake has a share in it


def modes_at(study: Study, tip_speed_ratio: float) -> tuple[float, list[CoupledMode], float]:
    """Rotor speed [rad/s], modes and spectral radius at another tip-speed ratio; the blades trimmed there."""
    case = study.case
    point = replace(case.operating_point, tip_speed_ratio=tip_speed_ratio)
    other = Study(replace(case, operating_point=point))
    turbine = time_invariant(other)
    modes = coupled_modes(other.parts, turbine, tower_modes=TOWER_MODES)
    return other.case.rotor_speed, modes, turbine.spectral_radius()


def campbell(study: Study, output: Path, tell: Tell) -> None:
    """Sweep, print and draw."""
    sweep = []
    for ratio in TIP_SPEED_RATIOS:
        tell(f"Campbell diagram: tip-speed ratio {ratio:g}")
        sweep.append(modes_at(study, ratio))
    rpm = np.array([speed for speed, _, _ in sweep]) * 30.0 / np.pi
    names = [mode.name for mode in sweep[0][1]]
    heads = [f"{value:.1f} rpm" for value in rpm]
    modes = [[next(mode for mode in found if mode.name == name) for _, found, _ in sweep] for name in names]
    rows = [
        [
            name,
            *(
                f"{mode.frequency:.3f} Hz, {100.0 * mode.damping:.1f} % ({mode.participation:.1f})"
                for mode in across
            ),
        ]
        for name, across in zip(names, modes, strict=True)
    ]
    rows.append(["spectral radius", *(f"{radius:.6f}" for _, _, radius in sweep)])
    table("Frequency, damping ratio and participation", ["mode", *heads], rows)
    draw(rpm, names, modes, output / "campbell.png")


def draw(rpm: np.ndarray, names: list[str], modes: list[list[CoupledMode]], path: Path) -> None:
    """Frequencies with multiples of the rotor's, and damping, over rotor speed."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13.5, 5.2), layout="constrained")
    axes = figure.subplots(1, 3, width_ratios=(1.2, 1, 1))
    kinds = list(dict.fromkeys(name.removesuffix(" " + name.split()[-1]) for name in names))
    lines = {"collective": "o-", "forward": "^--", "backward": "v:", "2": "D--"}
    for name, across in zip(names, modes, strict=True):
        way = name.split()[-1]
        colour = f"C{kinds.index(name.removesuffix(' ' + way))}"
        style = {"color": colour, "label": name, "markersize": 4, "linewidth": 1.2}
        frequency = [mode.frequency for mode in across]
        damping = [100.0 * mode.damping for mode in across]
        line = lines.get(way, "s-")
        if max(damping) > BROAD:
            line, style["fillstyle"] = line[0], "none"
        axes[0].plot(rpm, frequency, line, **style)
        axes[1 if max(damping) > LIGHT else 2].plot(rpm, damping, line, **style)
    for multiple in (1, 3, 6, 9):
        axes[0].plot(rpm, multiple * rpm / 60.0, color="0.75", linewidth=0.8, zorder=0)
        axes[0].annotate(f"{multiple}P", (rpm[-1] + 0.1, multiple * rpm[-1] / 60.0), color="0.5", fontsize=8)
    axes[0].set(ylabel="frequency from the ground [Hz]", ylim=(0.0, 3.7), xlim=(rpm[0] - 0.4, rpm[-1] + 0.9))
    axes[1].set(ylabel="damping ratio [%]", title="damped by the air")
    axes[2].set(ylabel="damping ratio [%]", title="lightly damped")
    axes[2].axhline(0.0, color="0.3", linewidth=0.8)
    for axis in axes:
        axis.set(xlabel="rotor speed [rpm]")
        axis.grid(color="0.92")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, fontsize=8)
    write_picture(path, figure)
