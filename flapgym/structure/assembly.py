"""The whole turbine's structure by direct assembly: blades clamped to a hub that moves with the support.

The unknowns are the blades' q in each blade's own rotating frame, then the support's q in the tower frame; the
hub's motion is substituted into eq. 2, so no multiplier is needed. With rotation the matrices depend on the
azimuth.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.linalg

from flapgym.core.arrays import AnyArray
from flapgym.core.fields import Count, Quantity
from flapgym.structure.blade import linear_blade
from flapgym.structure.body import LinearBlade
from flapgym.structure.rotation import about_x, hat
from flapgym.structure.support import LinearSupport, linear_support
from flapgym.turbine import Turbine


def hub_velocity(support: LinearSupport, azimuth: float, rotor_speed: float) -> tuple[AnyArray, AnyArray]:
    """Velocities nu (6, N) of a blade's frame at `azimuth` [rad] per q', and their rate of change per q'.

    nu = T q' and nu' = T q'' + T' q', with T' the derivative in time at constant rotor speed.
    """
    Quantity("angle").check(azimuth, "hub_velocity.azimuth")
    Quantity("angular rate").check(rotor_speed, "hub_velocity.rotor_speed")
    turn = about_x(-azimuth)
    rate = -rotor_speed * hat(np.array([1.0, 0.0, 0.0])) @ turn
    both = np.eye(2)
    return np.kron(both, turn) @ support.hub, np.kron(both, rate) @ support.hub


def assemble(
    blades: Sequence[LinearBlade], support: LinearSupport, azimuth: float = 0.0
) -> tuple[AnyArray, AnyArray, AnyArray]:
    """M, C, K of support and equally spaced blades at one azimuth [rad] of the first blade.

    Unknowns: the blades' 6n each, in their own frames, then the support's N. Loads on the blades also act on the
    support, by their resultant about the apex. The steady hub loads of the blades are taken to balance, as those
    of equal blades do (`joint.steady_load_tangent` gives what a remainder adds).
    """
    if not blades:
        raise ValueError("assemble.blades: expected one or more, got none")
    sizes = [blade.mass.shape[0] for blade in blades]
    rotor, total = sum(sizes), sum(sizes) + support.mass.shape[0]
    mass, damping, stiffness = (np.zeros((total, total)) for _ in range(3))
    base = slice(rotor, total)
    mass[base, base], damping[base, base], stiffness[base, base] = (
        support.mass,
        support.damping,
        support.stiffness,
    )
    start = 0
    for index, (blade, size) in enumerate(zip(blades, sizes, strict=True)):
        own = slice(start, start + size)
        motion, rate = hub_velocity(support, azimuth + 2 * np.pi * index / len(blades), blade.rotor_speed)
        mass[own, own], damping[own, own], stiffness[own, own] = blade.mass, blade.damping, blade.stiffness
        mass[own, base] = blade.mass_sr @ motion
        mass[base, own] = motion.T @ blade.mass_rs
        damping[own, base] = blade.damping_sr @ motion + blade.mass_sr @ rate
        damping[base, own] = motion.T @ blade.damping_rs
        stiffness[base, own] = motion.T @ blade.stiffness_rs
        mass[base, base] += motion.T @ blade.mass_rr @ motion
        damping[base, base] += motion.T @ (blade.damping_rr @ motion + blade.mass_rr @ rate)
        start += size
    return mass, damping, stiffness


def parked_modes(turbine: Turbine, elements: int = 12, count: int = 20) -> tuple[AnyArray, AnyArray]:
    """Lowest frequencies (count,) [Hz] and shapes (N, count), of unit modal mass, of the parked turbine, blade 1 up.

    Undamped, no wind, no gravity, generator locked: the paper's Table 1.
    """
    blade = linear_blade(turbine, elements)
    mass, _, stiffness = assemble([blade] * turbine.rotor.blade_count, linear_support(turbine))
    # The inverse problem has the lowest modes at its well-conditioned end.
    total = len(mass)
    Count(at_least=1, at_most=total).check(count, "parked_modes.count")
    inverse, shapes = scipy.linalg.eigh(mass, stiffness, subset_by_index=(total - count, total - 1))
    frequencies = 1.0 / (2.0 * np.pi * np.sqrt(inverse[::-1]))
    return frequencies, shapes[:, ::-1] * 2.0 * np.pi * frequencies
