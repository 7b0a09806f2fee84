"""Keywords of the environments: one frozen dataclass, checked before anything is built."""

from __future__ import annotations

import difflib
import math
import os
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flapgym.core.wording import number, shown
from flapgym.envs.observation import QUANTITIES, TURBINE_ONLY
from flapgym.model.nameplate import nameplate
from flapgym.model.turbine_model import DEFAULT_MODEL, TurbineModel, load_model
from flapgym.plant import KERNELS, PRECISIONS, Faults, GivenWind
from flapgym.turbine import BUILT_IN, load_case
from flapgym.wind import gust_of
from flapgym.wind.gusts import ROUNDING, ExtremeOperatingGust, Recorded, Sinusoid, is_number

LARGEST_POOL = 1_000_000
"""Realisations of a pool: each takes some kilobytes from the start and half a megabyte once it has been met."""
FRACTION = "a fraction of at least 0 and below 1 (0.10 is 10 %)"
"""What a turbulence intensity must be."""
LIMITS = {
    "wind_speed": (1.0, 100.0, " m/s"),
    "length_scale": (1.0, 1e5, " m"),
    "duration": (1e-3, 1e5, " s"),
    "measurement_noise": (0.0, 5e7, " N m"),  # the bound of the observation
    "sensor_delay": (0.0, 60.0, " s"),
    "actuator_lag": (0.0, 60.0, " s"),
    "flap_angle_weight": (0.0, 1e6, ""),
    "tower_weight": (0.0, 1e6, ""),
}
"""Least and largest value of a keyword, and its unit: what lies beyond is a slip, and overflows somewhere."""


