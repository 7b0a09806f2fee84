"""A row of the table: our value beside independent ones, and the range it is held to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

Interval = tuple[float, float]


class Limit(Protocol):
    """What a value is held to, given the independent values."""

    def allowed(self, independent: Sequence[float]) -> list[Interval]:
        """Ranges, any of which will do."""

    def __str__(self) -> str:
        """In a few words."""


@dataclass(frozen=True)
class Within:
    """Within a share of one of the independent values."""

    share: float

    def allowed(self, independent: Sequence[float]) -> list[Interval]:
        """One range about each value."""
        return [(value * (1.0 - self.share), value * (1.0 + self.share)) for value in independent]

    def __str__(self) -> str:
        return f"within {100 * self.share:g} %"


@dataclass(frozen=True)
class Between:
    """Between the least and the largest of the independent values, or within a share of one."""

    share: float = 0.0

    def allowed(self, independent: Sequence[float]) -> list[Interval]:
        """One range."""
        return [(min(independent) * (1.0 - self.share), max(independent) * (1.0 + self.share))]

    def __str__(self) -> str:
        return "between" + (f", or within {100 * self.share:g} % of one" if self.share else "")


@dataclass(frozen=True)
class Near:
    """Within an absolute distance of an independent value, in SI; `words` say it."""

    distance: float
    words: str

    def allowed(self, independent: Sequence[float]) -> list[Interval]:
        """One range about each value."""
        return [(value - self.distance, value + self.distance) for value in independent]

    def __str__(self) -> str:
        return self.words


@dataclass(frozen=True)
class AtLeast:
    """At least a value, whatever the others are."""

    value: float

    def allowed(self, independent: Sequence[float]) -> list[Interval]:
        """One range, open above."""
        return [(self.value, np.inf)]

    def __str__(self) -> str:
        return f"at least {self.value:g}"


@dataclass(frozen=True)
class Unit:
    """A unit to show values in, its size in SI, and the decimals shown."""

    name: str
    size: float = 1.0
    decimals: int = 3

    def show(self, value: float) -> str:
        """The number without its unit."""
        return f"{value / self.size:.{self.decimals}f}"


@dataclass(frozen=True)
class Row:
    """One quantity.

    Attributes
    ----------
    quantity : str
    unit : Unit
    ours : float
        In SI, as the others.
    independent : mapping
        Values by the name of what gave them; may be empty.
    limit : Limit, optional
        None where a value is told but not held to anything.
    """

    quantity: str
    unit: Unit
    ours: float
    independent: Mapping[str, float]
    limit: Limit | None = None

    @property
    def ratios(self) -> dict[str, float]:
        """Ours over each independent value that is not zero."""
        return {name: self.ours / value for name, value in self.independent.items() if value}

    @property
    def beyond(self) -> float | None:
        """How far ours lies beyond the nearest allowed range, in SI, negative when too low; None without a limit."""
        if self.limit is None:
            return None
        gaps = [
            min(self.ours - low, 0.0) + max(self.ours - high, 0.0)
            for low, high in self.limit.allowed(list(self.independent.values()))
        ]
        return min(gaps, key=abs)

    @property
    def met(self) -> bool | None:
        """Whether ours is in an allowed range; None without a limit."""
        return None if self.beyond is None else self.beyond == 0.0
