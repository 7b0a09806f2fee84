"""The Agent protocol every controller and policy follows, and the observation it reads.

`predict` has the signature of Stable-Baselines3's policies, so the evaluation treats open loop, PD, LQG and a trained
policy alike. Observations and states carry any leading batch axes.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from flapgym.core.arrays import BLADES, Array
from flapgym.core.state_space import require_time_step

OBSERVATION_SCALES: dict[str, float] = {"rbm": 1e6, "flap_angle": 1.0, "flap_rate": 1.0}
"""SI value of one unit of the environment's observation: MN m, rad, rad/s. Each has one entry per blade."""

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
    made for plants of that step and is refused by any other.
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
        """Action (..., 3) in [-1, 1] for an observation (..., n), and the state to hand back next time.

        State None, or `episode_start` true (one per batch entry), begins afresh.
        """
        ...


class OpenLoop:
    """Flaps at rest: the reference of every comparison."""

    name = "open_loop"
    observe: tuple[str, ...] = ("rbm",)
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
        return np.zeros((*np.shape(observation)[:-1], BLADES), dtype=np.float32), None


def check_time_step(agent: Agent, time_step: float) -> None:
    """Refuse an agent that was made for another time step [s] than the model's."""
    own = getattr(agent, "time_step", None)
    if own is not None:
        require_time_step(f"agent {agent.name}: time_step", own, time_step, "the model's")


def by_blade(observation: Floats, observe: tuple[str, ...]) -> Array:
    """The observation in SI units, one row a blade: (..., 3 n) becomes (..., 3, n).

    Raises
    ------
    ValueError
        If the length of the last axis is not that of `observe`.
    """
    values = np.asarray(observation, dtype=float)
    expected = BLADES * len(observe)
    if values.shape[-1] != expected:
        raise ValueError(
            f"observation: expected {expected} entries ({', '.join(observe)} of three blades), "
            f"got {values.shape[-1]}; make the environment with observe={observe}"
        )
    scales = np.array([OBSERVATION_SCALES[name] for name in observe])
    split = values.reshape(*values.shape[:-1], len(observe), BLADES)
    return np.swapaxes(split, -1, -2) * scales
