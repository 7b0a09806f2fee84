"""Aeroelastic coupling: structure and reduced aerodynamics joined into the turbine model (Section II.D)."""
