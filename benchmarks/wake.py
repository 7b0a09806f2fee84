"""The wake after a step of wind: `python -m benchmarks.wake [--output DIR]`.

Prints the tables of docs/aerodynamics.md on the moving wake in Markdown and writes wake-step.png.
A minute on one core, most of it the march.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.aerodynamics import table, variant
from flapgym.aerodynamics import (
    Aerodynamics,
    WakeTransport,
    build_aerodynamics,
    collective_response,
    gust_downwash,
    mean_loads,
    moving_wake_response,
    root_moment_load,
    wake_transport,
)
from flapgym.aerodynamics.biot_savart import ring_influence
from flapgym.aerodynamics.lattice import SHED_AGE, rotation_about_x, wake_nodes
from flapgym.aerodynamics.report import root_moment_inputs
from flapgym.aerodynamics.response import steady_circulation
from flapgym.aerodynamics.rotor import strip_radius
from flapgym.aerodynamics.steady import incidence_downwash
from flapgym.aerodynamics.transport import displaced_wake_downwash, fitted_state, march_case
from flapgym.turbine import Case, load_case

Array = NDArray[np.float64]

# Root moment per m/s of wind from 11 to 12 m/s, rigid rotor, by a free vortex wake behind lifting lines with the
# aerofoils' polars (OpenFAST 5.0.0, OLAF, run for this project): after 0.2 s, at its peak, in the end [MN m].
FREE_WAKE = (0.78, 0.887, 0.845)
# Lift slopes of the turbine's public polars from 4 to 6 degrees of incidence, where the blade works [1/rad].
WORKING_SLOPE = {"DU40": 7.37, "DU35": 7.58, "DU30": 7.37, "DU25": 6.00, "DU21": 5.62, "NACA64": 5.87}
DURATION = 20.0  # s
COARSE_STEP = 0.07  # s, of the march that is not linearised


def march_moving_wake(aero: Aerodynamics, zero_lift_angle: Array, wind: Array) -> Array:
    """Bound circulation (T, n) [m^2/s] while the wind changes by (T,) [m/s] and carries the wake along.

    Nothing is linearised in the wake's geometry: every row of corners lies where the air that left the trailing edge
    is, and its influence is computed anew at each step. It starts from the steady state without the gust.
    """
    lattice, flow, dt = aero.lattice, aero.inflow, aero.time_step
    strips = lattice.strips
    turn = rotation_about_x(-flow.rotor_speed * dt).T
    mean = incidence_downwash(aero, zero_lift_angle)
    start = steady_circulation(aero, mean[:, None])[:, 0]
    shed = np.tile(start[-strips:], (aero.wake_rows, 1))
    node = wake_nodes(lattice, flow, dt, aero.wake_rows)
    circulation = np.empty((len(wind), len(start)))
    behind = rotation_about_x(-flow.rotor_speed * SHED_AGE * dt).T
    for t, gust in enumerate(wind):
        if t:
            carried = flow.wake_velocity + [0.5 * (wind[t - 1] + gust), 0.0, 0.0]
            node[1:] = node[:-1] @ turn + carried * dt
        carried = flow.wake_velocity + [gust, 0.0, 0.0]
        node[0] = lattice.trailing_edge @ behind + carried * SHED_AGE * dt
        grid = np.concatenate([lattice.node[:-1], node])
        felt = np.zeros((len(start), len(grid) - 1, strips))
        for blade in range(aero.blades):
            felt += ring_influence(
                lattice.collocation,
                lattice.normal,
                grid @ rotation_about_x(2.0 * np.pi * blade / aero.blades).T,
            )
        bound, wake = felt[:, : lattice.chordwise].reshape(len(start), -1), felt[:, lattice.chordwise :]
        downwash = mean + gust * aero.normal[:, 0] + np.einsum("nks,ks->n", wake, shed)
        circulation[t] = -np.linalg.solve(bound, downwash)
        shed = np.concatenate([circulation[t, None, -strips:], shed[:-1]])
    return circulation


def zero_lift_angles(case: Case) -> Array:
    """Angles without lift (strips,) [rad] in the middle of the strips."""
    edge, planform = strip_radius(case), case.turbine.planform
    angle = [case.turbine.airfoil(name).zero_lift_angle_attached for name in planform.airfoil]
    return np.interp(0.5 * (edge[1:] + edge[:-1]), planform.radius, angle)


def marched(case: Case, length: float, gust: float) -> list[Array]:
    """Times (T,) [s] after a step of wind, change of the root moment per m/s (T,) [MN m], and the linear march's."""
    coarse = variant(march_case(case, length), time_step=COARSE_STEP)
    aero = build_aerodynamics(coarse)
    load = root_moment_load(aero, coarse)
    wind = np.append(0.0, np.full(round(DURATION / COARSE_STEP), 1.0))
    circulation = march_moving_wake(aero, zero_lift_angles(case), gust * wind)
    moment = collective_loads(aero, circulation - circulation[0], load) / (1e6 * gust)
    shed = circulation[0, -aero.lattice.strips :]
    linear = moving_wake_response(aero, shed, wind, load)[:, 0] / 1e6
    # The wind steps halfway between the first two instants.
    return [COARSE_STEP * (np.arange(len(wind), dtype=float) - 0.5), moment, linear]


