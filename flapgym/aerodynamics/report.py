"""What the lattice of a case says, as text: mean loads of the rigid rotor and gains of gust and flap."""

from __future__ import annotations

import numpy as np

from flapgym.aerodynamics.downwash import glauert_scale
from flapgym.aerodynamics.rigid import rigid_rotor
from flapgym.aerodynamics.rotor import root_moment_load
from flapgym.core.wording import number
from flapgym.turbine import Case

FREQUENCIES = (0.1, 0.2, 0.5, 1.0, 2.0, 3.0)  # Hz; nothing above 3 Hz is independent of the discretisation


def describe_aerodynamics(case: Case) -> str:
    """Mean loads and gains of a case's rigid, undeflected rotor and of one of its blades alone."""
    whole, alone = rigid_rotor(case), rigid_rotor(case, blades=1)
    rotor, mean = whole.aero, whole.loads
    lattice, grid, load = rotor.lattice, case.discretisation, root_moment_load(rotor, case)
    degree, count = np.pi / 180.0, len(case.flaps)
    names = ["flap"] if count == 1 else [f"flap{number}" for number in range(1, count + 1)]
    gust, *turned = whole.steady(load)[0]
    alone_gust, *alone_turned = alone.steady(load)[0]
    circulations = rotor.blades * (lattice.normal.shape[0] + lattice.strips * rotor.wake_rows)
    point = case.operating_point
    lines = [
        f"case             {case.name}: wind {number(point.wind_speed)} m/s, rotor {case.rotor_speed:.4f} rad/s, "
        f"pitch {number(point.pitch / degree)} deg",
        f"lattice          {rotor.blades} blades of {lattice.chordwise} x {lattice.strips} rings, time step "
        f"{number(rotor.time_step)} s",
        f"wake             {rotor.wake_rows} rows, {number(grid.wake_length)} diameters, "
        f"induction {number(grid.induction)}; {circulations} circulations in all",
        f"mean loads       rigid, undeflected blades, {_profile(case)}, {_mean_wake(case)}:",
        f"  thrust         {mean.thrust / 1e3:8.1f} kN      coefficient {mean.thrust_coefficient:.3f}",
        f"  torque         {mean.torque / 1e3:8.1f} kN m    by leading-edge suction "
        f"{mean.torque_by_suction / 1e3:.1f} kN m",
        f"  power          {mean.power / 1e6:8.3f} MW      coefficient {mean.power_coefficient:.3f}",
        f"  root moment    {mean.root_moment / 1e6:8.3f} MN m a blade, flapwise",
        "flapwise root moment, steady            rotor   one blade alone   ratio",
        f"  per m/s of gust       [MN m]        {gust / 1e6:7.4f}   {alone_gust / 1e6:15.4f}   "
        f"{gust / alone_gust:5.3f}",
        *(
            f"  {f'per degree of {name}':<22}[MN m]        {ours * degree / 1e6:7.4f}   "
            f"{single * degree / 1e6:15.4f}   {ours / single:5.3f}"
            for name, ours, single in zip(names, turned, alone_turned, strict=True)
        ),
        *(
            f"{name:<17}effectiveness {flap.effectiveness}; Glauert's lift over the lattice's own "
            f"{glauert_scale(lattice.chordwise, flap.chord_fraction):.4f}"
            for name, flap in zip(names, case.flaps, strict=True)
        ),
        f"flapwise root moment by frequency [MN m]    collective: gust, {', '.join(names)}     "
        f"whirl: gust, {', '.join(names)}",
    ]
    z = np.exp(2j * np.pi * np.array(FREQUENCIES) * rotor.time_step)
    response = [
        np.abs(whole.response(m, z, load)[:, 0] * [1.0, *[degree] * len(names)]) / 1e6 for m in (0, 1)
    ]
    for frequency, collective, whirl in zip(FREQUENCIES, *response, strict=True):
        pairs = "       ".join(" ".join(f"{each:8.4f}" for each in gain) for gain in (collective, whirl))
        lines.append(f"  {frequency:4.1f} Hz                                    {pairs}")
    return "\n".join(lines)


def _profile(case: Case) -> str:
    return "no profile drag" if case.airloads.profile == "none" else "with profile drag"


def _mean_wake(case: Case) -> str:
    length = case.airloads.mean_wake
    return "in the same wake" if length == "perturbations" else f"in a wake of {length:g} diameters"
