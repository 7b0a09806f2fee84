"""Keywords of the environments: frozen families of them, checked before anything is built.

The manual is the docstring of `flapgym.envs.FlapEnv`. A family may be given as a plain mapping, so that a
specification stays JSON.
"""

from __future__ import annotations

import difflib
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Annotated, Any

import numpy as np

from flapgym.core.arrays import BLADES, Array
from flapgym.core.fields import Choice, Count, Flag, OrNone, Quantity, TupleOf, check_fields, from_plain
from flapgym.core.wording import number, shown
from flapgym.envs.task import Task
from flapgym.model.model_set import is_model_set, load_model_set
from flapgym.model.nameplate import nameplate
from flapgym.model.turbine_model import DEFAULT_MODEL, TurbineModel, load_model
from flapgym.plant import BACKENDS, PRECISIONS, Faults, GivenWind, Surroundings
from flapgym.plant.surroundings import require_inputs
from flapgym.turbine import BUILT_IN, load_case
from flapgym.wind import BoxFile, Inflow, Lidar, Wind, turbulence_of
from flapgym.wind.box_field import BoxField
from flapgym.wind.gusts import ROUNDING, DiskGust, Gust, Recorded, gust_of
from flapgym.wind.turbulence import Turbulence

LONGEST_DELAY = 60.0
"""Of a sensor, and of an actuator's lag [s]."""


@dataclass(frozen=True)
class Actuators:
    """What stands between a command and what a flap does to the air; the default is nothing.

    Attributes
    ----------
    lag : float
        Time constant of a first-order lag of a flap's acceleration behind its command [s].
    stuck : tuple of float or None
        Angles at which flaps have long been stuck [rad]; None for one that moves. One a blade, or one a flap: those of
        blade 1 first.
    effectiveness : tuple of float
        Factors on what each flap does to the air; 0 floats, aligned with it. As many.
    """

    lag: Annotated[float, Quantity("time", at_least=0.0, at_most=LONGEST_DELAY)] = 0.0
    stuck: Annotated[tuple[float | None, ...], TupleOf(OrNone(Quantity("angle")))] = (None,) * BLADES
    effectiveness: Annotated[tuple[float, ...], TupleOf(Quantity("number", at_least=0.0, at_most=2.0))] = (
        1.0,
    ) * BLADES

    def __post_init__(self) -> None:
        check_fields(self, "actuators")

    def faults(self, model: TurbineModel) -> Faults:
        """The same, for the flaps of a model.

        Raises
        ------
        ValueError
            If a flap is stuck beyond its stop, or there is neither one entry a blade nor one a flap.
        """
        faults = Faults(self.effectiveness, self.stuck, self.lag)
        try:
            _, stuck = faults.on(BLADES, len(model.flaps))
        except ValueError as error:
            raise ValueError(str(error).replace("faults", "actuators")) from None
        limits = np.tile([flap.angle_limit for flap in model.flaps], BLADES)
        beyond = np.flatnonzero(np.abs(stuck) > limits * (1.0 + 1e-9))
        if beyond.size:
            raise ValueError(
                f"actuators.stuck: expected angles within +-{number(limits[beyond[0]])} rad, "
                f"got {shown(float(stuck[beyond[0]]))}"
            )
        return faults


@dataclass(frozen=True)
class Sensors:
    """What stands between a root bending moment and its observation, and what looks upwind; the reward sees none of it.

    Attributes
    ----------
    noise : float
        Standard deviation of white noise [N m].
    delay : float
        By which the moments are late [s], whole plant steps.
    lidar : Lidar, mapping or None
        That measures the wind before it comes, `{"range": 100.0, "radius": 40.0}`.
    """

    noise: Annotated[float, Quantity("moment", at_least=0.0, at_most=5e7)] = 0.0
    delay: Annotated[float, Quantity("time", at_least=0.0, at_most=LONGEST_DELAY)] = 0.0
    lidar: Annotated[Lidar | Mapping[str, Any] | None, OrNone(Lidar)] = None

    def __post_init__(self) -> None:
        check_fields(self, "sensors")

    def delay_steps(self, time_step: float) -> int:
        """Plant steps by which the observed moments are late.

        Raises
        ------
        ValueError
            If the delay is no whole number of them.
        """
        steps = round(self.delay / time_step)
        if not math.isclose(steps * time_step, self.delay, rel_tol=1e-6, abs_tol=1e-12):
            raise ValueError(
                f"sensors.delay: expected a multiple of the time step {number(time_step)} s, such as "
                f"{number(steps * time_step)} s, got {number(self.delay)} s"
            )
        return steps


