"""What one and many environments share: n turbines, their task, sensors and randomness."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, cast

import gymnasium
import numpy as np
from numpy.typing import ArrayLike

from flapgym.core.arrays import BLADES, Array, BoolArray, IntArray
from flapgym.core.fields import to_plain
from flapgym.core.state_space import series
from flapgym.core.wording import number, shown
from flapgym.envs.actions import UNREADABLE, numbers, refuse_not_finite
from flapgym.envs.disk import AZIMUTHS, EpisodeWind, azimuths, parts_of
from flapgym.envs.linear_range import LINEAR_SHARE, in_words, warn_beyond, whence
from flapgym.envs.settings import Settings
from flapgym.envs.states import (
    DAMAGE,
    Reader,
    checked_state,
    fresh,
    generator_of,
    generator_state,
    read_entry,
    reason,
)
from flapgym.envs.task import CHEAP, observe, places, rewards
from flapgym.model.nameplate import nameplate
from flapgym.model.turbine_model import TurbineModel
from flapgym.plant import LinearPlant, Loads, Quantities, Start, Stepping, chosen_backend, make_plant
from flapgym.plant.fingerprint import fingerprint
from flapgym.plant.responses import realisation_azimuth
from flapgym.reduction import output_rms
from flapgym.wind import Lidar, von_karman_filter
from flapgym.wind.box_field import BoxField
from flapgym.wind.lidar import ESTIMATES

MOTION = ("flap_angle", "flap_rate")
PITCH_MOTION = ("pitch_angle", "pitch_rate")
RESET_OPTIONS = ("realisation_seed", "azimuth", *MOTION, *PITCH_MOTION, "turbulence_intensity")
TOWER_TOP = ("tower_fore_aft", "tower_side_side")
"""Of the fixed outputs, what comes together in `info`."""
FRACTION = "a fraction of at least 0 and below 1 (0.10 is 10 %)"
"""What a turbulence intensity must be."""

Info = dict[str, Any]
Origin = dict[str, Any]
"""Where an episode comes from: the generator's state before its draws, and the options of the reset."""


class Episode(NamedTuple):
    """What a turbine goes on from.

    Attributes
    ----------
    origin : Origin
    generator : Generator
        As it was before the draws of the episode's start.
    plant : dict
        Of `flapgym.envs.states.checked_state`, with the late moments if the sensors are late.
    """

    origin: Origin
    generator: np.random.Generator
    plant: dict[str, Any]


