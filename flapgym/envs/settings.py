"""Keywords of the environments: one frozen dataclass, checked before anything is built."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from flapgym.aeroelastic.model import TurbineModel, load_model
from flapgym.envs.observation import QUANTITIES


@dataclass(frozen=True)
class Settings:
    """What can be chosen about an environment; the manual is the docstring of `FlapEnv`."""

    model: str | os.PathLike[str] | TurbineModel = "nrel5mw-rated"
    wind_speed: float | None = None
    turbulence_intensity: float = 0.10
    length_scale: float = 147.0
    duration: float = 20.0
    measurement_noise: float = 0.0
    steps_per_action: int = 5
    observe: Sequence[str] = ("rbm",)
    flap_angle_weight: float = 0.0
    tower_weight: float = 0.0
    record_samples: bool = False

    def __post_init__(self) -> None:
        positive = ["length_scale", "duration"] + ["wind_speed"] * (self.wind_speed is not None)
        for name in (
            *positive,
            "turbulence_intensity",
            "measurement_noise",
            "flap_angle_weight",
            "tower_weight",
        ):
            value = getattr(self, name)
            if (
                isinstance(value, bool)
                or not isinstance(value, (int, float, np.number))
                or not math.isfinite(value)
            ):
                raise ValueError(f"{name}: expected a finite number, got {value!r}")
            if value < 0.0 or (value == 0.0 and name in positive):
                raise ValueError(
                    f"{name}: expected a {'positive' if name in positive else 'non-negative'} number, "
                    f"got {value!r}"
                )
        if self.turbulence_intensity >= 1.0:
            raise ValueError(
                f"turbulence_intensity: expected a fraction below 1 (0.10 is 10 %), got {self.turbulence_intensity}"
            )
        steps = self.steps_per_action
        if isinstance(steps, bool) or not isinstance(steps, (int, np.integer)) or not 1 <= steps <= 100:
            raise ValueError(f"steps_per_action: expected a whole number from 1 to 100, got {steps!r}")
        object.__setattr__(self, "observe", checked_observe(self.observe))

    @classmethod
    def of(cls, keywords: dict[str, Any]) -> Settings:
        """From an environment's keywords; an unknown one is refused by name."""
        known = [field.name for field in fields(cls)]
        for name in keywords:
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
                f'wind_speed = "{self.wind_speed:g} m/s", then '
                f"`flapgym build {target}.toml --output {target}.safetensors` and pass "
                f'model="{target}.safetensors"'
            )
        return model

    def intervals(self, time_step: float) -> int:
        """Actions of an episode: the fewest that last `duration`."""
        return max(1, math.ceil(self.duration / (self.steps_per_action * time_step) - 1e-9))


def checked_observe(observe: Sequence[str]) -> tuple[str, ...]:
    """The observed quantities as a tuple, or an error that names the one that does not exist."""
    names = (observe,) if isinstance(observe, str) else tuple(observe)
    if not names:
        raise ValueError(f"observe: expected at least one of {', '.join(QUANTITIES)}, got none")
    for name in names:
        if name not in QUANTITIES:
            raise ValueError(f"observe: expected names among {', '.join(QUANTITIES)}, got {name!r}")
    if len(set(names)) != len(names):
        raise ValueError(f"observe: expected each name once, got {', '.join(names)}")
    return names
