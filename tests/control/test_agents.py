"""Agents as the evaluation uses them: batches, episode starts, files, and refusals that name the fault."""

from dataclasses import replace

import numpy as np
import pytest

from flapgym.control import (
    OpenLoop,
    PDGains,
    Policy,
    Weights,
    load_agent,
    lqg_agent,
    made_for,
    pd_agent,
    save_agent,
)
from tests.synthetic import synthetic_model

MODEL = synthetic_model()


def _lqg():
    return lqg_agent("lqg", MODEL, Weights(rbm=3.0))


def _policy(per_blade=True, squash="clip", activation="tanh"):
    rng = np.random.default_rng(0)
    size, actions = (3, 1) if per_blade else (9, 3)
    return Policy(
        name="ppo",
        observe=("rbm", "flap_angle", "flap_rate"),
        steps_per_action=5,
        per_blade=per_blade,
        offset=rng.standard_normal(size),
        scale=rng.uniform(0.5, 2.0, size),
        weights=(rng.standard_normal((8, size)), rng.standard_normal((actions, 8))),
        biases=(rng.standard_normal(8), rng.standard_normal(actions)),
        activation=activation,
        squash=squash,
        model_hash=MODEL.hash,
    )


def _observations(steps, batch=()):
    rng = np.random.default_rng(1)
    return (rng.standard_normal((steps, *batch, 9)) * np.repeat([1.0, 0.05, 0.1], 3)).astype(np.float32)


@pytest.mark.parametrize(
    "agent", [OpenLoop(), _lqg(), _policy(), _policy(per_blade=False)], ids=lambda a: a.name
)
def test_a_batch_gives_what_each_entry_gives_alone(agent):
    observations = _observations(6, (4,))
    if agent.observe == ("flap_angle",):
        observations = observations[..., :3]
    state, alone = None, [None] * 4
    for observation in observations:
        action, state = agent.predict(observation, state)
        assert action.shape == (4, 3)
        assert action.dtype == np.float32
        for entry in range(4):
            single, alone[entry] = agent.predict(observation[entry], alone[entry])
            np.testing.assert_allclose(action[entry], single, atol=1e-6)


def test_an_episode_start_forgets_the_past_of_that_entry_only():
    agent = _lqg()
    first, second, third = _observations(3, (2,))
    _, state = agent.predict(first)
    _, state = agent.predict(second, state)
    action, _ = agent.predict(third, state, episode_start=np.array([True, False]))
    fresh, _ = agent.predict(third)
    kept, _ = agent.predict(third, state)
    np.testing.assert_array_equal(action[0], fresh[0])
    np.testing.assert_array_equal(action[1], kept[1])
    assert not np.array_equal(fresh[0], kept[0])


def test_the_controller_runtime_equals_its_state_space():
    agent = _lqg()
    observations = _observations(50)
    blade = observations.reshape(50, 3, 3)[:, :, 1].astype(float) * [1e6, 1.0, 1.0]
    series = agent.system.simulate(blade, agent.start @ blade[0])
    expected = np.clip(series[:, 0] / agent.acceleration_limits[0], -1.0, 1.0)
    state, found = None, []
    for observation in observations:
        action, state = agent.predict(observation, state)
        found.append(action[1])
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_a_slope_is_not_read_into_the_first_sample_of_an_episode():
    agent = pd_agent("pd", MODEL, PDGains(3e-8, 5.0, 0.05, 3.0, 0.8))
    still = np.concatenate([[1.0, -0.5, 0.2], np.zeros(6)])
    action, _ = agent.predict(still)
    np.testing.assert_allclose(
        action * MODEL.flaps[0].acceleration_limit, -(3.0**2) * 3e-2 * still[:3], rtol=1e-5
    )


def test_a_shared_policy_treats_blades_alike():
    observation = _observations(1)[0]
    rolled = np.roll(observation.reshape(3, 3), 1, axis=1).ravel()
    action, _ = _policy().predict(observation)
    moved, _ = _policy().predict(rolled)
    np.testing.assert_allclose(moved, np.roll(action, 1), atol=1e-7)


