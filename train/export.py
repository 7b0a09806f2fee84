"""From a Stable-Baselines3 policy to an agent that runs in numpy: the mean action's layers, nothing else."""

from __future__ import annotations

from typing import cast

import numpy as np
import torch
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.base_class import BaseAlgorithm

from flapgym.control.policy import Activation, Policy, Squash
from flapgym.model.turbine_model import TurbineModel
from train.scaling import observation_scale
from train.settings import Training


def exported(algorithm: BaseAlgorithm, training: Training, model: TurbineModel) -> Policy:
    """The trained policy as an agent."""
    layers, squash = _mean_layers(algorithm)
    scale = observation_scale(training.environment.observe, model)
    return Policy(
        name=training.name,
        observe=training.environment.observe,
        steps_per_action=training.environment.steps_per_action,
        per_blade=True,
        offset=np.zeros_like(scale),
        scale=scale,
        weights=tuple(_numpy(layer.weight) for layer in layers),
        biases=tuple(_numpy(layer.bias) for layer in layers),
        activation=cast(Activation, training.algorithm.policy_kwargs.activation_fn),
        squash=squash,
        model_hash=model.hash,
    )


def _mean_layers(algorithm: BaseAlgorithm) -> tuple[list[torch.nn.Linear], Squash]:
    """Linear layers from observation to mean action, and what bounds the action."""
    if isinstance(algorithm, PPO):
        hidden, last = algorithm.policy.mlp_extractor.policy_net, algorithm.policy.action_net
        return [*_linear(hidden), cast(torch.nn.Linear, last)], "clip"
    assert isinstance(algorithm, SAC)
    return [*_linear(algorithm.actor.latent_pi), cast(torch.nn.Linear, algorithm.actor.mu)], "tanh"


def _linear(layers: torch.nn.Module) -> list[torch.nn.Linear]:
    return [layer for layer in layers.children() if isinstance(layer, torch.nn.Linear)]


def _numpy(tensor: torch.Tensor) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    return tensor.detach().cpu().numpy().astype(float)
