"""A wind box as the field over the rotor: read from a file, checked for a turbine and an episode, carried past it.

The box is frozen and carried with the mean wind; it does not turn. Where in it an episode begins is drawn, unless
`BoxFile.start` says it: the first of `TRIES` moments, uniform over the box, from which the episode fits. So a seed
means the same wind however long the episode is, as long as it fits there.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Annotated, ClassVar

import numpy as np
from scipy.special import ndtr

from flapgym.core.arrays import Array
from flapgym.core.fields import Count, FilePath, OrNone, Quantity, TupleOf, check_fields
from flapgym.core.wording import number, one_line
from flapgym.wind.box import ROUNDING, WindBox
from flapgym.wind.box_files import read_box
from flapgym.wind.disk import annulus_weights

TRIES = 64
"""Moments drawn, at most. If an episode fits from a tenth of the box, one in a thousand finds none of them to fit."""
MEAN_WITHIN = 0.1
"""By which the mean over the disk and the whole box may differ from the mean wind, over it: twice what ten minutes of
IEC's class A wander by at 11 m/s (intensity 18 %, integral time 31 s: 0.18 sqrt(2 * 31 / 600) = 6 % at a point)."""
AROUND = 360
"""Points around a ring for its mean: more than the cells that any ring of a usual grid crosses."""


@dataclass(frozen=True)
class BoxFile:
    """A wind box in a file: TurbSim's `.bts`, NetCDF, or with `shape` and `spacing` numbers as HAWC2 takes them.

    Parameters
    ----------
    file : str
        HAWC2's is that of the component along the wind.
    shape : tuple of three int or None
        Of a HAWC2 file: points along the wind, to the left and up.
    spacing : tuple of three float or None
        Of a HAWC2 file: their distances [m].
    start : float or None
        Moment of the box at which every episode begins [s]; drawn by default.
    turbulence_intensity : float or None
        To which what varies in time is scaled: its standard deviation over the whole box, over the mean wind. By
        default the wind is as in the file. The mean of each point, such as shear, stays.
    hub_height : float or None
        Height in the file at which the hub is [m], the turbine's by default. A HAWC2 file has none: the hub is in its
        middle.
    """

    kind: ClassVar[str] = "box"
    file: Annotated[str, FilePath("a wind box")]
    shape: Annotated[
        tuple[int, int, int] | None, OrNone(TupleOf(Count(at_least=2, at_most=1 << 20), length=3))
    ] = None
    spacing: Annotated[
        tuple[float, float, float] | None, OrNone(TupleOf(Quantity("length", above=0.0), length=3))
    ] = None
    start: Annotated[float | None, OrNone(Quantity("time", at_least=0.0))] = None
    turbulence_intensity: Annotated[float | None, OrNone(Quantity("fraction", at_least=0.0, below=1.0))] = (
        None
    )
    hub_height: Annotated[float | None, OrNone(Quantity("length", at_least=0.0, at_most=1000.0))] = None

    def __post_init__(self) -> None:
        check_fields(self, "field")
        for name, other in (("shape", "spacing"), ("spacing", "shape")):
            if getattr(self, name) is None and getattr(self, other) is not None:
                raise ValueError(
                    f"field.{name}: missing beside field.{other}; a HAWC2 file needs both, others neither"
                )
        if self.shape is not None and self.hub_height is not None:
            raise ValueError(
                f"field.hub_height: expected None beside field.shape, as the hub is in the middle of a HAWC2 file, "
                f"got {number(self.hub_height)} m"
            )

    def on_turbine(
        self, mean_wind: float, hub_height: float, reach: float, rotor_speed: float, duration: float
    ) -> BoxField:
        """Read the box and make sure that it suits a turbine and its episodes.

        Parameters
        ----------
        mean_wind : float
            The model's [m/s].
        hub_height : float
            Of the turbine [m].
        reach : float
            Radius up to which the blades meet wind [m].
        rotor_speed : float
            [rad/s]
        duration : float
            Of an episode [s].

        Raises
        ------
        FileNotFoundError, ValueError
            If there is no such file, or it is no box or none that suits; one line that names the field and the file.
        ImportError
            If a package is missing that reads it.
        """
        try:
            # Kept beside others that differ in where they begin, and read again once the file has changed.
            box = _read(replace(self, start=None), mean_wind, hub_height, _changed(self.file))
            if self.start is not None and box.duration >= duration > box.duration - self.start + ROUNDING:
                raise ValueError(
                    f"expected wind.field.start of at most {number(box.duration - duration)} s, as the box lasts "
                    f"{number(box.duration)} s and the episode {number(duration)} s, got {number(self.start)} s"
                )
            box.require(mean_wind, reach, duration)
            longest = math.pi / rotor_speed
            if box.time_step > longest:
                raise ValueError(
                    f"box.time_step: expected at most {number(longest)} s, half a revolution, or the box has "
                    f"nothing at the rotor's own frequency, got {number(box.time_step)} s; give more planes, or check "
                    "the unit of its times"
                )
            _require_mean(box, reach)
        except FileNotFoundError as error:
            raise FileNotFoundError(f"wind.field.file: {error}; give its path") from None
        except ValueError as error:
            name, line = one_line(self.file, 300), str(error)
            # What the reader found begins with the file's name.
            raise ValueError(
                f"wind.field.file: {line if line.startswith(name) else f'{name}: {line}'}"
            ) from None
        return BoxField(box, self.start)


