"""Doors to other libraries: each file imports one of them, and nothing else of the package imports it."""
