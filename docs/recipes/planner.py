"""Random shooting: a planner that tries target angles on a copy of the turbine before it moves the flaps.

In any folder:

    pip install flapgym
    python planner.py 500            # actions: 17 s of one core, reward from -1.03 to -0.18

The copy carries the state of the turbine and meets the same wind, so this planner knows what is coming. No controller
does: read its score as what foresight is worth, not as a rival's.
"""

import sys

import gymnasium
import numpy as np

import flapgym  # registers the environments
from flapgym.wrappers.single import TargetAngle

HORIZON, CANDIDATES = 15, 40


def turbine() -> gymnasium.Env:
    """The turbine whose actions are target angles; few realisations, because a copy is quick to set in a known one."""
    return TargetAngle(gymnasium.make("flapgym/NREL5MW-v1", duration=40.0, wind={"pool": 4}))


def plan(state: dict, copy: gymnasium.Env, last: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The best of some random targets for the three flaps, each held over the horizon on the copy."""
    trials = np.clip(last + 0.3 * rng.standard_normal((CANDIDATES, 3)), -1.0, 1.0)
    trials[0] = last
    scores = []
    for target in trials:
        copy.set_state(state)
        scores.append(sum(copy.step(target)[1] for _ in range(HORIZON)))
    return trials[int(np.argmax(scores))]


def main(actions: int) -> None:
    """Score the planner and flaps at rest on the same wind."""
    env, copy, resting = turbine(), turbine(), turbine()
    for each in (env, copy, resting):
        each.reset(seed=0)
    rng, target, rewards = np.random.default_rng(0), np.zeros(3), []
    for _ in range(actions):
        target = plan(env.get_state(), copy, target, rng)
        rewards.append((resting.step(np.zeros(3))[1], env.step(target)[1]))
    rest, planned = np.mean(rewards, axis=0)
    print(f"flapgym {flapgym.__version__}: reward an action, flaps at rest {rest:.3f}, planned {planned:.3f}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 500)
