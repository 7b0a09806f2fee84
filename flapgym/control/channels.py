"""The signals a linear controller reads and gives, by frame: one blade, three blades, or multi-blade components.

They stand signal by signal: the moments, the angles flap by flap, the rates flap by flap; each in the frame's channels.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flapgym.core.arrays import Array
from flapgym.model.signals import flap_names


@dataclass(frozen=True)
class Channels:
    """The m moments of a controller in a frame, and the angles, rates and accelerations of m F flaps.

    Attributes
    ----------
    suffixes : tuple of str
        Of the names: ("",), ("_1", "_2", "_3") or ("_0", "_c", "_s").
    weight : tuple of float
        Of a channel's square in the mean square over blades, relative: 1, and 1/2 for a cyclic component.
    noise : tuple of float
        Variance of a channel per variance of a blade's own noise.
    flaps : int
        Flaps F a blade.
    """

    suffixes: tuple[str, ...]
    weight: tuple[float, ...]
    noise: tuple[float, ...]
    flaps: int = 1

    @property
    def count(self) -> int:
        """Number m of moments."""
        return len(self.suffixes)

    @property
    def actions(self) -> int:
        """Number m F of angles, of rates, and of accelerations."""
        return self.count * self.flaps

    @property
    def moments(self) -> tuple[str, ...]:
        """Names of moments [N m]."""
        return self.named("rbm")

    @property
    def flap_inputs(self) -> tuple[str, ...]:
        """Names of angles [rad], flap by flap, then rates [rad/s]: the model's own."""
        return self.of_flaps("angle") + self.of_flaps("rate")

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of moments, angles and rates."""
        return self.moments + self.flap_inputs

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of accelerations [rad/s^2]."""
        # Of one flap a blade as files and tests have always had it.
        return self.named("acceleration") if self.flaps == 1 else self.of_flaps("acceleration")

    @property
    def multiblade(self) -> bool:
        """Whether the channels are components of the fixed frame."""
        return self.suffixes == MULTIBLADE.suffixes

    def named(self, signal: str) -> tuple[str, ...]:
        """The signal's name in each channel."""
        return tuple(signal + suffix for suffix in self.suffixes)

    def of_flaps(self, kind: str) -> tuple[str, ...]:
        """Names of what each flap has, flap by flap, in each channel."""
        return tuple(name for flap in flap_names(self.flaps) for name in self.named(f"{flap}_{kind}"))

    def with_flaps(self, flaps: int) -> Channels:
        """The same frame with so many flaps a blade."""
        return replace(self, flaps=flaps)

    def turn(self, angle: float) -> Array:
        """Matrix (m, m) that expresses what a blade keeps in axes which have turned on by `angle` [rad]."""
        if not self.multiblade:
            return np.eye(self.count)
        cosine, sine = np.cos(angle), np.sin(angle)
        return np.array([[1.0, 0.0, 0.0], [0.0, cosine, -sine], [0.0, sine, cosine]])

    def flap_turn(self, angle: float) -> Array:
        """The same for what the flaps keep, (m F, m F)."""
        return np.asarray(np.kron(np.eye(self.flaps), self.turn(angle)))


BLADE = Channels(("",), (1.0,), (1.0,))
ROTOR = Channels(("_1", "_2", "_3"), (1.0, 1.0, 1.0), (1.0, 1.0, 1.0))
MULTIBLADE = Channels(("_0", "_c", "_s"), (1.0, 0.5, 0.5), (1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0))
"""The frames, with one flap a blade; `with_flaps` gives them more."""

_ANGLE = re.compile(r"flap\d*_angle(_\w)?")


def controller_channels(names: Sequence[str]) -> Channels:
    """The channels to which names of flap angles belong, with as many flaps a blade as there are.

    Raises
    ------
    ValueError
        If the flap angles are those of no frame.
    """
    angles = [name for name in names if _ANGLE.fullmatch(name)]
    for frame in (BLADE, ROTOR, MULTIBLADE):
        channels = frame.with_flaps(max(1, len(angles) // frame.count))
        if set(angles) == set(channels.of_flaps("angle")):
            return channels
    raise ValueError(
        "channels: expected flap_angle, flap_angle_1 to _3 or flap_angle_0, _c and _s, or with several flaps a blade "
        f"flap1_angle, flap2_angle and so on likewise, got {', '.join(angles)}"
    )
