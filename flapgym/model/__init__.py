"""The built turbine model: what it holds, its file, its export, and the one transform to multi-blade coordinates.

Whoever runs a built model needs none of the physics behind it; `flapgym.aeroelastic.build` makes one.
"""

from flapgym.model.signals import blade_flap_inputs, flap_inputs, strip_inputs
from flapgym.model.turbine_model import (
    DEFAULT_MODEL,
    ModelFlap,
    TurbineModel,
    builtin_models,
    load_model,
    save_model,
)

__all__ = [
    "DEFAULT_MODEL",
    "ModelFlap",
    "TurbineModel",
    "blade_flap_inputs",
    "builtin_models",
    "flap_inputs",
    "load_model",
    "save_model",
    "strip_inputs",
]
