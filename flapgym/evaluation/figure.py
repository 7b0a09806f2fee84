"""A figure like the paper's Figure 15: one realisation, open against closed loop. Needs matplotlib."""

from __future__ import annotations

import importlib.util
import io
from typing import TYPE_CHECKING

import numpy as np

from flapgym.evaluation.comparison import Comparison
from flapgym.evaluation.record import Record

if TYPE_CHECKING:
    from matplotlib.axes import Axes

OPEN, CLOSED, INFLOW = "#9a9a9a", "#0b5394", "#c1651c"


def figure_is_possible() -> bool:
    """Whether matplotlib is installed."""
    return importlib.util.find_spec("matplotlib") is not None


def draw_figure(comparison: Comparison, file_format: str = "png") -> bytes:
    """Blade 1 on the first realisation: moment, tip deflection, flap angle with inflow, tower top; png, svg or pdf."""
    from matplotlib.figure import Figure

    open_loop, closed = comparison.records["open_loop"], comparison.records[_shown(comparison)]
    steps = open_loop.wind.shape[1]
    cycles = comparison.rotor_speed * open_loop.time_step * (1 + np.arange(steps)) / (2.0 * np.pi)
    figure = Figure(figsize=(8.0, 9.0), layout="constrained")
    axes = figure.subplots(4, 1, sharex=True)
    _pair(axes[0], cycles, open_loop.rbm[0, :, 0] / 1e6, closed.rbm[0, :, 0] / 1e6, "RBM [MN m]")
    axes[0].legend(
        ["open loop", f"closed loop ({_shown(comparison)})"], loc="upper right", ncols=2, frameon=False
    )
    _pair(
        axes[1],
        cycles,
        open_loop.tip_deflection[0, :, 0],
        closed.tip_deflection[0, :, 0],
        "tip deflection [m]",
    )
    _flap(axes[2], cycles, closed, comparison.flap_angle_limit)
    _pair(axes[3], cycles, open_loop.tower_fore_aft[0], closed.tower_fore_aft[0], "tower-top fore-aft [m]")
    axes[3].set_xlabel("rotor revolutions")
    axes[0].set_title(
        f"{comparison.model_name} ({comparison.nameplate.size}): blade 1, realisation {comparison.seed}",
        loc="left",
        fontsize=10,
        parse_math=False,  # a name may hold a dollar
    )
    for axis in axes:
        axis.set_xlim(0.0, cycles[-1])
        axis.grid(True, linewidth=0.4, alpha=0.5)
    content = io.BytesIO()
    figure.savefig(content, format=file_format, dpi=150)
    return content.getvalue()


def _shown(comparison: Comparison) -> str:
    """The limit-respecting LQG, as in the paper, or else the last agent of the table."""
    return "lqg" if "lqg" in comparison.records else list(comparison.records)[-1]


def _pair(axis: Axes, cycles: np.ndarray, without: np.ndarray, with_flap: np.ndarray, label: str) -> None:
    axis.plot(cycles, without, color=OPEN, linewidth=0.9)
    axis.plot(cycles, with_flap, color=CLOSED, linewidth=0.9)
    axis.set_ylabel(label)


def _flap(axis: Axes, cycles: np.ndarray, closed: Record, angle_limit: float) -> None:
    axis.plot(cycles, np.rad2deg(closed.flap_angle[0, :, 0]), color=CLOSED, linewidth=0.9)
    axis.set_ylabel("flap angle [deg]", color=CLOSED)
    stop = 1.1 * float(np.rad2deg(angle_limit))
    axis.set_ylim(-stop, stop)
    inflow = axis.twinx()
    inflow.plot(cycles, closed.wind[0], color=INFLOW, linewidth=0.6, alpha=0.5)
    inflow.set_ylabel("change in inflow [m/s]", color=INFLOW)
    reach = 1.05 * float(np.abs(closed.wind[0]).max()) or 1.0
    inflow.set_ylim(-reach, reach)
    # The flap, not the wind, is what the panel is about: draw it on top.
    axis.set_zorder(inflow.get_zorder() + 1)
    axis.patch.set_visible(False)
