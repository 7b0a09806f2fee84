"""A beam clamped to a frame whose motion is prescribed, ready to be marched in time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flapgym.core.arrays import AnyArray
from flapgym.structure.beam import Configuration
from reference.body_motion import Body, FrameMotion, dynamic_forces, dynamic_tangent, energy
from reference.march import Motion


def _no_load(time: float) -> float:
    return 0.0


@dataclass(frozen=True, eq=False)
class DrivenBeam:
    """Beam clamped at its first node to a frame that moves as prescribed.

    Parameters
    ----------
    body : Body
        The beam.
    frame : callable
        Time [s] -> motion of the frame.
    load : callable
        Time [s] -> dead nodal loads (n + 1, 6) in frame axes [N, N m]; default none.
    """

    body: Body
    frame: Callable[[float], FrameMotion]
    load: Callable[[float], AnyArray | float] = _no_load

    def _nodes(self, free: AnyArray) -> AnyArray:
        return np.concatenate([np.zeros(6), free]).reshape(-1, 6)

    def moved(
        self, configuration: tuple[Configuration, ...], increment: AnyArray
    ) -> tuple[Configuration, ...]:
        """Return the configuration after an increment of the free nodes."""
        return (configuration[0].moved(self._nodes(increment)),)

    def _forces(self, motion: Motion) -> tuple[AnyArray, AnyArray]:
        velocity, acceleration = self._nodes(motion.velocity), self._nodes(motion.acceleration)
        return dynamic_forces(
            self.body, motion.configuration[0], velocity, acceleration, self.frame(motion.time)
        )

    def residual(self, motion: Motion) -> AnyArray:
        """Return the imbalance of forces on the free nodes."""
        return (self._forces(motion)[0] - self.load(motion.time))[1:].ravel()

    def iteration_matrix(self, motion: Motion, rate_factor: float, mass_factor: float) -> AnyArray:
        """Return the derivative of `residual`."""
        spin = self.frame(motion.time).velocity[3:]
        return dynamic_tangent(self.body, motion.configuration[0], spin, rate_factor, mass_factor).ss[6:, 6:]

    def energy(self, motion: Motion) -> float:
        """Kinetic and elastic energy [J]."""
        velocity = self._nodes(motion.velocity)
        return energy(self.body, motion.configuration[0], velocity, self.frame(motion.time))

    def power(self, motion: Motion) -> float:
        """Power [W] that frame and nodal loads put in."""
        frame, load = (
            self.frame(motion.time),
            np.broadcast_to(self.load(motion.time), (len(self._nodes(motion.velocity)), 6)),
        )
        resultant = self._forces(motion)[1]
        arms = motion.configuration[0].position
        applied = np.concatenate(
            [load[:, :3].sum(axis=0), (load[:, 3:] + np.cross(arms, load[:, :3])).sum(axis=0)]
        )
        # The frame's force is what inertia needs beyond the loads; the loads move with frame and nodes.
        by_frame = (resultant - applied) @ frame.velocity
        by_loads = applied @ frame.velocity + float(np.sum(load * self._nodes(motion.velocity)))
        return float(by_frame + by_loads)
