"""What IEC 61400-1:2005 (third edition) says of a site's wind: classes, strength and scale of the turbulence."""

from __future__ import annotations

REFERENCE_SPEEDS = {"I": 50.0, "II": 42.5, "III": 37.5}
"""V_ref of the turbine classes [m/s] (Table 1)."""
REFERENCE_INTENSITIES = {"A": 0.16, "B": 0.14, "C": 0.12}
"""I_ref of the turbulence classes (the same table)."""


def turbulence_scale(hub_height: float) -> float:
    """Lambda_1 [m], 0.7 times the hub height [m] up to 60 m and 42 m above (equation 5)."""
    return 0.7 * min(hub_height, 60.0)


def normal_turbulence(turbulence_class: str, mean: float) -> float:
    """Standard deviation along the shaft [m/s] of the normal turbulence model at a mean wind [m/s] (equation 11).

    sigma_1 = I_ref (0.75 V_hub + 5.6 m/s), the 90 % quantile of what a site of the class has.
    """
    return REFERENCE_INTENSITIES[turbulence_class] * (0.75 * mean + 5.6)


def extreme_turbulence(turbine_class: str, turbulence_class: str, mean: float) -> float:
    """Standard deviation along the shaft [m/s] of the extreme turbulence model at a mean wind [m/s] (equation 19).

    sigma_1 = c I_ref (0.072 (V_ave / c + 3) (V_hub / c - 4) + 10) with c = 2 m/s and V_ave = 0.2 V_ref.
    """
    c = 2.0
    yearly_mean = 0.2 * REFERENCE_SPEEDS[turbine_class]
    part = 0.072 * (yearly_mean / c + 3.0) * (mean / c - 4.0) + 10.0
    return c * REFERENCE_INTENSITIES[turbulence_class] * part