@lru_cache(maxsize=2)
def _read(given: BoxFile, mean_wind: float, hub_height: float, changed: object) -> WindBox:
    height = hub_height if given.hub_height is None else given.hub_height
    box = read_box(given.file, mean_wind, height, given.shape, given.spacing)
    return box if given.turbulence_intensity is None else _scaled(box, given.turbulence_intensity)


def _changed(path: str) -> tuple[int, int] | None:
    """What differs once a file is another one under its name; None where there is none."""
    try:
        found = os.stat(path)
    except (OSError, ValueError):
        return None  # the reader says why
    return found.st_mtime_ns, found.st_size


def _rings(reach: float) -> Array:
    """Radii of rings whose annuli are the disk up to `reach`."""
    return np.asarray(reach * (np.arange(10) + 0.5) / 10.0, dtype=np.float64)


def _require_mean(box: WindBox, reach: float) -> None:
    radii = _rings(reach)
    average = float(np.einsum("tyz,yz->", box.u, _averaging(box, radii))) / len(box.u)
    if abs(average) > MEAN_WITHIN * box.mean_wind:
        raise ValueError(
            f"box.u: expected a mean over the disk within {MEAN_WITHIN:.0%} of the mean wind "
            f"{number(box.mean_wind)} m/s, got {box.mean_wind + average:.4g} m/s; take a model that was built for that "
            "wind, or another box"
        )


def _scaled(box: WindBox, intensity: float) -> WindBox:
    steady = box.u.mean(axis=0)
    deviation = math.sqrt(float(np.mean((box.u - steady) ** 2)))
    if not deviation > 0.0:
        raise ValueError(
            "expected a box whose wind varies in time, to scale it to wind.field.turbulence_intensity, got a steady "
            "one; leave that out"
        )
    return replace(box, u=steady + intensity * box.mean_wind / deviation * (box.u - steady))


def _averaging(box: WindBox, radii: Array) -> Array:
    """Weights (Y, Z) of the grid's points in the mean over the disk: rings, each for its annulus."""
    angle = 2.0 * np.pi * np.arange(AROUND) / AROUND
    y, z = -np.outer(radii, np.sin(angle)).ravel(), np.outer(radii, np.cos(angle)).ravel()
    shares = np.repeat(annulus_weights(radii) / AROUND, AROUND)
    # The wind between the points is a sum of theirs, each times a product of two hats.
    of_y, of_z = (
        np.stack([np.interp(place, axis, hat) for hat in np.eye(len(axis))], axis=1)
        for place, axis in ((y, box.y), (z, box.z))
    )
    return np.asarray(of_y.T @ (shares[:, None] * of_z))


