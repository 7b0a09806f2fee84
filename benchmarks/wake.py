"""The wake after a step of wind: `python -m benchmarks.wake [--output DIR]`.

Prints the tables of docs/aerodynamics.md on the moving wake in Markdown and writes wake-step.png.
One and a half minutes on one core, half of them the march.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.aerodynamics import table
from flapgym.aerodynamics import (
    Aerodynamics,
    WakeState,
    build_aerodynamics,
    collective_response,
    flap_downwash,
    gust_downwash,
    moving_wake_response,
    pitch_transport,
    rigid_rotor,
    root_moment_load,
    steady_circulation,
    wake_transport,
)
from flapgym.aerodynamics.biot_savart import ring_influence
from flapgym.aerodynamics.lattice import SHED_AGE, rotation_about_x, wake_nodes
from flapgym.aerodynamics.rotor import zero_lift_angles
from flapgym.aerodynamics.steady import incidence_downwash
from flapgym.aerodynamics.transport import (
    displaced_wake_downwash,
    fitted_state,
    march_case,
    travelling_displacement,
)
from flapgym.core.arrays import Array
from flapgym.core.atomic import write_picture
from flapgym.core.units import DEGREE
from flapgym.turbine import Airfoil, Case, load_case
from studies.gust import variant

# Root moment per m/s of wind from 11 to 12 m/s, rigid rotor, by a free vortex wake behind lifting lines with the
# aerofoils' polars (OpenFAST 5.0.0, OLAF, run for this project): after 0.2 s, at its peak, in the end [MN m].
FREE_WAKE = (0.78, 0.887, 0.845)
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
    node = wake_nodes(lattice, flow, aero.wake_age)
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


def marched(case: Case, length: float, gust: float) -> tuple[Array, Array]:
    """Change of the root moment (T,) [MN m per m/s] after a step of wind, and by the march that is linear in it."""
    coarse = variant(march_case(case, length), time_step=COARSE_STEP)
    aero = build_aerodynamics(coarse)
    load = root_moment_load(aero, coarse)
    wind = np.append(0.0, np.full(round(DURATION / COARSE_STEP), 1.0))
    circulation = march_moving_wake(aero, zero_lift_angles(case), gust * wind)
    moment = collective_loads(aero, circulation - circulation[0], load) / (1e6 * gust)
    shed = circulation[0, -aero.lattice.strips :]
    linear = moving_wake_response(aero, shed, wind, load)[:, 0] / 1e6
    return moment, linear


def collective_loads(aero: Aerodynamics, circulation: Array, load: Array) -> Array:
    """One load (T,) of circulations (T, n) that begin from rest."""
    rest = np.zeros((len(aero.force) - 1, circulation.shape[1]))
    history = np.concatenate([rest, circulation])
    lags = [history[len(rest) - lag : len(history) - lag] for lag in range(len(aero.force))]
    return np.asarray(sum(past @ (load @ force)[0] for past, force in zip(lags, aero.force, strict=True)))


def at_work(case: Case) -> Case:
    """The case with the lift slopes that its polars have from 4 to 6 degrees, where the outer blade works."""

    def steeper(airfoil: Airfoil) -> Airfoil:
        lift = np.interp([4.0 * DEGREE, 6.0 * DEGREE], airfoil.polar.angle, airfoil.polar.lift)
        return replace(airfoil, normal_force_slope=float(np.diff(lift).item() / (2.0 * DEGREE)))

    airfoils = tuple(steeper(a) if a.lift_slope else a for a in case.turbine.airfoils)
    return replace(case, turbine=replace(case.turbine, airfoils=airfoils))


def with_loads(case: Case, **airloads: Any) -> Case:
    """The case with other loads."""
    return replace(case, airloads=replace(case.airloads, **airloads))


def terms(case: Case) -> dict[str, tuple[Case, bool]]:
    """Cases that bring in one term after the other, and whether the state for slow wind stands before the rotor."""
    return {
        "lift slope 2 pi, forces in the mean flow": (
            with_loads(case, lift_slope="thin aerofoil", linearisation="mean flow"),
            False,
        ),
        "the sections' listed lift slopes": (with_loads(case, linearisation="mean flow"), False),
        "full linearisation": (case, False),
        "the state: the corrected turbine": (case, True),
        "lift slopes of the polars from 4 to 6 degrees": (at_work(case), True),
        "37 strips for ten": (variant(at_work(case), blade_elements=48, first_lattice_node=11), True),
    }


def rigid_step(case: Case, state: WakeState | None) -> Array:
    """Root moment (T,) [MN m] of a case's rigid rotor after a step of 1 m/s, few panels along the chord."""
    coarse = march_case(case, case.discretisation.wake_length)
    rotor = rigid_rotor(coarse)
    moment = rotor.step(DURATION, root_moment_load(rotor.aero, coarse)) / 1e6
    if state is not None:
        moment = state.state_space(rotor.aero.time_step, "wind").simulate(moment)
    return np.asarray(moment[:, 0])