class Turbines:
    """n turbines under one set of settings. Everything it returns has a leading axis of turbines and is fresh.

    Parameters
    ----------
    settings : Settings
    count : int
        Number of turbines n.
    full_info : bool
        Whether deflections are told beside what is observed.
    """

    def __init__(self, settings: Settings, count: int, full_info: bool = True) -> None:
        self.settings, self.count = settings, count
        model = settings.turbine_model()
        self.model = with_blade_rms(model) if settings.single_blade else model
        task, wind = settings.task, settings.wind
        self._delay = settings.sensors.delay_steps(self.model.time_step)
        # A late moment is looked up among the samples, and so is what weighs at every one of them.
        every = settings.record_samples or task.tower_weight > 0.0 or self._delay > 0
        self.stepping = Stepping(
            steps_per_action=settings.steps_per_action,
            intervals=settings.intervals(self.model.time_step),
            length_scale=self.model.length_scale if wind.length_scale is None else wind.length_scale,
            every_sample=every,
            record=settings.record_samples or self._delay > 0,
            displacements=every or full_info or not CHEAP.issuperset(task.observe),
            faults=settings.actuators.faults(self.model),
            single_blade=settings.single_blade,
            pitch=settings.pitch,
            precision=settings.precision,
            pool=wind.pool,
            surroundings=settings.surroundings(self.model),
        )
        self.quantities = self.stepping.quantities(self.model)
        # A mapping was made an object of when it was checked.
        self._lidar = cast("Lidar | None", settings.sensors.lidar)
        blades = self.quantities.blades
        sensed = places_sensed(blades, self._lidar)
        self.scoring = task.on(self.model, self.quantities, sensed)
        self.observed = places(task, self.model, self.quantities, sensed)
        """Where each name stands in an observation."""
        self._told = columns_told(self.quantities)
        self.sampled = columns_of(self.quantities, self.quantities.sample)
        """Where each name stands in a plant sample."""
        self.intensity = wind.intensities(count, self.model.turbulence_intensity)
        self._linear_limit = LINEAR_SHARE * self.model.wind_speed
        # Kept, because a plant computes the response to a gust it has met before only once.
        self._gust = settings.given_wind(self.model)
        self.plant = make_plant(self.model, count, self.stepping, settings.backend)
        self._own = np.empty((count, 0, 0))
        """What sensors add of their own, (n, intervals + 1, S): noise of each blade's moment [N m], then the lidar's
        signals [m/s]; of size 0 without any."""
        if settings.sensors.noise or self._lidar is not None:
            last = max((place.stop for place in sensed.values()), default=blades)
            self._own = np.zeros((count, self.stepping.intervals + 1, last))
        self._sensed = columns_of(self.quantities, sensed)
        if self._lidar is not None:
            self._prepare(self._lidar)
        self._past = np.zeros((count, self._delay, blades))
        """Moments of the last samples, the oldest first [N m], as far as the sensors are late."""
        # Once, and as a text, of which every state has a copy of its own.
        self._made_by = json.dumps(self._identity(), default=_plain)
        self._entries = self._plant_state(0)
        """Names and shapes of what a turbine's state holds."""
        bound = self.scoring.bounds
        self.observation_space = gymnasium.spaces.Box(-bound, bound, dtype=np.float32)
        actions = blades * (self.quantities.flaps + self.quantities.pitch)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (actions,), dtype=np.float32)
        self._actions = (count, actions)
        self._origins: list[Origin | None] = [None] * count

    @property
    def action_time(self) -> float:
        """Time for which an action is held [s]."""
        return self.stepping.steps_per_action * self.model.time_step

    @property
    def compiles(self) -> bool:
        """Whether one turbine can be stepped by `flapgym.envs.compiled`."""
        return isinstance(self.plant, LinearPlant) and not self.stepping.record and self._backend == "numba"

    @property
    def _backend(self) -> str:
        """What steps the plant: a model that follows the azimuth takes numpy, whatever was asked for."""
        return chosen_backend(self.settings.backend) if isinstance(self.plant, LinearPlant) else "numpy"

    def get_ready(self) -> None:
        """Wait now for code that has to be compiled, and not at the first step."""
        if isinstance(self.plant, LinearPlant):
            self.plant.get_ready()

    def own_of(self, turbine: int) -> Array:
        """What sensors add of their own over a turbine's episode, (intervals + 1, S), or of size 0."""
        return self._own[turbine]

    def _prepare(self, lidar: Lidar) -> None:
        """Find when what the lidar measures arrives, and what it sees of the gust.

        Raises
        ------
        ValueError
            If it tells of wind that has passed or is not known yet, or sees a box change that is frozen.
        """
        speed = self.model.wind_speed
        lidar.require_ahead(speed, self.plant.known_ahead, "sensors.lidar")
        if isinstance(self.stepping.surroundings.field, BoxField) and lidar.decay:
            raise ValueError(
                f"sensors.lidar.decay: expected 0 with a box, which is frozen, got {number(lidar.decay)}"
            )
        told = self.action_time * np.arange(self.stepping.intervals + 1, dtype=np.float64)
        self._newest, self._arrival = lidar.schedule(told, speed)
        self._gust_ahead = self.settings.gust_ahead(self.model, lidar, self._arrival)

    def _signals(self, lidar: Lidar, start: Start) -> Array:
        """Its beams and what it makes of them in m episodes, (m, intervals + 1, N + 3) [m/s]."""
        beams = self.plant.upwind(lidar, start, self._arrival) + self._gust_ahead
        return np.concatenate([beams, beams @ lidar.estimator.T], axis=2)[:, self._newest]

    def begin(
        self,
        turbines: IntArray,
        generators: Sequence[np.random.Generator],
        chosen: Sequence[Origin],
    ) -> tuple[np.ndarray, Info]:
        """Start an episode of m turbines, each with randomness from its own generator and with what was `chosen`.

        Returns
        -------
        observation : (m, size) float32
        info : dict
            Of the first sample.
        """
        origins = [
            {"generator": generator.bit_generator.state} | each
            for generator, each in zip(generators, chosen, strict=True)
        ]
        loads = self._reset(turbines, generators, chosen)
        for turbine, origin in zip(turbines, origins, strict=True):
            self._origins[turbine] = origin
        now = self._own[turbines, 0] if self._own.size else None
        return observe(self.scoring, loads.last, now), self.info(loads.last, now)

    def wind_over_disk(self, turbine: int) -> EpisodeWind | None:
        """What blows at a turbine's blades in its episode, made again: no plant keeps it. None without a field."""
        origin, around = self._origins[turbine], self.stepping.surroundings
        if origin is None or around.field is None:
            return None
        start, _ = self._start(np.array([turbine]), [generator_of(fresh(origin["generator"]))], [origin])
        field = self.plant.field(start)
        steady = np.zeros((len(field.radii), AZIMUTHS))
        if around.inflow is not None:
            disk = nameplate(self.model.case).disk
            assert disk is not None  # `Surroundings.require` has seen it
            steady = around.inflow.on_disk(field.radii, azimuths(), disk, self.model.wind_speed)
        gust = self._gust
        samples = self.stepping.intervals * self.stepping.steps_per_action + 1
        return EpisodeWind(
            field=field,
            azimuth=float(start.azimuth[0]),
            turn=self.model.rotor_speed * self.model.time_step,
            time_step=self.model.time_step,
            steps_per_action=self.stepping.steps_per_action,
            steady=steady,
            gust=np.zeros(samples) if gust is None else gust.wind,
            deviation=float(np.hypot(around.field.deviation(self.model.wind_speed), steady.std())),
            parts=parts_of(around, gust is not None),
        )

    def _reset(
        self,
        turbines: IntArray,
        generators: Sequence[np.random.Generator],
        chosen: Sequence[Origin],
    ) -> Loads:
        start, noise = self._start(turbines, generators, chosen)
        loads = self.plant.reset(turbines, start)
        # Of the mean over the rotor, about which loads are linear. At a single strip a field of the standard's class B
        # goes beyond in every episode, and averages out along the blade: a warning that always comes would say nothing.
        strongest = self.plant.strongest_wind[turbines].tolist()
        if max(strongest, default=0.0) > self._linear_limit:
            row = strongest.index(max(strongest))
            drawn = chosen[row]["realisation_seed"] if start.realisation is None else start.realisation[row]
            source = whence(generators[row], drawn)
            warn_beyond(self.model, in_words(self.settings.wind), source, strongest[row])
        blades = self.quantities.blades
        if noise is not None:
            self._own[turbines, :, :blades] = noise[:, :, :blades]
        if self._lidar is not None:
            self._own[turbines, :, blades:] = self._signals(self._lidar, start)
        # Before an episode the moments are taken to have been those of its first sample.
        self._past[turbines] = loads.last[:, None, self.quantities.last["rbm"]]
        return loads

    def step(self, actions: ArrayLike) -> tuple[np.ndarray, Array, BoolArray, BoolArray, Info]:
        """Advance every turbine by one action (n, blades A).

        Turbines whose episode is over are advanced too: what is returned for them has no meaning.
        """
        observation, loads = self.advance(actions)
        reward, of_moments, of_angles, of_tower = rewards(self.scoring, loads)
        info = self.info(loads.last, self._own_now())
        info["rbm_mean_square"] = loads.rbm_square
        info["reward_rbm"], info["reward_flap_angle"], info["reward_tower"] = of_moments, of_angles, of_tower
        if self.settings.record_samples:
            info["samples"] = {
                name: loads.samples.take(columns, axis=2) for name, columns in self.sampled.items()
            }
        return observation, reward, ~np.isfinite(reward), self.over, info

    def advance(self, actions: ArrayLike) -> tuple[np.ndarray, Loads]:
        """The same without reward and info: the observation, and all that the plant tells."""
        values = numbers(actions, self._actions)
        refuse_not_finite(values, blades=self.quantities.blades, flaps=self.quantities.flaps)
        loads = self.plant.step(values)
        return observe(self.scoring, self._as_measured(loads), self._own_now()), loads

    def _own_now(self) -> Array | None:
        """The sensors' own numbers now, (n, S); None without any."""
        if not self._own.size:
            return None
        return np.asarray(
            self._own[np.arange(self.count), np.minimum(self.plant.elapsed, self.stepping.intervals)]
        )

    @property
    def over(self) -> BoolArray:
        """Whether each turbine's episode has reached its end."""
        return self.plant.elapsed >= self.stepping.intervals

    def _as_measured(self, loads: Loads) -> Array:
        """The plant's numbers with the moments as late as the sensors are."""
        if not self._delay:
            return loads.last
        moments = loads.samples[:, :, self.quantities.sample["rbm"]]
        seen = np.concatenate([self._past, moments], axis=1)
        self._past = seen[:, -self._delay :]
        late = loads.last.copy()
        late[:, self.quantities.last["rbm"]] = seen[:, -self._delay - 1]
        return late

    def info(self, last: Array, own: Array | None) -> Info:
        """SI quantities of the last sample, for n turbines; copies, because a view would keep all numbers alive.

        Parameters
        ----------
        last : (n, size) float
            Of the plant.
        own : (n, S) float or None
            Of the sensors, if there is any.
        """
        told: Info = {name: last.take(columns, axis=1) for name, columns in self._told.items()}
        if own is not None:
            told |= {name: own.take(columns, axis=1) for name, columns in self._sensed.items()}
        for name in ("flap_stopped", "pitch_stopped")[: 1 + self.quantities.pitch]:
            told[name] = told[name] != 0.0
        if self.settings.full_info and self.stepping.surroundings.steady:
            told["rbm_steady"] = self.steady(told["azimuth"])["rbm"]
        return told

    def flap_motion(self) -> tuple[Array, Array]:
        """Angle and rate of every flap, (n, blades F) each [rad, rad/s]."""
        return self.plant.flap_motion()

    def steady(self, azimuth: Array) -> dict[str, Array]:
        """What steady inflow and gravity do to the outputs computed, see `Plant.steady`; empty without them."""
        if not self.stepping.surroundings.steady:
            return {}
        return self.plant.steady(azimuth)

    def get_state(self) -> dict[str, Any]:
        """The state of all turbines as plain values for JSON."""
        return {
            "made_by": self.made_by,
            "turbines": [self.turbine_state(turbine) for turbine in range(self.count)],
        }

    @property
    def made_by(self) -> dict[str, Any]:
        """What two environments must share for a state of one to mean the same to the other, as plain values."""
        made_by: dict[str, Any] = json.loads(self._made_by)
        return made_by

    def read_state(self, state: Mapping[str, Any], further: Mapping[str, Reader]) -> dict[str, Any]:
        """A state of the same model and settings, checked whole; nothing is changed.

        Parameters
        ----------
        state : mapping
            Of `get_state`, with what the environment has put beside.
        further : mapping
            Names of that, and what reads each: one environment's state is not that of a vector of one.

        Returns
        -------
        dict
            That, read, and "turbines" for `go_on`.

        Raises
        ------
        ValueError
            If the state is another environment's or damaged.
        """
        check_made_by(state, self.made_by)
        readers = {**further, "turbines": self._read_turbines}
        return {name: read_entry(state, name, reader) for name, reader in readers.items()}

    def go_on(self, episodes: Sequence[Episode | None]) -> list[tuple[Info | None, int]]:
        """Go on from the turbines of a state that was read, bit for bit.

        Returns
        -------
        list of (dict or None, int)
            Of each turbine what a picture can show before the next step, flap angles and azimuth, and the actions since
            its reset.
        """
        return [self.resume(turbine, episode) for turbine, episode in enumerate(episodes)]

    def resume(self, turbine: int, episode: Episode | None) -> tuple[Info | None, int]:
        """The same for one of them."""
        self._origins[turbine] = None if episode is None else episode.origin
        if episode is None:
            return None, 0
        # The realisation is drawn again; what became of the turbine in it is taken from the state.
        loads = self._reset(np.array([turbine]), [episode.generator], [episode.origin])
        self.plant.set_state(turbine, episode.plant)
        if self._delay:
            self._past[turbine] = episode.plant["past"]
        elapsed = episode.plant["elapsed"]
        of_flaps = self.quantities.blades * self.quantities.flaps
        now: Info = {"flap_angle": episode.plant["flaps"][0][:of_flaps]}
        if self.quantities.blades == BLADES:
            start = loads.last[0, self.quantities.last["azimuth"].start]
            now["azimuth"] = float(start + self.model.rotor_speed * self.action_time * elapsed)
        return now, elapsed

    def _plant_state(self, turbine: int) -> dict[str, Any]:
        late = {"past": self._past[turbine].tolist()} if self._delay else {}
        return self.plant.get_state(turbine) | late

    def turbine_state(self, turbine: int) -> dict[str, Any] | None:
        """The state of one turbine as plain values; None where no episode has begun."""
        origin = self._origins[turbine]
        return None if origin is None else {"origin": fresh(origin), "plant": self._plant_state(turbine)}

    def _read_turbines(self, entries: Sequence[Mapping[str, Any] | None]) -> list[Episode | None]:
        """What every turbine goes on from; None where no episode has begun."""
        if len(entries) != self.count:
            raise ValueError(f"expected {self.count} turbines, got {len(entries)}")
        episodes = list[Episode | None]()
        for turbine, entry in enumerate(entries):
            try:
                episodes.append(None if entry is None else self.read_episode(entry))
            except DAMAGE as error:
                raise ValueError(f"turbine {turbine}: {reason(error)}") from None
        return episodes

    def read_episode(self, entry: Mapping[str, Any]) -> Episode:
        """What is in a turbine's state, unless it is damaged; its origin is under the rules of a reset's options."""
        origin = entry["origin"]
        given = {name: origin[name] for name in RESET_OPTIONS if origin[name] is not None}
        (chosen,) = self.chosen(np.zeros(1, dtype=np.int64), given)
        generator = generator_of(origin["generator"])
        return Episode(
            {"generator": generator_state(generator), **chosen},
            generator,
            checked_state(entry["plant"], self._entries, self.model, self.stepping),
        )

    def _identity(self) -> dict[str, Any]:
        """What two environments must share for a state of one to mean the same to the other."""
        settings = {
            field.name: to_plain(getattr(self.settings, field.name))
            for field in dataclasses.fields(self.settings)
            if field.name not in ("model", "backend", "wind")
        }
        wind = to_plain(dataclasses.replace(self.settings.wind, gust=None))
        box = self.stepping.surroundings.field
        return {
            "model": self.plant.fingerprint,
            # Two backends agree to round-off, not bit for bit.
            "backend": self._backend,
            "num_envs": self.count,
            # The wind itself: a recording may have changed under its name, or have another.
            "gust": None
            if self._gust is None
            else fingerprint([self._gust.wind], np.ravel(self._gust.before))[:16],
            "wind": wind,
            **({"box": box.fingerprint} if isinstance(box, BoxField) else {}),
            **settings,
        }

    def chosen(self, turbines: IntArray, options: Mapping[str, Any] | None = None) -> list[Origin]:
        """The reset options of each of m turbines as plain values; what is left to chance is None.

        Raises
        ------
        ValueError
            If an option is unknown or impossible. Nothing has changed yet: no generator, no turbine.
        """
        return self.chosen_among(self.intensity, turbines, options)

    def chosen_among(
        self, intensity: Array, turbines: IntArray, options: Mapping[str, Any] | None = None
    ) -> list[Origin]:
        """The same for n turbines of which these are but some: the turbulence intensities (n,) say how many."""
        n, blades = len(intensity), self.quantities.blades
        options = {} if options is None else options
        if not isinstance(options, Mapping):
            raise ValueError(f"options: expected a dict of {', '.join(RESET_OPTIONS)}, got {shown(options)}")
        for name in options:
            if name not in RESET_OPTIONS:
                raise ValueError(f"options: no {shown(name)}; known: {', '.join(RESET_OPTIONS)}")
        flaps = blades * self.quantities.flaps
        limits = self.stepping.limits(self.model)
        moving = dict(zip(MOTION, limits[:, :flaps], strict=True))
        if self.quantities.pitch:
            moving |= dict(zip(PITCH_MOTION, limits[:, flaps:], strict=True))
        for name in PITCH_MOTION:
            if name in options and name not in moving:
                raise ValueError(
                    f"options.{name}: expected none without pitch=True, got {shown(options[name])}"
                )
        motion = {name: _option(options, name, (n, limit.size), limit) for name, limit in moving.items()}
        azimuth = _option(options, "azimuth", (n,)) if "azimuth" in options else None
        around = self.stepping.surroundings
        if azimuth is not None and around.turns and self.stepping.pool:
            raise ValueError(
                "options.azimuth: expected none where realisations of a pool depend on it, each begins at its own"
            )
        if "turbulence_intensity" in options and around.field is not None:
            raise ValueError(
                "options.turbulence_intensity: expected none beside wind.field, which has its own"
            )
        if "turbulence_intensity" in options:
            intensity = _option(options, "turbulence_intensity", (n,))
            if intensity.min() < 0.0 or intensity.max() >= 1.0:
                given = options["turbulence_intensity"]
                raise ValueError(f"options.turbulence_intensity: expected {FRACTION}, got {shown(given)}")
        seeds = _seeds(options, n, self.stepping.pool)
        return [
            {
                "realisation_seed": None if seeds is None else seeds[turbine],
                "azimuth": None if azimuth is None else float(azimuth[turbine]),
                **{
                    name: motion[name][turbine].tolist() if name in motion else None
                    for name in (*MOTION, *PITCH_MOTION)
                },
                # A field knows how strong it is.
                "turbulence_intensity": None if around.field is not None else float(intensity[turbine]),
            }
            for turbine in turbines
        ]

    def _start(
        self,
        turbines: IntArray,
        generators: Sequence[np.random.Generator],
        chosen: Sequence[Origin],
    ) -> tuple[Start, Array | None]:
        """How m episodes begin: what was chosen, and for the rest draws from each one's generator; sensors' noise."""
        m, pool = len(turbines), self.stepping.pool
        azimuth = np.empty(m)
        noise = None if pool else np.empty((m, self.plant.noise_count))
        realisation = np.empty(m, dtype=np.int64) if pool else None
        level = self.settings.sensors.noise
        # Three a sample for a single blade, too: the same seed, the same draws.
        measured = np.empty((m, self.stepping.intervals + 1, BLADES)) if level else None
        for row, (generator, each) in enumerate(zip(generators, chosen, strict=True)):
            drawn, seed = generator.uniform(0.0, 2.0 * np.pi), each["realisation_seed"]
            azimuth[row] = drawn if each["azimuth"] is None else each["azimuth"]
            if realisation is not None:
                realisation[row] = generator.integers(pool) if seed is None else seed
                if self.stepping.surroundings.turns:
                    azimuth[row] = realisation_azimuth(realisation[row])
            if noise is not None:
                source = generator if seed is None else np.random.default_rng(seed)
                source.standard_normal(out=noise[row])
            if measured is not None:
                generator.standard_normal(out=measured[row])
                measured[row] *= level
        start = Start(
            azimuth=azimuth,
            angle=np.array([[*each["flap_angle"], *(each["pitch_angle"] or ())] for each in chosen]),
            rate=np.array([[*each["flap_rate"], *(each["pitch_rate"] or ())] for each in chosen]),
            intensity=np.array([each["turbulence_intensity"] or 0.0 for each in chosen]),
            noise=noise,
            realisation=realisation,
            gust=self._gust,
        )
        return start, measured


