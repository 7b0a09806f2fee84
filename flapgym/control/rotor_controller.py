"""A linear controller for all three flaps: in the blades' own frames, or in multi-blade coordinates (paper IV.C)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from flapgym.control.agent import Floats, by_blade
from flapgym.control.agent_checks import check_hash, check_numbers, error_prefix, named_errors
from flapgym.control.blade_controller import CONTROLLER_INPUTS, step_matrix
from flapgym.control.channels import MULTIBLADE, Channels, controller_channels
from flapgym.core.arrays import BLADES, Array
from flapgym.core.state_space import StateSpace
from flapgym.model.multiblade import to_blades, to_components


@dataclass(frozen=True, eq=False)
class RotorController:
    """A linear controller from the root bending moments and flap motions of the three blades to their flaps.

    In multi-blade coordinates it also observes the azimuth, turns what the blades show into collective, cosine and sine
    components, and turns its demands back. As with `BladeController`, flap motion is read after the stops.

    Parameters
    ----------
    name : str
        What tables call it.
    system : StateSpace
        Inputs and outputs of the channels ``ROTOR`` or ``MULTIBLADE`` in SI units, at the plant's step.
    start : (order, 9) float
        State at the start of an episode from the first inputs.
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
    observe: tuple[str, ...] = field(init=False)
    steps_per_action: int = field(default=1, init=False)
    _step: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        with named_errors(self.name):
            self._check()

    def _check(self) -> None:
        channels = controller_channels(self.system.inputs)
        if (
            channels.count != BLADES
            or self.system.inputs != channels.inputs
            or self.system.outputs != channels.outputs
        ):
            raise ValueError(
                f"expected a controller of three flaps, got {self.system.inputs} to {self.system.outputs}"
            )
        if not 0.0 < self.acceleration_limit < np.inf:
            raise ValueError(f"acceleration_limit: expected a positive number, got {self.acceleration_limit}")
        check_hash(self.model_hash)
        object.__setattr__(self, "start", check_numbers(self.start, "start", 2))
        if self.start.shape != (self.system.order, 3 * BLADES):
            raise ValueError(f"start: expected shape {(self.system.order, 9)}, got {self.start.shape}")
        azimuth = ("azimuth",) if channels == MULTIBLADE else ()
        object.__setattr__(self, "observe", (*CONTROLLER_INPUTS, *azimuth))
        object.__setattr__(self, "_step", step_matrix(self.system, self.acceleration_limit))

    @property
    def time_step(self) -> float:
        """Of the plants it was made for [s]."""
        return self.system.time_step

    @property
    def channels(self) -> Channels:
        """The frame it works in."""
        return controller_channels(self.system.inputs)

    def predict(
        self,
        observation: Floats,
        state: Array | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], Array | None]:
        """Action (..., 3) and next state (..., order) for an observation (..., 9), or (..., 11) with the azimuth."""
        values = np.asarray(observation)
        signals = 3 * BLADES
        with error_prefix(self.name):
            blades = np.swapaxes(by_blade(values[..., :signals], CONTROLLER_INPUTS), -1, -2)
        turned = self.channels == MULTIBLADE
        if turned:
            if values.shape[-1] != signals + 2:
                raise ValueError(
                    f"agent {self.name}: expected {signals + 2} observations ({', '.join(self.observe)}), "
                    f"got {values.shape[-1]}"
                )
            azimuth = np.arctan2(values[..., signals + 1], values[..., signals]).astype(float)
            blades = to_components(blades, azimuth[..., None])
        measured = blades.reshape(*blades.shape[:-2], signals)
        order, batch = self.system.order, measured.shape[:-1]
        if state is None:
            state = measured @ self.start.T
        elif episode_start is not None and np.any(episode_start):
            begins = np.broadcast_to(np.asarray(episode_start, dtype=bool).reshape(-1), batch or (1,))
            state = np.where(begins.reshape(*batch, 1), measured @ self.start.T, state)
        after = np.concatenate([state, measured], axis=-1) @ self._step
        demand = to_blades(after[..., order:], azimuth) if turned else after[..., order:]
        return np.clip(demand, -1.0, 1.0).astype(np.float32), after[..., :order]
