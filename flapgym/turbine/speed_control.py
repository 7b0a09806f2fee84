"""Who holds the rotor's speed: operating points over wind speed, the generator's law, and collective pitch above rated.

The law is that of the NREL 5 MW's baseline controller (Jonkman, Butterfield, Musial, Scott 2009, NREL/TP-500-38060,
Section 7), its numbers a case's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from flapgym.core.arrays import Array
from flapgym.core.fields import Column, Quantity, check_fields
from flapgym.core.units import DEGREE
from flapgym.core.wording import number


@dataclass(frozen=True, eq=False)
class Schedule:
    """Operating points of a turbine over wind speed, arrays (n,); linear between them.

    Attributes
    ----------
    wind_speed : mean wind along the shaft [m/s]
    rotor_speed : [rad/s]
    pitch : collective [rad], positive with the leading edge upwind
    """

    wind_speed: Annotated[Array, Column("speed", above=0.0, increasing=True)]
    rotor_speed: Annotated[Array, Column("angular rate", above=0.0)]
    pitch: Annotated[Array, Column("angle", above=-90 * DEGREE, below=90 * DEGREE)]

    def __post_init__(self) -> None:
        check_fields(self, "schedule")

    def at(self, wind_speed: float) -> tuple[float, float]:
        """Rotor speed [rad/s] and pitch [rad] at a wind speed [m/s].

        Raises
        ------
        ValueError
            If the schedule does not reach so far.
        """
        low, high = self.wind_speed[0], self.wind_speed[-1]
        if not low <= wind_speed <= high:
            raise ValueError(
                f"schedule.wind_speed: expected a wind speed from {number(low)} to {number(high)} m/s, "
                f"got {number(wind_speed)} m/s"
            )
        return (
            float(np.interp(wind_speed, self.wind_speed, self.rotor_speed)),
            float(np.interp(wind_speed, self.wind_speed, self.pitch)),
        )


@dataclass(frozen=True)
class SpeedControl:
    """A variable-speed turbine's torque and pitch, about which the rotor's speed is a state of the model.

    Speeds are the generator's, behind the gearbox; what is fed back is low-passed.

    Attributes
    ----------
    speed_filter : float
        Corner of the low-pass [Hz].
    start_speed, optimal_from : float
        Where torque begins, and from where it is optimal, its rise between them straight [rad/s].
    optimal_gain : float
        Torque over the square of the speed, while power is optimal [N m s^2/rad^2].
    rated_speed : float
        [rad/s]
    rated_power : float
        Mechanical power at the generator, held above rated [W].
    slip : float
        Of the steep straight rise to rated torque just below rated speed: rated speed over the one where it would
        have no torque, less one.
    proportional, integral : float
        Gains of collective pitch on the generator's speed, at zero pitch [s, -].
    halving_pitch : float
        Pitch at which these gains have halved: they go with 1 / (1 + pitch / halving_pitch) [rad].
    estimate_time : float
        Time constant of the slow estimate of the mean wind from rotor speed and pitch [s].
    """

    speed_filter: Annotated[float, Quantity("frequency", above=0.0, at_most=100.0)]
    start_speed: Annotated[float, Quantity("angular rate", above=0.0)]
    optimal_from: Annotated[float, Quantity("angular rate", above=0.0)]
    optimal_gain: Annotated[float, Quantity("torque per speed squared", above=0.0)]
    rated_speed: Annotated[float, Quantity("angular rate", above=0.0)]
    rated_power: Annotated[float, Quantity("power", above=0.0)]
    slip: Annotated[float, Quantity("number", above=0.0, at_most=1.0)]
    proportional: Annotated[float, Quantity("time", at_least=0.0)]
    integral: Annotated[float, Quantity("number", above=0.0)]
    halving_pitch: Annotated[float, Quantity("angle", above=0.0)]
    estimate_time: Annotated[float, Quantity("time", above=0.0)]

    def __post_init__(self) -> None:
        check_fields(self, "speed_control")
        for slower, faster in (("start_speed", "optimal_from"), ("optimal_from", "rated_speed")):
            if not getattr(self, slower) < getattr(self, faster):
                raise ValueError(
                    f"speed_control.{faster}: expected more than speed_control.{slower} "
                    f"({number(getattr(self, slower))} rad/s), got {number(getattr(self, faster))} rad/s"
                )

    @property
    def rated_torque(self) -> float:
        """Of the generator at rated speed and power [N m]."""
        return self.rated_power / self.rated_speed

    @property
    def steep(self) -> tuple[float, float]:
        """The straight rise to rated: its slope [N m s/rad] and the speed at which it has no torque [rad/s]."""
        none = self.rated_speed / (1.0 + self.slip)
        return self.rated_torque / (self.rated_speed - none), none

    def torque(self, speed: float) -> float:
        """Torque of the generator below rated at its speed [rad/s], in [N m]."""
        if speed <= self.start_speed:
            return 0.0
        if speed < self.optimal_from:
            reached = self.optimal_gain * self.optimal_from**2
            return reached * (speed - self.start_speed) / (self.optimal_from - self.start_speed)
        slope, none = self.steep
        return max(self.optimal_gain * speed**2, slope * (speed - none))

    def torque_slope(self, speed: float, pitch: float) -> float:
        """Change of torque per change of the generator's speed at an operating point [N m s/rad].

        Parameters
        ----------
        speed : float
            Of the generator [rad/s].
        pitch : float
            Collective [rad]: above zero the turbine holds rated power, so that torque falls with speed.
        """
        if pitch > 0.0:
            return -self.rated_power / speed**2
        if speed <= self.start_speed:
            return 0.0
        if speed < self.optimal_from:
            return self.optimal_gain * self.optimal_from**2 / (self.optimal_from - self.start_speed)
        slope, none = self.steep
        optimal = self.optimal_gain * speed**2 >= slope * (speed - none)
        return 2.0 * self.optimal_gain * speed if optimal else slope

    def pitch_gains(self, pitch: float) -> tuple[float, float]:
        """Proportional and integral gain at a collective pitch [rad]; none below rated, where pitch rests [s, -]."""
        if pitch <= 0.0:
            return 0.0, 0.0
        share = 1.0 / (1.0 + pitch / self.halving_pitch)
        return share * self.proportional, share * self.integral