def check_made_by(state: object, own: Mapping[str, Any]) -> None:
    """Refuse what is no state, or that of an environment which differs in something that matters."""
    if not isinstance(state, Mapping) or not isinstance(state.get("made_by"), Mapping):
        raise ValueError("state: expected what get_state of such an environment returned")
    for name, value in own.items():
        there = state["made_by"].get(name)
        if there != value:
            raise ValueError(
                f"state: made by an environment with {name} {shown(there)}, this one has {shown(value)}"
            )


def with_blade_rms(model: TurbineModel) -> TurbineModel:
    """The model with the root moment's open-loop rms of its clamped blade in place of the turbine's."""
    shaping = von_karman_filter(
        model.wind_speed, model.turbulence_intensity, model.length_scale, model.time_step
    )
    joint = series(shaping, model.blade.select(["wind"], ["rbm"]))
    return dataclasses.replace(model, rbm_rms=float(output_rms(joint)[0]))


def places_sensed(blades: int, lidar: Lidar | None) -> dict[str, slice]:
    """Where what no plant tells stands among the sensors' own numbers, behind the moments' noise."""
    if lidar is None:
        return {}
    last = blades + lidar.beams
    return {"lidar_beams": slice(blades, last), "lidar": slice(last, last + ESTIMATES)}


