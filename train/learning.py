"""One training run: environment, learner, progress, and the agent it leaves."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from typing import Any

import torch
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecMonitor

from flapgym.adapters.sb3 import FlapVecEnv
from flapgym.control.policy import Policy
from flapgym.core.progress import ProgressBar
from flapgym.envs import FlapVectorEnv
from flapgym.model.turbine_model import TurbineModel
from train.export import exported
from train.scaling import Scaled, observation_scale
from train.settings import PPOSettings, SACSettings, Training

ACTIVATIONS = {"tanh": torch.nn.Tanh, "relu": torch.nn.ReLU}
ALGORITHMS: dict[type[PPOSettings | SACSettings], type[PPO | SAC]] = {PPOSettings: PPO, SACSettings: SAC}


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a run left.

    Attributes
    ----------
    policy : Policy
    record : dict
        Plain JSON values: settings, seed, steps done, seconds, whether it was interrupted.
    """

    policy: Policy
    record: dict[str, Any]


def learn(training: Training, model: TurbineModel, seed: int, tensorboard: str | None = None) -> Outcome:
    """Train one policy. Ctrl-C ends the run early and keeps what was learnt."""
    # The networks are so small that a second thread costs more than it brings.
    torch.set_num_threads(1)
    env = environment(training, model)
    algorithm = learner(training, env, seed, tensorboard)
    began, interrupted, progress = time.perf_counter(), False, Progress(training)
    try:
        algorithm.learn(training.total_timesteps, callback=progress, tb_log_name=training.name)
    except KeyboardInterrupt:
        interrupted = True
    finally:
        progress.close()
        env.close()
    record = {
        "training": asdict(training),
        "seed": seed,
        "steps": int(algorithm.num_timesteps),
        "seconds": round(time.perf_counter() - began, 1),
        "interrupted": interrupted,
    }
    return Outcome(exported(algorithm, training, model), record)


def environment(training: Training, model: TurbineModel) -> Scaled:
    """Turbines side by side, one environment a blade, scaled."""
    chosen = training.environment
    vector = FlapVectorEnv(
        chosen.turbines,
        autoreset_mode="SameStep",
        model=model,
        duration=chosen.duration,
        steps_per_action=chosen.steps_per_action,
        task={"observe": chosen.observe, "flap_angle_weight": chosen.flap_angle_weight},
    )
    blades = VecMonitor(FlapVecEnv(vector, per_blade=True))
    return Scaled(blades, observation_scale(chosen.observe, model), training.algorithm.gamma)


def learner(training: Training, env: Scaled, seed: int, tensorboard: str | None) -> BaseAlgorithm:
    """The Stable-Baselines3 algorithm of a run."""
    keywords = asdict(training.algorithm)
    rate, network = keywords["learning_rate"], keywords["policy_kwargs"]
    keywords["learning_rate"] = lambda left: left * rate  # `left` falls from one to zero over the run
    network["net_arch"] = list(network["net_arch"])
    network["activation_fn"] = ACTIVATIONS[network["activation_fn"]]
    kind = ALGORITHMS[type(training.algorithm)]
    # On the CPU: to move batches this small to an accelerator takes longer than to multiply them here.
    return kind("MlpPolicy", env, seed=seed, device="cpu", tensorboard_log=tensorboard, **keywords)


class Progress(BaseCallback):
    """A bar over the steps, with the mean reward an action of the episodes that ended last.

    Parameters
    ----------
    training : Training
    """

    def __init__(self, training: Training) -> None:
        super().__init__()
        self._training = training
        self._bar: Any = None

    def _on_training_start(self) -> None:
        self._bar = ProgressBar(
            total=self._training.total_timesteps, desc=self._training.name, unit="step", unit_scale=True
        )

    def _on_step(self) -> bool:
        done = min(self.num_timesteps, self._training.total_timesteps)
        self._bar.update(done - self._bar.n)
        episodes = self.model.ep_info_buffer
        if episodes:
            reward = sum(entry["r"] for entry in episodes) / sum(entry["l"] for entry in episodes)
            self._bar.set_postfix_str(f"reward {reward:.3f} an action", refresh=False)
        return True

    def close(self) -> None:
        """End the bar, wherever it stands."""
        if self._bar is not None:
            self._bar.close()
