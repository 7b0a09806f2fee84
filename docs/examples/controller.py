"""A controller of one's own: each flap leans against the moment of its blade, and is scored beside the shipped LQG."""

import numpy as np

from flapgym.evaluation import as_text, compare


class Leaning:
    """A target angle against the blade's moment, and a spring and a damper that bring the flap there."""

    name = "leaning"  # what the table calls it
    observe = ("rbm", "flap_angle", "flap_rate")  # in MN m, rad and rad/s, each of blades 1 to 3
    steps_per_action = 5  # plant steps for which an action is held
    model_hash = None  # fits any model; else the hash of the one it was made for

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        """Action (..., 3) within -1 and 1, and what to be handed as `state` next time."""
        moment, angle, rate = np.split(np.asarray(observation), 3, axis=-1)
        target = -0.05 * moment  # a positive angle gives more lift, so the sign is against the moment
        action = 10.0 * (target - angle) - 2.0 * rate
        return np.clip(action, -1.0, 1.0).astype(np.float32), None


comparison = compare([Leaning(), "lqg"], realisations=1, duration=60.0)
print(as_text(comparison))