def wake_steps(case: Case, circulation: Array) -> dict[str, Array]:
    """Root moment (T,) [MN m] after a step of wind of 1 m/s, by the wake; forces in the mean flow, as in the march."""
    found, own = {}, case.discretisation.wake_length
    for length in (own, 2.0):
        other = march_case(case, length)
        aero = build_aerodynamics(other)
        wind, load = np.ones(round(DURATION / aero.time_step)), root_moment_load(aero, other)
        gust = gust_downwash(aero).sum(axis=1, keepdims=True)
        found[f"fixed, {length:g} D"] = collective_response(aero, wind[:, None], gust, load)[:, 0] / 1e6
    found["moving, 2 D"] = moving_wake_response(aero, circulation, wind, load)[:, 0] / 1e6
    state = wake_transport(case, circulation).wind.state_space(aero.time_step, "wind")
    found["short and state"] = state.simulate(found[f"fixed, {own:g} D"][:, None])[:, 0]
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


def state_row(name: str, *states: WakeState) -> list[str]:
    """Named states as a row of a table."""
    figures = ((f"{s.gain:.3f}", f"{s.time_constant:.2f}", f"{100 * s.misfit:.1f}") for s in states)
    return [name, *(figure for state in figures for figure in state)]


STATE = ["gain", "time constant [s]", "misfit [%]"]
BOTH = [f"{of}: {figure}" for of in ("wind", "flap") for figure in STATE]


def state_table(case: Case, circulation: Array) -> None:
    """Gains and time constants by the speed of the wake and by the march's size."""
    rows = []
    for induction in (0.0, 0.1, 0.2, 0.3):
        found = wake_transport(variant(case, induction=induction), circulation)
        rows.append(state_row(f"{induction:g}", found.wind, found.flaps[0]))
    table("The states, by axial induction of the perturbations' wake", ["induction", *BOTH], rows)
    rows = []
    for panels, length in ((3, 2.0), (6, 2.0), (3, 1.0), (3, 3.0)):
        found = wake_transport(case, circulation, wake_length=length, panels=panels)
        rows.append(state_row(f"{panels} panels, {length:g} D", found.wind, found.flaps[0]))
    fine = variant(case, blade_elements=48, first_lattice_node=11)
    found = wake_transport(fine, shed_by(fine))
    rows.append(state_row("3 panels, 2 D, 37 strips for 10", found.wind, found.flaps[0]))
    table("The states, by size of the march", ["march", *BOTH], rows)


def shed_by(case: Case) -> Array:
    """Mean circulation (strips,) [m^2/s] that a blade of the rigid rotor sheds."""
    flow = rigid_rotor(march_case(case, case.discretisation.wake_length)).flow
    return flow.circulation[-flow.aero.lattice.strips :]


