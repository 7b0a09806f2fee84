"""A linear controller for all blades' flaps: in the blades' own frames, or in multi-blade coordinates (paper IV.C)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from flapgym.control.agent import Floats, by_blade
from flapgym.control.agent_checks import check_hash, check_numbers, error_prefix, named_errors
from flapgym.control.blade_controller import OBSERVED, check_limits, step_matrix
from flapgym.control.channels import Channels, controller_channels
from flapgym.core.arrays import BLADES, Array
from flapgym.core.multiblade import to_blades, to_components
from flapgym.core.state_space import StateSpace


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
    start : (order, 3 + 6 F) float
        State at the start of an episode from the first inputs.
    acceleration_limits : tuple of float
        Acceleration of a full action of each of a blade's F flaps [rad/s^2].
    model_hash : str or None
        Hash of the model it was designed on.
    """

    name: str
    system: StateSpace
    start: Array
    acceleration_limits: tuple[float, ...]
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
                f"expected a controller of three blades' flaps, got {self.system.inputs} to {self.system.outputs}"
            )
        object.__setattr__(
            self, "acceleration_limits", check_limits(self.acceleration_limits, channels.flaps)
        )
        check_hash(self.model_hash)
        object.__setattr__(self, "start", check_numbers(self.start, "start", 2))
        expected = self.system.order, len(channels.inputs)
        if self.start.shape != expected:
            raise ValueError(f"start: expected shape {expected}, got {self.start.shape}")
        azimuth = ("azimuth",) if channels.multiblade else ()
        object.__setattr__(self, "observe", (*OBSERVED, *azimuth))
        object.__setattr__(self, "_step", step_matrix(self.system, self._unit))

    @property
    def _unit(self) -> Array:
        """Acceleration of a full action of each output, which stand flap by flap."""
        return np.repeat(self.acceleration_limits, BLADES)

    @property
    def flaps(self) -> int:
        """Flaps a blade."""
        return self.channels.flaps

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
        """Action (..., 3 F) and next state (..., order) for an observation (..., 3 + 6 F), of the azimuth two more."""
        values = np.asarray(observation)
        flaps, signals = self.flaps, len(self.system.inputs)
        turned = self.channels.multiblade
        if turned and values.shape[-1] != signals + 2:
            raise ValueError(
                f"agent {self.name}: expected {signals + 2} observations ({', '.join(self.observe)}), "
                f"got {values.shape[-1]}"
            )
        with error_prefix(self.name):
            own = values[..., :signals] if turned else values
            # A signal's blades side by side, as the controller takes them.
            blades = np.swapaxes(by_blade(own, OBSERVED, flaps), -1, -2)
        azimuth = np.empty(0)
        if turned:
            azimuth = np.arctan2(values[..., signals + 1], values[..., signals]).astype(float)[..., None]
            blades = to_components(blades, azimuth)
        measured = blades.reshape(*blades.shape[:-2], signals)
        order, batch = self.system.order, measured.shape[:-1]
        if state is None:
            state = measured @ self.start.T
        elif episode_start is not None and np.any(episode_start):
            begins = np.broadcast_to(np.asarray(episode_start, dtype=bool).reshape(-1), batch or (1,))
            state = np.where(begins.reshape(*batch, 1), measured @ self.start.T, state)
        after = np.concatenate([state, measured], axis=-1) @ self._step
        demand = after[..., order:].reshape(*batch, flaps, BLADES)
        if turned:
            demand = to_blades(demand, azimuth)
        # Actions stand blade by blade.
        action = np.swapaxes(demand, -1, -2).reshape(*batch, BLADES * flaps)
        return np.clip(action, -1.0, 1.0).astype(np.float32), after[..., :order]
