"""Wrappers of the environments: target angles, a residual on an agent; for one environment and for many."""
