"""A lidar that looks upwind: where its beams measure, when what they see arrives, and what it makes of them.

Beams point evenly around a cone from the hub to a circle of a radius at a range ahead of the rotor, the first of them
upright. Turbulence comes down from there with the mean wind U, so what is measured at a time t arrives at t + range / U
(Taylor). On the way it changes: the coherence, its magnitude squared, of the wind there and at the rotor is taken as
exp(-decay f range / U), whatever else happens across the wind (Simley and Pao 2015, "A longitudinal spatial coherence
model for wind evolution based on large-eddy simulation", ACC, eq. 4 without its part at zero frequency). A beam's speed
is a mean along it, here with the weights of a bell curve.

Only the component along the shaft is in the model: a beam has its projection, u cos(cone angle), and none of the wind
across, which adds to what a real one measures in proportion to the sine.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np

from flapgym.core.arrays import Array, IntArray
from flapgym.core.fields import Count, Quantity, check_fields
from flapgym.core.wording import number

WIDTH = 1.0 / math.sqrt(8.0 * math.log(2.0))
"""Standard deviation of a bell curve over its full width at half of its height."""
POINTS = 41
"""Along a beam, over `REACH` standard deviations to either side, where a wind is not given by its spectrum."""
REACH = 3.5
ESTIMATES = 3
"""What it makes of its beams: u_0, u_c and u_s."""
ROUNDING = 1e-9
"""Of a sampling interval by which a measurement may seem late."""


@dataclass(frozen=True)
class Lidar:
    """Beams, what they measure of the wind, and when it is told.

    Attributes
    ----------
    range : float
        From the rotor to where the beams measure, along the shaft [m].
    radius : float
        Of the circle on which they do [m]; 0 for one beam ahead of the hub.
    beams : int
        On the circle, all measured at the same moment.
    probe_length : float
        Full width at half height of the weights along a beam [m]; about 30 m for pulsed lidars (Cariou and Boquet 2010,
        Leosphere pulsed lidar principles).
    decay : float
        Of the coherence, see above; 0 is frozen. Simley and Pao find 8.4 sigma / U + 0.05 (their eq. 7, sigma of all
        three components), which is 2.1 in the standard's class B at 11 m/s.
    sample_rate : float
        Measurements of each beam a second [Hz]; the newest is held.
    delay : float
        From a measurement until it is told [s].
    noise : float
        Standard deviation of white noise on each beam's measurements [m/s].
    """

    range: Annotated[float, Quantity("length", at_least=1.0, at_most=1000.0)]
    radius: Annotated[float, Quantity("length", at_least=0.0, at_most=500.0)]
    beams: Annotated[int, Count(at_least=1, at_most=32)] = 4
    probe_length: Annotated[float, Quantity("length", at_least=0.0, at_most=200.0)] = 30.0
    decay: Annotated[float, Quantity("number", at_least=0.0, at_most=100.0)] = 2.0
    sample_rate: Annotated[float, Quantity("frequency", at_least=0.1, at_most=100.0)] = 4.0
    delay: Annotated[float, Quantity("time", at_least=0.0, at_most=60.0)] = 0.0
    noise: Annotated[float, Quantity("speed", at_least=0.0, at_most=10.0)] = 0.0

    def __post_init__(self) -> None:
        check_fields(self, "lidar")
        if self.beams > 1 and self.radius == 0.0:
            raise ValueError(f"lidar.beams: expected 1 at radius 0, where all are the same, got {self.beams}")

    @property
    def azimuths(self) -> Array:
        """Of the beams (N,) [rad], as of blades: zero upright, growing clockwise for one who looks downwind."""
        return np.asarray(2.0 * np.pi * np.arange(self.beams) / self.beams)

    @property
    def projection(self) -> float:
        """Cosine of the cone angle: what a beam has of the wind along the shaft."""
        return self.range / math.hypot(self.range, self.radius)

    @cached_property
    def estimator(self) -> Array:
        """Speeds of the beams (N,) to the estimates u_0, u_c, u_s (3, N), by least squares.

        The wind at azimuth a of the circle is taken as u_0 + u_c cos(a) + u_s sin(a). Two beams tell no u_s, and one
        beam u_0 alone; what is not told is zero.
        """
        basis = np.stack([np.ones(self.beams), np.cos(self.azimuths), np.sin(self.azimuths)], axis=1)
        told = np.linalg.pinv(basis[:, : min(self.beams, ESTIMATES)])
        return np.vstack([told, np.zeros((ESTIMATES - len(told), self.beams))]) / self.projection

    def require_ahead(self, wind_speed: float, longest: float, name: str = "lidar") -> None:
        """Refuse a lidar that tells of wind which has passed, or sees farther ahead than a wind is known.

        Parameters
        ----------
        wind_speed : float
            Mean [m/s].
        longest : float
            Time beyond an episode up to which its wind is known [s].
        name : str
            For the message.

        Raises
        ------
        ValueError
            The message names the field.
        """
        ahead = self.range / wind_speed
        latest = ahead - 1.0 / self.sample_rate
        if latest < 0.0:
            raise ValueError(
                f"{name}.range: expected at least {number(wind_speed / self.sample_rate)} m, from where the wind takes "
                f"longer than from one measurement to the next, got {number(self.range)} m"
            )
        if self.delay > latest:
            raise ValueError(
                f"{name}.delay: expected at most {number(latest)} s, or the wind from {number(self.range)} m ahead has "
                f"passed before it is told, got {number(self.delay)} s"
            )
        if ahead > longest:
            raise ValueError(
                f"{name}.range: expected at most {number(longest * wind_speed)} m, {number(longest)} s of this wind, "
                f"got {number(self.range)} m"
            )

    def schedule(self, time: Array, wind_speed: float) -> tuple[IntArray, Array]:
        """Which measurement is the newest told at times (T,) [s], and when each arrives at the rotor (S,) [s].

        Measurements are evenly spaced, and one is at time zero.

        Parameters
        ----------
        time : (T,) float
            Rising [s].
        wind_speed : float
            Mean [m/s].
        """
        newest = np.floor((time - self.delay) * self.sample_rate + ROUNDING).astype(np.int64)
        made = np.arange(newest[0], newest[-1] + 1)
        return newest - newest[0], made / self.sample_rate + self.range / wind_speed

    def likeness(self, frequency: Array, wind_speed: float) -> Array:
        """Root of the coherence of wind measured and wind that arrives, at frequencies [Hz] of either sign."""
        return np.exp(-0.5 * self.decay * np.abs(frequency) * self.range / wind_speed)

    def averaging(self, frequency: Array, wind_speed: float) -> Array:
        """What the mean along a beam leaves of waves at frequencies [Hz]."""
        return np.exp(-0.5 * (2.0 * np.pi * frequency * self._spread(wind_speed)) ** 2)

    def along(self, wind_speed: float) -> tuple[Array, Array]:
        """The same as a sum: times by which points along a beam are before its middle (K,) [s], and weights (K,)."""
        if self.probe_length == 0.0:
            return np.zeros(1), np.ones(1)
        places = np.linspace(-REACH, REACH, POINTS)
        weights = np.exp(-0.5 * places**2)
        return self._spread(wind_speed) * places, weights / weights.sum()

    def _spread(self, wind_speed: float) -> float:
        """Standard deviation of the weights, in time [s]: along the wind a beam's probe is shorter by its cosine."""
        return WIDTH * self.probe_length * self.projection / wind_speed