@pytest.mark.parametrize("squash", ["clip", "tanh"])
@pytest.mark.parametrize("activation", ["tanh", "relu"])
def test_a_policy_equals_the_same_network_in_torch(squash, activation):
    torch = pytest.importorskip("torch")
    policy = _policy(per_blade=False, squash=squash, activation=activation)
    observations = _observations(20)
    hidden = torch.as_tensor((observations.astype(float) - policy.offset) * policy.scale)
    middle = torch.tanh if activation == "tanh" else torch.relu
    hidden = middle(
        torch.nn.functional.linear(hidden, *map(torch.as_tensor, (policy.weights[0], policy.biases[0])))
    )
    out = torch.nn.functional.linear(hidden, *map(torch.as_tensor, (policy.weights[1], policy.biases[1])))
    expected = torch.tanh(out) if squash == "tanh" else out.clamp(-1.0, 1.0)
    np.testing.assert_allclose(policy.predict(observations)[0], expected.numpy(), atol=1e-6)


def test_the_pd_servo_settles_at_the_demanded_angle():
    gains = PDGains(3e-7, 0.1, 0.05, 9.0, 0.8)
    agent = pd_agent("pd", MODEL, gains)
    angle, rate, state, dt = np.zeros(3), np.zeros(3), None, MODEL.time_step
    for _ in range(1000):
        observation = np.concatenate([[0.2, 0.0, -0.2], angle, rate])
        action, state = agent.predict(observation, state)
        acceleration = action * agent.acceleration_limits[0]
        angle, rate = angle + dt * rate + 0.5 * dt**2 * acceleration, rate + dt * acceleration
    np.testing.assert_allclose(angle, [-0.06, 0.0, 0.06], atol=1e-5)


@pytest.mark.parametrize("agent", [_lqg(), _policy(squash="tanh")], ids=lambda a: a.name)
def test_an_agent_survives_its_file(agent, tmp_path):
    path = tmp_path / "agent.json"
    save_agent(path, agent, MODEL, "A test.", {"seed": 1})
    loaded = load_agent(path, MODEL)
    observation = _observations(1, (2,))[0]
    np.testing.assert_array_equal(loaded.predict(observation)[0], agent.predict(observation)[0])
    assert (loaded.name, loaded.steps_per_action) == (agent.name, agent.steps_per_action)
    assert made_for(loaded, MODEL)
    assert not made_for(loaded, replace(MODEL, turbine=replace(MODEL.turbine, A=0.5 * MODEL.turbine.A)))


def test_open_loop_fits_every_model():
    assert made_for(
        load_agent("open_loop", MODEL),
        replace(MODEL, turbine=replace(MODEL.turbine, A=0.5 * MODEL.turbine.A)),
    )


def test_an_unknown_agent_is_refused_with_the_known_ones():
    with pytest.raises(ValueError, match=r"agent lqr: unknown; expected one of open_loop, pd, pid, "):
        load_agent("lqr", MODEL)
    with pytest.raises(ValueError, match="no such file"):
        load_agent("nowhere.json", MODEL)


def test_an_agent_that_no_file_holds_is_refused_by_its_kind(tmp_path):
    with pytest.raises(TypeError, match="got OpenLoop; any other agent is handed to .*compare"):
        save_agent(tmp_path / "mine.json", OpenLoop(), MODEL, "A test.", {})


def test_an_observation_of_the_wrong_size_is_refused():
    with pytest.raises(ValueError, match="agent lqg: observation: expected 9"):
        _lqg().predict(np.zeros(3, dtype=np.float32))
    with pytest.raises(ValueError, match="expected 9"):
        _policy().predict(np.zeros(3, dtype=np.float32))


def test_a_policy_whose_layers_do_not_fit_is_refused():
    with pytest.raises(ValueError, match="expected a layer of"):
        replace(_policy(), weights=_policy().weights[::-1])
    with pytest.raises(ValueError, match="activation"):
        replace(_policy(), activation="elu")
