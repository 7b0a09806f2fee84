"""A wrapper of one's own: one action moves the flaps of all three blades together."""

import gymnasium
import numpy as np

import flapgym  # registers the environments


class Together(gymnasium.ActionWrapper):
    """The action is one acceleration, -1 to 1, for every flap."""

    def __init__(self, env):
        super().__init__(env)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,), dtype=np.float32)

    def action(self, action):
        """The same action for each flap of the environment behind."""
        return np.repeat(action, self.env.action_space.shape[0])


env = Together(gymnasium.make("flapgym/NREL5MW-v1", full_info=True))
env.reset(seed=1)
for _ in range(10):
    observation, reward, terminated, truncated, info = env.step(np.array([0.1], dtype=np.float32))
print(f"flapgym {flapgym.__version__}: angles [rad] {info['flap_angle']}")
