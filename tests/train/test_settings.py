"""Training runs are read strictly: every mistake is refused by its name, before PyTorch is loaded."""

from __future__ import annotations

import tomllib
from dataclasses import fields
from inspect import signature
from pathlib import Path

import pytest

from flapgym.core.fields import to_plain
from train.policies import main
from train.settings import RENAMED, EntropyCoefficient, PPOSettings, SACSettings, load_training

CONFIGS = Path(__file__).parents[2] / "configs"


@pytest.mark.parametrize("name", ["ppo", "sac"])
def test_the_shipped_runs_are_read_as_they_stand(name):
    path = CONFIGS / f"train-{name}.toml"
    training = load_training(path)
    table = tomllib.loads(path.read_text(encoding="utf-8"))
    assert training.name == name
    assert training.total_timesteps == table["total_timesteps"]
    assert to_plain(training.algorithm) == table[name]
    assert training.environment.observe == tuple(table["environment"]["observe"])


@pytest.mark.parametrize(
    "old, new, message",
    [
        ("batch_size", "batchsize", "ppo.batchsize: unknown key; did you mean 'batch_size'"),
        ("gamma = 0.99", "gamma = 1.5", "ppo.gamma: expected 0 < number < 1, got 1.5"),
        ('duration = "40 s"', 'duration = "40 m"', "environment.duration"),
        ('"flap_rate"]', '"azimuth"]', r"environment.observe\[2\]"),
        ("net_arch = [64, 64]", "net_arch = []", "policy_kwargs.net_arch"),
        ('activation_fn = "relu"', 'activation_fn = "gelu"', "policy_kwargs.activation_fn"),
        ("turbines = 64", "turbines = 0.5", "environment.turbines"),
        ('algorithm = "ppo"', 'algorithm = "dqn"', "algorithm: expected 'ppo' or 'sac'"),
        ("[ppo]", "[sac]", "unknown key"),
        ('"flap_rate"]', '"rbm"]', "environment.observe: expected each value once"),
        ("total_timesteps", "total timesteps", "not valid TOML"),
        ("total_timesteps", "total_steps", "^total_steps: now total_timesteps"),
        ("gamma", "discount", "^ppo.discount: now ppo.gamma, as in Stable-Baselines3; rename it"),
        ("n_steps", "rollout", "^ppo.rollout: now ppo.n_steps,"),
        (
            "max_grad_norm = 0.5",
            "initial_log_std = 1.0",
            "^ppo.initial_log_std: now ppo.policy_kwargs.log_std_init",
        ),
        (
            "[ppo.policy_kwargs]",
            "[network]",
            "^network: now ppo.policy_kwargs, with net_arch and activation_fn",
        ),
    ],
)
def test_a_mistake_is_refused_by_its_name(tmp_path, old, new, message):
    text = (CONFIGS / "train-ppo.toml").read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "run.toml"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(ValueError, match=message):
        load_training(path)


def test_a_missing_file_costs_one_line_and_exit_code_2(tmp_path, capsys):
    assert main([str(tmp_path / "none.toml"), "--output", str(tmp_path)]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("given", ["auto", "auto_0.01", "auto_1e-3", 0.5])
def test_the_weight_of_the_entropy_is_a_number_or_adapted(given):
    assert EntropyCoefficient().check(given, "sac.ent_coef") == given


@pytest.mark.parametrize(
    "given", ["auto_", "auto_0", "auto_nan", "auto_x", "automatic", "0.1", 0.0, True, None]
)
def test_another_weight_of_the_entropy_is_refused_before_the_algorithm_would(given):
    with pytest.raises(ValueError, match="^sac.ent_coef: expected "):
        EntropyCoefficient().check(given, "sac.ent_coef")


def test_hyperparameters_have_the_names_of_the_algorithms():
    algorithms = pytest.importorskip("stable_baselines3")
    for settings, algorithm in ((PPOSettings, algorithms.PPO), (SACSettings, algorithms.SAC)):
        own = {field.name for field in fields(settings)}
        assert own <= set(signature(algorithm.__init__).parameters)
        assert not own & set(RENAMED)
