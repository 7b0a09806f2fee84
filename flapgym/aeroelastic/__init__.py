"""Aeroelastic coupling: structure and reduced aerodynamics joined into the turbine model (Section II.D).

``flapgym.aeroelastic.build`` makes a model; it is not imported here, since whoever runs a built model needs
none of the physics behind it.
"""

from flapgym.aeroelastic.model import DEFAULT_MODEL, TurbineModel, builtin_models, load_model, save_model

__all__ = ["DEFAULT_MODEL", "TurbineModel", "builtin_models", "load_model", "save_model"]
