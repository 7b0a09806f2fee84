"""The wind about its mean as one object: stationary turbulence, and a gust given in advance.

A kind of wind of one's own is a class with a `kind`, its fields and `wind(time, mean)`; an object of it is the gust:

    @dataclass(frozen=True)
    class Bell:
        kind: ClassVar[str] = "bell"
        size: Annotated[float, Quantity("speed", at_least=-20.0, at_most=20.0)]  # [m/s]
        middle: Annotated[float, Quantity("time", at_least=0.0)] = 10.0  # [s]
        width: Annotated[float, Quantity("time", above=0.0)] = 2.0  # [s]

        def __post_init__(self) -> None:
            check_fields(self, "gust")

        def wind(self, time: Array, mean: float) -> Array:
            return self.size * np.exp(-0.5 * ((time - self.middle) / self.width) ** 2)

    Wind(turbulence_intensity=0.0, gust=Bell(3.0))

For a mapping to name it, `{"kind": "bell", "size": 3.0}`, it joins the classes of `flapgym.wind.gusts.GUSTS`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from flapgym.core.arrays import BLADES, Array
from flapgym.core.fields import Count, Numbers, OneOrMore, OrNone, Quantity, check_fields
from flapgym.wind.box_field import BoxFile
from flapgym.wind.gusts import (
    GUST,
    STRONGEST,
    DiskGust,
    Gust,
    Sinusoid,
    SizedGust,
    gust_components,
    gust_of,
)
from flapgym.wind.inflow import Inflow
from flapgym.wind.turbulence import TURBULENCE, Turbulence

LARGEST_POOL = 1_000_000
"""Realisations of a pool: each takes some kilobytes from the start and half a megabyte once it has been met."""


@dataclass(frozen=True)
class Wind:
    """Perturbations along the shaft about the mean wind: turbulence drawn at random, plus a gust.

    Attributes
    ----------
    turbulence_intensity : float, tuple of float, or None
        Standard deviation over the mean wind speed, 0.1 for 10 %: one for all turbines, or one for each. The model's
        own where it is None, as is the length scale.
    length_scale : float or None
        Integral length of the turbulence [m].
    gust : Gust, mapping or None
        An object, or the mapping that describes one, `{"kind": "step", "start": 2.0, "size": 1.0}`, which becomes it.
    field : Turbulence, BoxFile, mapping or None
        Turbulence that differs over the disk, `{"kind": "kaimal", "turbulence_class": "B"}`, in the place of the
        homogeneous one. It knows its own intensity and scale, von Karman's by default those of the model. A wind box
        from a file, `{"kind": "box", "file": "wind.bts"}`, is as the file has it.
    inflow : Inflow, mapping or None
        What is steady of the wind over the disk, `{"shear_exponent": 0.2, "tower_shadow": True}`.
    pool : int
        Realisations of turbulence that all episodes share; 0 for a new one at each.
    """

    turbulence_intensity: Annotated[
        float | tuple[float, ...] | None, OrNone(OneOrMore(Quantity("fraction", at_least=0.0, below=1.0)))
    ] = None
    length_scale: Annotated[float | None, OrNone(Quantity("length", at_least=1.0, at_most=1e5))] = None
    gust: Annotated[Gust | Mapping[str, Any] | None, OrNone(GUST)] = None
    field: Annotated[Turbulence | BoxFile | Mapping[str, Any] | None, OrNone(TURBULENCE)] = None
    inflow: Annotated[Inflow | Mapping[str, Any] | None, OrNone(Inflow)] = None
    pool: Annotated[int, Count(at_least=0, at_most=LARGEST_POOL)] = 0

    def __post_init__(self) -> None:
        check_fields(self, "wind")
        for name in ("turbulence_intensity", "length_scale"):
            if self.field is not None and getattr(self, name) is not None:
                raise ValueError(f"wind.{name}: expected None beside a field, which has its own")
        if self.gust is not None and self.pool:
            raise ValueError(
                f"wind.pool: expected 0 beside a gust, whose wind no pool holds, got {self.pool}"
            )

    def intensities(self, count: int, default: float) -> Array:
        """Turbulence intensity of each of `count` turbines, (count,); `default` where none was given.

        Raises
        ------
        ValueError
            If there is neither one for all nor one for each.
        """
        chosen = default if self.turbulence_intensity is None else self.turbulence_intensity
        if isinstance(chosen, tuple) and len(chosen) != count:
            raise ValueError(
                f"wind.turbulence_intensity: expected one number, or one for each of {count} environments, "
                f"got {len(chosen)}"
            )
        return np.broadcast_to(np.asarray(chosen, dtype=np.float64), (count,)).copy()

    def given(
        self,
        time: Array,
        mean_speed: float,
        rotor_diameter: float | None = None,
        hub_height: float | None = None,
    ) -> Array:
        """What is known in advance of the perturbation [m/s], (T,): the gust; zero without one.

        Parameters
        ----------
        time : (T,) float
            Samples, evenly spaced, since the episode's start [s]; before it, negative.
        mean_speed : float
            [m/s]
        rotor_diameter, hub_height : float or None
            Of the turbine [m], if they are known: what IEC's extreme gusts take where they give none themselves.

        Raises
        ------
        ValueError
            If the gust differs over the disk, the samples would show a sinusoid as a slower one, a recording ends
            before they do, an extreme gust lacks the turbine's size, or the perturbation is not one finite number of at
            most 100 m/s at each time.
        """
        if self.gust is None:
            return np.zeros(len(time))
        gust = gust_of(self.gust)
        if isinstance(gust, DiskGust):
            raise ValueError(
                f"gust.kind: expected a gust that is the same over the disk here, got {gust.kind}, which needs a model "
                "with the wind in each strip of its blades"
            )
        if isinstance(gust, SizedGust):
            gust = gust.on_turbine(rotor_diameter, hub_height)
        elif isinstance(gust, Sinusoid) and len(time) > 1:
            gust.check_samples(float(time[1] - time[0]))
        return _checked(gust.wind(time, mean_speed), time.shape, gust.kind)

    def given_by_strip(
        self,
        time: Array,
        mean_speed: float,
        radius: Array,
        rotor_diameter: float | None = None,
        hub_height: float | None = None,
    ) -> Array:
        """The same at strips of the blades, radii (R,) [m]: multi-blade components (u_0, u_c, u_s) (T, R, 3) [m/s].

        Raises
        ------
        ValueError
            If there is no gust, an extreme gust lacks the turbine's size, or the perturbation is not a finite number of
            at most 100 m/s everywhere.
        """
        gust = gust_of(self.gust)
        if isinstance(gust, SizedGust):
            gust = gust.on_turbine(rotor_diameter, hub_height)
        found = gust_components(gust, time, radius, mean_speed)
        return _checked(found, (len(time), len(radius), BLADES), gust.kind)


def _checked(wind: Any, shape: tuple[int, ...], kind: str) -> Array:
    """What a gust gives as finite numbers of this shape."""
    found = Numbers(dimension="speed", axes=len(shape), at_least=-STRONGEST, at_most=STRONGEST).check(
        wind, f"gust {kind}"
    )
    if found.shape != shape:
        raise ValueError(f"gust {kind}: expected wind at {shape[0]} times, got {len(found)}")
    return found
