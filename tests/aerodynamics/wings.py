"""Straight wings in steady translation built from the rotor's own routines: the two-dimensional limit and beyond."""

from dataclasses import dataclass

import numpy as np
from scipy.special import hankel2

from flapgym.aerodynamics.lattice import Inflow, build_lattice
from flapgym.aerodynamics.model import Aerodynamics, assemble


@dataclass(frozen=True)
class Wing:
    """A wing of unit speed, density and mean chord: x is up, the wind blows along y, the span lies along z."""

    aero: Aerodynamics
    area: float

    @property
    def lift_load(self):
        """Row (1, 3 P) giving the lift coefficient of the forces."""
        return np.tile([1.0, 0.0, 0.0], len(self.aero.force_point))[None] / (0.5 * self.area)

    @property
    def moment_load(self):
        """Row (1, 3 P) giving the nose-up moment coefficient about the quarter chord of a rectangular wing."""
        arm = -(self.aero.force_point[:, 1] - 0.25) / (0.5 * self.area)
        return np.stack([arm, 0.0 * arm, 0.0 * arm], axis=-1).reshape(1, -1)

    @property
    def station(self):
        """Chordwise position of the collocation points in chords behind the leading edge."""
        return self.aero.collocation[:, 1]


def straight_wing(
    panels=10, courant=1.0, wake_chords=100.0, span=1e4, strips=1, difference=2, wake_end="closed"
):
    """Rectangular wing; `courant` is the length of a wake row over that of a panel."""
    flow = np.array([0.0, 1.0, 0.0])
    inflow = Inflow(velocity=flow, rotor_speed=0.0, wake_velocity=flow)
    leading = np.linspace([0.0, 0.0, -span / 2], [0.0, 0.0, span / 2], strips + 1)
    step = courant / panels
    lattice = build_lattice(leading, leading + flow, panels, inflow, step)
    rows = round(wake_chords / step)
    aero = assemble(
        lattice,
        inflow,
        time_step=step,
        wake_rows=rows,
        air_density=1.0,
        difference=difference,
        wake_end=wake_end,
    )
    return Wing(aero, area=span)


def theodorsen(k):
    """Lift-deficiency function of reduced frequency k = omega c / 2 V."""
    return hankel2(1, k) / (hankel2(1, k) + 1j * hankel2(0, k))


def elliptic_wing(aspect_ratio, panels=10, strips=40, straight=0.25, wake_chords=20.0):
    """Flat elliptic wing of unit root chord on even strips, the chords' points at fraction `straight` in line."""
    span = aspect_ratio * np.pi / 4
    flow = np.array([0.0, 1.0, 0.0])
    inflow = Inflow(velocity=flow, rotor_speed=0.0, wake_velocity=flow)
    z = np.linspace(-span / 2, span / 2, strips + 1)
    chord = np.sqrt(np.clip(1.0 - (2.0 * z / span) ** 2, 1e-8, None))
    leading = np.stack([0.0 * z, -straight * chord, z], axis=1)
    lattice = build_lattice(leading, leading + chord[:, None] * flow, panels, inflow, 1.0 / panels)
    rows = round(wake_chords * panels)
    aero = assemble(lattice, inflow, time_step=1.0 / panels, wake_rows=rows, air_density=1.0)
    return Wing(aero, area=np.pi / 4 * span)
