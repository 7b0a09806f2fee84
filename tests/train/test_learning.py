"""Both algorithms train, and what they leave runs in numpy as it ran in PyTorch. A few hundred steps only."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flapgym.control import load_agent
from flapgym.control.agent_files import save_agent
from flapgym.model.turbine_model import save_model
from tests.synthetic import synthetic_model
from train.learning import Progress, environment, learn, learner
from train.policies import main
from train.settings import load_training

CONFIGS = Path(__file__).parents[2] / "configs"


def _small(name):
    """The shipped run, cut down to what a smoke test may take."""
    training = load_training(CONFIGS / f"train-{name}.toml")
    cut = {"batch_size": 32} | (
        {"n_steps": 16} if name == "ppo" else {"learning_starts": 30, "buffer_size": 1000}
    )
    return replace(
        training,
        total_timesteps=300,
        environment=replace(training.environment, turbines=2, duration=1.0),
        algorithm=replace(training.algorithm, **cut),
    )


@pytest.mark.parametrize("name", ["ppo", "sac"])
def test_the_agent_acts_as_the_policy_that_was_trained(name, tmp_path):
    model, training = synthetic_model(), _small(name)
    env = environment(training, model)
    algorithm = learner(training, env, seed=0, tensorboard=None)
    algorithm.learn(training.total_timesteps)
    from train.export import exported

    agent = exported(algorithm, training, model)
    save_agent(tmp_path / "agent.json", agent, model, "a test", {})
    agent = load_agent(tmp_path / "agent.json", model)
    rng = np.random.default_rng(0)
    # Two turbines' observations in the environment's units, quantity by quantity.
    observation = rng.normal(size=(2, 9)) * np.repeat([1.0, 0.1, 1.0], 3)
    action, _ = agent.predict(observation.astype(np.float32))
    rows = observation.reshape(2, 3, 3).transpose(0, 2, 1).reshape(6, 3)
    rows = (
        rows * [1e6 / model.rbm_rms, 1 / model.flaps[0].angle_limit, 1 / model.flaps[0].rate_limit]
    ).astype(np.float32)
    expected, _ = algorithm.predict(rows, deterministic=True)
    np.testing.assert_allclose(action.ravel(), expected.ravel(), atol=1e-5)


@pytest.mark.parametrize("name", ["ppo", "sac"])
def test_the_same_seed_trains_the_same_policy(name):
    model, training = synthetic_model(), _small(name)
    first, again, other = (learn(training, model, seed).policy for seed in (1, 1, 2))
    for one, two in zip(first.weights, again.weights, strict=True):
        np.testing.assert_array_equal(one, two)
    assert not np.array_equal(first.weights[0], other.weights[0])


def test_an_interrupted_run_keeps_what_it_learnt(monkeypatch):
    def interrupt(self):
        if self.num_timesteps > 100:
            raise KeyboardInterrupt
        return True

    monkeypatch.setattr(Progress, "_on_step", interrupt)
    outcome = learn(_small("ppo"), synthetic_model(), seed=0)
    assert outcome.record["interrupted"]
    assert 100 < outcome.record["steps"] < 300
    assert outcome.policy.weights[0].shape == (64, 3)


def test_the_program_writes_an_agent_for_each_seed(tmp_path):
    save_model(synthetic_model(), tmp_path / "model.safetensors")
    text = (CONFIGS / "train-ppo.toml").read_text(encoding="utf-8")
    text = text.replace('"nrel5mw-corrected"', f'"{tmp_path / "model.safetensors"}"')
    text = text.replace("turbines = 64", "turbines = 2").replace("n_steps = 64", "n_steps = 8")
    text = text.replace("batch_size = 2048", "batch_size = 48")
    (tmp_path / "run.toml").write_text(text, encoding="utf-8")
    assert main([str(tmp_path / "run.toml"), "--output", str(tmp_path), "--seeds", "2", "--steps", "96"]) == 0
    for seed in (0, 1):
        agent = load_agent(tmp_path / f"ppo-seed{seed}.json", synthetic_model())
        assert (
            agent.steps_per_action == load_training(CONFIGS / "train-ppo.toml").environment.steps_per_action
        )
        assert agent.model_hash == synthetic_model().hash
