"""The Agent protocol every controller and policy follows, and the observation it reads.

`predict` has the signature of Stable-Baselines3's policies, so the evaluation treats open loop, PD, LQG and a trained
policy alike. Observations and states carry any leading batch axes.
"""

from __future__ import annotations

from functools import cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from flapgym.core.arrays import BLADES, Array, IntArray
from flapgym.core.state_space import require_time_step
from flapgym.model.turbine_model import TurbineModel

OBSERVATION_SCALES: dict[str, float] = {"rbm": 1e6, "flap_angle": 1.0, "flap_rate": 1.0}
"""SI value of one unit of the environment's observation: MN m, rad, rad/s."""
OF_FLAPS = ("flap_angle", "flap_rate")
"""Observations of which each flap has one, blade by blade and on each blade in turn; of others each blade has one."""

Floats = NDArray[np.floating]
"""Observations come as the environment's float32."""


class Agent(Protocol):
    """What acts on the flaps.

    Attributes
    ----------
    name : str
        What tables call it.
    observe : tuple of str
        Observations it needs, in order (the environment's `observe`).
    steps_per_action : int
        Plant steps for which it holds an action.
    model_hash : str or None
        Hash of the model it was made for; None if it fits any.

    Notes
    -----
    One with a true `per_blade` treats each blade alone, so it can act on a single one. One with a `time_step` [s] was
    made for plants of that step, one with `flaps` for turbines of so many flaps a blade; both are refused by any other.
    One with a true `pitches` gives three more actions behind those of the flaps, the pitch of each blade.
    """

    @property
    def name(self) -> str: ...  # noqa: D102 (documented above, as are the next three)
    @property
    def observe(self) -> tuple[str, ...]: ...  # noqa: D102
    @property
    def steps_per_action(self) -> int: ...  # noqa: D102
    @property
    def model_hash(self) -> str | None: ...  # noqa: D102

    def predict(
        self,
        observation: Floats,
        state: Array | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], Array | None]:
        """Action (..., 3 F) in [-1, 1] for an observation (..., n), and the state to hand back next time.

        Blade by blade, and on each of F flaps a blade in turn.

        State None, or `episode_start` true (one per batch entry), begins afresh.
        """
        ...


class OpenLoop:
    """Flaps at rest: the reference of every comparison. It observes the flaps, which tells it how many there are."""

    name = "open_loop"
    observe: tuple[str, ...] = ("flap_angle",)
    steps_per_action = 10  # doing nothing is the same at any interval, and quicker at a long one
    model_hash: str | None = None
    per_blade = True

    def predict(
        self,
        observation: Floats,
        state: Array | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], Array | None]:
        """No acceleration, whatever is observed."""
        return np.zeros(np.shape(observation), dtype=np.float32), None


def check_fit(agent: Agent, model: TurbineModel) -> None:
    """Refuse an agent that was made for another time step or another number of flaps a blade than the model's."""
    own = getattr(agent, "time_step", None)
    if own is not None:
        require_time_step(f"agent {agent.name}: time_step", own, model.time_step, "the model's")
    flaps = getattr(agent, "flaps", None)
    if flaps is not None:
        check_flaps(agent.name, flaps, model)


def check_pitch(agent: Agent, moves: bool) -> None:
    """Refuse an agent that pitches the blades where their pitch stays."""
    if getattr(agent, "pitches", False) and not moves:
        raise ValueError(
            f"agent {agent.name}: moves the blades' pitch; take an environment with pitch=True, such as "
            "flapgym/NREL5MWPitch-v0"
        )


def check_flaps(name: str, flaps: int, model: TurbineModel) -> None:
    """Refuse an agent, by its name, that was made for another number of flaps a blade than the model's."""
    expected = len(model.flaps)
    if flaps != expected:
        raise ValueError(
            f"agent {name}: made for {flaps} {'flap' if flaps == 1 else 'flaps'} a blade, the model {model.name} "
            f"has {expected}; tune or train it on this model, or take a model of {flaps}"
        )


def blade_entries(observe: tuple[str, ...], flaps: int) -> int:
    """Entries that a blade of so many flaps has in an observation."""
    return sum(flaps if name in OF_FLAPS else 1 for name in observe)


@cache
def blade_places(observe: tuple[str, ...], flaps: int) -> IntArray:
    """Where each blade's entries stand in an observation, (3, n): an observation goes through its blades in turn."""
    places, first = [], 0
    for name in observe:
        size = blade_entries((name,), flaps)
        places.append(first + np.arange(BLADES * size).reshape(BLADES, size))
        first += BLADES * size
    return np.hstack(places)


@cache
def _scales(observe: tuple[str, ...], flaps: int) -> Array:
    """SI values of the units of a blade's entries, (n,)."""
    return np.repeat(
        [OBSERVATION_SCALES[name] for name in observe], [blade_entries((name,), flaps) for name in observe]
    )


def by_blade(observation: Floats, observe: tuple[str, ...], flaps: int = 1) -> Array:
    """The observation of F flaps a blade in SI units, one row a blade: (..., 3 n) becomes (..., 3, n).

    Raises
    ------
    ValueError
        If the length of the last axis is not that of `observe`.
    """
    values = np.asarray(observation, dtype=float)
    places = blade_places(observe, flaps)
    if values.shape[-1] != places.size:
        raise ValueError(
            f"observation: expected {places.size} entries ({', '.join(observe)} of three blades"
            f"{'' if flaps == 1 else f' with {flaps} flaps each'}), got {values.shape[-1]}; "
            f"make the environment with observe={observe}"
        )
    return np.asarray(values[..., places] * _scales(observe, flaps))
