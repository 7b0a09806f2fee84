"""What a plant tells, by name: the one place that knows where each quantity stands among a turbine's numbers."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property


@dataclass(frozen=True)
class Quantities:
    """Names and places of a turbine's numbers, all in SI units, at the last sample of an interval or at every one.

    Parameters
    ----------
    blades : int
        Blades that are there: 3, or 1 for the single blade.
    flaps : int
        Flaps F on each.
    pitch : bool
        Whether the blades' pitch moves.
    blade_outputs : tuple of str
        What the model tells of each blade, "rbm" first.
    fixed_outputs : tuple of str
        What it tells in the fixed frame.
    """

    blades: int
    flaps: int
    pitch: bool
    blade_outputs: tuple[str, ...]
    fixed_outputs: tuple[str, ...]

    @cached_property
    def last(self) -> dict[str, slice]:
        """Of the numbers at the last sample: loads, actuators, fixed outputs, wind, azimuth of blade 1.

        Flaps come blade by blade, then pitch. The azimuth comes with its cosine and sine, behind one another, under
        "heading".
        """
        sizes = dict.fromkeys(self.blade_outputs, self.blades)
        sizes |= self._of_actuators("angle", "rate", "travel", "stopped")
        sizes |= dict.fromkeys((*self.fixed_outputs, "wind", "azimuth"), 1) | {"heading": 2}
        return _places(sizes)

    @cached_property
    def sample(self) -> dict[str, slice]:
        """Of the numbers at a plant sample."""
        sizes = dict.fromkeys(self.blade_outputs, self.blades)
        sizes |= self._of_actuators("angle", "rate")
        sizes |= dict.fromkeys((*self.fixed_outputs, "wind"), 1)
        return _places(sizes)

    def _of_actuators(self, *kinds: str) -> dict[str, int]:
        sizes = {"flap": self.blades * self.flaps} | ({"pitch": self.blades} if self.pitch else {})
        return {f"{name}_{kind}": size for kind in kinds for name, size in sizes.items()}

    @property
    def size(self) -> int:
        """Numbers at the last sample."""
        return self.last["heading"].stop

    @property
    def sample_size(self) -> int:
        """Numbers at a plant sample."""
        return self.sample["wind"].stop


def _places(sizes: dict[str, int]) -> dict[str, slice]:
    places, first = {}, 0
    for name, size in sizes.items():
        places[name] = slice(first, first + size)
        first += size
    return places
