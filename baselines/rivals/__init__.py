"""Rivals of the LQG and the bound of all: `python -m baselines.rivals`."""
