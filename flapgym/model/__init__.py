"""The built turbine model: what it holds, its file, its export, and the one transform to multi-blade coordinates.

Whoever runs a built model needs none of the physics behind it; `flapgym.aeroelastic.build` makes one.
"""

from flapgym.model.model_set import (
    ModelSet,
    builtin_model_sets,
    is_model_set,
    load_model_set,
    save_model_set,
)
from flapgym.model.signals import blade_flap_inputs, flap_inputs, pitch_inputs, strip_inputs
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
    "ModelSet",
    "TurbineModel",
    "blade_flap_inputs",
    "builtin_model_sets",
    "builtin_models",
    "flap_inputs",
    "is_model_set",
    "load_model",
    "load_model_set",
    "pitch_inputs",
    "save_model",
    "save_model_set",
    "strip_inputs",
]