@dataclass(frozen=True, eq=False)
class BoxField:
    """A box that suits the turbine. Two are equal if the wind in them is.

    Attributes
    ----------
    box : WindBox
    start : float or None
        Moment of the box at which every episode begins [s]; drawn if None.
    """

    box: WindBox
    start: float | None = None

    @property
    def fingerprint(self) -> str:
        """Of every number, and of where episodes begin."""
        return f"{self.box.fingerprint} {self.start}"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, BoxField) and self.fingerprint == other.fingerprint

    def __hash__(self) -> int:
        return hash(self.fingerprint)

    def deviation(self, mean: float) -> float:
        """Standard deviation [m/s] over the whole box, whatever the mean wind."""
        return float(self.box.u.std())

    def begins(self, noise: Array, duration: float) -> float:
        """Moment of the box [s] at which an episode begins that lasts so long [s].

        Parameters
        ----------
        noise : (TRIES,) float
            Standard normal numbers.
        duration : float
            At most the box's.
        """
        if self.start is not None:
            return self.start
        latest = max(0.0, self.box.duration - duration)
        chances = ndtr(noise)
        fitting = np.flatnonzero(chances * self.box.duration <= latest)
        return float(chances[fitting[0]] * self.box.duration if fitting.size else chances[0] * latest)

    def passing(self, noise: Array, time: Array, duration: float, radii: Array) -> BoxWind:
        """The wind of an episode that lasts so long [s], at times (T,) since its start [s] and rings (R,) [m].

        Before its first plane the box is taken to have stood still, and after its last one.
        """
        moments = np.clip(self.begins(noise, duration) + time, 0.0, self.box.duration)
        return BoxWind(self.box, moments, radii)


@dataclass(frozen=True, eq=False)
class BoxWind:
    """One passage of a box at T steps and R rings, in m/s about the mean.

    Attributes
    ----------
    box : WindBox
    moments : (T,) float
        Of the box [s].
    radii : (R,) float
        Of the rings [m].
    """

    box: WindBox
    moments: Array
    radii: Array

    @property
    def steps(self) -> int:
        """T."""
        return len(self.moments)

    def components(self, azimuth: Array) -> Array:
        """Multi-blade components (T, R, 3) of what the blades meet, from blade 1's azimuth (T,) [rad]."""
        return self.box.components(self.moments, azimuth, self.radii)

    def rotor_average(self) -> Array:
        """The mean over the disk (T,), each ring for the annulus up to midway to its neighbours."""
        step = self.box.time_step
        first, last = (int(bound(self.moments[at] / step)) for bound, at in ((np.floor, 0), (np.ceil, -1)))
        planes = self.box.u[first : last + 1]
        average = np.einsum("tyz,yz->t", planes, _averaging(self.box, self.radii))
        return np.interp(self.moments, step * (first + np.arange(len(planes))), average)


@dataclass(frozen=True, eq=False)
class BoxOnDisk:
    """One passage of a box over the whole disk, for a picture; as `flapgym.wind.blade_field.FieldOnDisk`.

    Attributes
    ----------
    box : WindBox
    begin : float
        Moment of the box at time zero [s].
    radii : (R,) float
        Of the rings [m].
    """

    box: WindBox
    begin: float
    radii: Array

    def on_disk(self, time: float, rotor: float, azimuth: Array) -> Array:
        """Wind (R, A) [m/s] at a time [s] and azimuths (A,) [rad], wherever the rotor is."""
        moment = np.clip(self.begin + time, 0.0, self.box.duration)
        arm = self.radii[:, None]
        return self.box.at(moment, -arm * np.sin(azimuth), arm * np.cos(azimuth))
