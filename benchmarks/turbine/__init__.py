"""Figures 10, 11, 13, 14 of the paper, reduced models against full ones, speed and damping of the turbine model."""
