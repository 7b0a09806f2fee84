"""A controller of one's own, with a memory: each flap leans against the smoothed moment of its blade."""

import numpy as np

from flapgym.evaluation import as_text, compare
from flapgym.model import load_model


class Leaning:
    """A target angle against the blade's moment behind a low-pass; a spring and a damper bring the flap there."""

    name = "leaning"  # what the table calls it
    observe = ("rbm", "flap_angle", "flap_rate")  # in MN m, rad and rad/s, each of blades 1 to 3
    steps_per_action = 5  # plant steps, of model.time_step seconds each, for which an action is held
    model_hash = None  # fits any model; else the hash of the one it was made for

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        """Action (..., 3), fractions of the acceleration limit, and what comes back as `state` (..., 3)."""
        moment, angle, rate = np.split(np.asarray(observation, dtype=float), 3, axis=-1)
        begins = True if state is None or episode_start is None else np.asarray(episode_start)[..., None]
        before = moment if state is None else np.where(begins, moment, state)
        smooth = before + 0.3 * (moment - before)
        target = -0.05 * smooth  # a positive angle gives more lift, so the sign is against the moment
        return np.clip(10.0 * (target - angle) - 2.0 * rate, -1.0, 1.0).astype(np.float32), smooth


comparison = compare([Leaning(), "lqg"], load_model(), realisations=1, duration=60.0)
print(as_text(comparison))
