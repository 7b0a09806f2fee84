"""What `configs/tuning.toml` says, read strictly: an unknown or missing key is refused by its name."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Annotated

from flapgym.core.fields import Count, Quantity, check_fields, read
from flapgym.core.files import read_toml
from flapgym.evaluation import SCORED_SEED


@dataclass(frozen=True)
class LQGCandidate:
    """Weights of an LQG but that on the root bending moment, which the tuning finds."""

    flap_angle: Annotated[float, Quantity("number", above=0.0)]
    acceleration: Annotated[float, Quantity("number", above=0.0)]
    measurement_noise: Annotated[float, Quantity("number", above=0.0)]

    def __post_init__(self) -> None:
        check_fields(self, "lqg")


@dataclass(frozen=True)
class FieldCandidate(LQGCandidate):
    """Of an LQG for a field also the heaviest weight on the root bending moment that is tried."""

    heaviest: Annotated[float, Quantity("number", above=0.1)]


@dataclass(frozen=True)
class PDCandidate:
    """A PD controller but for its gain, which the tuning finds."""

    derivative_time: Annotated[float, Quantity("time", at_least=0.0)]
    filter_time: Annotated[float, Quantity("time", above=0.0)]
    servo_frequency: Annotated[float, Quantity("angular rate", above=0.0)]
    servo_damping: Annotated[float, Quantity("number", above=0.0)]

    def __post_init__(self) -> None:
        check_fields(self, "pd")


@dataclass(frozen=True)
class PIDCandidate(PDCandidate):
    """A PID controller but for its gain, which the tuning finds; also that of a tilt and yaw channel."""

    integral_gain: Annotated[float, Quantity("number", at_least=0.0)]
    leak_time: Annotated[float, Quantity("time", above=0.0)]

    def __post_init__(self) -> None:
        check_fields(self, "pid")


@dataclass(frozen=True)
class Tuning:
    """Realisations, the disk margin asked for, and candidates."""

    seed: Annotated[int, Count(at_least=0)]
    realisations: Annotated[int, Count(at_least=2, at_most=1000)]
    disk_margin: Annotated[float, Quantity("number", above=0.0, below=2.0)]
    lqg: tuple[LQGCandidate, ...]
    lqg_saturating: tuple[LQGCandidate, ...]
    lqg_field: tuple[FieldCandidate, ...]
    pd: tuple[PDCandidate, ...]
    pid: tuple[PIDCandidate, ...]
    tilt_yaw: tuple[PIDCandidate, ...]

    def __post_init__(self) -> None:
        check_fields(self)
        if self.seed < SCORED_SEED + 1000 and self.seed + self.realisations > SCORED_SEED:
            raise ValueError(
                f"seed: tuning realisations must not be scored ones ({SCORED_SEED} and the next thousand), "
                f"got {self.seed}"
            )


def load_tuning(path: str | os.PathLike[str]) -> Tuning:
    """Read a tuning file.

    Raises
    ------
    ValueError, OSError
        Naming the file and the field.
    """
    table = read_toml(path)
    try:
        return read(Tuning, table)
    except ValueError as error:
        raise ValueError(f"{error} (in {path})") from None
