"""What an environment asks of a plant, whatever turbine it stands for: the one boundary between task and physics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from flapgym.core.arrays import Array, FloatArray
from flapgym.plant.actuator import Faults
from flapgym.plant.layout import REWARD, WIND

Told = tuple[int, float, float]
"""What `Plant.step` returns, and of the first turbine the reward and the wind perturbation [m/s], which mean nothing if
it is negative."""
Quick = tuple[Callable[[Any, NDArray[np.float32], NDArray[np.float32], NDArray[np.float64]], Told], Any]
"""A function of this very thing, flat actions, and observation and rows to fill."""


@dataclass(frozen=True)
class Setup:
    """How a plant is stepped.

    Parameters
    ----------
    steps_per_action : int
        Plant steps k for which an action is held.
    intervals : int
        Actions per episode.
    length_scale : float
        Of the turbulence [m].
    every_sample : bool
        Compute tip deflection, tower and wind at every plant sample, not only at the last one of an interval.
    displacements : bool
        Compute tip deflection and tower at all; without, a plant may leave them NaN in its rows of steps, which saves
        a tenth of the time of a single turbine's step.
    faults : Faults
        Of the flaps.
    single_blade : bool
        The clamped single blade instead of the turbine: one flap, one moment, no tower.
    precision : str
        "float64", or "float32" of the modes and of the response to the wind.
    kernel : str
        "numba", "numpy", or "auto" for the first that can be had.
    pool : int
        Number of realisations of the turbulence shared by all plants of the process; 0 draws each anew.
    delay : int
        Plant samples by which the observed moments are late.
    """

    steps_per_action: int
    intervals: int
    length_scale: float
    every_sample: bool = False
    displacements: bool = True
    faults: Faults = field(default_factory=Faults)
    single_blade: bool = False
    precision: str = "float64"
    kernel: str = "auto"
    pool: int = 0
    delay: int = 0

    @property
    def blades(self) -> int:
        """Blades, and flaps."""
        return 1 if self.single_blade else 3


@dataclass(frozen=True, eq=False)
class Task:
    """What is made of a plant's rows: an observation and the weights of a reward.

    Attributes
    ----------
    columns : (observed,) int
        Columns of a row (flapgym.plant.layout).
    factors, bounds : (observed,) float
        On the value; of the product.
    noisy : (observed,) int
        Blade whose measurement noise is added to the value, or -1.
    rbm_weight, angle_weight, tower_weight : float
        Reward lost per mean square of moment [1 / (N m)^2], flap angle [1 / rad^2] and fore-aft displacement [1 / m^2].
    """

    columns: NDArray[np.int64]
    factors: Array
    bounds: Array
    noisy: NDArray[np.int64]
    rbm_weight: float
    angle_weight: float = 0.0
    tower_weight: float = 0.0

    @property
    def size(self) -> int:
        """Entries of the observation."""
        return self.columns.size

    def observe(self, rows: Array, noise: Array | None = None) -> NDArray[np.float32]:
        """Observations (m, observed) of rows (m, ROW), with measurement noise (m, 3) [N m] if there is any."""
        values = rows[:, self.columns]
        if noise is not None:
            values = values + np.where(self.noisy >= 0, noise[:, self.noisy], 0.0)
        # Rounded before it is bounded: a stop rounded up to float32 would leave the space.
        packed, bound = (values * self.factors).astype(np.float32), self.bounds.astype(np.float32)
        return np.maximum(np.minimum(packed, bound), -bound)


class GivenWind(NamedTuple):
    """A wind known in advance, such as a gust.

    Attributes
    ----------
    wind : (T + 1,) float
        Perturbation at samples 0 to T [m/s].
    before : float
        What has always blown before [m/s]: the turbine starts in equilibrium with it.
    """

    wind: Array
    before: float


@dataclass(frozen=True, eq=False)
class Start:
    """How m turbines begin an episode.

    Attributes
    ----------
    azimuth : (m,) float
        Of blade 1 [rad].
    flap_angle, flap_rate : (m, 3) float
        Within the stops [rad, rad/s]. The turbine's response to the flaps starts from rest.
    intensity : (m,) float
        Of the turbulence; none where it is zero.
    noise : (m, noise_count) float or None
        Standard normal numbers that make the realisations.
    realisation : (m,) int or None
        Instead of noise: which realisations of the pool.
    measurement_noise : (m, intervals + 1, 3) float or None
        Added to the observed moments [N m]; given always or never.
    gust : GivenWind or None
        Wind beside the turbulence. Keep the object: its response is computed once.
    """

    azimuth: Array
    flap_angle: Array
    flap_rate: Array
    intensity: Array
    noise: Array | None = None
    realisation: NDArray[np.int64] | None = None
    measurement_noise: Array | None = None
    gust: GivenWind | None = None

    def under(self, faults: Faults) -> Start:
        """The same with stuck flaps where they are stuck."""
        if not faults.held.any():
            return self
        angle = np.where(faults.held, faults.held_angle, self.flap_angle)
        return replace(self, flap_angle=angle, flap_rate=np.where(faults.held, 0.0, self.flap_rate))


class Interval(NamedTuple):
    """What n turbines did during one action; arrays are fresh.

    Attributes
    ----------
    rbm : (n, k, 3) float
        Flapwise root bending moment at samples 1 to k [N m].
    tip_deflection : (n, kept, 3) float
        Tip deflection at the samples kept (all k, or the last) [m].
    tower : (n, kept, 2) float
        Tower-top displacement downwind and sideways [m].
    wind : (n, kept) float
        Wind perturbation [m/s].
    flap_angle, flap_rate : (n, k + 1, 3) float
        Flap motion at samples 0 to k [rad, rad/s].
    stopped : (n, 3) bool
        Flaps that met a stop.
    """

    rbm: Array
    tip_deflection: Array
    tower: Array
    wind: Array
    flap_angle: Array
    flap_rate: Array
    stopped: NDArray[np.bool_]


def told(
    step: Callable[..., int], actions: FloatArray, observation: NDArray[np.float32], rows: Array
) -> Told:
    """A plant's `step` in the form of `Quick`."""
    status = step(actions, observation, rows)
    return status, rows.item(REWARD), rows.item(WIND)


