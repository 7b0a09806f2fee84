"""Training runs are read strictly: every mistake is refused by its name, before PyTorch is loaded."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from train.policies import main
from train.settings import load_training

CONFIGS = Path(__file__).parents[2] / "configs"


@pytest.mark.parametrize("name", ["ppo", "sac"])
def test_the_shipped_runs_are_read_as_they_stand(name):
    path = CONFIGS / f"train-{name}.toml"
    training = load_training(path)
    table = tomllib.loads(path.read_text(encoding="utf-8"))
    assert training.name == name
    assert training.total_steps == table["total_steps"]
    assert training.discount == table[name]["discount"]
    assert training.environment.observe == tuple(table["environment"]["observe"])


@pytest.mark.parametrize(
    "old, new, message",
    [
        ("batch_size", "batchsize", "ppo.batchsize: unknown key; did you mean 'batch_size'"),
        ("discount = 0.99", "discount = 1.5", "ppo.discount"),
        ('duration = "40 s"', 'duration = "40 m"', "environment.duration"),
        ('"flap_rate"]', '"azimuth"]', r"environment.observe\[2\]"),
        ("hidden = [64, 64]", "hidden = []", "network.hidden"),
        ('activation = "relu"', 'activation = "gelu"', "network.activation"),
        ("turbines = 64", "turbines = 0.5", "environment.turbines"),
        ('algorithm = "ppo"', 'algorithm = "dqn"', "algorithm: expected 'ppo' or 'sac'"),
        ("[ppo]", "[sac]", "unknown key"),
        ("total_steps", "total steps", "not valid TOML"),
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
