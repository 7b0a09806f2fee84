"""What runs fast: flap actuators, modal form, superposition, and the plant of one or many turbines.

Pure functions over named arrays: `step(parameters, episode, state, actions) -> state, loads`, in the ways that
`flapgym.plant.backends` holds. Rewards and observations are the environments'.
"""

from __future__ import annotations

from importlib import import_module
from typing import Protocol

from flapgym.core.arrays import Array, FloatArray, IntArray
from flapgym.core.fields import Choice, Count
from flapgym.model.turbine_model import TurbineModel
from flapgym.plant.actuator import Faults
from flapgym.plant.linear import LinearPlant
from flapgym.plant.parameters import PRECISIONS, Loads, Stepping
from flapgym.plant.periodic import PeriodicPlant
from flapgym.plant.quantities import Quantities
from flapgym.plant.start import GivenWind, Start
from flapgym.plant.surroundings import Surroundings
from flapgym.wind import Lidar
from flapgym.wind.blade_field import FieldOnDisk
from flapgym.wind.box_field import BoxOnDisk

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


class Plant(Protocol):
    """n turbines that are advanced by actions: what an environment asks of whatever stands for a turbine.

    Attributes
    ----------
    count : int
        Turbines n.
    stepping : Stepping
    quantities : Quantities
        What it tells.
    fingerprint : str
        Of every number that decides how the plant moves.
    """

    count: int
    stepping: Stepping
    quantities: Quantities
    fingerprint: str

    @property
    def noise_count(self) -> int:
        """Standard normal numbers one turbine's realisation takes."""
        ...

    @property
    def strongest_wind(self) -> Array:
        """Largest modulus of the wind, mean over the rotor, in each turbine's episode, (n,) [m/s]."""
        ...

    @property
    def elapsed(self) -> IntArray:
        """Actions since each turbine's reset, (n,)."""
        ...

    def reset(self, turbines: IntArray, start: Start) -> Loads:
        """Begin an episode of m turbines; their loads at sample 0."""
        ...

    def step(self, actions: FloatArray) -> Loads:
        """Hold actions (n, blades A), finite fractions of what they command, for k plant steps."""
        ...

    def field(self, start: Start) -> FieldOnDisk | BoxOnDisk:
        """The wind over the disk while the one turbine of a start goes through its episode; ValueError without one."""
        ...

    @property
    def known_ahead(self) -> float:
        """Time beyond an episode up to which its wind can be told ahead [s]."""
        ...

    def upwind(self, lidar: Lidar, start: Start, arrival: Array) -> Array:
        """Speeds along a lidar's beams (m, S, N) [m/s] in m episodes, of turbulence that arrives at times (S,) [s]."""
        ...

    def steady(self, azimuth: Array) -> dict[str, Array]:
        """What steady inflow and gravity do to the outputs at azimuths of blade 1 (n,) [rad]; ValueError without."""
        ...

    def flap_motion(self) -> tuple[Array, Array]:
        """Angle and rate of every flap, (n, blades F) each [rad, rad/s]."""
        ...

    def get_state(self, turbine: int) -> dict[str, object]:
        """What changes of a turbine, but for its realisation, as plain values for JSON."""
        ...

    def set_state(self, turbine: int, state: dict[str, object]) -> None:
        """Go on from there; `reset` with the same realisation comes before."""
        ...


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
