"""Trained policies run in numpy: the mean action of a multi-layer perceptron, no torch needed (design section 6)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from flapgym.control.agent import Floats, blade_entries, blade_places
from flapgym.control.agent_checks import (
    BLADE_QUANTITIES,
    check_hash,
    check_names,
    check_numbers,
    check_steps_per_action,
    named_errors,
)
from flapgym.core.arrays import BLADES, Array
from flapgym.core.wording import shown

Activation = Literal["tanh", "relu"]
Squash = Literal["clip", "tanh"]


@dataclass(frozen=True, eq=False)
class Policy:
    """A memoryless policy: normalise, layers, squash.

    Parameters
    ----------
    name : str
        What tables call it.
    observe : tuple of str
        Observations it was trained on, in order.
    steps_per_action : int
        Plant steps for which an action is held.
    per_blade : bool
        True: one network serves each blade with that blade's observations, in the order of `observe` and of flaps one
        after the other; it has an action for each of the blade's F flaps. False: one network of 3 F actions, in the
        order of the environment's, sees the whole observation.
    offset, scale : (n,) float
        The network sees (observation - offset) * scale, in the environment's units; one entry per network input.
    weights, biases : tuple of (outputs, inputs) and (outputs,) float
        Layers from input to output.
    activation : "tanh" or "relu"
        Between layers.
    squash : "clip" or "tanh"
        Of the last layer to [-1, 1]: PPO clips, SAC takes the hyperbolic tangent.
    model_hash : str or None
        Hash of the model it was trained on.
    """

    name: str
    observe: tuple[str, ...]
    steps_per_action: int
    per_blade: bool
    offset: Array
    scale: Array
    weights: tuple[Array, ...]
    biases: tuple[Array, ...]
    activation: Activation
    squash: Squash
    model_hash: str | None = None

    def __post_init__(self) -> None:
        with named_errors(self.name):
            self._check()

    def _check(self) -> None:
        for field, value, known in (
            ("activation", self.activation, get_args(Activation)),
            ("squash", self.squash, get_args(Squash)),
        ):
            if value not in known:
                raise ValueError(f"{field}: expected one of {', '.join(known)}, got {shown(value)}")
        if not isinstance(self.per_blade, bool | np.bool_):
            raise ValueError(f"per_blade: expected true or false, got {shown(self.per_blade)}")
        if not self.weights or len(self.weights) != len(self.biases):
            raise ValueError(
                f"weights: expected as many layers as biases, got {len(self.weights)} and {len(self.biases)}"
            )
        for field, found in {
            "observe": check_names(self.observe, BLADE_QUANTITIES, "observe"),
            "steps_per_action": check_steps_per_action(self.steps_per_action),
            "model_hash": check_hash(self.model_hash),
            "offset": check_numbers(self.offset, "offset", 1),
            "scale": check_numbers(self.scale, "scale", 1),
            "weights": tuple(
                check_numbers(weight, f"weights[{i}]", 2) for i, weight in enumerate(self.weights)
            ),
            "biases": tuple(check_numbers(bias, f"biases[{i}]", 1) for i, bias in enumerate(self.biases)),
        }.items():
            object.__setattr__(self, field, found)
        self._check_shapes()

    def _check_shapes(self) -> None:
        actions, blades = self.biases[-1].size, 1 if self.per_blade else BLADES
        if not actions or actions % blades:
            raise ValueError(
                f"weights: expected {blades} {'action' if self.per_blade else 'actions'} of the last layer for each "
                f"flap of a blade, got {actions}"
            )
        size = blade_entries(self.observe, self.flaps) * blades
        if self.offset.shape != (size,) or self.scale.shape != (size,):
            raise ValueError(
                f"offset and scale: expected {size} entries each, got {self.offset.size} and {self.scale.size}"
            )
        for weight, bias in zip(self.weights, self.biases, strict=True):
            if weight.ndim != 2 or weight.shape != (bias.size, size):
                raise ValueError(
                    f"weights: expected a layer of {(bias.size, size)} after {size} values, got {weight.shape}"
                )
            size = bias.size

    @property
    def flaps(self) -> int:
        """Flaps a blade: what its last layer has actions for."""
        return self.biases[-1].size // (1 if self.per_blade else BLADES)

    def predict(
        self,
        observation: Floats,
        state: Array | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], Array | None]:
        """Action (..., 3 F) for an observation (..., 3 n); always the mean action."""
        values = np.asarray(observation, dtype=float)
        expected = BLADES * blade_entries(self.observe, self.flaps)
        if values.shape[-1] != expected:
            raise ValueError(
                f"agent {self.name}: expected {expected} observations ({', '.join(self.observe)} of three blades), "
                f"got {values.shape[-1]}"
            )
        if self.per_blade:
            values = values[..., blade_places(self.observe, self.flaps)]
        hidden = (values - self.offset) * self.scale
        for index, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            if index:
                hidden = np.tanh(hidden) if self.activation == "tanh" else np.maximum(hidden, 0.0)
            hidden = hidden @ weight.T + bias
        action = np.tanh(hidden) if self.squash == "tanh" else np.clip(hidden, -1.0, 1.0)
        if self.per_blade:
            action = action.reshape(*action.shape[:-2], BLADES * self.flaps)
        return action.astype(np.float32), None

    def slope_at_rest(self) -> Array:
        """Change of its network's actions per change of what the network sees, about an observation of zero.

        In the units of action and observation, (outputs, inputs).
        """
        hidden = -self.offset * self.scale
        slope = np.diag(self.scale)
        for index, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            if index:
                tanh = self.activation == "tanh"
                slope = (1.0 - np.tanh(hidden) ** 2 if tanh else 1.0 * (hidden > 0.0))[:, None] * slope
                hidden = np.tanh(hidden) if tanh else np.maximum(hidden, 0.0)
            hidden, slope = weight @ hidden + bias, weight @ slope
        last = 1.0 - np.tanh(hidden) ** 2 if self.squash == "tanh" else 1.0 * (np.abs(hidden) < 1.0)
        return np.asarray(last[:, None] * slope)