class Plant(Protocol):
    """n turbines that are advanced by actions.

    Attributes
    ----------
    count : int
        Turbines n.
    setup : Setup
    fingerprint : str
        Of every number that decides how the plant moves.
    """

    count: int
    setup: Setup
    fingerprint: str

    @property
    def noise_count(self) -> int:
        """Standard normal numbers one turbine's realisation takes."""
        ...

    @property
    def elapsed(self) -> NDArray[np.int64]:
        """Intervals done since each turbine's reset, (n,)."""
        ...

    def reset(self, turbines: NDArray[np.int64], start: Start) -> tuple[NDArray[np.float32], Array]:
        """Begin an episode of m turbines; observations (m, observed) and rows (m, ROW) of sample 0."""
        ...

    def step(
        self,
        actions: FloatArray,
        observation: NDArray[np.float32],
        rows: Array,
        samples: Array | None = None,
    ) -> int:
        """Hold actions (n blades,), fractions of the acceleration limit, for k plant steps.

        Parameters
        ----------
        actions : (n blades,) float32 or float64
            Contiguous; clipped to +-1.
        observation : (n observed,) float32
            Filled.
        rows : (n ROW,) float64
            Filled (flapgym.plant.layout).
        samples : (n, k, SAMPLE) float64, optional
            Filled with the plant samples 1 to k; takes a setup with `every_sample`.

        Returns
        -------
        int
            Bit 0: some turbine's reward is not finite. Bit 1: some turbine's episode is over. Negative, with
            everything untouched: -1 for a wrong number of actions or of places to fill, -2 - i if action i is not
            finite.

        Raises
        ------
        TypeError
            If the actions are no flat array of floats, or what is to be filled has another type or gaps.
        """
        ...

    @property
    def quick(self) -> Quick:
        """`step` for flat float32 arrays and without samples, at the least cost of a call; not to be copied."""
        ...

    def get_state(self, turbine: int) -> dict[str, Any]:
        """What changes of a turbine, but for its realisation, as plain values for JSON."""
        ...

    def set_state(self, turbine: int, state: dict[str, Any]) -> None:
        """Go on from there; `reset` with the same realisation comes before."""
        ...
