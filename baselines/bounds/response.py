"""What flaps and pitch of all blades do to the root moments, as a linear map and its adjoint.

The matrices are the plant's own (`flapgym.plant.kernel`), so that the programme's moments are the environment's to
rounding: the whole turning turbine, every mode of it, blades coupled by tower and wake.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from baselines.bounds.modes import march
from flapgym.core.arrays import BLADES, Array
from flapgym.core.multiblade import blade_azimuths
from flapgym.model.turbine_model import TurbineModel
from flapgym.plant import Stepping
from flapgym.plant.actuator import Law, free_motion
from flapgym.plant.kernel import parameters_of, prepare
from flapgym.plant.parameters import Parameters

QUANTITIES = 3
"""Of an actuator at an interval's start: command, angle, rate."""


@dataclass(frozen=True, eq=False)
class Actuator:
    """One of those that a blade has; on every blade the same.

    Attributes
    ----------
    law : Law
        What accelerates it.
    limits : (3,) float
        Of command, angle and rate [rad/s^2, rad, rad/s]; a pitch actuator's command is its stiffness times the angle
        demanded.
    march, drive : (2, 2), (2,) float
        Angle and rate at an interval's end from those at its start, and from the command held over it.
    """

    law: Law
    limits: Array
    march: Array
    drive: Array

    @property
    def integrates(self) -> bool:
        """Whether it is a flap, which a command accelerates freely."""
        return self.law.stiffness == 0.0


@dataclass(frozen=True, eq=False)
class Response:
    """From motion held over intervals of k steps to moments at every sample.

    B = 3 blades, A actuators on each, K intervals; the last is pitch where it moves.

    Attributes
    ----------
    parameters : Parameters
        Of the plant, k steps an interval.
    actuators : tuple of Actuator
    transform : (K, 3, 3) float
        One, cosine and sine (rows) of each blade's azimuth (columns) at the intervals' starts.
    """

    parameters: Parameters
    actuators: tuple[Actuator, ...]
    transform: Array

    @property
    def intervals(self) -> int:
        """K."""
        return len(self.transform)

    def moments(self, motion: Array) -> Array:
        """Root moments (K k, 3) at samples 1 to K k [N m] of command, angle and rate (K, 3, B, A)."""
        p, count = self.parameters, self.intervals
        # As the plant has them: quantity, actuator, component.
        given = (np.swapaxes(motion, 2, 3) @ self._components()[:, None]).reshape(count, -1)
        rows = march(*p.decay, given @ p.B[: p.sizes.given]) @ p.C + given @ p.D[: p.sizes.given]
        return np.asarray((rows.reshape(count, p.sizes.steps, BLADES) @ self.transform).reshape(-1, BLADES))

    def pull(self, weights: Array) -> Array:
        """The adjoint: what a change of command, angle and rate does (K, 3, B, A) to the sum of weights times moments.

        Parameters
        ----------
        weights : (K k, 3) float
        """
        p, count = self.parameters, self.intervals
        rows = weights.reshape(count, p.sizes.steps, BLADES) @ np.swapaxes(self.transform, 1, 2)
        rows = rows.reshape(count, -1)
        # What a mode at an interval's end does to all that is told later: marched backward, by the conjugate decay.
        later = march(p.decay[0], -p.decay[1], (rows @ p.C.T)[::-1])[::-1]
        given = later @ p.B[: p.sizes.given].T + rows @ p.D[: p.sizes.given].T
        given = given.reshape(count, QUANTITIES, len(self.actuators), BLADES)
        return np.asarray(np.swapaxes(given @ np.swapaxes(self._components(), 1, 2)[:, None], 2, 3))

    def _components(self) -> Array:
        """(K, blades, components), the inverse of the transform."""
        return np.swapaxes(self.transform, 1, 2) * (np.array([1.0, 2.0, 2.0]) / BLADES)


def response_of(model: TurbineModel, pitch: bool, azimuth: float, samples: int, hold: int) -> Response:
    """Of a turbine that starts at an azimuth [rad], for intervals of `hold` steps that cover the samples.

    Raises
    ------
    ValueError
        If the blades are unequal: their response follows the azimuth.
    """
    if model.periodic is not None:
        raise ValueError(f"bound: expected a model of equal blades, got {model.name}: {model.form}")
    count = -(-samples // hold)
    stepping = Stepping(
        steps_per_action=hold,
        intervals=count,
        length_scale=model.length_scale,
        displacements=False,
        pitch=pitch,
    )
    parameters = parameters_of(model, stepping, prepare(model, stepping))
    # A flap and the pitch of blade 1, as every blade has them.
    places = [*range(parameters.sizes.flaps), *([parameters.all_flaps] if pitch else [])]
    actuators = tuple(_actuator(parameters, place) for place in places)
    angle = blade_azimuths(azimuth + parameters.turn * hold * np.arange(count, dtype=np.float64))
    transform = np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle)], axis=1)
    return Response(parameters, actuators, transform)


def _actuator(parameters: Parameters, place: int) -> Actuator:
    p, law = parameters, Law(*parameters.actuators[4:, place].tolist())
    end = free_motion(p.sizes.steps, p.time_step, law, False)[-2:]
    limits = np.array([p.acceleration[place], p.angle_limit[place], p.rate_limit[place]])
    return Actuator(law, limits, end[:, 1:], end[:, 0])
