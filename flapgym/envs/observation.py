"""What can be observed: name, entries, unit and bound of every quantity, and where it stands in a plant's rows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flapgym.core.arrays import BLADES
from flapgym.model.turbine_model import TurbineModel
from flapgym.plant import Task, layout


@dataclass(frozen=True)
class Quantity:
    """One entry of `observe`.

    Attributes
    ----------
    columns : tuple of int
        Where its entries stand in a plant's row.
    unit : str
    meaning : str
    bound : callable
        Largest magnitude for a model; larger values are clipped.
    factor : float
        From SI to the unit.
    per_blade : bool
        One entry a blade.
    """

    columns: tuple[int, ...]
    unit: str
    meaning: str
    bound: Callable[[TurbineModel], float]
    factor: float = 1.0

    @property
    def size(self) -> int:
        """Entries for a turbine."""
        return len(self.columns)

    @property
    def per_blade(self) -> bool:
        """Whether there is one entry a blade."""
        return self.size == BLADES

    def seen(self, blades: int) -> tuple[int, ...]:
        """The columns for a turbine of three blades, or for the single blade."""
        return self.columns[: blades if self.per_blade else None]


def _blades(first: int) -> tuple[int, ...]:
    return first, first + 1, first + 2


QUANTITIES: dict[str, Quantity] = {
    "rbm": Quantity(
        _blades(layout.RBM),
        "MN m",
        "flapwise root bending moment of blades 1 to 3",
        lambda model: max(50.0, 40.0e-6 * model.rbm_rms),  # a large turbine's loads are not clipped
        factor=1e-6,
    ),
    "flap_angle": Quantity(
        _blades(layout.ANGLE),
        "rad",
        "flap angle of blades 1 to 3",
        lambda model: model.flap_angle_limit,
    ),
    "flap_rate": Quantity(
        _blades(layout.RATE),
        "rad/s",
        "flap rate of blades 1 to 3",
        lambda model: model.flap_rate_limit,
    ),
    "tip_deflection": Quantity(
        _blades(layout.TIP),
        "m",
        "tip deflection of blades 1 to 3, downwind",
        lambda model: 50.0,
    ),
    "azimuth": Quantity(
        (layout.COSINE, layout.SINE),
        "-",
        "cosine and sine of the azimuth of blade 1",
        lambda model: 1.0,
    ),
    "tower_top": Quantity(
        (layout.TOWER, layout.TOWER + 1),
        "m",
        "tower-top displacement downwind and sideways",
        lambda model: 10.0,
    ),
    "wind": Quantity((layout.WIND,), "m/s", "wind perturbation along the shaft", lambda model: 50.0),
}
"""Everything observable. Perturbations about the steady equilibrium, except flap and azimuth."""
TURBINE_ONLY = frozenset(("azimuth", "tower_top"))
"""Those a single blade does not have."""
DISPLACEMENTS = frozenset(("tip_deflection", "tower_top"))
"""Those a plant gives only if its setup asks for displacements."""


def task_of(
    observe: Sequence[str],
    model: TurbineModel,
    blades: int,
    flap_angle_weight: float = 0.0,
    tower_weight: float = 0.0,
) -> Task:
    """The task of an environment: the quantities asked for, in their order, and the reward.

    Parameters
    ----------
    observe : sequence of str
        Names of `QUANTITIES`.
    model : TurbineModel
        Gives bounds and the reward's constant.
    blades : int
        3, or 1 for the single blade, which sees the first entry of what each blade has.
    flap_angle_weight, tower_weight : float
        Of the reward.
    """
    columns: list[int] = []
    factors: list[float] = []
    bounds: list[float] = []
    noisy: list[int] = []
    for name in observe:
        quantity = QUANTITIES[name]
        seen = quantity.seen(blades)
        columns += seen
        factors += [quantity.factor] * len(seen)
        bounds += [quantity.bound(model)] * len(seen)
        noisy += [column - layout.RBM if name == "rbm" else -1 for column in seen]
    return Task(
        columns=np.array(columns),
        factors=np.array(factors),
        bounds=np.array(bounds),
        noisy=np.array(noisy),
        rbm_weight=1.0 / model.rbm_rms**2,
        angle_weight=flap_angle_weight / model.flap_angle_limit**2,
        tower_weight=tower_weight,
    )


def bound_of(task: Task) -> NDArray[np.float32]:
    """Largest magnitudes of an observation."""
    return task.bounds.astype(np.float32)
