"""What every part stands on: array types, state spaces, fields with units, files written whole, plain wording."""
