"""The built turbine model: what it holds, its file, its export, and the one transform to multi-blade coordinates.

Whoever runs a built model needs none of the physics behind it; `flapgym.aeroelastic.build` makes one.
"""

from flapgym.model.turbine_model import DEFAULT_MODEL, TurbineModel, builtin_models, load_model, save_model

__all__ = ["DEFAULT_MODEL", "TurbineModel", "builtin_models", "load_model", "save_model"]
