"""PPO in one file of plain PyTorch over the vector environment: the whole turbine, nine observations, three flaps.

In any folder:

    pip install flapgym torch
    python cleanrl_ppo.py 2000000    # actions of turbines: 40 s of one core, reward from -1.11 to -0.56
"""

import sys

import gymnasium
import numpy as np
import torch
from torch import nn

import flapgym  # registers the environments

ROLLOUT, EPOCHS, BATCHES = 64, 5, 4
DISCOUNT, TRACE, CLIP, RATE = 0.99, 0.95, 0.2, 5e-4


def turbines(count: int) -> gymnasium.vector.VectorEnv:
    """Turbines side by side; an episode's end and the next one's beginning fall into one step."""
    return gymnasium.make_vec(
        "flapgym/NREL5MW-v1",
        num_envs=count,
        task={"observe": ("rbm", "flap_angle", "flap_rate")},
        duration=40.0,
        autoreset_mode="SameStep",
    )


def network(outputs: int) -> nn.Sequential:
    """Two hidden layers."""
    return nn.Sequential(nn.Linear(9, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, outputs))


class Agent(nn.Module):
    """Gaussian policy and value; moments are of order 1 MN m, flap motions are scaled by their stops."""

    def __init__(self, space: gymnasium.spaces.Box) -> None:
        super().__init__()
        bound = torch.as_tensor(space.high)
        self.register_buffer("scale", torch.where(bound > 10.0, torch.ones(9), 1.0 / bound))
        self.mean, self.value = network(3), network(1)
        self.log_std = nn.Parameter(torch.full((3,), -0.5))
        with torch.no_grad():
            self.mean[-1].weight *= 0.01

    def policy(self, observation: torch.Tensor) -> torch.distributions.Normal:
        """Distribution of the action."""
        return torch.distributions.Normal(self.mean(observation * self.scale), self.log_std.exp())

    def worth(self, observation: torch.Tensor) -> torch.Tensor:
        """Value of observations."""
        return self.value(observation * self.scale)[..., 0]


def update(agent: Agent, optimiser: torch.optim.Optimizer, data: list[torch.Tensor]) -> None:
    """Some epochs over one rollout: observations, actions, log probabilities, advantages, returns."""
    size = len(data[0])
    for _ in range(EPOCHS):
        for chosen in torch.randperm(size).chunk(BATCHES):
            seen, action, log_before, advantage, goal = (part[chosen] for part in data)
            advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
            ratio = (agent.policy(seen).log_prob(action).sum(-1) - log_before).exp()
            gain = torch.minimum(ratio * advantage, ratio.clamp(1 - CLIP, 1 + CLIP) * advantage)
            loss = 0.5 * (agent.worth(seen) - goal).square().mean() - gain.mean()
            optimiser.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(agent.parameters(), 0.5)
            optimiser.step()


def train(budget: int, count: int) -> Agent:
    """Train for a number of turbines' actions."""
    env = turbines(count)
    agent = Agent(env.single_observation_space)
    optimiser = torch.optim.Adam(agent.parameters(), lr=RATE, eps=1e-5)
    seen = torch.as_tensor(env.reset(seed=0)[0])
    updates = max(1, budget // (ROLLOUT * count))
    for done in range(updates):
        optimiser.param_groups[0]["lr"] = RATE * (1.0 - done / updates)
        steps = []
        for _ in range(ROLLOUT):
            with torch.no_grad():
                distribution = agent.policy(seen)
                action = distribution.sample()
                following, reward, terminated, truncated, info = env.step(action.numpy())
                following, after = torch.as_tensor(following), torch.as_tensor(following).clone()
                ended = torch.as_tensor(terminated | truncated)
                for index in np.flatnonzero(
                    ended
                ):  # value what the episode ended on, not how the next begins
                    after[index] = torch.as_tensor(info["final_obs"][index])
                goes_on = torch.as_tensor(~terminated).float()
                error = (
                    torch.as_tensor(reward).float()
                    + DISCOUNT * goes_on * agent.worth(after)
                    - agent.worth(seen)
                )
                steps.append((seen, action, distribution.log_prob(action).sum(-1), error, ended))
            seen = following
        advantage, advantages = torch.zeros(count), []
        for *_, error, ended in reversed(steps):
            advantage = error + DISCOUNT * TRACE * (~ended).float() * advantage
            advantages.append(advantage)
        seen_all, actions, logs, _, _ = (torch.stack(part) for part in zip(*steps, strict=True))
        gained = torch.stack(advantages[::-1])
        with torch.no_grad():
            goals = gained + agent.worth(seen_all)
        update(agent, optimiser, [part.flatten(0, 1) for part in (seen_all, actions, logs, gained, goals)])
    return agent


def mean_reward(agent: Agent | None, steps: int) -> float:
    """Reward an action on wind not trained on; without an agent the flaps rest. About -1 means no load taken off."""
    env, rewards = turbines(16), []
    observation, _ = env.reset(seed=1000)
    for _ in range(steps):
        action = np.zeros((16, 3), dtype=np.float32)
        if agent is not None:
            with torch.no_grad():
                action = agent.policy(torch.as_tensor(observation)).mean.numpy()
        observation, reward, *_ = env.step(action)
        rewards.append(reward.mean())
    return float(np.mean(rewards))


def main(budget: int) -> None:
    """Train and score."""
    torch.manual_seed(0)
    torch.set_num_threads(1)
    small = budget < 100_000
    agent = train(budget, 4 if small else 128)
    resting, trained = (mean_reward(each, 50 if small else 1000) for each in (None, agent))
    print(
        f"flapgym {flapgym.__version__}: reward an action, flaps at rest {resting:.3f}, trained {trained:.3f}"
    )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 2_000_000)
