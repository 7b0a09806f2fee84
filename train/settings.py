"""A training run as a frozen dataclass, read strictly from TOML: what it does not know it refuses by name.

The hyperparameters are keyword arguments of the algorithm's class in Stable-Baselines3, under their names there.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from flapgym.control.agent_checks import BLADE_QUANTITIES, check_name
from flapgym.core.fields import (
    Choice,
    Count,
    Quantity,
    Text,
    TupleOf,
    check_fields,
    check_keys,
    is_number,
    read,
)
from flapgym.core.files import read_toml
from flapgym.core.wording import shown


@dataclass(frozen=True)
class EntropyCoefficient:
    """A number that stays; or "auto", adapted from 1, or "auto_0.01", adapted from there."""

    def check(self, value: object, name: str) -> float | str:
        """Refuse what SAC would."""
        if is_number(value):
            return float(Positive.check(value, name))
        word, _, start = value.partition("_") if isinstance(value, str) else ("", "", "")
        if word != "auto" or (value != "auto" and not _is_positive(start)):
            raise ValueError(f"{name}: expected a number, 'auto', or such as 'auto_0.01', got {shown(value)}")
        return str(value)


def _is_positive(text: str) -> bool:
    try:
        return 0.0 < float(text) < float("inf")
    except ValueError:
        return False


Positive = Quantity("number", above=0.0)
NotNegative = Quantity("number", at_least=0.0)
Share = Quantity("number", at_least=0.0, at_most=1.0)
Discount = Quantity("number", above=0.0, below=1.0)


@dataclass(frozen=True)
class EnvironmentSettings:
    """What the policy is trained in; units as in `flapgym.envs.FlapEnv`."""

    turbines: Annotated[int, Count(at_least=1)]
    steps_per_action: Annotated[int, Count(at_least=1, at_most=100)]
    duration: Annotated[float, Quantity("time", above=0.0)]
    observe: Annotated[tuple[str, ...], TupleOf(Choice(BLADE_QUANTITIES), distinct=True)]
    flap_angle_weight: Annotated[float, NotNegative]

    def __post_init__(self) -> None:
        check_fields(self, "environment")


@dataclass(frozen=True)
class SACNetwork:
    """The multi-layer perceptrons of policy and critics."""

    net_arch: Annotated[tuple[int, ...], TupleOf(Count(at_least=1))]
    activation_fn: Annotated[str, Choice(("tanh", "relu"))]

    def __post_init__(self) -> None:
        check_fields(self, "policy_kwargs")


@dataclass(frozen=True)
class PPONetwork(SACNetwork):
    """The multi-layer perceptrons of policy and value function, and how wide exploration begins."""

    log_std_init: Annotated[float, Quantity("number")]


@dataclass(frozen=True)
class PPOSettings:
    """Keyword arguments of `stable_baselines3.PPO`."""

    learning_rate: Annotated[float, Positive]
    n_steps: Annotated[int, Count(at_least=2)]
    batch_size: Annotated[int, Count(at_least=2)]
    n_epochs: Annotated[int, Count(at_least=1)]
    gamma: Annotated[float, Discount]
    gae_lambda: Annotated[float, Share]
    clip_range: Annotated[float, Positive]
    ent_coef: Annotated[float, NotNegative]
    vf_coef: Annotated[float, NotNegative]
    max_grad_norm: Annotated[float, Positive]
    policy_kwargs: PPONetwork

    def __post_init__(self) -> None:
        check_fields(self, "ppo")


@dataclass(frozen=True)
class SACSettings:
    """Keyword arguments of `stable_baselines3.SAC`."""

    learning_rate: Annotated[float, Positive]
    buffer_size: Annotated[int, Count(at_least=1)]
    learning_starts: Annotated[int, Count(at_least=1)]
    batch_size: Annotated[int, Count(at_least=2)]
    tau: Annotated[float, Share]
    gamma: Annotated[float, Discount]
    train_freq: Annotated[int, Count(at_least=1)]
    gradient_steps: Annotated[int, Count(at_least=1)]
    ent_coef: Annotated[float | str, EntropyCoefficient()]
    target_entropy: Annotated[float | str, Quantity("number", words=("auto",))]
    policy_kwargs: SACNetwork

    def __post_init__(self) -> None:
        check_fields(self, "sac")


@dataclass(frozen=True)
class Training:
    """One training run.

    Attributes
    ----------
    name, model : str
        Of the agent, and of the turbine model (or its file).
    total_timesteps : int
        Actions of single blades.
    environment : EnvironmentSettings
    algorithm : PPOSettings or SACSettings
    """

    name: str
    model: str
    total_timesteps: int
    environment: EnvironmentSettings
    algorithm: PPOSettings | SACSettings


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
    _refuse_old_names(table, algorithm)
    check_keys(table, ("name", "algorithm", "model", "total_timesteps", "environment", algorithm), "")
    return Training(
        name=check_name(table["name"]),
        model=Text().check(table["model"], "model"),
        total_timesteps=Count(at_least=1).check(table["total_timesteps"], "total_timesteps"),
        environment=read(EnvironmentSettings, table["environment"], "environment"),
        algorithm=read(kinds[algorithm], table[algorithm], algorithm),
    )


RENAMED = {
    "discount": "gamma",
    "rollout": "n_steps",
    "epochs": "n_epochs",
    "trace_decay": "gae_lambda",
    "entropy_weight": "ent_coef",
    "initial_log_std": "policy_kwargs.log_std_init",
    "target_rate": "tau",
    "warm_up": "learning_starts",
    "initial_entropy_weight": 'ent_coef, written as "auto_0.01"',
}
"""What hyperparameters were called in files before they had Stable-Baselines3's names."""


def _refuse_old_names(table: Mapping[str, Any], algorithm: str) -> None:
    if "total_steps" in table:
        raise ValueError("total_steps: now total_timesteps, as in Stable-Baselines3; rename it")
    if "network" in table:
        raise ValueError(
            f"network: now {algorithm}.policy_kwargs, with net_arch and activation_fn, as in Stable-Baselines3; "
            "rename hidden and activation"
        )
    chosen = table.get(algorithm)
    for old, new in RENAMED.items():
        if isinstance(chosen, Mapping) and old in chosen:
            raise ValueError(f"{algorithm}.{old}: now {algorithm}.{new}, as in Stable-Baselines3; rename it")