def collective_loads(aero: Aerodynamics, circulation: Array, load: Array) -> Array:
    """One load (T,) of circulations (T, n) that begin from rest."""
    rest = np.zeros((len(aero.force) - 1, circulation.shape[1]))
    history = np.concatenate([rest, circulation])
    lags = [history[len(rest) - lag : len(history) - lag] for lag in range(len(aero.force))]
    return np.asarray(sum(past @ (load @ force)[0] for past, force in zip(lags, aero.force, strict=True)))


def with_lift_slope(aero: Aerodynamics, ratio: Array) -> Aerodynamics:
    """The lattice whose sections have `ratio` (strips,) of the lift slope 2 pi, in slow flow.

    Of the downwash that a strip's circulation answers, the part of its own section's vortices is divided by the ratio.
    """
    nc = aero.lattice.chordwise
    panel = np.arange(nc)
    vortex = -nc / (2.0 * np.pi * (panel[:, None] - panel + 0.5))
    ring = vortex @ (
        np.eye(nc) - np.eye(nc, k=-1)
    )  # a ring's vortex is its own circulation less the one ahead
    chord = np.linalg.norm(aero.lattice.chord_vector, axis=1)
    section = np.kron(ring, np.diag((1.0 / ratio - 1.0) / chord))
    return replace(aero, bound_pair=np.concatenate([aero.bound_pair[:1] + section, aero.bound_pair[1:]]))


def working_slopes(case: Case) -> Array:
    """Lift slope over 2 pi (strips,) of the aerofoils of the nearest stations, where the blade works."""
    edge, planform = strip_radius(case), case.turbine.planform
    nearest = np.abs(np.asarray(planform.radius)[:, None] - 0.5 * (edge[1:] + edge[:-1])).argmin(axis=0)
    return np.array([WORKING_SLOPE[planform.airfoil[i].split("_")[0]] for i in nearest]) / (2.0 * np.pi)


def step_responses(case: Case, state: WakeTransport, circulation: Array, slope: Array) -> dict[str, Array]:
    """Root moment (T,) [MN m] at the steps of the march after a step of wind of 1 m/s, by the wake."""
    found = {}
    for length in (case.discretisation.wake_length, 2.0):
        other = march_case(case, length)
        aero = with_lift_slope(build_aerodynamics(other), slope)
        wind, load = np.ones(round(DURATION / aero.time_step)), root_moment_load(aero, other)
        gust = gust_downwash(aero).sum(axis=1, keepdims=True)
        found[f"fixed, {length:g} D"] = collective_response(aero, wind[:, None], gust, load)[:, 0] / 1e6
    found["moving, 2 D"] = moving_wake_response(aero, circulation, wind, load)[:, 0] / 1e6
    short = found[f"fixed, {case.discretisation.wake_length:g} D"]
    found["short and state"] = state.state_space(aero.time_step).simulate(short[:, None])[:, 0]
    return found


def figures(time: Array, moment: Array) -> Array:
    """Values after 0.2 s, at the peak after the first 0.1 s, and in the end."""
    return np.array([np.interp(0.2, time, moment), moment[time > 0.1].max(), moment[-1]])


def step_table(title: str, time: Array, moments: dict[str, Array]) -> None:
    """Each wake's figures, over the free wake's."""
    rows = []
    for name, moment in moments.items():
        value = figures(time, moment)
        over = value / FREE_WAKE
        rows.append(
            [
                name,
                *(f"{v:.3f} ({o:.2f})" for v, o in zip(value, over, strict=True)),
                f"{value[2] / value[1]:.3f}",
            ]
        )
    free = [f"{v:.3f}" for v in FREE_WAKE]
    rows.append(["free wake", *free, f"{FREE_WAKE[2] / FREE_WAKE[1]:.3f}"])
    table(title, ["wake", "0.2 s [MN m s/m]", "peak", "20 s", "20 s over peak"], rows)


def state_row(name: str, state: WakeTransport) -> list[str]:
    """A named state as a row of a table."""
    return [name, f"{state.gain:.3f}", f"{state.time_constant:.2f}", f"{100 * state.misfit:.1f}"]


STATE = ["gain", "time constant [s]", "misfit [%]"]


def state_table(case: Case) -> None:
    """Gain and time constant by the speed of the wake, its mean circulation with it, and by the march's size."""
    rows = []
    for induction in (0.0, 0.1, 0.2, 0.3):
        other = variant(case, induction=induction)
        rows.append(state_row(f"{induction:g}", wake_transport(other, shed_by(other))))
    table("The state, by axial induction", ["induction", *STATE], rows)
    rows = []
    for panels, length in ((3, 2.0), (6, 2.0), (3, 1.0), (3, 3.0)):
        state = wake_transport(case, shed_by(case), wake_length=length, panels=panels)
        rows.append(state_row(f"{panels} panels, {length:g} D", state))
    fine = variant(case, blade_elements=48, first_lattice_node=11)
    rows.append(state_row("3 panels, 2 D, 37 strips for 10", wake_transport(fine, shed_by(fine))))
    table("The state, by size of the march", ["march", *STATE], rows)


