"""A training run as a frozen dataclass, read strictly from TOML: what it does not know it refuses by name."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Annotated, Any

from flapgym.control.agent_checks import BLADE_QUANTITIES, check_name
from flapgym.core.fields import Choice, Count, Quantity, Text, check_fields, check_keys, read
from flapgym.core.files import read_toml
from flapgym.core.wording import shown


@dataclass(frozen=True)
class Several:
    """A list of one or more values, each held to the same specification."""

    item: Any

    def parse(self, value: object, name: str) -> tuple[Any, ...]:
        """Read a TOML value."""
        return self.check(value, name)

    def check(self, value: object, name: str) -> tuple[Any, ...]:
        """Refuse an empty list, or an entry that does not fit."""
        if not isinstance(value, (list, tuple)) or not value:
            raise ValueError(f"{name}: expected a list of one or more values, got {shown(value)}")
        return tuple(self.item.check(entry, f"{name}[{index}]") for index, entry in enumerate(value))


Positive = Quantity("number", above=0.0)
Share = Quantity("number", at_least=0.0, at_most=1.0)
Discount = Quantity("number", above=0.0, below=1.0)


@dataclass(frozen=True)
class EnvironmentSettings:
    """What the policy is trained in; units as in `flapgym.envs.FlapEnv`."""

    turbines: Annotated[int, Count(at_least=1)]
    steps_per_action: Annotated[int, Count(at_least=1, at_most=100)]
    duration: Annotated[float, Quantity("time", above=0.0)]
    observe: Annotated[tuple[str, ...], Several(Choice(BLADE_QUANTITIES))]
    flap_angle_weight: Annotated[float, Quantity("number", at_least=0.0)]

    def __post_init__(self) -> None:
        check_fields(self, "environment")


@dataclass(frozen=True)
class NetworkSettings:
    """The multi-layer perceptrons."""

    hidden: Annotated[tuple[int, ...], Several(Count(at_least=1))]
    activation: Annotated[str, Choice(("tanh", "relu"))]

    def __post_init__(self) -> None:
        check_fields(self, "network")


@dataclass(frozen=True)
class PPOSettings:
    """Proximal policy optimisation."""

    learning_rate: Annotated[float, Positive]
    rollout: Annotated[int, Count(at_least=2)]
    batch_size: Annotated[int, Count(at_least=2)]
    epochs: Annotated[int, Count(at_least=1)]
    discount: Annotated[float, Discount]
    trace_decay: Annotated[float, Share]
    clip_range: Annotated[float, Positive]
    entropy_weight: Annotated[float, Quantity("number", at_least=0.0)]
    initial_log_std: Annotated[float, Quantity("number")]

    def __post_init__(self) -> None:
        check_fields(self, "ppo")


@dataclass(frozen=True)
class SACSettings:
    """Soft actor-critic."""

    learning_rate: Annotated[float, Positive]
    buffer_size: Annotated[int, Count(at_least=1)]
    batch_size: Annotated[int, Count(at_least=2)]
    gradient_steps: Annotated[int, Count(at_least=1)]
    discount: Annotated[float, Discount]
    target_rate: Annotated[float, Share]
    warm_up: Annotated[int, Count(at_least=1)]
    initial_entropy_weight: Annotated[float, Positive]
    target_entropy: Annotated[float, Quantity("number")]

    def __post_init__(self) -> None:
        check_fields(self, "sac")


@dataclass(frozen=True)
class Training:
    """One training run.

    Attributes
    ----------
    name, model : str
        Of the agent, and of the turbine model (or its file).
    total_steps : int
        Actions of single blades.
    environment : EnvironmentSettings
    network : NetworkSettings
    algorithm : PPOSettings or SACSettings
    """

    name: str
    model: str
    total_steps: int
    environment: EnvironmentSettings
    network: NetworkSettings
    algorithm: PPOSettings | SACSettings

    @property
    def discount(self) -> float:
        """Per action."""
        return self.algorithm.discount


def load_training(path: str | os.PathLike[str]) -> Training:
    """Read a run from a TOML file such as those in `configs/`.

    Raises
    ------
    ValueError, FileNotFoundError
        If a key is unknown or missing, a value out of range, or the file no TOML; the message names it.
    """
    table = read_toml(path)
    try:
        return _training(table)
    except ValueError as error:
        raise ValueError(f"{error} (in {path})") from None


def _training(table: dict[str, Any]) -> Training:
    kinds: dict[str, type[PPOSettings] | type[SACSettings]] = {"ppo": PPOSettings, "sac": SACSettings}
    algorithm = Choice(tuple(kinds)).check(table.get("algorithm"), "algorithm")
    check_keys(table, ("name", "algorithm", "model", "total_steps", "environment", "network", algorithm), "")
    return Training(
        name=check_name(table["name"]),
        model=Text().check(table["model"], "model"),
        total_steps=Count(at_least=1).check(table["total_steps"], "total_steps"),
        environment=read(EnvironmentSettings, table["environment"], "environment"),
        network=read(NetworkSettings, table["network"], "network"),
        algorithm=read(kinds[algorithm], table[algorithm], algorithm),
    )
