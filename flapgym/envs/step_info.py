"""What a step of one turbine tells beside the observation, made when it is looked at."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flapgym.core.arrays import BLADES, Array
from flapgym.plant import layout

RBM, TIP, ANGLE, RATE, TRAVEL, MEAN_SQUARE, STOPPED = (
    slice(column, column + BLADES)
    for column in (
        layout.RBM,
        layout.TIP,
        layout.ANGLE,
        layout.RATE,
        layout.TRAVEL,
        layout.MEAN_SQUARE,
        layout.STOPPED,
    )
)
TOWER = slice(layout.TOWER, layout.TOWER + 2)
PLACES = {"rbm": RBM, "flap_angle": ANGLE, "flap_rate": RATE}
"""Of what is asked for most."""


class StepInfo(dict[str, Any]):
    """A dict of what a step did, whose arrays are made when it is first looked at.

    Nobody reads the `info` of most steps, and its arrays would take a quarter of the time of a step. Whatever is asked
    of this dict, but for a few single entries, fills it in; from then on it is a dict like any other. It always has an
    entry, because Python's encoder of JSON takes a dict without one for empty and does not ask; code in C that reads
    dicts past Python wants `dict(info)`.

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
        azimuth, _, of_moments, of_angles, of_tower = row[layout.AZIMUTH : layout.REWARD_TOWER + 1].tolist()
        made = {
            "rbm": row[RBM],
            "flap_angle": row[ANGLE],
            "flap_rate": row[RATE],
            "azimuth": azimuth,
            "flap_travel": row[TRAVEL],
            "flap_stopped": row[STOPPED] != 0.0,
            "rbm_mean_square": row[MEAN_SQUARE],
            "reward_rbm": of_moments,
            "reward_flap_angle": of_angles,
            "reward_tower": of_tower,
        }
        if self.displaced:
            made["tip_deflection"], made["tower_top"] = row[TIP], row[TOWER]
        # What was there already stays.
        made.update(dict.items(self))
        dict.update(self, made)

    def __missing__(self, name: str) -> Any:
        row = getattr(self, "row", None)
        if row is None:
            raise KeyError(name)
        if name in PLACES:
            value = row[PLACES[name]]
            dict.__setitem__(self, name, value)
            return value
        self._fill()
        return self[name]

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, (type(self), dict(dict.items(self)), getattr(self, "row", None))


class FullInfo(StepInfo):
    """The same with deflections."""

    __slots__ = ()
    displaced = True


def _again(kind: type[StepInfo], entries: dict[str, Any], row: Array | None) -> StepInfo:
    """A copy, as far filled as what was copied."""
    info = kind(entries)
    info.row = row
    return info


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
