"""Agents side by side do what each does alone, in one environment and in one product."""

from dataclasses import replace

import numpy as np
import pytest

from flapgym.control import (
    OpenLoop,
    PDGains,
    PIDGains,
    Weights,
    load_agent,
    lqg_agent,
    multiblade_pid_agent,
    pd_agent,
)
from flapgym.control.policy import Policy
from flapgym.evaluation import simulate, simulate_together
from flapgym.evaluation.bank import LinearBank, same_kind
from flapgym.model import load_model
from tests.synthetic import synthetic_model

MODEL = synthetic_model()
PID = PIDGains(6e-8, 0.1, 0.1, 12.0, 0.8, 1.0, 2.0)
PD = pd_agent("pd", MODEL, PDGains(5e-8, 0.1, 0.1, 9.0, 0.8))
LQG = lqg_agent("lqg", MODEL, Weights(0.5))
TURNED = multiblade_pid_agent("individual", MODEL, PID, PID)
POLICY = Policy(
    name="policy",
    observe=("flap_angle", "rbm", "flap_rate"),
    steps_per_action=7,
    per_blade=True,
    offset=np.zeros(3),
    scale=np.ones(3),
    weights=(np.array([[-2.0, -0.1, -1.0]]),),
    biases=(np.zeros(1),),
    activation="tanh",
    squash="clip",
)
SIGNALS = ("rbm", "tip_deflection", "flap_angle", "flap_rate", "tower_fore_aft", "tower_side_side", "wind")


@pytest.mark.parametrize("settings", [{}, {"sensors": {"noise": 1e5, "delay": 0.014}}])
def test_records_are_those_of_each_agent_alone(settings):
    agents = [TURNED, OpenLoop(), PD, POLICY, LQG, replace(PD, name="again")]
    together = simulate_together(agents, MODEL, [5, 9], 4.0, **settings)
    for agent, record in zip(agents, together, strict=True):
        alone = simulate(agent, MODEL, [5, 9], 4.0, **settings)
        for name in SIGNALS:
            ours, theirs = getattr(record, name), getattr(alone, name)
            np.testing.assert_allclose(ours, theirs, atol=1e-9 * np.abs(theirs).max(), err_msg=agent.name)
        np.testing.assert_array_equal(record.azimuth, alone.azimuth)


@pytest.mark.parametrize("agents", [(PD, LQG), (TURNED,)], ids=["blades", "rotor"])
def test_a_bank_acts_as_its_agents_do_by_themselves(agents):
    rng, bank, states = np.random.default_rng(0), LinearBank(agents), [None] * len(agents)
    for _ in range(20):
        seen = (0.05 * rng.standard_normal((len(agents), 4, 9))).astype(np.float32)
        if agents[0] is TURNED:
            angle = rng.uniform(0.0, 6.0, (len(agents), 4))
            turned = np.stack([np.cos(angle), np.sin(angle)], axis=-1).astype(np.float32)
            seen = np.concatenate([seen, turned], axis=-1)
        together = bank.act(seen.reshape(len(agents) * 4, -1)).reshape(len(agents), 4, 3)
        for index, agent in enumerate(agents):
            action, states[index] = agent.predict(seen[index], states[index])
            np.testing.assert_allclose(together[index], action, rtol=1e-6, atol=1e-7)


def test_only_the_linear_controllers_themselves_are_banked():
    assert same_kind(PD) == same_kind(LQG) != same_kind(TURNED)
    assert same_kind(POLICY) is same_kind(OpenLoop()) is None


class _Lost(OpenLoop):
    name = "lost"

    def predict(self, observation, *_):
        return np.full((len(observation), 3), np.nan, dtype=np.float32), None


def test_an_agent_whose_action_is_not_finite_is_named_among_others():
    with pytest.raises(ValueError, match=r"agent lost: gave an action that is not finite after 0\.00 s"):
        simulate_together([OpenLoop(), _Lost()], MODEL, [1, 2], 2.0)


@pytest.mark.parametrize("more", [-1.0, -0.5, 0.0, 0.5, 1.0])
def test_agents_of_other_intervals_meet_one_field_at_whatever_length(more):
    """Also where a field of one length ends and that of another begins, for which one step decides."""
    model = load_model("nrel5mw-site")
    settings = {"wind": {"field": {"kind": "von_karman"}}}
    lqg, slow = load_agent("lqg", model), replace(load_agent("ppo", model), steps_per_action=7)
    # 41.93 s for this field: von Karman's, at the model's scale and wind.
    duration = 41.93 + 7.0 * (more - 1.0) * model.time_step
    first, second = simulate_together([lqg, slow], model, [0], duration, **settings)
    np.testing.assert_array_equal(first.wind, second.wind)
