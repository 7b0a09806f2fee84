"""What a step of one turbine tells beside the observation, made when it is looked at."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flapgym.aeroelastic.multiblade import BLADES
from flapgym.plant import layout
from flapgym.state_space import Array

ARRAYS = (
    ("rbm", layout.RBM, BLADES),
    ("flap_angle", layout.ANGLE, BLADES),
    ("flap_rate", layout.RATE, BLADES),
    ("flap_travel", layout.TRAVEL, BLADES),
    ("rbm_mean_square", layout.MEAN_SQUARE, BLADES),
)
"""Names, with columns of a row."""
DISPLACED = (("tip_deflection", layout.TIP, BLADES), ("tower_top", layout.TOWER, 2))
"""The same of what is computed only if it is asked for."""
NUMBERS = (
    ("azimuth", layout.AZIMUTH),
    ("reward_rbm", layout.REWARD_RBM),
    ("reward_flap_angle", layout.REWARD_ANGLE),
    ("reward_tower", layout.REWARD_TOWER),
)


class StepInfo(dict[str, Any]):
    """A dict of what a step did, whose arrays are made when it is first looked at.

    Nobody reads the `info` of most steps, and its arrays would take a fifth of the time of a step. Whatever is asked of
    this dict, but for an entry it has already, fills it in; from then on it is a dict like any other. Copies
    and pickles are filled, and so is what it is merged into.

    Attributes
    ----------
    row : (ROW,) float or None
        Of the plant (flapgym.plant.layout); None once the dict is filled.
    """

    __slots__ = ("row",)
    row: Array | None
    displaced = False
    """Whether deflections are told, too."""

    def _fill(self) -> None:
        # Not there, either, in one that somebody made of another's entries.
        row, self.row = getattr(self, "row", None), None
        if row is None:
            return
        made: dict[str, Any] = {
            name: row[column : column + size]
            for name, column, size in (*ARRAYS, *(DISPLACED if self.displaced else ()))
        }
        made["flap_stopped"] = row[layout.STOPPED : layout.STOPPED + BLADES] != 0.0
        made |= {name: row.item(column) for name, column in NUMBERS}
        for name, value in made.items():
            dict.setdefault(self, name, value)

    def __missing__(self, name: str) -> Any:
        if getattr(self, "row", None) is None:
            raise KeyError(name)
        self._fill()
        return self[name]

    def __reduce__(self) -> tuple[Any, ...]:
        return _filled_with, (type(self), dict(self))


class FullInfo(StepInfo):
    """The same with deflections."""

    __slots__ = ()
    displaced = True


def _filled_with(kind: type[StepInfo], entries: dict[str, Any]) -> StepInfo:
    """A copy: nothing is left to be made."""
    return kind(entries)


def _of_filled(name: str) -> Callable[..., Any]:
    """A dict's method, on a filled one."""
    method = getattr(dict, name)

    def filled(self: StepInfo, *arguments: Any, **keywords: Any) -> Any:
        self._fill()
        return method(self, *arguments, **keywords)

    filled.__name__, filled.__doc__ = name, method.__doc__
    return filled


for _name in (
    *(
        "__contains__",
        "__delitem__",
        "__eq__",
        "__ior__",
        "__iter__",
        "__len__",
        "__ne__",
        "__or__",
        "__repr__",
    ),
    *("__reversed__", "__ror__", "clear", "copy", "get", "items", "keys", "pop", "popitem", "setdefault"),
    *("update", "values"),
):
    setattr(StepInfo, _name, _of_filled(_name))
