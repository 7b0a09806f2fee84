"""n turbines each of which flies every episode at a wind speed of its own."""

from __future__ import annotations

import dataclasses
import heapq
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from flapgym.core.arrays import Array, BoolArray, IntArray
from flapgym.core.fields import to_plain
from flapgym.core.wording import shown
from flapgym.envs.actions import numbers, refuse_not_finite
from flapgym.envs.disk import EpisodeWind
from flapgym.envs.settings import Settings
from flapgym.envs.states import Reader, checked_whole, read_entry
from flapgym.envs.turbines import Episode, Info, Origin, Turbines, check_made_by
from flapgym.envs.wind_speeds import among, drawn_speed, widest
from flapgym.model.model_set import ModelSet
from flapgym.model.turbine_model import TurbineModel
from flapgym.plant import Loads


class Place(NamedTuple):
    """Where a turbine flies its episode: the wind speed [m/s], which block of it, and which turbine of the block."""

    wind_speed: float
    block: int
    slot: int


class RangeTurbines:
    """What `Turbines` is at one wind speed, over several: it has the same methods.

    At each wind speed there are blocks of some turbines, which are stepped together. A turbine takes a free place at
    the wind speed that its episode draws, and leaves it at its next reset.

    Parameters
    ----------
    models : ModelSet
    wind_speeds : tuple of float
        Of the set, at which episodes are flown [m/s].
    settings : Settings
        With the model of the first of them.
    count : int
        Number of turbines n.
    """

    def __init__(
        self, models: ModelSet, wind_speeds: tuple[float, ...], settings: Settings, count: int
    ) -> None:
        self.settings, self.count = settings, count
        self._models, self._wind_speeds = models, wind_speeds
        settings.wind.intensities(count, 0.0)  # refused before any work if there is not one for each
        # A second block is as slow as a first one. About one standard deviation of the number of turbines at a wind
        # speed above its mean, one block is mostly enough.
        mean = count / len(wind_speeds)
        self._size = min(count, math.ceil(mean + math.sqrt(mean)))
        self._blocks: dict[float, list[Turbines]] = {speed: [] for speed in wind_speeds}
        self._free: dict[float, list[tuple[int, int]]] = {speed: [] for speed in wind_speeds}
        """Heaps of the places left."""
        self._places: list[Place | None] = [None] * count
        self._flying = dict[tuple[float, int], tuple[IntArray, IntArray]]()
        """Of each block in which turbines fly: which, and their slots."""
        self._first = self._block(wind_speeds[0], 0)
        if settings.sensors.lidar is not None:
            # The faster the wind, the sooner what a lidar sees has passed: refused here, and not at some later reset.
            self._block(wind_speeds[-1], 0)
        self.stepping, self.quantities = self._first.stepping, self._first.quantities
        self.sampled = self._first.sampled
        self.observed, self.action_space = self._first.observed, self._first.action_space
        self.action_time = self._first.action_time
        self.observation_space = widest(models, wind_speeds, settings, self.observed)
        self._actions = (count, *(self.action_space.shape or ()))

    @property
    def model(self) -> TurbineModel:
        """The model at the lowest wind speed; flaps, inputs and outputs are those of all."""
        return self._first.model

    def model_of(self, turbine: int) -> TurbineModel:
        """The model of a turbine's episode."""
        place = self._places[turbine]
        return self.model if place is None else self._block(place.wind_speed, place.block).model

    def get_ready(self) -> None:
        """As `Turbines.get_ready`."""
        self._first.get_ready()

    def _block(self, wind_speed: float, number: int) -> Turbines:
        """A block at a wind speed, made when it is first met."""
        there = self._blocks[wind_speed]
        while len(there) <= number:
            settings = dataclasses.replace(
                self.settings,
                model=self._models.at(wind_speed),
                # Each turbine is told its own as its episode begins.
                wind=dataclasses.replace(self.settings.wind, turbulence_intensity=None)
                if self.settings.wind.field is None
                else self.settings.wind,
            )
            there.append(Turbines(settings, self._size))
            for slot in range(self._size):
                heapq.heappush(self._free[wind_speed], (len(there) - 1, slot))
        return there[number]

    def _leave(self, turbines: IntArray) -> None:
        for turbine in turbines:
            place = self._places[turbine]
            if place is not None:
                heapq.heappush(self._free[place.wind_speed], (place.block, place.slot))
            self._places[turbine] = None

    def _enter(self, wind_speed: float) -> Place:
        if not self._free[wind_speed]:
            self._block(wind_speed, len(self._blocks[wind_speed]))
        return Place(wind_speed, *heapq.heappop(self._free[wind_speed]))

    def _keep_flying(self) -> None:
        """Note who flies where."""
        by_block = dict[tuple[float, int], list[tuple[int, int]]]()
        for turbine, place in enumerate(self._places):
            if place is not None:
                by_block.setdefault(place[:2], []).append((turbine, place.slot))
        self._flying = {block: (pairs[:, 0], pairs[:, 1]) for block, pairs in _arrays(by_block).items()}

    def chosen(self, turbines: IntArray, options: Mapping[str, Any] | None = None) -> list[Origin]:
        """As `Turbines.chosen`, with the wind speed; None leaves it, and what goes with its model, to chance."""
        further, given = options, None
        if isinstance(options, Mapping):
            given = options.get("wind_speed")
            further = {name: value for name, value in options.items() if name != "wind_speed"}
        speeds = self._each(given)
        intensity = self.settings.wind.intensities(self.count, self.model.turbulence_intensity)
        chosen = self._first.chosen_among(intensity, turbines, further)
        if self.settings.wind.turbulence_intensity is None and "turbulence_intensity" not in (further or {}):
            chosen = [each | {"turbulence_intensity": None} for each in chosen]
        return [
            each | {"wind_speed": speeds[turbine]} for each, turbine in zip(chosen, turbines, strict=True)
        ]

    def _each(self, given: object) -> list[float | None]:
        """The wind speeds of a reset's options, one a turbine."""
        if given is None:
            return [None] * self.count
        if not isinstance(given, list | tuple | np.ndarray):
            return [among(given, self._wind_speeds, "options.wind_speed")] * self.count
        if np.ndim(given) != 1 or len(given) != self.count:
            raise ValueError(
                f"options.wind_speed: expected one speed, or one for each of {self.count} environments, "
                f"got {shown(given)}"
            )
        return [among(each, self._wind_speeds, "options.wind_speed") for each in given]

    def begin(
        self,
        turbines: IntArray,
        generators: Sequence[np.random.Generator],
        chosen: Sequence[Origin],
    ) -> tuple[np.ndarray, Info]:
        """As `Turbines.begin`; a wind speed that was not chosen is drawn."""
        speeds = [
            drawn_speed(generator, self._wind_speeds) if each["wind_speed"] is None else each["wind_speed"]
            for generator, each in zip(generators, chosen, strict=True)
        ]
        self._leave(turbines)
        by_block = dict[tuple[float, int], list[tuple[int, int]]]()
        for row, (turbine, speed) in enumerate(zip(turbines, speeds, strict=True)):
            place = self._places[turbine] = self._enter(speed)
            by_block.setdefault(place[:2], []).append((row, place.slot))
        self._keep_flying()
        whole: Info = {}
        for at, pairs in _arrays(by_block).items():
            rows, slots = pairs.T
            block = self._block(*at)
            observation, info = block.begin(
                slots, [generators[row] for row in rows], [_origin(chosen[row], block) for row in rows]
            )
            everyone = np.arange(len(rows))
            _spread(whole, {"observation": observation, "info": info}, rows, everyone, len(turbines))
        whole["info"]["wind_speed"] = np.array(speeds)
        return whole["observation"], whole["info"]

    def step(self, actions: ArrayLike) -> tuple[np.ndarray, Array, BoolArray, BoolArray, Info]:
        """As `Turbines.step`."""
        whole: Info = {}
        for block, turbines, slots, own in self._blocks_given(actions):
            observation, reward, terminated, truncated, info = block.step(own)
            part = {
                "observation": observation,
                "reward": reward,
                "terminated": terminated,
                "truncated": truncated,
                "info": info,
            }
            _spread(whole, part, turbines, slots, self.count)
        info = whole["info"]
        info["wind_speed"] = np.array([place.wind_speed for place in self._places if place is not None])
        return whole["observation"], whole["reward"], whole["terminated"], whole["truncated"], info

    def advance(self, actions: ArrayLike) -> tuple[np.ndarray, Loads]:
        """As `Turbines.advance`."""
        whole: Info = {}
        for block, turbines, slots, own in self._blocks_given(actions):
            observation, loads = block.advance(own)
            _spread(whole, {"observation": observation, **loads._asdict()}, turbines, slots, self.count)
        return whole.pop("observation"), Loads(**whole)

    def _blocks_given(self, actions: ArrayLike) -> Iterator[tuple[Turbines, IntArray, IntArray, Array]]:
        """Each block in which turbines fly: which, their slots, and what all of its slots are to do."""
        values = numbers(actions, self._actions)
        refuse_not_finite(values, blades=self.quantities.blades, flaps=self.quantities.flaps)
        for at, (turbines, slots) in self._flying.items():
            own = np.zeros((self._size, values.shape[1]), dtype=values.dtype)
            own[slots] = values[turbines]
            yield self._block(*at), turbines, slots, own

    @property
    def over(self) -> BoolArray:
        """As `Turbines.over`; true where no episode has begun."""
        over = np.ones(self.count, dtype=bool)
        for at, (turbines, slots) in self._flying.items():
            over[turbines] = self._block(*at).over[slots]
        return over

    def wind_over_disk(self, turbine: int) -> EpisodeWind | None:
        """As `Turbines.wind_over_disk`."""
        place = self._places[turbine]
        return (
            None if place is None else self._block(place.wind_speed, place.block).wind_over_disk(place.slot)
        )

    def flap_motion(self) -> tuple[Array, Array]:
        """As `Turbines.flap_motion`; zero where no episode has begun."""
        flaps = self.quantities.blades * self.quantities.flaps
        angle, rate = np.zeros((2, self.count, flaps))
        for at, (turbines, slots) in self._flying.items():
            angles, rates = self._block(*at).flap_motion()
            angle[turbines], rate[turbines] = angles[slots], rates[slots]
        return angle, rate

    def steady(self, azimuth: Array) -> dict[str, Array]:
        """As `Turbines.steady` at one wind speed; raises ValueError if there are several."""
        if len(self._wind_speeds) > 1:
            raise ValueError(
                f"steady: expected an environment at one wind speed, got one at {len(self._wind_speeds)}"
            )
        return self._first.steady(azimuth)

    def get_state(self) -> dict[str, Any]:
        """As `Turbines.get_state`."""
        return {
            "made_by": self._made_by(),
            "turbines": [None if place is None else self._turbine_state(place) for place in self._places],
        }

    def _turbine_state(self, place: Place) -> dict[str, Any]:
        block = self._block(place.wind_speed, place.block)
        of_turbine = block.turbine_state(place.slot)
        assert of_turbine is not None  # an episode began as it took its place
        # With its place, for another's sums may be rounded otherwise.
        return of_turbine | {"place": list(place), "model": block.plant.fingerprint}

    def _made_by(self) -> dict[str, Any]:
        wind = to_plain(dataclasses.replace(self.settings.wind, gust=None))
        own = {"num_envs": self.count, "wind": wind, "wind_speed": list(self._wind_speeds)}
        return self._first.made_by | own

    def read_state(self, state: Mapping[str, Any], further: Mapping[str, Reader]) -> dict[str, Any]:
        """As `Turbines.read_state`."""
        check_made_by(state, self._made_by())
        readers = {**further, "turbines": self._read_turbines}
        return {name: read_entry(state, name, reader) for name, reader in readers.items()}

    def _read_turbines(
        self, entries: Sequence[Mapping[str, Any] | None]
    ) -> list[tuple[Place, Episode] | None]:
        if len(entries) != self.count:
            raise ValueError(f"expected {self.count} turbines, got {len(entries)}")
        read = [None if entry is None else self._read_turbine(entry) for entry in entries]
        places = [each[0] for each in read if each is not None]
        if len(set(places)) < len(places):
            raise ValueError("place: expected one for each turbine, got one for two")
        return read

    def _read_turbine(self, entry: Mapping[str, Any]) -> tuple[Place, Episode]:
        speed, number, slot = entry["place"]
        speed = among(speed, self._wind_speeds, "place")
        place = Place(
            speed,
            checked_whole("place", number, self.count - 1),
            checked_whole("place", slot, self._size - 1),
        )
        block = self._block(speed, 0)
        if entry["model"] != block.plant.fingerprint:
            raise ValueError(f"model: expected {block.plant.fingerprint}, got {shown(entry['model'])}")
        return place, block.read_episode(entry)

    def go_on(self, episodes: Sequence[tuple[Place, Episode] | None]) -> list[tuple[Info | None, int]]:
        """As `Turbines.go_on`."""
        self._leave(np.arange(self.count))
        instants = list[tuple[Info | None, int]]()
        for turbine, each in enumerate(episodes):
            if each is None:
                instants.append((None, 0))
                continue
            place, episode = each
            block = self._block(place.wind_speed, place.block)
            self._free[place.wind_speed].remove((place.block, place.slot))
            heapq.heapify(self._free[place.wind_speed])
            self._places[turbine] = place
            instants.append(block.resume(place.slot, episode))
        self._keep_flying()
        return instants


def _arrays(by_block: Mapping[tuple[float, int], list[tuple[int, int]]]) -> dict[tuple[float, int], IntArray]:
    return {block: np.array(pairs, dtype=np.int64) for block, pairs in by_block.items()}


def _origin(chosen: Origin, block: Turbines) -> Origin:
    """What was chosen for an episode, as its block takes it."""
    own = {name: value for name, value in chosen.items() if name != "wind_speed"}
    if own["turbulence_intensity"] is None and block.stepping.surroundings.field is None:
        own["turbulence_intensity"] = block.model.turbulence_intensity
    return own


def _spread(whole: Info, part: Info, rows: IntArray, own: IntArray, count: int) -> None:
    """Put rows of a part into rows of the whole, which has `count`; also inside of nested ones."""
    for name, value in part.items():
        if isinstance(value, dict):
            _spread(whole.setdefault(name, {}), value, rows, own, count)
            continue
        if name not in whole:
            whole[name] = np.zeros((count, *value.shape[1:]), dtype=value.dtype)
        whole[name][rows] = value[own]
