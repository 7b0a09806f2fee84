"""What runs fast: flap actuators, modal form, superposition, and the plant of one or many turbines."""

from __future__ import annotations

import importlib.util

from flapgym.core.fields import Count
from flapgym.core.wording import shown
from flapgym.model.turbine_model import TurbineModel
from flapgym.plant.actuator import Actuator, Faults
from flapgym.plant.delayed import DelayedPlant
from flapgym.plant.held import NEAREST, distance
from flapgym.plant.interface import GivenWind, Interval, Plant, Setup, Start, Task
from flapgym.plant.kernel import prepare
from flapgym.plant.lifted_plant import LiftedPlant
from flapgym.plant.periodic_plant import PeriodicPlant

__all__ = [
    "KERNELS",
    "PRECISIONS",
    "Actuator",
    "Faults",
    "GivenWind",
    "Interval",
    "LiftedPlant",
    "Plant",
    "Setup",
    "Start",
    "Task",
    "make_plant",
]

KERNELS = ("auto", "numba", "numpy")
PRECISIONS = ("float64", "float32")


def make_plant(model: TurbineModel, count: int, setup: Setup, task: Task) -> Plant:
    """The plant of n turbines; compiled if numba is installed, which takes some seconds the very first time.

    A model whose blades differ has a plant of its own, in numpy.

    Raises
    ------
    ValueError
        If kernel or precision is unknown.
    ImportError
        If numba is asked for and is not installed.
    """
    for name, known in (("kernel", KERNELS), ("precision", PRECISIONS)):
        if getattr(setup, name) not in known:
            raise ValueError(f"{name}: expected one of {', '.join(known)}, got {shown(getattr(setup, name))}")
    compiled = importlib.util.find_spec("numba") is not None
    if setup.kernel == "numba" and not compiled:
        raise ImportError('kernel: numba is not installed; pip install "flapgym[fast]", or take "numpy"')
    Count(at_least=1).check(count, "make_plant.count")
    plant = _of_model(model, count, setup, task, compiled and setup.kernel != "numpy")
    return DelayedPlant(plant, task, setup.delay) if setup.delay else plant


def holds(model: TurbineModel, setup: Setup) -> bool:
    """Whether the compiled plant loses no digits on a model (flapgym.plant.held)."""
    kernel = prepare(
        model, setup.steps_per_action, setup.length_scale, setup.every_sample, setup.single_blade
    )
    return distance(kernel.flap, kernel.turn) >= NEAREST


def _of_model(model: TurbineModel, count: int, setup: Setup, task: Task, compiled: bool) -> Plant:
    """The plant that suits the model, compiled or not."""
    if model.periodic is not None and not setup.single_blade:
        return PeriodicPlant(model, count, setup, task)
    if not compiled:
        return LiftedPlant(model, count, setup, task)
    if not holds(model, setup):
        if setup.kernel == "numba":
            raise ValueError(
                "kernel: the model has a mode too near to what a flap at rest excites (a slow state, or one at the "
                "rotor's speed) for compiled code; "
                'expected "numpy" or "auto", got "numba"'
            )
        return LiftedPlant(model, count, setup, task)
    from flapgym.plant.compiled_plant import CompiledPlant

    return CompiledPlant(model, count, setup, task)
