"""What the step of a turbine needs and never changes, what changes, and what it tells: named arrays.

Superposition: the response to the flaps is stepped, that to the wind is looked up (`flapgym.plant.responses`). Between
its stops a flap moves under a held acceleration, so three numbers a flap (four where the acceleration lags) decide an
interval of k steps: it is one product, whatever k. Where a stop changes the motion, what it took away is added. Where
the blades' pitch moves, it is one more actuator on each, with a law of its own.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, NamedTuple

import numpy as np

from flapgym.core.arrays import BLADES, Array, FloatArray, IntArray
from flapgym.core.fields import Choice, Count, Flag, Quantity, check_fields
from flapgym.model.turbine_model import TurbineModel
from flapgym.plant.actuator import Faults
from flapgym.plant.quantities import Quantities
from flapgym.plant.surroundings import Surroundings

PRECISIONS = ("float64", "float32")


class Sizes(NamedTuple):
    """Whole numbers of a step; of its compiled code all that is no array or time.

    Attributes
    ----------
    steps, intervals : int
        Plant steps k an action is held; actions of an episode.
    kept : int
        Samples at which everything but the root moment is told: k, or 1 for the last.
    blades, flaps, pitch : int
        Blades, flaps F on each, and 1 where pitch moves, else 0: A = F + pitch actuators a blade.
    blade_outputs, fixed_outputs : int
        Quantities that are computed of the blades (1: the root moment alone) and in the fixed frame.
    blade_places, fixed_places : int
        The same of those that have a place among a turbine's numbers; what is not computed is NaN there.
    record, lags : int
        1 where every plant sample is told; where a flap's acceleration lags behind its command.
    modes, rows : int
        Twice the number of modes M, and rows of an interval without the wind's.
    given, commanded : int
        Q = 3 A kinds of what decides a motion, and those of command and lag among them.
    """

    steps: int
    intervals: int
    kept: int
    blades: int
    flaps: int
    pitch: int
    blade_outputs: int
    fixed_outputs: int
    blade_places: int
    fixed_places: int
    record: int
    lags: int
    modes: int
    rows: int
    given: int
    commanded: int


class Parameters(NamedTuple):
    """Constants of a step: z' = decay z + u B and rows = z C + u D, over an interval.

    Flap f of blade b comes at b F + f, the pitch of blade b behind all flaps, at blades F + b.

    Attributes
    ----------
    sizes : Sizes
    time_step, turn : float
        Of a plant step [s, rad of azimuth].
    actuators : (8, blades A) float
        Of each: stops of angle and rate [rad, rad/s]; what an action of one commands [rad/s^2], zero for a stuck flap;
        effectiveness; then its `flapgym.plant.actuator.Law`: decay and gain of the lag, stiffness, damping.
    settling : (k, 2) float
        `flapgym.plant.actuator.rate_gained` of pitch, which moves without a command, too.
    decay : (2, M) float
        What an interval leaves of the modes: real and imaginary part of their eigenvalues' k-th power.
    B : (Q + 6 A k, 2 M) float
        What actuators do to the modes at the end, by quantities of each in components 0, c, s in the frame of the
        start. The first Q are of motion that is free of stops: command, if it lags the acceleration at the start,
        angle and rate there. Where stops are met, the command's part is left out, and behind angle and rate come the
        rate gained step by step, less `settling`, and the jumps of the angle step by step.
    C : (2 M, rows) float
        Modes at the start, real parts first, to the rows (`flapgym.plant.frame.OutputRows`, without the wind's).
    D : (Q + 6 A k, rows) float
        What actuators do to the rows.
    """

    sizes: Sizes
    time_step: float
    turn: float
    actuators: Array
    settling: Array
    decay: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray

    @property
    def angle_limit(self) -> Array:
        """Stops of every actuator's angle (blades A,) [rad]."""
        return self.actuators[0]

    @property
    def rate_limit(self) -> Array:
        """Stops of every actuator's rate (blades A,) [rad/s]."""
        return self.actuators[1]

    @property
    def acceleration(self) -> Array:
        """What an action of one commands (blades A,) [rad/s^2]."""
        return self.actuators[2]

    @property
    def effectiveness(self) -> Array:
        """Of every actuator (blades A,)."""
        return self.actuators[3]

    @property
    def all_flaps(self) -> int:
        """Flaps of all blades: as many actuators come before the first that pitches a blade."""
        return self.sizes.blades * self.sizes.flaps


class Episode(NamedTuple):
    """What does not change within an episode of n turbines.

    Attributes
    ----------
    azimuth : (n,) float
        Of blade 1 at the reset [rad].
    responses : (places, intervals, rows + kept) float
        What the wind does to the rows, and the wind itself, at unit level.
    place : (n,) int
        Where each turbine's response stands.
    level : (n,) float
        Factor on it.
    """

    azimuth: Array
    responses: FloatArray
    place: IntArray
    level: Array


class State(NamedTuple):
    """What changes from step to step.

    Attributes
    ----------
    elapsed : (n,) int
        Actions since the reset.
    flaps : (4, blades A, n) float
        Of flaps and pitch: angle, rate, lagged acceleration, way since the reset [rad, rad/s, rad/s^2, rad].
    modes : (n, 2 M) float
        Of the response to the flaps, real parts first.
    """

    elapsed: IntArray
    flaps: Array
    modes: FloatArray

    def copy(self) -> State:
        """Of arrays that may be changed."""
        return State(self.elapsed.copy(), self.flaps.copy(), self.modes.copy())


class Loads(NamedTuple):
    """What n turbines did during an action.

    Attributes
    ----------
    last : (n, size) float
        At the last sample (`flapgym.plant.quantities.Quantities.last`).
    rbm_square : (n, blades) float
        Mean square of the root moment over the samples [N^2 m^2].
    angle_square : (n,) float
        The same of the flap angles over their stops, mean over the flaps.
    fixed_square : (n, fixed) float
        The same of the fixed outputs, over the samples kept.
    samples : (n, k, sample_size) float
        Every plant sample; (n, 0, 0) where they are not wanted.
    """

    last: Array
    rbm_square: Array
    angle_square: Array
    fixed_square: Array
    samples: Array


@dataclass(frozen=True)
class Stepping:
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
        Compute everything at every plant sample, not only at the last one of an interval.
    record : bool
        Tell every plant sample; takes `every_sample` and `displacements`.
    displacements : bool
        Compute more than root moments and wind at all; without it the rest is NaN, which saves a tenth of the time of
        a single turbine's step.
    faults : Faults
        Of the flaps.
    single_blade : bool
        The clamped single blade instead of the turbine.
    pitch : bool
        Whether the pitch of each blade moves, too.
    precision : str
        "float64", or "float32" of the modes and of the response to the wind.
    pool : int
        Number of realisations of the turbulence shared by all plants of the process; 0 draws each anew.
    surroundings : Surroundings
        A field in the place of the homogeneous turbulence, steady inflow, gravity.
    """

    steps_per_action: Annotated[int, Count(at_least=1)]
    intervals: Annotated[int, Count(at_least=1)]
    length_scale: Annotated[float, Quantity("length", above=0.0)]
    every_sample: Annotated[bool, Flag()] = False
    record: Annotated[bool, Flag()] = False
    displacements: Annotated[bool, Flag()] = True
    faults: Faults = field(default_factory=Faults)
    single_blade: Annotated[bool, Flag()] = False
    pitch: Annotated[bool, Flag()] = False
    precision: Annotated[str, Choice(PRECISIONS)] = "float64"
    pool: Annotated[int, Count(at_least=0)] = 0
    surroundings: Surroundings = field(default_factory=Surroundings)

    def __post_init__(self) -> None:
        check_fields(self, "stepping")
        if self.single_blade and self.surroundings.turns:
            raise ValueError("surroundings: expected none with the single blade, which does not turn")
        if self.record and not (self.every_sample and self.displacements):
            raise ValueError(
                "stepping.record: expected every_sample and displacements with it, got one without"
            )

    @property
    def blades(self) -> int:
        """Blades that are there."""
        return 1 if self.single_blade else BLADES

    def quantities(self, model: TurbineModel) -> Quantities:
        """What a plant of the model tells."""
        if self.single_blade:
            return Quantities(self.blades, len(model.flaps), False, model.blade.outputs, ())
        return Quantities(self.blades, len(model.flaps), self.pitch, model.blade_outputs, model.fixed_outputs)

    def limits(self, model: TurbineModel) -> Array:
        """Stops of angle and rate of every actuator, (2, blades A) [rad, rad/s]."""
        pitch = [model.pitch_actuator] * self.blades if self.pitch else []
        of_all = [*model.flaps * self.blades, *pitch]
        return np.array([[getattr(each, name) for each in of_all] for name in ("angle_limit", "rate_limit")])

    def require(self, model: TurbineModel) -> None:
        """Refuse a model without the inputs that this takes.

        Raises
        ------
        ValueError
            The message names the setting and a model that has them.
        """
        self.surroundings.require(model)
        if not self.pitch:
            return
        if model.pitch_actuator is None:
            raise ValueError(
                f"pitch: expected a model with pitch as an input, such as nrel5mw-site, got {model.name}; "
                "see [signals] in the case file"
            )
        if self.single_blade:
            raise ValueError("pitch: expected none with the single blade, whose model has no such input")
