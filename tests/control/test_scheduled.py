"""Agents by wind speed: each turbine's is chosen as its episode begins, and keeps its own memory."""

import numpy as np
import pytest

from flapgym.control.scheduled import ScheduledAgent


class Counting:
    """Answers its own number, and remembers how often it was asked."""

    observe, steps_per_action, model_hash = ("rbm",), 5, None

    def __init__(self, number, name="counting", steps_per_action=5):
        self.number, self.name, self.steps_per_action = number, name, steps_per_action

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        rows = len(observation)
        before = (
            np.zeros((rows, 1)) if state is None else np.where(np.reshape(episode_start, (-1, 1)), 0.0, state)
        )
        action = np.tile([self.number, before[0, 0], 0.0], (rows, 1)).astype(np.float32)
        action[:, 1] = before[:, 0]
        return action, before + 1.0


AGENT = ScheduledAgent("both", (7.0, 11.0), (Counting(0.7), Counting(0.1)))


def observed(*winds):
    return np.column_stack([np.zeros((len(winds), 3)), winds])


def test_each_turbine_takes_the_agent_of_the_nearest_wind_speed():
    actions, _ = AGENT.predict(observed(5.0, 8.9, 9.1, 20.0))
    np.testing.assert_allclose(actions[:, 0], [0.7, 0.7, 0.1, 0.1])


def test_the_choice_stays_for_the_episode_and_is_made_anew_for_the_next():
    _, state = AGENT.predict(observed(7.0, 7.0))
    actions, state = AGENT.predict(observed(11.0, 11.0), state, np.array([False, True]))
    np.testing.assert_allclose(actions[:, 0], [0.7, 0.1])
    np.testing.assert_allclose(actions[:, 1], [1.0, 0.0])  # the second turbine's agent has forgotten
    actions, _ = AGENT.predict(observed(11.0, 7.0), state, np.array([False, False]))
    np.testing.assert_allclose(actions[:, :2], [[0.7, 2.0], [0.1, 1.0]])


def test_one_turbine_needs_no_batch():
    action, state = AGENT.predict(observed(11.0)[0])
    assert action.shape == (3,)
    action, _ = AGENT.predict(observed(7.0)[0], state, np.array(False))
    np.testing.assert_allclose(action[:2], [0.1, 1.0])


def test_it_observes_the_wind_speed_behind_what_its_agents_do():
    assert AGENT.observe == ("rbm", "wind_speed")
    assert AGENT.at(8.0) is AGENT.agents[0]


@pytest.mark.parametrize(
    "speeds, agents, said",
    [
        ((7.0,), (), "^scheduled.agents: expected one for each of 1 wind speeds"),
        ((9.0, 7.0), (Counting(0), Counting(1)), "^scheduled.wind_speeds: expected them ascending"),
        (
            (7.0, 9.0),
            (Counting(0), Counting(1, steps_per_action=3)),
            "^scheduled.agents: expected the same steps",
        ),
    ],
)
def test_agents_that_do_not_go_together_are_refused(speeds, agents, said):
    with pytest.raises(ValueError, match=said):
        ScheduledAgent("none", speeds, agents)
