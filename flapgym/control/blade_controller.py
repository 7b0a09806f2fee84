"""One linear controller on each blade, the three acting independently: PD and LQG run as this (paper section IV.C)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from flapgym.control.agent import Floats, by_blade
from flapgym.control.agent_checks import check_hash, check_numbers, error_prefix, named_errors
from flapgym.control.channels import BLADE
from flapgym.core.arrays import Array
from flapgym.core.state_space import StateSpace

CONTROLLER_INPUTS = BLADE.inputs
CONTROLLER_OUTPUTS = BLADE.outputs


@dataclass(frozen=True, eq=False)
class BladeController:
    """Three copies of a linear controller from a blade's own root bending moment and flap motion to its flap.

    The flap angle and rate it reads are those after the stops. An observer inside therefore always has what the flap
    really did, which is all the anti-windup a saturating design needs.

    Parameters
    ----------
    name : str
        What tables call it.
    system : StateSpace
        Inputs ``CONTROLLER_INPUTS`` [N m, rad, rad/s], output ``CONTROLLER_OUTPUTS`` [rad/s^2], at the plant's step.
    start : (order, 3) float
        State at the start of an episode from the first inputs. A controller that begins at zero takes the load it finds
        for a sudden one and throws the flap.
    acceleration_limit : float
        Acceleration of a full action [rad/s^2].
    model_hash : str or None
        Hash of the model it was designed on.
    """

    name: str
    system: StateSpace
    start: Array
    acceleration_limit: float
    model_hash: str | None = None
    observe: tuple[str, ...] = field(default=CONTROLLER_INPUTS, init=False)
    steps_per_action: int = field(default=1, init=False)
    per_blade: ClassVar[bool] = True
    _step: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        with named_errors(self.name):
            self._check()

    def _check(self) -> None:
        if self.system.inputs != CONTROLLER_INPUTS or self.system.outputs != CONTROLLER_OUTPUTS:
            raise ValueError(
                f"expected a controller from {CONTROLLER_INPUTS} to {CONTROLLER_OUTPUTS}, "
                f"got {self.system.inputs} to {self.system.outputs}"
            )
        if not 0.0 < self.acceleration_limit < np.inf:
            raise ValueError(f"acceleration_limit: expected a positive number, got {self.acceleration_limit}")
        check_hash(self.model_hash)
        object.__setattr__(self, "start", check_numbers(self.start, "start", 2))
        s = self.system
        if self.start.shape != (s.order, len(CONTROLLER_INPUTS)):
            raise ValueError(f"start: expected shape {(s.order, 3)}, got {self.start.shape}")
        object.__setattr__(self, "_step", step_matrix(s, self.acceleration_limit))

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
        """Action (..., 3) and next state (..., 3, order) for an observation (..., 9)."""
        with error_prefix(self.name):
            measured = by_blade(observation, self.observe)
        order = self.system.order
        batch = measured.shape[:-2]
        if state is None:
            # Not zero: the load found at the start would look like a sudden one.
            state = measured @ self.start.T
        elif episode_start is not None and np.any(episode_start):
            begins = np.broadcast_to(np.asarray(episode_start, dtype=bool).reshape(-1), batch or (1,))
            state = np.where(begins.reshape(*batch, 1, 1), measured @ self.start.T, state)
        after = np.concatenate([state, measured], axis=-1) @ self._step
        action = np.clip(after[..., order], -1.0, 1.0).astype(np.float32)
        return action, after[..., :order]


def step_matrix(system: StateSpace, acceleration_limit: float) -> Array:
    """A controller's step as one matrix: [state, input] times it is [next state, action]."""
    return np.ascontiguousarray(
        np.vstack(
            [
                np.hstack([system.A.T, system.C.T / acceleration_limit]),
                np.hstack([system.B.T, system.D.T / acceleration_limit]),
            ]
        )
    )