@dataclass(frozen=True)
class Settings:
    """What can be chosen about an environment; the manual is the docstring of `FlapEnv`."""

    model: str | os.PathLike[str] | TurbineModel = DEFAULT_MODEL
    wind_speed: float | None = None
    turbulence_intensity: float | Sequence[float] | None = None
    length_scale: float | None = None
    gust: Mapping[str, Any] | None = None
    duration: float = 20.0
    measurement_noise: float = 0.0
    sensor_delay: float = 0.0
    actuator_lag: float = 0.0
    stuck_flaps: Sequence[float | None] = (None, None, None)
    flap_effectiveness: Sequence[float] = (1.0, 1.0, 1.0)
    steps_per_action: int = 5
    observe: Sequence[str] = ("rbm",)
    flap_angle_weight: float = 0.0
    tower_weight: float = 0.0
    full_info: bool = False
    record_samples: bool = False
    realisation_pool: int = 0
    precision: str = "float64"
    kernel: str = "auto"

    def __post_init__(self) -> None:
        if not isinstance(self.model, (str, os.PathLike, TurbineModel)):
            raise ValueError(
                f"model: expected the name of a shipped model or a model file, got {shown(self.model)}"
            )
        for name in ("full_info", "record_samples"):
            if not isinstance(getattr(self, name), (bool, np.bool_)):
                raise ValueError(f"{name}: expected True or False, got {shown(getattr(self, name))}")
            self._take(name, bool(getattr(self, name)))
        for name, (lowest, highest, unit) in LIMITS.items():
            value = getattr(self, name)
            if value is None and name in ("wind_speed", "length_scale"):
                continue  # the model's
            if not is_number(value):
                raise ValueError(f"{name}: expected a finite number, got {shown(value)}")
            # As Python's: bounds overflow in NumPy's numbers of few bits.
            value = value if isinstance(value, int) else float(value)
            if not lowest <= value <= highest:
                raise ValueError(
                    f"{name}: expected a number from {number(lowest)} to {number(highest)}{unit}, got {shown(value)}"
                )
            self._take(name, float(value))
        if self.turbulence_intensity is not None:
            self._take("turbulence_intensity", _checked_intensity(self.turbulence_intensity))
        steps = self.steps_per_action
        if isinstance(steps, bool) or not isinstance(steps, (int, np.integer)) or not 1 <= steps <= 100:
            raise ValueError(f"steps_per_action: expected a whole number from 1 to 100, got {shown(steps)}")
        # NumPy's own numbers are of few bits, some of them, and overflow when they are counted with.
        self._take("steps_per_action", int(steps))
        pool = self.realisation_pool
        if isinstance(pool, bool) or not isinstance(pool, (int, np.integer)) or not 0 <= pool <= LARGEST_POOL:
            raise ValueError(
                f"realisation_pool: expected a whole number from 0 to {LARGEST_POOL}, got {shown(pool)}"
            )
        self._take("realisation_pool", int(pool))
        for name, known in (("precision", PRECISIONS), ("kernel", KERNELS)):
            value = getattr(self, name)
            if not isinstance(value, str) or value not in known:
                raise ValueError(f"{name}: expected one of {', '.join(known)}, got {shown(value)}")
        self._take("observe", checked_observe(self.observe))
        self._take("stuck_flaps", _three("stuck_flaps", self.stuck_flaps, optional=True))
        self._take("flap_effectiveness", _three("flap_effectiveness", self.flap_effectiveness))
        if not all(0.0 <= factor <= 2.0 for factor in self.flap_effectiveness):
            raise ValueError(
                f"flap_effectiveness: expected factors from 0 (a floating flap) to 2, got {self.flap_effectiveness}"
            )
        if self.gust is not None:
            gust_of(self.gust)
            if self.realisation_pool:
                raise ValueError(
                    f"realisation_pool: expected 0 beside a gust, whose wind no pool holds, got {pool}"
                )

    def _take(self, name: str, value: object) -> None:
        """Keep a checked value in its canonical type."""
        object.__setattr__(self, name, value)

    @classmethod
    def of(cls, keywords: dict[str, Any], owner: str) -> Settings:
        """From the keywords of an environment's class `owner`; an unknown one is refused by name.

        The refusal begins in Python's own words: other libraries look for them to learn what an environment takes.
        """
        known = [field.name for field in fields(cls)]
        for name in keywords:
            if name not in known:
                near = difflib.get_close_matches(name, known, n=1)
                hint = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(known)}, render_mode"
                hint = "give duration in its place [s]" if name == "max_episode_steps" else hint
                raise TypeError(
                    f"{owner}.__init__() got an unexpected keyword argument {shown(name)}; {hint}"
                )
        return cls(**keywords)

    def turbine_model(self) -> TurbineModel:
        """The model meant, loaded if it is a name or a file.

        Raises
        ------
        ValueError
            If it was built for another wind speed; the message says how to build the right one.
        """
        model = self.model if isinstance(self.model, TurbineModel) else load_model(self.model)
        if self.wind_speed is not None and not math.isclose(self.wind_speed, model.wind_speed, rel_tol=1e-9):
            wanted = number(self.wind_speed)
            target = f"{model.name}-{wanted}mps"
            raise ValueError(
                f"wind_speed: model {model.name} was built for {number(model.wind_speed)} m/s, got {wanted} m/s; "
                f'write {target}.toml with base = "{_base_of(model)}", name = "{target}" and in [operating_point] '
                f'wind_speed = "{wanted} m/s" (above rated wind also pitch and tip_speed_ratio), then '
                f"`flapgym build {target}.toml --output {target}.safetensors` and pass "
                f'model="{target}.safetensors"'
            )
        return model

    def check_single_blade(self) -> None:
        """Refuse what only a whole turbine has."""
        for name in self.observe:
            if name in TURBINE_ONLY:
                raise ValueError(f"observe: a single blade has no {name}; leave it out")
        if self.tower_weight:
            raise ValueError(f"tower_weight: expected 0 for a single blade, got {shown(self.tower_weight)}")

    def faults(self, model: TurbineModel) -> Faults:
        """What is wrong with the flaps of a model.

        Raises
        ------
        ValueError
            If a flap is stuck beyond its stop.
        """
        for angle in self.stuck_flaps:
            if angle is not None and abs(angle) > model.flap_angle_limit * (1.0 + 1e-9):
                raise ValueError(
                    f"stuck_flaps: expected angles within +-{number(model.flap_angle_limit)} rad, got {shown(angle)}"
                )
        first, second, third = self.stuck_flaps
        one, two, three = self.flap_effectiveness
        return Faults((one, two, three), (first, second, third), self.actuator_lag)

    def given_wind(self, model: TurbineModel) -> GivenWind | None:
        """Samples of the gust over an episode, and the wind before it.

        Raises
        ------
        ValueError
            If the gust's recording does not last as long, its frequency is above what the samples show, or it wants the
            size of a turbine that the model's case does not tell.
        """
        if self.gust is None:
            return None
        dt, gust = model.time_step, gust_of(self.gust)
        action, intervals = self.steps_per_action * dt, self.intervals(dt)
        if isinstance(gust, Recorded):
            whole = math.floor((gust.lasts() + ROUNDING) / action)
            if intervals > whole:
                raise ValueError(
                    f"duration: {gust.file} lasts {number(gust.lasts())} s from where the episode begins; expected a "
                    f"duration of at most {number(whole * action)} s, whole actions of {number(action)} s, or an "
                    f"earlier gust.start, got {number(self.duration)} s"
                )
        samples = intervals * self.steps_per_action + 1
        time = np.arange(-1, samples, dtype=np.float64) * dt
        gust = gust_of(self.gust)
        if isinstance(gust, ExtremeOperatingGust):
            plate = nameplate(model.case)
            diameter = None if plate.rotor_radius is None else 2.0 * plate.rotor_radius
            gust = gust.on_turbine(diameter, plate.hub_height)
        elif isinstance(gust, Sinusoid):
            gust.check_samples(dt)
        wind = gust.wind(time, model.wind_speed)
        return GivenWind(wind[1:], float(wind[0]))

    def delay(self, time_step: float) -> int:
        """Plant steps by which the observed moments are late.

        Raises
        ------
        ValueError
            If the delay is no whole number of them.
        """
        steps = round(self.sensor_delay / time_step)
        if not math.isclose(steps * time_step, self.sensor_delay, rel_tol=1e-6, abs_tol=1e-12):
            raise ValueError(
                f"sensor_delay: expected a multiple of the time step {number(time_step)} s, such as "
                f"{number(steps * time_step)} s, got {number(self.sensor_delay)} s"
            )
        return steps

    def intensities(self, count: int, model: TurbineModel) -> NDArray[np.float64]:
        """Turbulence intensity of each of `count` turbines; the model's own if none is given.

        Raises
        ------
        ValueError
            If there is neither one for all nor one for each.
        """
        chosen = self.turbulence_intensity
        given = np.asarray(model.turbulence_intensity if chosen is None else chosen)
        if given.shape not in ((), (count,)):
            raise ValueError(
                f"turbulence_intensity: expected one number, or one for each of {count} environments, "
                f"got {len(given)}"
            )
        return np.broadcast_to(given, (count,)).astype(float)

    def intervals(self, time_step: float) -> int:
        """Actions of an episode: the fewest that last `duration`."""
        return max(1, math.ceil(self.duration / (self.steps_per_action * time_step) - 1e-9))


