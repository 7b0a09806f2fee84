"""Figure 8: flapwise load of rigid blades after an impulsive gust, full rotor against a single blade."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from flapgym.aerodynamics import (
    build_aerodynamics,
    collective_response,
    gust_downwash,
    rigid_rotor,
    root_moment_load,
)
from flapgym.core.arrays import Array
from flapgym.turbine import Case

WAKES = ((0.25, 0.0), (1.0, 0.3))
"""Lengths [rotor diameters] and inductions of the two readings of the wake."""
TURNS = 3.2
"""Length of a response."""


@dataclass(frozen=True, eq=False)
class GustLoads:
    """Flapwise root moment after a step of the wind, by reading of the wake: WAKES.

    Attributes
    ----------
    turns : (T,) float
        Rotor turns since the gust.
    moment : (2, 2, T) float
        By wake, of a single blade and of one in the full rotor, over the single blade's last.
    loss : (2,) float
        Steady load in the full rotor against the single blade's [%].
    """

    turns: Array
    moment: Array
    loss: Array


def gust_loads(case: Case) -> GustLoads:
    """The loads of a case."""
    turn = 2.0 * np.pi / case.rotor_speed / case.discretisation.time_step
    steps = round(TURNS * turn)
    moment, loss = np.empty((2, 2, steps)), np.empty(2)
    for wake, (length, induction) in enumerate(WAKES):
        other = variant(case, wake_length=length, induction=induction)
        for which, blades in enumerate((1, 3)):
            aero = build_aerodynamics(other, blades=blades)
            gust = gust_downwash(aero).sum(axis=1, keepdims=True)
            load = root_moment_load(aero, other)
            moment[wake, which] = collective_response(aero, np.ones((steps, 1)), gust, load)[:, 0]
        moment[wake] /= moment[wake, 0, -1]
        rotor, alone = (steady_gains(other, blades)[0] for blades in (3, 1))
        loss[wake] = 100.0 * (rotor / alone - 1.0)
    return GustLoads(np.arange(steps) / turn, moment, loss)


def variant(case: Case, **grid: Any) -> Case:
    """The case with another discretisation."""
    return replace(case, discretisation=replace(case.discretisation, **grid))


def steady_gains(case: Case, blades: int = 3) -> Array:
    """Steady root moment [N m] per m/s of gust and per radian of all flaps, (2,), of the rotor or a blade alone."""
    rotor = rigid_rotor(case, blades)
    return rotor.steady(root_moment_load(rotor.aero, case))[0]
