"""A box of wind on a grid of times and places in the rotor plane, such as TurbSim, HAWC2 or hipersim make."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np

from flapgym.core.arrays import Array
from flapgym.core.fields import Count, Numbers, Quantity, TupleOf, check_fields
from flapgym.core.multiblade import blade_azimuths, to_components
from flapgym.core.wording import number

MEAN_TOLERANCE = 0.01
"""By which the mean wind of a box may differ from the model's, over it: all its frequencies are off by as much."""
ROUNDING = 1e-6
"""By which a point may lie beyond the grid [m, s], as single precision leaves it."""
STRONGEST = 100.0
"""Largest perturbation [m/s]: more is another unit."""

MANN_LENGTH_SCALE = 33.6
"""Of Mann's model [m]: 0.8 times 42 m, for hubs above 60 m (IEC 61400-1:2005, Annex B)."""
MANN_ANISOTROPY = 3.9
"""gamma of Mann's model (the same annex)."""


@dataclass(frozen=True, eq=False)
class WindBox:
    """The wind along the shaft at points of a plane, at times one step apart; it does not turn with the rotor.

    Attributes
    ----------
    u : (T, Y, Z) float
        Perturbation about the mean wind [m/s]. Shear that a file has stays in it: give none beside it.
    y, z : (Y,), (Z,) float
        Places of the points from the hub [m], increasing: to the left of one who looks downwind, and up.
    time_step : float
        [s]. The first plane arrives at time zero.
    mean_wind : float
        With which the box is carried past the rotor [m/s].
    """

    u: Annotated[Array, Numbers("speed", axes=3, at_least=-STRONGEST, at_most=STRONGEST)]
    y: Annotated[Array, Numbers("length", axes=1)]
    z: Annotated[Array, Numbers("length", axes=1)]
    time_step: Annotated[float, Quantity("time", above=0.0)]
    mean_wind: Annotated[float, Quantity("speed", above=0.0, at_most=STRONGEST)]

    def __post_init__(self) -> None:
        check_fields(self, "box")
        for name in ("y", "z"):
            places = getattr(self, name)
            if len(places) < 2 or not (np.diff(places) > 0.0).all():
                raise ValueError(f"box.{name}: expected two or more places that increase, got {len(places)}")
        if self.u.shape[0] < 2 or self.u.shape[1:] != (len(self.y), len(self.z)):
            raise ValueError(
                f"box.u: expected two or more times of {len(self.y)} by {len(self.z)} points, got {self.u.shape}"
            )
        self.u.flags.writeable = False

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 of every number."""
        digest = hashlib.sha256(repr((self.time_step, self.mean_wind)).encode())
        for numbers in (self.y, self.z, self.u):
            digest.update(repr(numbers.shape).encode())
            digest.update(np.ascontiguousarray(numbers).tobytes())
        return digest.hexdigest()

    @property
    def duration(self) -> float:
        """Time from the first plane to the last [s]."""
        return (len(self.u) - 1) * self.time_step

    def require(self, mean_wind: float, radius: float, duration: float) -> None:
        """Refuse a box that does not suit an episode.

        Parameters
        ----------
        mean_wind : float
            The model's [m/s]; the box's may differ by `MEAN_TOLERANCE` of it.
        radius : float
            Of the rotor [m], which the grid has to cover.
        duration : float
            Of the episode [s].

        Raises
        ------
        ValueError
            If the box has another mean wind, does not cover the rotor, or ends too early.
        """
        if abs(self.mean_wind - mean_wind) > MEAN_TOLERANCE * mean_wind:
            raise ValueError(
                f"box.mean_wind: expected the model's {number(mean_wind)} m/s within {MEAN_TOLERANCE:.0%}, got "
                f"{number(self.mean_wind)} m/s; take a model that was built for that wind, or another box"
            )
        for name in ("y", "z"):
            places = getattr(self, name)
            if places[0] > -radius + ROUNDING or places[-1] < radius - ROUNDING:
                raise ValueError(
                    f"box.{name}: expected a grid that covers the rotor, -{number(radius)} to {number(radius)} m about "
                    f"the hub, got {number(places[0])} to {number(places[-1])} m; take a wider grid, or check "
                    "the hub's height in it"
                )
        if self.duration < duration - ROUNDING:
            raise ValueError(
                f"box.u: expected a box that lasts as long as the episode, {number(duration)} s, got "
                f"{number(self.duration)} s; take a longer one, or a duration that fits into it"
            )

    def at(self, time: Array, y: Array, z: Array) -> Array:
        """Perturbation [m/s] at times [s] and places [m], which broadcast: the shape they have together.

        It is linear between the points in all three directions, which takes off some of what is smaller than twice
        the grid's spacing.

        Raises
        ------
        ValueError
            If a point lies outside the box.
        """
        from scipy.interpolate import RegularGridInterpolator  # long to import

        times = self.time_step * np.arange(len(self.u))
        axes = (times, self.y, self.z)
        points = []
        for name, axis, given in zip(("time", "y", "z"), axes, np.broadcast_arrays(time, y, z), strict=True):
            low, high = float(given.min(initial=axis[0])), float(given.max(initial=axis[-1]))
            if not (low >= axis[0] - ROUNDING and high <= axis[-1] + ROUNDING):
                outside = low if not low >= axis[0] - ROUNDING else high
                unit = "s" if name == "time" else "m"
                raise ValueError(
                    f"box.{name}: expected points from {number(axis[0])} to {number(axis[-1])} {unit}, got "
                    f"{number(outside)} {unit}"
                )
            points.append(np.clip(given, axis[0], axis[-1]))
        return np.asarray(RegularGridInterpolator(axes, self.u)(np.stack(points, axis=-1)))

    def components(self, time: Array, azimuth: Array, radius: Array) -> Array:
        """What the three blades meet, in multi-blade components (u_0, u_c, u_s) (T, R, 3) [m/s].

        Tilt and cone of the rotor are left out: its points are taken in the plane of the box.

        Parameters
        ----------
        time, azimuth : (T,) float
            Times since the first plane [s] and the azimuths of the rotor then [rad]: blade 1 upright at zero, growing
            clockwise for one who looks downwind.
        radius : (R,) float
            [m]

        Raises
        ------
        ValueError
            If a point lies outside the box.
        """
        angle = blade_azimuths(azimuth)[:, None, :]  # (T, 1, 3)
        arm = radius[:, None]
        blades = self.at(time[:, None, None], -arm * np.sin(angle), arm * np.cos(angle))
        return to_components(blades, azimuth[:, None])


def mann_box(
    mean_wind: float,
    standard_deviation: float,
    shape: tuple[int, int, int],
    spacing: tuple[float, float, float],
    seed: int,
    length_scale: float = MANN_LENGTH_SCALE,
    anisotropy: float = MANN_ANISOTROPY,
) -> WindBox:
    """A box of Mann's turbulence about the hub, made by hipersim and scaled to a standard deviation.

    Parameters
    ----------
    mean_wind, standard_deviation : float
        [m/s]; the latter is that of the whole box.
    shape : tuple of three int
        Points along the wind, to the left and up.
    spacing : tuple of three float
        Their distances [m]; along the wind it makes the time step, over the mean wind (Taylor).
    seed : int
    length_scale, anisotropy : float
        L [m] and gamma of the model; IEC 61400-1:2005, Annex B, by default.

    Raises
    ------
    ImportError
        If hipersim is not installed.
    ValueError
        If a number is out of range.
    """
    for name, value in (("mean_wind", mean_wind), ("standard_deviation", standard_deviation)):
        Quantity("speed", above=0.0, at_most=STRONGEST).check(value, f"mann_box.{name}")
    TupleOf(Count(at_least=2, at_most=1 << 20), length=3).check(shape, "mann_box.shape")
    TupleOf(Quantity("length", above=0.0), length=3).check(spacing, "mann_box.spacing")
    Count(at_least=0, at_most=(1 << 32) - 1).check(seed, "mann_box.seed")
    Quantity("length", above=0.0).check(length_scale, "mann_box.length_scale")
    Quantity("number", at_least=0.0, at_most=10.0).check(anisotropy, "mann_box.anisotropy")
    try:
        from hipersim import MannTurbulenceField
    except ImportError as error:
        raise ImportError(f'mann_box: hipersim makes it: pip install "flapgym[wind]" ({error})') from error
    field = MannTurbulenceField.generate(
        L=length_scale, Gamma=anisotropy, Nxyz=shape, dxyz=spacing, seed=seed, verbose=0
    )
    wind = np.asarray(field.uvw[0], dtype=np.float64)
    return along_the_wind(wind * (standard_deviation / wind.std()), spacing, mean_wind)


def along_the_wind(u: Array, spacing: tuple[float, float, float], mean_wind: float) -> WindBox:
    """The box of perturbations u (X, Y, Z) [m/s] on a grid of spacings [m], x downwind, y to the left, z up.

    The wind carries it along x, so its last plane arrives first (Taylor). The hub is in the middle of y and z.
    """
    step, *sides = spacing
    y, z = (
        side * (np.arange(count) - 0.5 * (count - 1)) for side, count in zip(sides, u.shape[1:], strict=True)
    )
    return WindBox(u[::-1], y, z, step / mean_wind, mean_wind)
