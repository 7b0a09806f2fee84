"""Where a turbine runs at a wind speed: as its schedule says, above rated at the pitch that holds rated power."""

from __future__ import annotations

from dataclasses import replace

from scipy.optimize import root_scalar

from flapgym.aeroelastic.trim import trim
from flapgym.core.units import DEGREE
from flapgym.core.wording import number
from flapgym.turbine import Case

FIRST_MOVE = -0.5 * DEGREE
"""From the listed pitch, to begin the search with."""
SETTLED = 1e-4 * DEGREE
"""Change of pitch that counts as none."""


def operating_case(case: Case, wind_speed: float) -> Case:
    """The case at a wind speed [m/s] of its schedule.

    With a table `[speed_control]` the pitch above rated is the one at which the air gives rated power, for that is what
    the control holds: well above rated a blade that twists needs less than the listed pitch of a stiff one.

    Raises
    ------
    ValueError
        If the schedule does not reach so far, or no pitch near the listed one gives rated power.
    """
    listed = case.at_wind_speed(wind_speed)
    point, control = listed.operating_point, listed.speed_control
    if control is None or point.pitch <= 0.0:
        return listed

    def excess(pitch: float) -> float:
        return (
            trim(replace(listed, operating_point=replace(point, pitch=pitch))).loads.power
            - control.rated_power
        )

    found = root_scalar(excess, x0=point.pitch, x1=point.pitch + FIRST_MOVE, xtol=SETTLED, method="secant")
    if not found.converged:
        raise ValueError(
            f"operating_point.pitch: no pitch near {number(point.pitch / DEGREE)} deg gives the rated power of "
            f"{number(control.rated_power / 1e6)} MW at {number(wind_speed)} m/s"
        )
    return replace(listed, operating_point=replace(point, pitch=float(found.root)))
