"""Train PPO of Stable-Baselines3, one policy shared by all blades of 64 turbines, and compare it with doing nothing.

In any folder:

    pip install "flapgym[train]"
    python sb3_ppo.py 3000000        # actions of single blades: 40 s of one core, reward from -1.11 to -0.38
"""

import sys

import gymnasium
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecMonitor

import flapgym  # registers the environments
from flapgym.adapters.sb3 import FlapVecEnv


def environment(turbines: int, seed: int) -> VecMonitor:
    """Turbines side by side, each blade an environment of its own that sees its moment, flap angle and flap rate."""
    vector = gymnasium.make_vec(
        "flapgym/NREL5MW-v1",
        num_envs=turbines,
        task={"observe": ("rbm", "flap_angle", "flap_rate")},
        duration=40.0,
        autoreset_mode="SameStep",
    )
    env = VecMonitor(FlapVecEnv(vector.unwrapped, per_blade=True))
    env.seed(seed)
    return env


def mean_reward(env: VecMonitor, policy: PPO | None, steps: int) -> float:
    """Reward an action over all blades; without a policy the flaps rest. About -1 means no load taken off."""
    observation, rewards = env.reset(), []
    for _ in range(steps):
        action = np.zeros((env.num_envs, 1), dtype=np.float32)
        if policy is not None:
            action, _ = policy.predict(observation, deterministic=True)
        observation, reward, _, _ = env.step(action)
        rewards.append(reward.mean())
    return float(np.mean(rewards))


def main(budget: int) -> None:
    """Train for a number of single blades' actions, then score on wind that was not trained on."""
    torch.set_num_threads(1)  # the network is too small for more
    turbines = 64 if budget > 100_000 else 4
    policy = PPO(
        "MlpPolicy",
        environment(turbines, seed=0),
        learning_rate=lambda left: 5e-4 * left,
        n_steps=64,
        batch_size=2048 if turbines == 64 else 64,
        n_epochs=5,
        gamma=0.99,
        policy_kwargs={"net_arch": [64, 64], "log_std_init": -0.5},
        seed=0,
        device="cpu",
    )
    policy.learn(budget)
    policy.save("ppo_flaps.zip")
    steps = 1000 if budget > 100_000 else 50
    resting, trained = (mean_reward(environment(16, 1000), each, steps) for each in (None, policy))
    print(
        f"flapgym {flapgym.__version__}: reward an action, flaps at rest {resting:.3f}, trained {trained:.3f}"
    )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 3_000_000)
