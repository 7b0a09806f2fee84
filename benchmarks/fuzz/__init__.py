"""Mutated files of every kind that people give: each is refused in one line, or holds what its kind must."""
