"""Side effects and duty of the controllers, as a section of the report."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from baselines.duty import Duty
from baselines.effects import Effects
from flapgym.evaluation import paired_change
from studies.document import Section, Table, percent

SIDE = {
    "fore_aft_rms": "tower base fore-aft rms",
    "fore_aft_del": "its DEL",
    "side_side_rms": "tower base side-to-side rms",
    "side_side_del": "its DEL",
    "edge_rms": "edgewise RBM rms",
    "edge_del": "its DEL",
}
"""Loads of `Effects` and their names in tables."""


def effects_section(
    found: Mapping[str, tuple[Effects, Duty]],
    labels: Mapping[str, str],
    open_loop: Effects,
    realisations: int,
) -> Section:
    """Tables of side effects and of duty by controller; the base case is "lqg"."""
    base = found["lqg"][1]
    loads, duty = [], []
    for name, (ours, moved) in found.items():
        changes = (paired_change(getattr(ours, key), getattr(open_loop, key)) for key in SIDE)
        loads.append((labels[name], *(percent(change) for change in changes)))
        degrees = (
            np.rad2deg(getattr(moved, key).mean()) for key in ("travel", "rate_rms", "acceleration_rms")
        )
        shares = (
            getattr(moved, key).mean() / getattr(base, key).mean()
            for key in ("inertial_power", "hinge_power")
        )
        duty.append(
            (labels[name], *(f"{value:.2f}" for value in degrees), *(f"{share:.2f}" for share in shares))
        )
    content: list[str | Table | Path] = [
        f"Change against open loop on the same {realisations} realisations [%], mean of the ratios, 95 % paired "
        "bootstrap interval. Tower: "
        "bending moment on the foundation, DEL with the S-N slope 4 of steel; edgewise root bending moment of the "
        "blades, DEL with slope 10. Gravity and profile drag are left out of the model and in-plane loads come out "
        "some 40 % small (docs/aerodynamics.md): these are changes of what turbulence does, not of all edgewise "
        "loads.",
        Table(("controller", *SIDE.values()), tuple(loads)),
        "Actuator duty, mean over blades and realisations: path of a flap, rms of rate and acceleration, and power "
        "over the base case's: to move the flap's inertia (mean modulus of rate times acceleration) and against a "
        "hinge moment in proportion to the angle (mean modulus of angle times rate).",
        Table(
            (
                "controller",
                "travel [deg/s]",
                "rate rms [deg/s]",
                "acceleration rms [deg/s^2]",
                "inertial power over base",
                "hinge power over base",
            ),
            tuple(duty),
        ),
    ]
    conclusions = []
    if "pd" in found:
        inertial, hinge = (
            100.0 * (getattr(found["pd"][1], key).mean() / getattr(base, key).mean() - 1.0)
            for key in ("inertial_power", "hinge_power")
        )
        verdict = "agrees" if inertial > 0.0 else "disagrees"
        conclusions.append(
            "The paper cites up to 70 % more actuation power for PD than for a robust controller at equal load. By the "
            f"paper's rule, not quite at equal load, ours takes {inertial:+.0f} % of inertial and {hinge:+.0f} % of "
            f"hinge power against the base case: {verdict} in sign. The base case's weights leave acceleration "
            "nearly free; the section on rivals compares at equal load, and with an LQG that weighs it."
        )
    return Section("Side effects and actuator duty", tuple(content), conclusions=tuple(conclusions))