def share_table(case: Case, circulation: Array) -> None:
    """The state that each kind of step calls for, by root moment or thrust."""
    short, long = march_case(case, case.discretisation.wake_length), march_case(case, 2.0)
    fixed, aero = build_aerodynamics(short), build_aerodynamics(long)
    wind, n = np.ones(aero.wake_rows), len(aero.normal)
    gust, flap = gust_downwash(fixed).sum(axis=1), flap_downwash(fixed, case.flaps[0])[0]
    moment, thrust = root_moment_load(aero, long), np.tile([[1.0, 0.0, 0.0]], len(aero.force_point))

    def still(lattice: Aerodynamics, downwash: Array, load: Array) -> Array:
        return collective_response(lattice, wind[:, None], downwash[:, None], load)[:, 0]

    # A parcel of air that keeps its gust carries the row shed into it; rows shed before the gust keep their way.
    carried = travelling_displacement(wind, aero.time_step, aero.wake_rows)
    moved = carried @ displaced_wake_downwash(aero, circulation).T
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


def pitch_table(case: Case) -> None:
    """The state of collective pitch by the march's size."""
    flow = rigid_rotor(march_case(case, case.discretisation.wake_length)).flow
    rows = []
    for panels, length in ((3, 2.0), (6, 2.0), (3, 1.0), (3, 3.0)):
        found = pitch_transport(case, flow, wake_length=length, panels=panels)
        per_degree = replace(found, gain=found.gain * DEGREE)
        rows.append(state_row(f"{panels} panels, {length:g} D", per_degree))
    table("The state of pitch, by size of the march", ["march", "gain [m/s per deg]", *STATE[1:]], rows)


def draw(time: Array, wakes: dict[str, Array], rigid: dict[str, Array], path: Path) -> None:
    """Root moment after the step, by the wake and term after term."""
    import matplotlib

    matplotlib.use("agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(11, 4.2), sharey=True, layout="constrained")
    panels = {"by the wake, forces in the mean flow": wakes, "the rigid rotor, term after term": rigid}
    for axis, (title, moments) in zip(axes, panels.items(), strict=True):
        for place, (name, moment) in enumerate(moments.items()):
            axis.plot(time[3:], moment[3:], f"C{place}", label=name)
        for value, name in zip(FREE_WAKE[1:], ("peak", "end"), strict=True):
            axis.axhline(value, color="0.6", linestyle=":", zorder=0)
            axis.text(19.9, value + 0.003, f"free wake's {name}", ha="right", color="0.4", fontsize=8)
        axis.plot(0.2, FREE_WAKE[0], "ko", markersize=5, label="free wake after 0.2 s")
        axis.set(xlabel="time after the step [s]", title=title, xlim=(0.0, 20.0), ylim=(0.70, 1.22))
        axis.legend(fontsize=8, loc="upper right")
    axes[0].set_ylabel("root moment [MN m per m/s]")
    path.parent.mkdir(parents=True, exist_ok=True)
    write_picture(path, figure)


def main() -> None:
    """Print every table and draw the figure."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--output", type=Path, default=Path("results"), help="folder for wake-step.png")
    output: Path = parser.parse_args().output
    case = load_case("nrel5mw-corrected")
    circulation = shed_by(case)
    state, wakes = wake_transport(case, circulation).wind, wake_steps(case, circulation)
    rigid = {name: rigid_step(of, state if slow else None) for name, (of, slow) in terms(case).items()}
    step = march_case(case, case.discretisation.wake_length).discretisation.time_step
    time = step * np.arange(round(DURATION / step), dtype=float)
    step_table("After a step of 1 m/s, by the wake (over the free wake's)", time, wakes)
    step_table("The rigid rotor, one term after the other (over the free wake's)", time, rigid)
    state_table(case, circulation)
    share_table(case, circulation)
    pitch_table(case)
    # Not linearised in its wake's place, but of flat plates: the march knows no other slope.
    moment, linear = marched(with_loads(case, lift_slope="thin aerofoil"), 2.0, 1.0)
    apart = np.abs(moment - linear).max() / linear[-1]
    print(f"\nmarch of 1 m/s against its linear part: {100 * apart:.2f} % of the end at most")
    draw(time, wakes, rigid, output / "wake-step.png")


if __name__ == "__main__":
    main()