@dataclass(frozen=True)
class Settings:
    """What can be chosen about an environment."""

    model: str | os.PathLike[str] | TurbineModel = DEFAULT_MODEL
    wind_speed: Annotated[float | None, OrNone(Quantity("speed", at_least=1.0, at_most=100.0))] = None
    wind: Wind = field(default_factory=Wind)
    gravity: Annotated[bool, Flag()] = False
    pitch: Annotated[bool, Flag()] = False
    task: Task = field(default_factory=Task)
    actuators: Actuators = field(default_factory=Actuators)
    sensors: Sensors = field(default_factory=Sensors)
    duration: Annotated[float, Quantity("time", at_least=1e-3, at_most=1e5)] = 20.0
    steps_per_action: Annotated[int, Count(at_least=1, at_most=100)] = 5
    single_blade: Annotated[bool, Flag()] = False
    full_info: Annotated[bool, Flag()] = False
    record_samples: Annotated[bool, Flag()] = False
    precision: Annotated[str, Choice(PRECISIONS)] = "float64"
    backend: Annotated[str, Choice(BACKENDS)] = "auto"

    def __post_init__(self) -> None:
        if not isinstance(self.model, (str, os.PathLike, TurbineModel)):
            raise ValueError(
                f"model: expected the name of a shipped model or a model file, got {shown(self.model)}"
            )
        check_fields(self)

    @classmethod
    def of(cls, keywords: dict[str, Any], owner: str) -> Settings:
        """From the keywords of an environment's class `owner`; an unknown one is refused by name.

        The refusal begins in Python's own words: other libraries look for them to learn what an environment takes.
        """
        known = [each.name for each in fields(cls)]
        for name in keywords:
            if name not in known:
                near = difflib.get_close_matches(name, [*known, *_MOVED], n=1)
                hint = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(known)}, render_mode"
                hint = _MOVED.get(near[0] if near else name, hint)
                raise TypeError(
                    f"{owner}.__init__() got an unexpected keyword argument {shown(name)}; {hint}"
                )
        return cls(**keywords)

    def turbine_model(self) -> TurbineModel:
        """The model meant, loaded if it is a name or a file.

        Raises
        ------
        ValueError
            If it was built for another wind speed; the message says how to build the right one.
        """
        model = self._loaded()
        if self.wind_speed is not None and not math.isclose(self.wind_speed, model.wind_speed, rel_tol=1e-9):
            wanted = number(self.wind_speed)
            target = f"{model.name}-{wanted}mps"
            raise ValueError(
                f"wind_speed: model {model.name} was built for {number(model.wind_speed)} m/s, got {wanted} m/s; "
                f'write {target}.toml with base = "{_base_of(model)}", name = "{target}" and in [operating_point] '
                f'wind_speed = "{wanted} m/s" (above rated wind also pitch and tip_speed_ratio), then '
                f"`flapgym build {target}.toml --output {target}.safetensors` and pass "
                f'model="{target}.safetensors"'
            )
        return model

    def _loaded(self) -> TurbineModel:
        """The model itself; of a set the one built for the wind speed."""
        if isinstance(self.model, TurbineModel):
            return self.model
        if not is_model_set(self.model):
            return load_model(self.model)
        models = load_model_set(self.model)
        if self.wind_speed is None:
            raise ValueError(
                f"wind_speed: expected one of {', '.join(map(number, models.wind_speeds))} m/s with the set "
                f"{self.model}, got none; flapgym/NREL5MWRange-v0 draws one each episode"
            )
        return models.at(self.wind_speed)

    def surroundings(self, model: TurbineModel) -> Surroundings:
        """Field and steady inflow on the turbine of a model, and gravity.

        Raises
        ------
        FileNotFoundError
            If the field is a box whose file is not there.
        ValueError
            If the model has no inputs for them, the single blade is asked for, or a box does not suit the model and the
            episode.
        """
        wind = self.wind
        require_inputs(model, wind.field is not None, wind.inflow is not None, self.gravity)
        if self.single_blade and (wind.field is not None or wind.inflow is not None or self.gravity):
            name = "gravity" if self.gravity else "wind.field" if wind.inflow is None else "wind.inflow"
            raise ValueError(f"{name}: expected none with single_blade=True, which does not turn")
        blowing = None if wind.field is None else self._field(turbulence_of(wind.field), model)
        inflow = (
            from_plain(Inflow, wind.inflow, "wind.inflow")
            if isinstance(wind.inflow, Mapping)
            else wind.inflow
        )
        return Surroundings(blowing, inflow, self.gravity)

    def _field(self, given: Turbulence | BoxFile, model: TurbineModel) -> Turbulence | BoxField:
        """The field on the turbine of a model; a box is read, and suits it and the episode."""
        plate = nameplate(model.case)
        if not isinstance(given, BoxFile):
            return given.on_turbine(model.turbulence_intensity, model.length_scale, plate.hub_height)
        assert plate.hub_height is not None
        return given.on_turbine(
            mean_wind=model.wind_speed,
            hub_height=plate.hub_height,
            reach=float(plate.strip_radii[-1]),
            rotor_speed=model.rotor_speed,
            duration=self.intervals(model.time_step) * self.steps_per_action * model.time_step,
        )

    def given_wind(self, model: TurbineModel) -> GivenWind | None:
        """Samples of the gust over an episode, and the wind before it; by strip if it differs over the disk.

        Raises
        ------
        ValueError
            If the gust's recording does not last as long, its frequency is above what the samples show, it wants the
            size of a turbine that the model's case does not tell, or it differs over the disk and the model has no
            winds by strip.
        """
        if self.wind.gust is None:
            return None
        gust = gust_of(self.wind.gust)
        dt = model.time_step
        action, intervals = self.steps_per_action * dt, self.intervals(dt)
        if isinstance(gust, Recorded):
            whole = math.floor((gust.lasts() + ROUNDING) / action)
            if intervals > whole:
                raise ValueError(
                    f"duration: {gust.file} lasts {number(gust.lasts())} s from where the episode begins; expected a "
                    f"duration of at most {number(whole * action)} s, whole actions of {number(action)} s, or an "
                    f"earlier gust.start, got {number(self.duration)} s"
                )
        # From one sample before the episode: the turbine begins in equilibrium with the wind there.
        time = np.arange(-1, intervals * self.steps_per_action + 1, dtype=np.float64) * dt
        plate = nameplate(model.case)
        diameter = None if plate.rotor_radius is None else 2.0 * plate.rotor_radius
        wind: Array
        if isinstance(gust, DiskGust) and model.strips and len(plate.strip_radii) == model.strips:
            self._require_turning(gust)
            wind = self.wind.given_by_strip(
                time, model.wind_speed, plate.strip_radii, diameter, plate.hub_height
            ).reshape(len(time), -1)
            return GivenWind(wind[1:], wind[0])
        wind = self.wind.given(time, model.wind_speed, diameter, plate.hub_height)
        return GivenWind(wind[1:], float(wind[0]))

    def gust_ahead(self, model: TurbineModel, lidar: Lidar, arrival: Array) -> Array:
        """What a lidar's beams measure of the gust, (S, N) [m/s] along them, by when it arrives (S,) [s].

        A recording is taken to stay at its end.
        """
        if self.wind.gust is None:
            return np.zeros((len(arrival), lidar.beams))
        before, weights = lidar.along(model.wind_speed)
        time = (arrival[:, None] - before).ravel()
        gust = gust_of(self.wind.gust)
        if isinstance(gust, Recorded):
            time = np.minimum(time, gust.lasts())
        plate = nameplate(model.case)
        diameter = None if plate.rotor_radius is None else 2.0 * plate.rotor_radius
        radius = np.array([lidar.radius])
        found = self.wind.given_by_strip(time, model.wind_speed, radius, diameter, plate.hub_height)
        found = weights @ found.reshape(len(arrival), len(weights), -1)
        of_beams = np.stack([np.ones(lidar.beams), np.cos(lidar.azimuths), np.sin(lidar.azimuths)])
        return lidar.projection * (found @ of_beams)

    def _require_turning(self, gust: Gust) -> None:
        """Refuse a gust that differs over the disk where the winds by strip do not turn."""
        if self.single_blade:
            raise ValueError(
                f"gust.kind: expected a gust that is the same over the disk with single_blade=True, which does not "
                f"turn, got {gust.kind}"
            )

    def intervals(self, time_step: float) -> int:
        """Actions of an episode: the fewest that last `duration`."""
        return max(1, math.ceil(self.duration / (self.steps_per_action * time_step) - 1e-9))


