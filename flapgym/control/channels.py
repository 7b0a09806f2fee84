"""The signals a linear controller reads and gives, by frame: one blade, three blades, or multi-blade components."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flapgym.core.arrays import Array


@dataclass(frozen=True)
class Channels:
    """The m moments, flap angles, flap rates and accelerations of a controller.

    Attributes
    ----------
    suffixes : tuple of str
        Of the names: ("",), ("_1", "_2", "_3") or ("_0", "_c", "_s").
    weight : tuple of float
        Of a channel's square in the mean square over blades, relative: 1, and 1/2 for a cyclic component.
    noise : tuple of float
        Variance of a channel per variance of a blade's own noise.
    """

    suffixes: tuple[str, ...]
    weight: tuple[float, ...]
    noise: tuple[float, ...]

    @property
    def count(self) -> int:
        """Number m of moments, and of flaps."""
        return len(self.suffixes)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of moments [N m], angles [rad] and rates [rad/s]."""
        return self.named("rbm") + self.named("flap_angle") + self.named("flap_rate")

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of accelerations [rad/s^2]."""
        return self.named("acceleration")

    def named(self, signal: str) -> tuple[str, ...]:
        """The signal's name in each channel."""
        return tuple(signal + suffix for suffix in self.suffixes)

    def turn(self, angle: float) -> Array:
        """Matrix (m, m) that expresses what a blade keeps in axes which have turned on by `angle` [rad]."""
        if self != MULTIBLADE:
            return np.eye(self.count)
        cosine, sine = np.cos(angle), np.sin(angle)
        return np.array([[1.0, 0.0, 0.0], [0.0, cosine, -sine], [0.0, sine, cosine]])


BLADE = Channels(("",), (1.0,), (1.0,))
ROTOR = Channels(("_1", "_2", "_3"), (1.0, 1.0, 1.0), (1.0, 1.0, 1.0))
MULTIBLADE = Channels(("_0", "_c", "_s"), (1.0, 0.5, 0.5), (1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0))


def controller_channels(names: Sequence[str]) -> Channels:
    """The channels to which names of flap angles belong.

    Raises
    ------
    ValueError
        If the flap angles are those of no frame.
    """
    angles = [name for name in names if name.startswith("flap_angle")]
    for channels in (BLADE, ROTOR, MULTIBLADE):
        if set(angles) == set(channels.named("flap_angle")):
            return channels
    raise ValueError(
        f"channels: expected flap_angle, flap_angle_1 to _3 or flap_angle_0, _c and _s, got {', '.join(angles)}"
    )
