"""A backend of one's own: the turbines shared out among threads, each of which takes numpy's step."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from flapgym.model import load_model
from flapgym.plant import LinearPlant, Start, Stepping
from flapgym.plant.backends import numpy as plain
from flapgym.plant.parameters import Loads, State

TURBINES, THREADS = 64, 2
pool = ThreadPoolExecutor(THREADS)


def step(parameters, episode, state, actions):
    """Hold actions (n, flaps) for an interval: the new state and the loads; nothing given is changed."""

    def part(some):
        azimuth, place, level = (each[some] for each in (episode.azimuth, episode.place, episode.level))
        own = episode._replace(azimuth=azimuth, place=place, level=level)
        begun = State(state.elapsed[some], state.flaps[:, :, some], state.modes[some])
        return plain.step(parameters, own, begun, actions[some])

    states, loads = zip(*pool.map(part, np.array_split(np.arange(len(actions)), THREADS)), strict=True)
    elapsed, flaps, modes = zip(*states, strict=True)
    after = State(np.concatenate(elapsed), np.concatenate(flaps, axis=2), np.concatenate(modes))
    return after, Loads(*(np.concatenate(each) for each in zip(*loads, strict=True)))


model, rng = load_model(), np.random.default_rng(0)
stepping = Stepping(steps_per_action=5, intervals=20, length_scale=model.length_scale)
plants = [LinearPlant(model, TURBINES, stepping, each) for each in (plain.step, step)]
rest, noise = np.zeros((TURBINES, 3)), rng.standard_normal((TURBINES, plants[0].noise_count))
for plant in plants:
    plant.reset(np.arange(TURBINES), Start(np.zeros(TURBINES), rest, rest, np.full(TURBINES, 0.1), noise))
for action in rng.uniform(-1.0, 1.0, (20, TURBINES, 3)):
    one, other = (plant.step(action).last for plant in plants)
print(f"equal to numpy: {np.allclose(one, other, rtol=1e-12, atol=1e-9, equal_nan=True)}")
