"""What runs fast: flap actuator, modal form, superposition, and the plant of one or many turbines."""

from flapgym.plant.actuator import Actuator
from flapgym.plant.plant import Interval, Plant

__all__ = ["Actuator", "Interval", "Plant"]