_FAMILIES = {
    "turbulence_intensity": 'wind={"turbulence_intensity": ...}',
    "length_scale": 'wind={"length_scale": ...}',
    "gust": 'wind={"gust": ...}',
    "realisation_pool": 'wind={"pool": ...}',
    "observe": 'task={"observe": ...}',
    "flap_angle_weight": 'task={"flap_angle_weight": ...}',
    "tower_weight": 'task={"tower_weight": ...}',
    "actuator_lag": 'actuators={"lag": ...}',
    "stuck_flaps": 'actuators={"stuck": ...}',
    "flap_effectiveness": 'actuators={"effectiveness": ...}',
    "measurement_noise": 'sensors={"noise": ...}',
    "sensor_delay": 'sensors={"delay": ...}',
    "kernel": "backend=...",
}
_MOVED = {name: f"it is {place} now" for name, place in _FAMILIES.items()} | {
    "max_episode_steps": "give duration in its place [s]"
}
"""What a keyword that people know from elsewhere, or from version 0.1, is called here."""


def _base_of(model: TurbineModel) -> str:
    """What a case that differs from a model's in one thing takes as its base."""
    if model.name in BUILT_IN["case"] and load_case(model.name).hash() == model.inputs_hash:
        return model.name
    return f"the case file that {model.name} was built from"
