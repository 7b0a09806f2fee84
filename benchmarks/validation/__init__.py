"""The turbine model beside OpenFAST on the same turbine, wind and rotor speed (docs/validation.md)."""
