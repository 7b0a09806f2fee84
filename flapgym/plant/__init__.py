"""What runs fast: flap actuators, superposition, and the plant of one or many turbines.

Pure functions over named arrays: `step(parameters, episode, state, actions) -> state, loads`, in the ways that
`flapgym.plant.backends` holds. Rewards and observations are the environments'.
"""

from __future__ import annotations

from importlib import import_module

from flapgym.core.fields import Choice, Count
from flapgym.model.turbine_model import TurbineModel
from flapgym.plant.actuator import Faults
from flapgym.plant.linear import LinearPlant
from flapgym.plant.parameters import PRECISIONS, Loads, Stepping
from flapgym.plant.periodic import PeriodicPlant
from flapgym.plant.plant import Plant
from flapgym.plant.quantities import Quantities
from flapgym.plant.start import GivenWind, Start
from flapgym.plant.surroundings import Surroundings

__all__ = [
    "BACKENDS",
    "PRECISIONS",
    "Faults",
    "GivenWind",
    "LinearPlant",
    "Loads",
    "PeriodicPlant",
    "Plant",
    "Quantities",
    "Start",
    "Stepping",
    "Surroundings",
    "chosen_backend",
    "make_plant",
]

BACKENDS = ("auto", "numba", "numpy")


def chosen_backend(backend: str) -> str:
    """The backend that "auto" means here; any other is what it says.

    Raises
    ------
    ValueError
        If it is unknown.
    ImportError
        If numba is asked for and cannot be imported.
    """
    Choice(BACKENDS).check(backend, "backend")
    if backend == "numpy":
        return backend
    try:
        import_module("flapgym.plant.backends.numba")  # a second, for those who step
    except ImportError as error:  # missing, or behind the NumPy that is here
        if backend == "auto":
            return "numpy"
        raise ImportError(
            f'backend: numba cannot be imported ({error}); pip install numba, or take "numpy"'
        ) from None
    return "numba"


def make_plant(model: TurbineModel, count: int, stepping: Stepping, backend: str = "auto") -> Plant:
    """The plant of n turbines. A model whose blades differ has one of its own, in numpy.

    Raises
    ------
    ValueError
        If the backend is unknown, or the count is none.
    ImportError
        If numba is asked for and cannot be imported.
    """
    chosen = chosen_backend(backend)
    Count(at_least=1).check(count, "make_plant.count")
    if model.periodic is not None and not stepping.single_blade:
        return PeriodicPlant(model, count, stepping)
    step = import_module(f"flapgym.plant.backends.{chosen}").step
    return LinearPlant(model, count, stepping, step)
