"""The task: what is observed of a plant, and what its loads cost."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Set
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flapgym.core.arrays import Array, IntArray
from flapgym.core.fields import Quantity, check_fields
from flapgym.core.wording import shown
from flapgym.model.turbine_model import TurbineModel
from flapgym.plant import Loads, Quantities


@dataclass(frozen=True)
class Observable:
    """One entry of `observe`.

    Attributes
    ----------
    sources : tuple of str
        Whose numbers of a plant it shows (`flapgym.plant.Quantities.last`).
    unit : str
    meaning : str
    bound : callable
        Largest magnitude for a model; larger values are clipped. Of flaps, one each (F,).
    factor : float
        From SI to the unit.
    offset : callable
        What is added for a model, in the unit.
    """

    sources: tuple[str, ...]
    unit: str
    meaning: str
    bound: Callable[[TurbineModel], Any]
    factor: float = 1.0
    offset: Callable[[TurbineModel], float] = lambda model: 0.0


def _stop_of_pitch(model: TurbineModel, name: str) -> float:
    return float(getattr(model.pitch_actuator, name))


OBSERVABLES: dict[str, Observable] = {
    "rbm": Observable(
        ("rbm",),
        "MN m",
        "flapwise root bending moment of blades 1 to 3",
        lambda model: max(50.0, 40.0e-6 * model.rbm_rms),  # a large turbine's loads are not clipped
        factor=1e-6,
    ),
    "flap_angle": Observable(
        ("flap_angle",),
        "rad",
        "flap angle of blades 1 to 3",
        lambda model: np.array([flap.angle_limit for flap in model.flaps]),
    ),
    "flap_rate": Observable(
        ("flap_rate",),
        "rad/s",
        "flap rate of blades 1 to 3",
        lambda model: np.array([flap.rate_limit for flap in model.flaps]),
    ),
    "tip_deflection": Observable(
        ("tip_deflection",), "m", "tip deflection of blades 1 to 3, downwind", lambda model: 50.0
    ),
    "azimuth": Observable(("heading",), "-", "cosine and sine of the azimuth of blade 1", lambda model: 1.0),
    "tower_top": Observable(
        ("tower_fore_aft", "tower_side_side"),
        "m",
        "tower-top displacement downwind and sideways",
        lambda model: 10.0,
    ),
    "wind": Observable(("wind",), "m/s", "wind perturbation along the shaft", lambda model: 50.0),
    "pitch_angle": Observable(
        ("pitch_angle",),
        "rad",
        "pitch of blades 1 to 3 from the operating point's",
        lambda model: _stop_of_pitch(model, "angle_limit"),
    ),
    "pitch_rate": Observable(
        ("pitch_rate",),
        "rad/s",
        "pitch rate of blades 1 to 3",
        lambda model: _stop_of_pitch(model, "rate_limit"),
    ),
    "wind_speed": Observable(
        ("wind_speed_estimate",),
        "m/s",
        "mean wind as rotor speed or pitch tell it slowly",
        lambda model: 100.0,
        offset=lambda model: model.wind_speed,
    ),
    "lidar": Observable(
        ("lidar",),
        "m/s",
        "mean and cosine and sine of the azimuth of the wind that comes, as a lidar makes them of its beams",
        lambda model: 50.0,
    ),
    "lidar_beams": Observable(
        ("lidar_beams",), "m/s", "wind perturbation along each beam of a lidar", lambda model: 50.0
    ),
}
"""What there is to observe of any model. Perturbations about the steady equilibrium, except flap and azimuth."""
TURBINE_ONLY = frozenset(("azimuth", "tower_top"))
"""Those a single blade does not have."""
SPEED = frozenset(("wind_speed",))
"""Those of a model whose rotor's speed is controlled."""
PITCH = frozenset(("pitch_angle", "pitch_rate"))
"""Those of a turbine whose pitch moves."""
LIDAR = frozenset(("lidar", "lidar_beams"))
"""Those of a lidar, which no plant tells."""
CHEAP = frozenset(("rbm", "flap_angle", "flap_rate", "azimuth", "wind")) | PITCH | LIDAR
"""Those a plant tells even where its stepping has no displacements."""


