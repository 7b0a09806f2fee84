"""Millions of plant steps in every registered environment: no NaN, no drift, no memory gained."""

from __future__ import annotations

import resource
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np

from flapgym.envs.registration import ENVIRONMENTS

COUNT, STEPS_PER_ACTION = 64, 10


@dataclass(frozen=True)
class Endurance:
    """What became of an environment.

    Attributes
    ----------
    name : str
    plant_steps : int
        Counted over all turbines.
    finite : bool
        Every observation, reward and quantity of the info.
    drift : float
        Rms of the moments in the last tenth over that in the first.
    megabytes : float
        Memory gained after the first tenth.
    """

    name: str
    plant_steps: int
    finite: bool
    drift: float
    megabytes: float


def endure(plant_steps: int, tell: Callable[[str], None]) -> list[Endurance]:
    """Random actions in every environment, with an episode's end every 20 s, from a pool of realisations."""
    results = []
    for entry in ENVIRONMENTS:
        tell(f"endurance: {entry.id}")
        wind = _pooled(entry.keywords.get("wind", {}))
        spec = gymnasium.spec(entry.id)  # so that no version is called out of date
        env = gymnasium.make_vec(spec, num_envs=COUNT, steps_per_action=STEPS_PER_ACTION, wind=wind)
        env.reset(seed=0)
        rng = np.random.default_rng(0)
        calls = max(10, plant_steps // (COUNT * STEPS_PER_ACTION))
        shape = env.action_space.shape
        finite, squares, begun = True, [], 0.0
        for n in range(calls):
            observation, reward, _, _, info = env.step(rng.uniform(-1.0, 1.0, shape).astype(np.float32))
            finite &= bool(np.isfinite(observation).all() and np.isfinite(reward).all())
            squares.append(float(np.mean(info["rbm"] ** 2)))
            if n == calls // 10:
                begun = _peak()
        env.close()
        tenth = max(1, calls // 10)
        drift = float(np.sqrt(np.mean(squares[-tenth:]) / np.mean(squares[:tenth])))
        steps = calls * COUNT * STEPS_PER_ACTION
        results.append(Endurance(entry.id, steps, finite, drift, _peak() - begun))
    return results


def _pooled(wind: Mapping[str, Any]) -> dict[str, Any]:
    """The wind from a pool, so that time goes into steps; a gust has none."""
    return dict(wind) if "gust" in wind else {**wind, "pool": 64}


def _peak() -> float:
    """Most memory the process ever had [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
