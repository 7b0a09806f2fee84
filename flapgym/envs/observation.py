"""What can be observed: name, entries, unit and bound of every quantity, and how it is read from the plant."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flapgym.aeroelastic.model import TurbineModel
from flapgym.state_space import Array


class Instant(NamedTuple):
    """What n turbines show at one sample, in SI units.

    Attributes
    ----------
    rbm, tip_deflection, flap_angle, flap_rate : (n, 3) float
        [N m, m, rad, rad/s].
    tower_top : (n, 2) float
        Displacement downwind and sideways [m].
    wind : (n,) float
        Perturbation [m/s].
    azimuth : (n,) float
        Of blade 1 [rad].
    """

    rbm: Array
    tip_deflection: Array
    flap_angle: Array
    flap_rate: Array
    tower_top: Array
    wind: Array
    azimuth: Array


@dataclass(frozen=True)
class Quantity:
    """One entry of `observe`.

    Attributes
    ----------
    size : int
        Entries.
    unit : str
    meaning : str
    bound : callable
        Largest magnitude for a model; larger values are clipped.
    read : callable
        Values (n, size) of an instant, in the unit.
    """

    size: int
    unit: str
    meaning: str
    bound: Callable[[TurbineModel], float]
    read: Callable[[Instant], Array]


QUANTITIES: dict[str, Quantity] = {
    "rbm": Quantity(
        3,
        "MN m",
        "flapwise root bending moment of blades 1 to 3",
        lambda model: 50.0,
        lambda now: 1e-6 * now.rbm,
    ),
    "flap_angle": Quantity(
        3,
        "rad",
        "flap angle of blades 1 to 3",
        lambda model: model.flap_angle_limit,
        lambda now: now.flap_angle,
    ),
    "flap_rate": Quantity(
        3,
        "rad/s",
        "flap rate of blades 1 to 3",
        lambda model: model.flap_rate_limit,
        lambda now: now.flap_rate,
    ),
    "tip_deflection": Quantity(
        3,
        "m",
        "tip deflection of blades 1 to 3, downwind",
        lambda model: 50.0,
        lambda now: now.tip_deflection,
    ),
    "azimuth": Quantity(
        2,
        "-",
        "cosine and sine of the azimuth of blade 1",
        lambda model: 1.0,
        lambda now: np.stack([np.cos(now.azimuth), np.sin(now.azimuth)], axis=1),
    ),
    "tower_top": Quantity(
        2, "m", "tower-top displacement downwind and sideways", lambda model: 10.0, lambda now: now.tower_top
    ),
    "wind": Quantity(
        1, "m/s", "wind perturbation along the shaft", lambda model: 50.0, lambda now: now.wind[:, None]
    ),
}
"""Everything observable. Perturbations about the steady equilibrium, except flap and azimuth."""


class Observer:
    """Packs the quantities asked for into one float32 row a turbine.

    Parameters
    ----------
    observe : sequence of str
        Names of `QUANTITIES`, in the order of the row.
    model : TurbineModel
        Gives the bounds.
    """

    def __init__(self, observe: Sequence[str], model: TurbineModel) -> None:
        self._names = tuple(observe)
        quantities = [QUANTITIES[name] for name in self._names]
        sizes = [quantity.size for quantity in quantities]
        self.bound: NDArray[np.float32] = np.repeat(
            [quantity.bound(model) for quantity in quantities], sizes
        ).astype(np.float32)
        self._noisy = "rbm" in self._names
        start = sum(sizes[: self._names.index("rbm")]) if self._noisy else 0
        self._rbm = slice(start, start + 3)

    def __call__(self, now: Instant, noise: Array | None = None) -> NDArray[np.float32]:
        """Rows (n, size) for an instant; noise (n, 3) [N m] is added to the moments, if they are observed."""
        parts = [QUANTITIES[name].read(now) for name in self._names]
        row = np.concatenate(parts, axis=1) if len(parts) > 1 else parts[0]
        if noise is not None and self._noisy:
            row[:, self._rbm] += 1e-6 * noise
        packed = row.astype(np.float32)
        # Rounded before it is bounded: a stop rounded up to float32 would leave the space.
        np.minimum(packed, self.bound, out=packed)
        return np.maximum(packed, -self.bound, out=packed)