def observable(name: str, model: TurbineModel) -> Observable:
    """An entry of `observe`: one of those above, or a further output of the model, in SI units.

    Raises
    ------
    ValueError
        If there is no such quantity.
    """
    if name in OBSERVABLES:
        return OBSERVABLES[name]
    further = (*model.blade_outputs, *model.fixed_outputs)
    if name not in further:
        known = dict.fromkeys((*OBSERVABLES, *further))
        raise ValueError(f"task.observe: expected names among {', '.join(known)}, got {shown(name)}")
    return Observable((name,), "SI", f"{name.replace('_', ' ')} of the model", lambda model: 1e9)


@dataclass(frozen=True)
class _Names:
    """A name or several, each once, in their order."""

    def check(self, value: Any, name: str) -> tuple[str, ...]:
        known = ", ".join(OBSERVABLES)
        # The order of a set or a mapping says nothing.
        if not isinstance(value, Iterable) or isinstance(value, (bytes, Set, Mapping)):
            raise ValueError(f"{name}: expected names among {known}, got {shown(value)}")
        names = (value,) if isinstance(value, str) else tuple(value)
        if not names:
            raise ValueError(f"{name}: expected at least one of {known}, got none")
        for each in names:
            if not isinstance(each, str):
                raise ValueError(f"{name}: expected names among {known}, got {shown(each)}")
        names = tuple(str(each) for each in names)  # NumPy has texts of its own
        if len(set(names)) != len(names):
            raise ValueError(f"{name}: expected each name once, got {', '.join(names)}")
        return names


@dataclass(frozen=True)
class Task:
    """What an agent sees and what it loses.

    Attributes
    ----------
    observe : tuple of str
        Names of `OBSERVABLES`, or of further outputs of the model.
    flap_angle_weight, tower_weight : float
        Of the reward: lost per mean square of flap angle over angle stop, and of the tower top's fore-aft
        displacement [1 / m^2].
    """

    observe: Annotated[tuple[str, ...], _Names()] = ("rbm",)
    flap_angle_weight: Annotated[float, Quantity("number", at_least=0.0, at_most=1e6)] = 0.0
    tower_weight: Annotated[float, Quantity("number", at_least=0.0, at_most=1e6)] = 0.0

    def __post_init__(self) -> None:
        check_fields(self, "task")

    def on(self, model: TurbineModel, quantities: Quantities, sensed: Mapping[str, slice]) -> Scoring:
        """The same for what a plant of the model tells.

        Parameters
        ----------
        model : TurbineModel
        quantities : Quantities
        sensed : mapping of slice
            Where what no plant tells stands in what sensors add of their own.

        Raises
        ------
        ValueError
            If something is observed or weighed that the model, or a single blade, does not have.
        """
        single = quantities.blades == 1
        if single and self.tower_weight:
            raise ValueError(
                f"task.tower_weight: expected 0 for a single blade, got {shown(self.tower_weight)}"
            )
        columns, added = list[int](), list[int]()
        factors, offsets, bounds = list[float](), list[float](), list[float]()
        for name in self.observe:
            of_model = name in (*model.blade_outputs, *model.fixed_outputs)
            if single and (name in TURBINE_ONLY or (of_model and name not in quantities.last)):
                raise ValueError(f"task.observe: a single blade has no {name}; leave it out")
            if name in PITCH and not quantities.pitch:
                raise ValueError(f"task.observe: {name} takes pitch=True; leave it out without")
            if name in SPEED and not all(source in quantities.last for source in OBSERVABLES[name].sources):
                raise ValueError(
                    f"task.observe: {name} takes a turbine whose rotor speed is controlled, as of the models "
                    "nrel5mw-range; leave it out"
                )
            if name in LIDAR and name not in sensed:
                raise ValueError(f"task.observe: {name} takes sensors.lidar; leave it out without")
            entry = observable(name, model)
            for source in entry.sources:
                place = sensed[source] if source in sensed else quantities.last[source]
                size = place.stop - place.start
                columns += [-1] * size if source in sensed else range(place.start, place.stop)
                factors += [entry.factor] * size
                offsets += [entry.offset(model)] * size
                bounds += np.resize(entry.bound(model), size).tolist()
                if source in sensed:
                    added += range(place.start, place.stop)
                else:
                    added += range(size) if source == "rbm" else [-1] * size
        fore_aft = model.fixed_outputs.index("tower_fore_aft") if self.tower_weight else -1
        return Scoring(
            columns=np.array(columns, dtype=np.int64),
            factors=np.array(factors),
            offsets=np.array(offsets),
            bounds=np.array(bounds, dtype=np.float32),
            added=np.array(added, dtype=np.int64),
            rbm_weight=1.0 / model.rbm_rms**2,
            angle_weight=self.flap_angle_weight,
            tower_weight=self.tower_weight,
            fore_aft=fore_aft,
        )


