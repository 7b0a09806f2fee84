"""One linear controller on each blade, the three acting independently: PD and LQG run as this (paper section IV.C)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from flapgym.control.agent import Floats, by_blade
from flapgym.control.agent_checks import check_hash, check_numbers, error_prefix, named_errors
from flapgym.control.channels import BLADE, controller_channels
from flapgym.core.arrays import BLADES, Array
from flapgym.core.state_space import StateSpace
from flapgym.model.turbine_model import TurbineModel

OBSERVED = ("rbm", "flap_angle", "flap_rate")
"""What a linear controller observes of the blades."""


@dataclass(frozen=True, eq=False)
class BladeController:
    """Three copies of a linear controller from a blade's own root bending moment and flap motion to its flaps.

    The flap angles and rates it reads are those after the stops. An observer inside therefore always has what the flaps
    really did, which is all the anti-windup a saturating design needs.

    Parameters
    ----------
    name : str
        What tables call it.
    system : StateSpace
        Inputs and outputs of the channels ``BLADE``, with as many flaps as it has: moment, angles and rates [N m, rad,
        rad/s] to accelerations [rad/s^2], at the plant's step.
    start : (order, 1 + 2 F) float
        State at the start of an episode from the first inputs. A controller that begins at zero takes the load it finds
        for a sudden one and throws the flap.
    acceleration_limits : tuple of float
        Acceleration of a full action of each of the F flaps [rad/s^2].
    model_hash : str or None
        Hash of the model it was designed on.
    """

    name: str
    system: StateSpace
    start: Array
    acceleration_limits: tuple[float, ...]
    model_hash: str | None = None
    observe: tuple[str, ...] = field(default=OBSERVED, init=False)
    steps_per_action: int = field(default=1, init=False)
    per_blade: ClassVar[bool] = True
    _step: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        with named_errors(self.name):
            self._check()

    def _check(self) -> None:
        channels = controller_channels(self.system.inputs)
        expected = BLADE.with_flaps(channels.flaps)
        if self.system.inputs != expected.inputs or self.system.outputs != expected.outputs:
            raise ValueError(
                f"expected a controller from {expected.inputs} to {expected.outputs}, "
                f"got {self.system.inputs} to {self.system.outputs}"
            )
        object.__setattr__(
            self, "acceleration_limits", check_limits(self.acceleration_limits, channels.flaps)
        )
        check_hash(self.model_hash)
        object.__setattr__(self, "start", check_numbers(self.start, "start", 2))
        s = self.system
        if self.start.shape != (s.order, len(s.inputs)):
            raise ValueError(f"start: expected shape {(s.order, len(s.inputs))}, got {self.start.shape}")
        object.__setattr__(self, "_step", step_matrix(s, np.array(self.acceleration_limits)))

    @property
    def flaps(self) -> int:
        """Flaps a blade."""
        return len(self.system.outputs)

    @property
    def time_step(self) -> float:
        """Of the plants it was made for [s]."""
        return self.system.time_step

    def predict(
        self,
        observation: Floats,
        state: Array | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], Array | None]:
        """Action (..., 3 F) and next state (..., 3, order) for an observation (..., 3 + 6 F)."""
        with error_prefix(self.name):
            measured = by_blade(observation, self.observe, self.flaps)
        order = self.system.order
        batch = measured.shape[:-2]
        if state is None:
            # Not zero: the load found at the start would look like a sudden one.
            state = measured @ self.start.T
        elif episode_start is not None and np.any(episode_start):
            begins = np.broadcast_to(np.asarray(episode_start, dtype=bool).reshape(-1), batch or (1,))
            state = np.where(begins.reshape(*batch, 1, 1), measured @ self.start.T, state)
        after = np.concatenate([state, measured], axis=-1) @ self._step
        action = np.clip(after[..., order:], -1.0, 1.0).astype(np.float32)
        return action.reshape(*batch, BLADES * self.flaps), after[..., :order]


def acceleration_limits(model: TurbineModel) -> tuple[float, ...]:
    """Acceleration of a full action of each flap of a blade [rad/s^2]."""
    return tuple(flap.acceleration_limit for flap in model.flaps)


def check_limits(limits: object, flaps: int) -> tuple[float, ...]:
    """Refuse what is not one positive acceleration for each flap."""
    values = check_numbers(limits, "acceleration_limits", 1)
    if values.size != flaps or not (values > 0.0).all():
        raise ValueError(
            f"acceleration_limits: expected {flaps} positive {'number' if flaps == 1 else 'numbers'}, got {limits}"
        )
    return tuple(values.tolist())


def step_matrix(system: StateSpace, unit: Array) -> Array:
    """A controller's step as one matrix: [state, input] times it is [next state, action].

    `unit` (outputs,) is the acceleration of a full action [rad/s^2].
    """
    return np.ascontiguousarray(
        np.vstack(
            [
                np.hstack([system.A.T, system.C.T / unit]),
                np.hstack([system.B.T, system.D.T / unit]),
            ]
        )
    )
