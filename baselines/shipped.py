"""The shipped controllers as the studies take them: refused where they were made for another model."""

from __future__ import annotations

from baselines.tuning import LinearController
from flapgym.control import Weights, agent_design, load_agent, made_for
from flapgym.model.turbine_model import TurbineModel


def loaded(name: str, model: TurbineModel) -> LinearController:
    """A shipped linear agent, refused if it was made for another model."""
    agent = load_agent(name, model)
    if not isinstance(agent, LinearController) or not made_for(agent, model):
        raise ValueError(f"agent {name}: not tuned on the model {model.name}; run python -m baselines.tune")
    return agent


def shipped_weights(name: str, model: TurbineModel) -> Weights:
    """Those of a shipped LQG, named as for `load_agent`."""
    design = agent_design(name, model)
    return Weights(**{key: design[key] for key in ("rbm", "flap_angle", "acceleration", "measurement_noise")})