def columns_of(quantities: Quantities, places: Mapping[str, slice]) -> dict[str, IntArray | int]:
    """Columns by name: several where there is a number for each blade or flap, or just one."""
    one = {*quantities.fixed_outputs, "wind", "azimuth"}
    return {
        name: place.start if name in one else np.arange(place.start, place.stop)
        for name, place in places.items()
    }


def columns_told(quantities: Quantities) -> dict[str, IntArray | int]:
    """Columns of a turbine's last numbers by the names under which `info` tells them."""
    columns = columns_of(quantities, quantities.last)
    del columns["heading"]
    columns["wind_perturbation"] = columns.pop("wind")
    if quantities.blades == BLADES:
        columns["tower_top"] = np.array([columns.pop(name) for name in TOWER_TOP])
    else:
        del columns["azimuth"]
    return columns


def _option(
    options: Mapping[str, Any], name: str, shape: tuple[int, ...], limit: Array | float = np.inf
) -> Array:
    """A reset option as an array of the shape wanted; zero if it is not given."""
    if name not in options:
        return np.zeros(shape)
    try:
        given = np.asarray(options[name])
        if given.dtype.kind not in "iuf":
            raise TypeError
        value = np.broadcast_to(given, shape).astype(float)
    except UNREADABLE:
        raise ValueError(
            f"options.{name}: expected numbers that fit shape {shape}, got {shown(options[name])}"
        ) from None
    if not np.isfinite(value).all() or np.any(np.abs(value) > limit * (1.0 + 1e-9)):
        most = number(float(np.max(limit)))
        raise ValueError(
            f"options.{name}: expected finite numbers within +-{most}, got {shown(options[name])}"
        )
    return np.clip(value, -limit, limit)


def _seeds(options: Mapping[str, Any], n: int, pool: int) -> list[int] | None:
    """Seeds of the realisations, one a turbine; None leaves them to the environment's generator."""
    given = options.get("realisation_seed")
    if given is None:
        return None
    try:
        seeds = np.asarray(given)
    except UNREADABLE:
        seeds = np.empty(0)
    if seeds.dtype.kind not in "iu" or seeds.shape not in ((), (n,)) or seeds.min() < 0:
        raise ValueError(
            f"options.realisation_seed: expected one non-negative whole number, or one for each of {n} environments, "
            f"got {shown(given)}"
        )
    if pool and seeds.max() >= pool:
        raise ValueError(
            f"options.realisation_seed: the pool holds the realisations of seeds 0 to {pool - 1}, got {shown(given)}"
        )
    return np.broadcast_to(seeds, (n,)).tolist()


def _plain(value: Any) -> Any:
    """What JSON does not know: numbers and arrays of numpy, paths."""
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else str(value)
