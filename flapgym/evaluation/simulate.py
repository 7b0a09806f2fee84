"""Run an agent through the environment and keep every plant sample."""

from __future__ import annotations

from collections.abc import Callable, Sequence, Set
from typing import Any

import numpy as np

from flapgym.control import Agent, OpenLoop
from flapgym.control.agent import check_time_step
from flapgym.core.fields import Quantity
from flapgym.core.wording import shown
from flapgym.envs import FlapVectorEnv
from flapgym.evaluation.metrics import Record
from flapgym.model.turbine_model import TurbineModel

BATCH = 10
"""Realisations run side by side: more of them would hold gigabytes of samples."""

_SAMPLES = ("rbm", "tip_deflection", "flap_angle", "flap_rate", "tower_fore_aft", "tower_side_side", "wind")


def simulate(
    agent: Agent,
    model: TurbineModel,
    seeds: Sequence[int],
    duration: float,
    advanced: Callable[[int], Any] = lambda samples: None,
    **settings: Any,
) -> Record:
    """The record of `agent` on one realisation per seed, from a calm flap.

    Parameters
    ----------
    agent : Agent
        What acts; its own `observe` and `steps_per_action` make the environment.
    model : TurbineModel
        The turbine.
    seeds : sequence of int
        Seeds of the realisations; agents given the same seeds meet the same wind and azimuth.
    duration : float
        Length of each [s]; the record keeps round(duration / dt) samples.
    advanced : callable
        Told the samples each step adds to the record, for a progress bar.
    **settings
        Further keywords of the environment, as `sensors`; turbulence is the model's own unless given.
    """
    if isinstance(seeds, Set) or not len(seeds):
        raise ValueError(f"simulate.seeds: expected a list of one or more, got {shown(seeds)}")
    Quantity("time", above=0.0).check(duration, "simulate.duration")
    check_time_step(agent, model.time_step)
    environment = FlapVectorEnv(
        num_envs=len(seeds),
        model=model,
        task={"observe": agent.observe},
        steps_per_action=agent.steps_per_action,
        # Whole intervals that cover the duration: agents of other intervals must not end early.
        duration=duration + agent.steps_per_action * model.time_step,
        record_samples=True,
        **settings,
    )
    kept = round(duration / model.time_step)
    pieces: dict[str, list[np.ndarray]] = {name: [] for name in _SAMPLES}
    observation, first = environment.reset(seed=list(seeds))
    # Predictive controllers may be given the wind before it comes, as a lidar would.
    preview = getattr(agent, "preview", 0)
    coming = coming_wind(model, seeds, kept + preview, **settings) if preview else None
    state, start, done = None, np.ones(len(seeds), dtype=bool), 0
    while done < kept:
        if coming is not None:
            observation = np.hstack([observation, coming[:, done : done + preview]])
        with np.errstate(over="ignore", invalid="ignore"):  # an unstable controller grows without end
            action, state = agent.predict(observation, state, start)
        if not np.isfinite(action).all():
            raise ValueError(
                f"agent {agent.name}: gave an action that is not finite after {done * model.time_step:.2f} s; "
                "its own state or its layers overflow"
            )
        observation, _, terminated, truncated, info = environment.step(action)
        for name in _SAMPLES:
            pieces[name].append(info["samples"][name])
        start = terminated | truncated
        advanced(min(agent.steps_per_action, kept - done))
        done += agent.steps_per_action
        if start.any() and done < kept:
            raise RuntimeError(f"agent {agent.name}: the episode ended after {done} of {kept} samples")
    environment.close()
    series = {name: np.concatenate(parts, axis=1)[:, :kept] for name, parts in pieces.items()}
    return Record(**series, azimuth=first["azimuth"], time_step=model.time_step)


def coming_wind(model: TurbineModel, seeds: Sequence[int], samples: int, **settings: Any) -> np.ndarray:
    """Wind perturbation of each realisation at samples 1 to so many, (N, samples) [m/s]; no agent changes it."""
    return simulate(OpenLoop(), model, seeds, samples * model.time_step, **settings).wind
