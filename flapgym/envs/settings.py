"""Keywords of the environments: one frozen dataclass, checked before anything is built."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flapgym.aeroelastic.model import DEFAULT_MODEL, TurbineModel, load_model
from flapgym.envs.observation import QUANTITIES, TURBINE_ONLY
from flapgym.plant import KERNELS, PRECISIONS, Faults, GivenWind
from flapgym.turbulence import gust_of
from flapgym.turbulence.gusts import is_number

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
    turbulence_intensity: float | Sequence[float] = 0.10
    length_scale: float = 147.0
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
                f"model: expected the name of a shipped model or a model file, got {self.model!r}"
            )
        for name in ("full_info", "record_samples"):
            if not isinstance(getattr(self, name), (bool, np.bool_)):
                raise ValueError(f"{name}: expected True or False, got {getattr(self, name)!r}")
        for name, (lowest, highest, unit) in LIMITS.items():
            value = getattr(self, name)
            if value is None and name == "wind_speed":
                continue
            if not is_number(value):
                raise ValueError(f"{name}: expected a finite number, got {value!r}")
            if not lowest <= value <= highest:
                raise ValueError(
                    f"{name}: expected a number from {lowest:g} to {highest:g}{unit}, got {value!r}"
                )
        object.__setattr__(self, "turbulence_intensity", _checked_intensity(self.turbulence_intensity))
        steps = self.steps_per_action
        if isinstance(steps, bool) or not isinstance(steps, (int, np.integer)) or not 1 <= steps <= 100:
            raise ValueError(f"steps_per_action: expected a whole number from 1 to 100, got {steps!r}")
        pool = self.realisation_pool
        if isinstance(pool, bool) or not isinstance(pool, (int, np.integer)) or pool < 0:
            raise ValueError(f"realisation_pool: expected a whole number of at least 0, got {pool!r}")
        for name, known in (("precision", PRECISIONS), ("kernel", KERNELS)):
            if getattr(self, name) not in known:
                raise ValueError(f"{name}: expected one of {', '.join(known)}, got {getattr(self, name)!r}")
        object.__setattr__(self, "observe", checked_observe(self.observe))
        object.__setattr__(self, "stuck_flaps", _three("stuck_flaps", self.stuck_flaps, optional=True))
        object.__setattr__(self, "flap_effectiveness", _three("flap_effectiveness", self.flap_effectiveness))
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

    @classmethod
    def of(cls, keywords: dict[str, Any]) -> Settings:
        """From an environment's keywords; an unknown one is refused by name."""
        known = [field.name for field in fields(cls)]
        for name in keywords:
            if name == "max_episode_steps":
                raise TypeError(
                    "max_episode_steps: expected duration in its place, the seconds of an episode of every environment"
                )
            if name not in known:
                raise TypeError(
                    f"{name}: no such keyword of the environment; known: {', '.join(known)}, render_mode"
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
            target = f"{model.name}-{self.wind_speed:g}mps"
            raise ValueError(
                f"wind_speed: model {model.name} was built for {model.wind_speed:g} m/s, got {self.wind_speed:g} m/s; "
                f'write {target}.toml with base = "nrel5mw-rated", name = "{target}" and in [operating_point] '
                f'wind_speed = "{self.wind_speed:g} m/s" (above rated wind also pitch and tip_speed_ratio), then '
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
            raise ValueError(f"tower_weight: expected 0 for a single blade, got {self.tower_weight!r}")

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
                    f"stuck_flaps: expected angles within +-{model.flap_angle_limit:.4g} rad, got {angle!r}"
                )
        first, second, third = self.stuck_flaps
        one, two, three = self.flap_effectiveness
        return Faults((one, two, three), (first, second, third), self.actuator_lag)

    def given_wind(self, model: TurbineModel) -> GivenWind | None:
        """Samples of the gust over an episode, and the wind before it.

        Raises
        ------
        ValueError
            If the gust's recording does not last as long.
        """
        if self.gust is None:
            return None
        dt = model.time_step
        samples = self.intervals(dt) * self.steps_per_action + 1
        time = np.arange(-1, samples, dtype=np.float64) * dt
        wind = gust_of(self.gust).wind(time, model.wind_speed)
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
                f"sensor_delay: expected a multiple of the time step {time_step:g} s, such as "
                f"{steps * time_step:g} s, got {self.sensor_delay:g} s"
            )
        return steps

    def intensities(self, count: int) -> NDArray[np.float64]:
        """Turbulence intensity of each of `count` turbines.

        Raises
        ------
        ValueError
            If there is neither one for all nor one for each.
        """
        given = np.asarray(self.turbulence_intensity)
        if given.shape not in ((), (count,)):
            raise ValueError(
                f"turbulence_intensity: expected one number, or one for each of {count} environments, "
                f"got {len(given)}"
            )
        return np.broadcast_to(given, (count,)).astype(float)

    def intervals(self, time_step: float) -> int:
        """Actions of an episode: the fewest that last `duration`."""
        return max(1, math.ceil(self.duration / (self.steps_per_action * time_step) - 1e-9))


def _three(name: str, values: object, optional: bool = False) -> tuple[Any, ...]:
    """One number for each blade, or None where that is allowed."""
    what = "numbers or None" if optional else "numbers"
    if not isinstance(values, (Sequence, np.ndarray)) or isinstance(values, str) or len(values) != 3:
        raise ValueError(f"{name}: expected three {what}, blade 1 first, got {values!r}")
    for value in values:
        if not ((optional and value is None) or is_number(value)):
            raise ValueError(f"{name}: expected three finite {what}, blade 1 first, got {values!r}")
    return tuple(values)


def _checked_intensity(given: Any) -> float | tuple[float, ...]:
    """One fraction, or a tuple of them."""
    several = isinstance(given, (Sequence, np.ndarray)) and not isinstance(given, str) and np.ndim(given) == 1
    values = list(given) if several else [given]
    for value in values:
        if not is_number(value):
            raise ValueError(f"turbulence_intensity: expected a finite number, got {value!r}")
        if not 0.0 <= value < 1.0:
            raise ValueError(f"turbulence_intensity: expected {FRACTION}, got {value!r}")
    return tuple(float(value) for value in values) if several else given


def checked_observe(observe: Sequence[str]) -> tuple[str, ...]:
    """The observed quantities as a tuple, or an error that names the one that does not exist."""
    if not isinstance(observe, Iterable):
        raise ValueError(f"observe: expected names among {', '.join(QUANTITIES)}, got {observe!r}")
    names = (observe,) if isinstance(observe, str) else tuple(observe)
    if not names:
        raise ValueError(f"observe: expected at least one of {', '.join(QUANTITIES)}, got none")
    for name in names:
        if not isinstance(name, str) or name not in QUANTITIES:
            raise ValueError(f"observe: expected names among {', '.join(QUANTITIES)}, got {name!r}")
    if len(set(names)) != len(names):
        raise ValueError(f"observe: expected each name once, got {', '.join(names)}")
    return names
