"""Figure 11: tips of three turning blades under one homogeneous turbulence, and how far they differ."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.aerodynamics import table
from benchmarks.turbine.study import Study, Tell, pyplot
from flapgym.core.arrays import Array
from flapgym.core.atomic import write_picture
from flapgym.core.state_space import series
from flapgym.model import TurbineModel, load_model
from flapgym.model.multiblade import to_blades
from flapgym.wind import realise, von_karman_filter

CYCLES = (28, 37)  # the paper's window
SEED = 11
TIPS = ("tip_deflection_0", "tip_deflection_c", "tip_deflection_s")


def simulate_tips(model: TurbineModel, cycles: int, seed: int) -> tuple[Array, Array, Array]:
    """Rotor turns (T,), wind (T,) [m/s] and tips (T, 3) [m] under one realisation of the reference turbulence."""
    turn = model.rotor_speed * model.time_step / (2.0 * np.pi)
    steps = round(cycles / turn)
    shaping = von_karman_filter(
        model.wind_speed, model.turbulence_intensity, model.length_scale, model.time_step
    )
    wind = realise(shaping, steps, np.random.default_rng(seed))[0]
    turns = turn * np.arange(steps, dtype=np.float64)
    tips = model.turbine.select(inputs=["wind"], outputs=TIPS).simulate(wind[:, None])
    return turns, wind, to_blades(tips, 2.0 * np.pi * turns)


def exact_rms(model: TurbineModel) -> tuple[float, float]:
    """Stationary rms [m] of a blade's tip, and of its difference from the mean of the three."""
    shaping = von_karman_filter(
        model.wind_speed, model.turbulence_intensity, model.length_scale, model.time_step
    )
    driven = series(shaping, model.turbine.select(inputs=["wind"], outputs=TIPS))
    variance = np.diag(driven.C @ driven.stationary_covariance() @ driven.C.T + driven.D @ driven.D.T)
    apart = 0.5 * (variance[1] + variance[2])
    return float(np.sqrt(variance[0] + apart)), float(np.sqrt(apart))


def figure11(study: Study, output: Path, tell: Tell) -> None:
    """Simulate, measure and draw."""
    tell("Figure 11: tips under turbulence")
    model = load_model(study.case.name)
    turns, wind, tips = simulate_tips(model, CYCLES[1], SEED)
    inside = turns >= CYCLES[0]
    turns, wind, tips = turns[inside], wind[inside], tips[inside]
    apart = tips - tips.mean(axis=1, keepdims=True)
    spread = tips.max(axis=1) - tips.min(axis=1)
    exact, exact_apart = exact_rms(model)
    rows = [
        [
            f"cycles {CYCLES[0]} to {CYCLES[1]} of one realisation",
            f"{np.sqrt((tips**2).mean()):.3f}",
            f"{tips.min():+.2f} to {tips.max():+.2f}",
            f"{np.sqrt((apart**2).mean()):.4f}",
            f"{100.0 * np.sqrt((apart**2).mean() / (tips**2).mean()):.1f} %",
            f"{spread.max():.3f}",
        ],
        ["stationary", f"{exact:.3f}", "", f"{exact_apart:.4f}", f"{100.0 * exact_apart / exact:.1f} %", ""],
    ]
    head = ["", "tip rms [m]", "range [m]", "rms of a blade from the mean of three [m]"]
    head += ["over tip rms", "largest spread [m]"]
    table("Figure 11: tips of the three blades", head, rows)
    draw(turns, wind, tips, output / f"figure11.{study.picture}")


def draw(turns: Array, wind: Array, tips: Array, path: Path) -> None:
    """Tips, each blade's difference from the mean, and the wind."""
    plt = pyplot()
    figure, axes = plt.subplots(
        3, 1, figsize=(8.5, 7.0), sharex=True, layout="constrained", height_ratios=(2.2, 1.3, 1.0)
    )
    for blade, line in enumerate(("-", "--", ":")):
        name = f"blade {blade + 1}"
        axes[0].plot(turns, tips[:, blade], line, label=name, linewidth=1.2)
        axes[1].plot(turns, tips[:, blade] - tips.mean(axis=1), line, label=name, linewidth=1.2)
    axes[0].set(ylabel="tip out of plane [m]", title="One homogeneous turbulence, open loop, about the mean")
    axes[0].legend(ncols=3)
    axes[1].set(ylabel="from the mean\nof three [m]")
    axes[2].plot(turns, wind, color="0.3", linewidth=1.0)
    axes[2].set(ylabel="wind [m/s]", xlabel="cycles", xlim=CYCLES)
    for axis in axes:
        axis.grid(color="0.9")
    write_picture(path, figure)
    plt.close(figure)