def shed_by(case: Case) -> Array:
    """Mean circulation (strips,) [m^2/s] that a blade sheds into two diameters of wake."""
    long = march_case(case, 2.0)
    aero = build_aerodynamics(long)
    return mean_loads(long, aero).circulation[-aero.lattice.strips :]


def share_table(case: Case, circulation: Array) -> None:
    """The state that each kind of step calls for, by root moment or thrust."""
    short, long = march_case(case, case.discretisation.wake_length), march_case(case, 2.0)
    fixed, aero = build_aerodynamics(short), build_aerodynamics(long)
    time = aero.time_step * np.arange(aero.wake_rows, dtype=float)
    wind, n = np.ones(len(time)), len(aero.normal)
    gust, flap = root_moment_inputs(case, fixed).T
    moment, thrust = root_moment_load(aero, long), np.tile([[1.0, 0.0, 0.0]], len(aero.force_point))

    def still(lattice: Aerodynamics, downwash: Array, load: Array) -> Array:
        return collective_response(lattice, wind[:, None], downwash[:, None], load)[:, 0]

    # A parcel of air that keeps its gust carries the row shed into it; rows shed before the gust keep their way.
    age = (np.arange(aero.wake_rows + 1) + SHED_AGE) * aero.time_step
    moved = np.where(age <= time[:, None], age, 0.0) @ displaced_wake_downwash(aero, circulation).T
    kept = collective_response(aero, gust + moved, np.eye(n), moment)[:, 0]
    steps = {
        "wind": (still(fixed, gust, moment), moving_wake_response(aero, circulation, wind, moment)[:, 0]),
        "wind, by thrust": (
            still(fixed, gust, thrust),
            moving_wake_response(aero, circulation, wind, thrust)[:, 0],
        ),
        "wind that travels with the air": (still(fixed, gust, moment), kept),
        "flap": (still(fixed, flap, moment), still(aero, flap, moment)),
    }
    rows = [
        state_row(name, fitted_state(given, wanted, aero.time_step, first=len(aero.force)))
        for name, (given, wanted) in steps.items()
    ]
    table("The state, by what steps", ["step of", *STATE], rows)


def draw(panels: dict[str, dict[str, Array]], time: Array, march: list[Array], path: Path) -> None:
    """Root moment after the step with the lattice's lift slope and with the polars'."""
    import matplotlib

    matplotlib.use("agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(10, 3.8), sharey=True, layout="constrained")
    for axis, (title, moments) in zip(axes, panels.items(), strict=True):
        for (name, moment), style in zip(moments.items(), ("C0--", "C3--", "C2-", "C1-"), strict=True):
            axis.plot(time[3:], moment[3:], style, label=name)
        for value, name in zip(FREE_WAKE[1:], ("peak", "end"), strict=True):
            axis.axhline(value, color="0.6", linestyle=":", zorder=0)
            axis.text(19.9, value + 0.003, f"free wake's {name}", ha="right", color="0.4", fontsize=8)
        axis.plot(0.2, FREE_WAKE[0], "ko", markersize=5, label="free wake after 0.2 s")
        axis.set(xlabel="time after the step [s]", title=title, xlim=(0.0, 20.0), ylim=(0.72, 1.02))
    axes[0].plot(march[0][3::4], march[1][3::4], "k.", markersize=3, label="moving, not linearised")
    axes[0].set_ylabel("root moment [MN m per m/s]")
    axes[0].legend(fontsize=8, ncols=2, loc="upper right")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)


def main() -> None:
    """Print every table and draw the figure."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--output", type=Path, default=Path("results"), help="folder for wake-step.png")
    output: Path = parser.parse_args().output
    case = load_case("nrel5mw-rated")
    circulation = shed_by(case)
    state = wake_transport(case, circulation)
    slopes = working_slopes(case)
    panels = {
        "lift slope 2 pi": step_responses(case, state, circulation, np.ones_like(slopes)),
        "lift slopes of the polars at 4 to 6 degrees": step_responses(case, state, circulation, slopes),
    }
    step = march_case(case, 2.0).discretisation.time_step
    time = step * np.arange(round(DURATION / step), dtype=float)
    for title, moments in panels.items():
        step_table(f"After a step of 1 m/s, {title} (over the free wake's)", time, moments)
    state_table(case)
    share_table(case, circulation)
    *march, linear = marched(case, 2.0, 1.0)
    apart = np.abs(march[1] - linear).max() / linear[-1]
    print(f"\nmarch of 1 m/s against its linear part: {100 * apart:.2f} % of the end at most")
    draw(panels, time, march, output / "wake-step.png")


if __name__ == "__main__":
    main()