def _base_of(model: TurbineModel) -> str:
    """What a case that differs from a model's in one thing takes as its base."""
    if model.name in BUILT_IN["case"] and load_case(model.name).hash() == model.inputs_hash:
        return model.name
    return f"the case file that {model.name} was built from"


def _three(name: str, values: object, optional: bool = False) -> tuple[Any, ...]:
    """One number for each blade, or None where that is allowed."""
    what = "numbers or None" if optional else "numbers"
    if not isinstance(values, (Sequence, np.ndarray)) or isinstance(values, str) or len(values) != 3:
        raise ValueError(f"{name}: expected three {what}, blade 1 first, got {shown(values)}")
    for value in values:
        if not ((optional and value is None) or is_number(value)):
            raise ValueError(f"{name}: expected three finite {what}, blade 1 first, got {shown(values)}")
    return tuple(None if value is None else float(value) for value in values)


def _checked_intensity(given: Any) -> float | tuple[float, ...]:
    """One fraction, or a tuple of them."""
    several = isinstance(given, (Sequence, np.ndarray)) and not isinstance(given, str) and np.ndim(given) == 1
    values = list(given) if several else [given]
    for value in values:
        if not is_number(value):
            raise ValueError(f"turbulence_intensity: expected a finite number, got {shown(value)}")
        if not 0.0 <= value < 1.0:
            raise ValueError(f"turbulence_intensity: expected {FRACTION}, got {shown(value)}")
    return tuple(float(value) for value in values) if several else float(given)


def checked_observe(observe: Sequence[str]) -> tuple[str, ...]:
    """The observed quantities as a tuple, or an error that names the one that does not exist."""
    if not isinstance(observe, Iterable) or isinstance(
        observe, (bytes, Set, Mapping)
    ):  # whose order says nothing
        raise ValueError(f"observe: expected names among {', '.join(QUANTITIES)}, got {shown(observe)}")
    names = (observe,) if isinstance(observe, str) else tuple(observe)
    names = tuple(
        str(name) if isinstance(name, str) else name for name in names
    )  # NumPy has texts of its own
    if not names:
        raise ValueError(f"observe: expected at least one of {', '.join(QUANTITIES)}, got none")
    for name in names:
        if not isinstance(name, str) or name not in QUANTITIES:
            raise ValueError(f"observe: expected names among {', '.join(QUANTITIES)}, got {shown(name)}")
    if len(set(names)) != len(names):
        raise ValueError(f"observe: expected each name once, got {', '.join(names)}")
    return names