def places(
    task: Task, model: TurbineModel, quantities: Quantities, sensed: Mapping[str, slice]
) -> dict[str, range]:
    """Where each name stands in an observation."""
    found, first = {}, 0
    for name in task.observe:
        told = quantities.last | dict(sensed)
        sources = [told[source] for source in observable(name, model).sources]
        size = sum(place.stop - place.start for place in sources)
        found[name] = range(first, first + size)
        first += size
    return found


class Scoring(NamedTuple):
    """A task on a plant, as numbers.

    Attributes
    ----------
    columns : (observed,) int
        Places among the plant's numbers; -1 for what is a sensor's alone.
    factors : (observed,) float
        On the value.
    offsets : (observed,) float
        Added to the product.
    bounds : (observed,) float32
        Of the sum.
    added : (observed,) int
        Which of the sensors' own numbers is added to the value, or -1: a blade's measurement noise, a lidar's signal.
    rbm_weight, angle_weight, tower_weight : float
        Reward lost per mean square of moment [1 / (N m)^2], flap angle over stop, and fore-aft displacement [1 / m^2].
    fore_aft : int
        Which of the fixed outputs that is; -1 if it weighs nothing.
    """

    columns: IntArray
    factors: Array
    offsets: Array
    bounds: NDArray[np.float32]
    added: IntArray
    rbm_weight: float
    angle_weight: float
    tower_weight: float
    fore_aft: int


def observe(scoring: Scoring, last: Array, own: Array | None = None) -> np.ndarray:
    """Observations (n, observed) float32 of a plant's numbers (n, size) and of sensors' own (n, S), in SI units."""
    values = last.take(scoring.columns, axis=1)
    if own is not None:
        values[:, scoring.columns < 0] = 0.0
        values += np.where(scoring.added >= 0, own[:, scoring.added], 0.0)
    values *= scoring.factors
    values += scoring.offsets
    # Rounded before it is bounded: a stop rounded up to float32 would leave the space.
    packed = values.astype(np.float32)
    np.minimum(packed, scoring.bounds, out=packed)
    return np.maximum(packed, -scoring.bounds, out=packed)


def rewards(scoring: Scoring, loads: Loads) -> tuple[Array, Array, Array, Array]:
    """Reward and its terms for moments, flap angles and tower, (n,) each and fresh."""
    of_moments = -scoring.rbm_weight * np.einsum("nb->n", loads.rbm_square) / loads.rbm_square.shape[1]
    of_angles = -scoring.angle_weight * loads.angle_square
    of_tower = np.zeros(len(of_moments))
    if scoring.fore_aft >= 0:
        of_tower = -scoring.tower_weight * loads.fixed_square[:, scoring.fore_aft]
    return of_moments + of_angles + of_tower, of_moments, of_angles, of_tower
