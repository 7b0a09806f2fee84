"""Pictures of the studies' numbers; the ending of the path says whether png or svg."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from flapgym.core.arrays import Array
from flapgym.core.atomic import write_picture
from studies.bode import OWN, PARKED, RIGID, SOFT, Curves, decibel
from studies.gust import TURNS, WAKES, GustLoads
from studies.tips import CYCLES, Tips

STATES = 150
"""Where the paper truncates."""


def draw_gust_loads(found: GustLoads, path: Path) -> None:
    """Figure 8; dotted lines at thirds of a turn."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 3.6), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    for axis, (length, induction), moments in zip(axes, WAKES, found.moment, strict=True):
        for moment, name in zip(moments, ("single blade", "full rotor"), strict=True):
            axis.plot(found.turns[2:], moment[2:], label=name)
        for third in range(1, 10):
            axis.axvline(third / 3.0, color="0.8", linestyle=":", zorder=0)
        axis.set(xlabel="turns", title=f"wake of {length:g} diameters, induction {induction:g}")
        axis.set(xlim=(0.0, TURNS), ylim=(0.82, 1.1))
    axes[0].set_ylabel("flapwise root moment over the single blade's")
    axes[0].legend()
    write_picture(path, figure)


def draw_hankel_values(values: Array, path: Path) -> None:
    """Figure 12: the rotor's Hankel singular values, largest first, over the largest."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6, 3.6), layout="constrained")
    axis = figure.subplots()
    axis.semilogy(np.arange(1, len(values) + 1), values / values[0])
    axis.axvline(STATES, color="0.6", linestyle=":")
    axis.set(
        xlabel="states", ylabel="Hankel singular value over the largest", xlim=(0, 200), ylim=(1e-6, 1.5)
    )
    write_picture(path, figure)


def draw_towers(curves: Curves, path: Path) -> None:
    """Figure 10: the towers, and the parked structure."""
    shown = [list(curves.names).index(name) for name in (RIGID, OWN, SOFT, PARKED)]
    some = Curves(curves.names[shown], curves.frequency, curves.response[shown])
    _draw_bode(some, path, "Gust to tip deflection by tower")


def draw_structural_modes(curves: Curves, path: Path) -> None:
    """Figure 13."""
    _draw_bode(curves, path, "Structural modes, 150 aerodynamic states", deviation=True)


def draw_aerodynamic_states(curves: Curves, path: Path) -> None:
    """Figure 14."""
    _draw_bode(curves, path, "Aerodynamic states, 15 tower and 40 blade modes", deviation=True)


def draw_tips(found: Tips, path: Path) -> None:
    """Figure 11: tips, each blade's difference from the mean, and the wind."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.5, 7.0), layout="constrained")
    axes = figure.subplots(3, 1, sharex=True, height_ratios=(2.2, 1.3, 1.0))
    for blade, line in enumerate(("-", "--", ":")):
        name = f"blade {blade + 1}"
        axes[0].plot(found.turns, found.tips[:, blade], line, label=name, linewidth=1.2)
        axes[1].plot(found.turns, found.apart[:, blade], line, label=name, linewidth=1.2)
    axes[0].set(ylabel="tip out of plane [m]", title="One homogeneous turbulence, open loop, about the mean")
    axes[0].legend(ncols=3)
    axes[1].set(ylabel="from the mean\nof three [m]")
    axes[2].plot(found.turns, found.wind, color="0.3", linewidth=1.0)
    axes[2].set(ylabel="wind [m/s]", xlabel="cycles", xlim=CYCLES)
    for axis in axes:
        axis.grid(color="0.9")
    write_picture(path, figure)


def _draw_bode(curves: Curves, path: Path, title: str, deviation: bool = False) -> None:
    """Magnitude and phase over frequency and, if asked for, the deviation from the first curve."""
    from matplotlib.figure import Figure

    panels, size = (3, 8.4) if deviation else (2, 6.2)
    figure = Figure(figsize=(7.5, size), layout="constrained")
    axes = figure.subplots(panels, 1, sharex=True)
    frequency, first = curves.frequency, curves.response[0]
    lines = zip(("C0-", "C1--", "C2-.", "C3:"), curves.names, curves.response, strict=False)
    for index, (line, name, response) in enumerate(lines):
        axes[0].semilogx(frequency, decibel(response), line, label=name, linewidth=1.4)
        phase = np.degrees(np.unwrap(np.angle(response)))
        axes[1].semilogx(frequency, phase - 360.0 * np.round(phase[0] / 360.0), line, linewidth=1.4)
        if deviation and index:
            axes[2].loglog(frequency, 100.0 * np.abs(response / first - 1.0), line, linewidth=1.4)
    axes[0].set(ylabel="magnitude [dB of 1 m per m/s]", title=title)
    axes[0].legend()
    axes[1].set(ylabel="phase [deg]")
    if deviation:
        axes[2].set(ylabel="deviation [%]", ylim=(1e-3, 3e2))
    axes[-1].set(xlabel="frequency [Hz]", xlim=(frequency[0], frequency[-1]))
    for axis in axes:
        axis.grid(which="both", color="0.9")
    write_picture(path, figure)
