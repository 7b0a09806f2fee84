"""What one and many environments share: n turbines, their settings and their randomness."""

from __future__ import annotations

import dataclasses
import json
import operator
from collections.abc import Callable, Mapping, Sequence
from numbers import Real
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from numpy.typing import ArrayLike, NDArray

from flapgym.core.arrays import BLADES, Array
from flapgym.core.state_space import series
from flapgym.core.wording import number, shown
from flapgym.envs.observation import DISPLACEMENTS, bound_of, task_of
from flapgym.envs.settings import FRACTION, Settings
from flapgym.model.turbine_model import TurbineModel
from flapgym.plant import Setup, Start, layout, make_plant
from flapgym.plant.delayed import DelayedPlant
from flapgym.plant.kernel import fingerprint
from flapgym.plant.states import checked_state, checked_whole
from flapgym.reduction import output_rms
from flapgym.wind import von_karman_filter

FLOAT32, FLOAT64 = np.dtype(np.float32), np.dtype(np.float64)
BIT_GENERATORS = ("MT19937", "PCG64", "PCG64DXSM", "Philox", "SFC64")
BUFFERS = {"pos": 624, "buffer_pos": 4}
"""What a generator's place in its own numbers is called, and the last one."""
UNREADABLE = (TypeError, ValueError, OverflowError, RuntimeError)
"""What others' arrays raise that NumPy cannot read: ragged, too large, or a tensor that keeps gradients."""
RESET_OPTIONS = ("realisation_seed", "azimuth", "flap_angle", "flap_rate", "turbulence_intensity")

Info = dict[str, Any]
Origin = dict[str, Any]
"""Where an episode comes from: the generator's state before its draws, and the options of the reset."""
Reader = Callable[[Any], Any]
"""Makes of a state's entry what it stands for, or raises one of these errors."""
_DAMAGE = (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError)


class Episode(NamedTuple):
    """What a turbine goes on from.

    Attributes
    ----------
    origin : Origin
    generator : Generator
        As it was before the draws of the episode's start.
    plant : dict
        Of `flapgym.plant.states.checked_state`.
    """

    origin: Origin
    generator: np.random.Generator
    plant: dict[str, Any]


class Fleet:
    """n turbines under one set of settings. Everything it returns has a leading axis of turbines and is fresh.

    Parameters
    ----------
    settings : Settings
    count : int
        Number of turbines n.
    single_blade : bool
        The clamped single blade in place of each turbine.
    full_info : bool
        Whether tip deflection and tower are told beside what is observed.
    """

    def __init__(
        self, settings: Settings, count: int, single_blade: bool = False, full_info: bool = True
    ) -> None:
        self.settings, self.count = settings, count
        self.model = settings.turbine_model()
        if single_blade:
            settings.check_single_blade()
            self.model = with_blade_rms(self.model)
        self.setup = Setup(
            steps_per_action=settings.steps_per_action,
            intervals=settings.intervals(self.model.time_step),
            length_scale=self.model.length_scale if settings.length_scale is None else settings.length_scale,
            # A late moment is looked up among the samples.
            every_sample=settings.record_samples
            or settings.tower_weight > 0.0
            or settings.sensor_delay > 0.0,
            displacements=full_info or not DISPLACEMENTS.isdisjoint(settings.observe),
            faults=settings.faults(self.model),
            single_blade=single_blade,
            precision=settings.precision,
            kernel=settings.kernel,
            pool=settings.realisation_pool,
            delay=settings.delay(self.model.time_step),
        )
        self.task = task_of(
            settings.observe,
            self.model,
            self.setup.blades,
            settings.flap_angle_weight,
            settings.tower_weight,
        )
        self.intensity = settings.intensities(count, self.model)
        # Kept, because a plant computes the response to a gust it has met before only once.
        self._gust = settings.given_wind(self.model)
        self.plant = make_plant(self.model, count, self.setup, self.task)
        # Once, and as a text, of which every state has a copy of its own.
        self._made_by = json.dumps(self._identity(), default=_plain)
        self._entries = self.plant.get_state(0)
        """Names and shapes of what a turbine's state holds."""
        bound = bound_of(self.task)
        self.observation_space = gymnasium.spaces.Box(-bound, bound, dtype=np.float32)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (self.setup.blades,), dtype=np.float32)
        self._origins: list[Origin | None] = [None] * count

    @property
    def action_time(self) -> float:
        """Time for which an action is held [s]."""
        return self.setup.steps_per_action * self.model.time_step

    def begin(
        self,
        turbines: NDArray[np.int64],
        generators: Sequence[np.random.Generator],
        chosen: Sequence[Origin],
    ) -> tuple[NDArray[np.float32], Array]:
        """Start an episode of m turbines, each with randomness from its own generator and with what was `chosen`.

        Returns
        -------
        observation : (m, size) float32
        rows : (m, ROW) float
            Of the first sample (flapgym.plant.layout).
        """
        origins = [
            {"generator": generator.bit_generator.state} | each
            for generator, each in zip(generators, chosen, strict=True)
        ]
        observation, rows = self.plant.reset(turbines, self._start(turbines, generators, chosen))
        for turbine, origin in zip(turbines, origins, strict=True):
            self._origins[turbine] = origin
        return observation, rows

    def step(
        self, actions: ArrayLike
    ) -> tuple[NDArray[np.float32], Array, NDArray[np.bool_], NDArray[np.bool_], Info]:
        """Advance every turbine by one action (n, blades).

        Turbines whose episode is over are advanced too: what is returned for them has no meaning.
        """
        n, setup = self.count, self.setup
        values = numbers(actions, (n, setup.blades))
        observation, rows = np.empty((n, self.task.size), np.float32), np.empty((n, layout.ROW))
        samples = self.samples()
        status = self.plant.step(values.reshape(-1), observation.reshape(-1), rows.reshape(-1), samples)
        if status < 0:
            raise refusal(values, status, setup.blades)
        reward = rows[:, layout.REWARD].copy()
        terminated = ~np.isfinite(reward) if status & 1 else np.zeros(n, dtype=bool)
        truncated = self.plant.elapsed >= setup.intervals if status & 2 else np.zeros(n, dtype=bool)
        info = state_info(rows, setup.blades) | further_info(rows, setup.blades)
        if samples is not None:
            info["samples"] = sample_info(samples, setup.blades)
        return observation, reward, terminated, truncated, info

    def samples(self) -> Array | None:
        """Room for the plant samples of a step; none if they are not wanted."""
        if not self.settings.record_samples:
            return None
        return np.empty((self.count, self.setup.steps_per_action, layout.SAMPLE))

    def get_state(self) -> dict[str, Any]:
        """The state of all turbines as plain values for JSON."""
        return {
            "made_by": json.loads(self._made_by),
            "turbines": self._turbines(),
        }

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
        if not isinstance(state, Mapping) or not isinstance(state.get("made_by"), Mapping):
            raise ValueError("state: expected what get_state of such an environment returned")
        readers = {**further, "turbines": self._read_turbines}
        made_by = state["made_by"]
        for name, own in json.loads(self._made_by).items():
            if made_by.get(name) != own:
                raise ValueError(
                    f"state: made by an environment with {name} {shown(made_by.get(name))}, this one has {shown(own)}"
                )
        return {name: read_entry(state, name, reader) for name, reader in readers.items()}

    def go_on(self, episodes: Sequence[Episode | None]) -> list[tuple[Info | None, int]]:
        """Go on from the turbines of a state that was read, bit for bit.

        Returns
        -------
        list of (dict or None, int)
            Of each turbine what a picture can show before the next step, flap angles and azimuth, and the actions since
            its reset.
        """
        instants: list[tuple[Info | None, int]] = [(None, 0)] * self.count
        for turbine, episode in enumerate(episodes):
            self._origins[turbine] = None if episode is None else episode.origin
            if episode is None:
                continue
            which = np.array([turbine])
            start = self._start(which, [episode.generator], [episode.origin])
            self.plant.reset(which, start)
            self.plant.set_state(turbine, episode.plant)
            elapsed = episode.plant["elapsed"]
            now: Info = {"flap_angle": episode.plant["flaps"][0]}
            if self.setup.blades == BLADES:
                now["azimuth"] = float(start.azimuth[0] + self.model.rotor_speed * self.action_time * elapsed)
            instants[turbine] = now, elapsed
        return instants

    def _turbines(self) -> list[dict[str, Any] | None]:
        return [
            None if origin is None else {"origin": _fresh(origin), "plant": self.plant.get_state(turbine)}
            for turbine, origin in enumerate(self._origins)
        ]

    def _read_turbines(self, entries: Sequence[Mapping[str, Any] | None]) -> list[Episode | None]:
        """What every turbine goes on from; None where no episode has begun."""
        if len(entries) != self.count:
            raise ValueError(f"expected {self.count} turbines, got {len(entries)}")
        episodes = list[Episode | None]()
        for turbine, entry in enumerate(entries):
            try:
                episodes.append(None if entry is None else self._read_episode(entry))
            except _DAMAGE as error:
                raise ValueError(f"turbine {turbine}: {_reason(error)}") from None
        return episodes

    def _read_episode(self, entry: Mapping[str, Any]) -> Episode:
        """A turbine's entry; its origin is under the rules of a reset's options."""
        origin = entry["origin"]
        given = {name: origin[name] for name in RESET_OPTIONS if origin[name] is not None}
        (chosen,) = self.chosen(np.zeros(1, dtype=np.int64), given)
        generator = generator_of(origin["generator"])
        return Episode(
            {"generator": generator_state(generator), **chosen},
            generator,
            checked_state(entry["plant"], self._entries, self.model, self.setup),
        )

    def _identity(self) -> dict[str, Any]:
        """What two environments must share for a state of one to mean the same to the other."""
        settings = {
            field.name: getattr(self.settings, field.name)
            for field in dataclasses.fields(self.settings)
            if field.name not in ("model", "kernel", "gust")
        }
        return {
            "model": self.plant.fingerprint,
            "kernel": type(self.plant.plant if isinstance(self.plant, DelayedPlant) else self.plant).__name__,
            "num_envs": self.count,
            # The wind itself: a recording may have changed under its name, or have another.
            "gust": None if self._gust is None else fingerprint([self._gust.wind], [self._gust.before])[:16],
            **settings,
        }

    def chosen(self, turbines: NDArray[np.int64], options: Mapping[str, Any] | None = None) -> list[Origin]:
        """The reset options of each of m turbines as plain values; what is left to chance is None.

        Raises
        ------
        ValueError
            If an option is unknown or impossible. Nothing has changed yet: no generator, no turbine.
        """
        n, model = self.count, self.model
        options = {} if options is None else options
        if not isinstance(options, Mapping):
            raise ValueError(f"options: expected a dict of {', '.join(RESET_OPTIONS)}, got {shown(options)}")
        for name in options:
            if name not in RESET_OPTIONS:
                raise ValueError(f"options: no {shown(name)}; known: {', '.join(RESET_OPTIONS)}")
        angle = _option(options, "flap_angle", (n, BLADES), model.flap_angle_limit)
        rate = _option(options, "flap_rate", (n, BLADES), model.flap_rate_limit)
        azimuth = _option(options, "azimuth", (n,)) if "azimuth" in options else None
        intensity = self.intensity
        if "turbulence_intensity" in options:
            intensity = _option(options, "turbulence_intensity", (n,))
            if intensity.min() < 0.0 or intensity.max() >= 1.0:
                given = options["turbulence_intensity"]
                raise ValueError(f"options.turbulence_intensity: expected {FRACTION}, got {shown(given)}")
        seeds = _seeds(options, n, self.setup.pool)
        return [
            {
                "realisation_seed": None if seeds is None else seeds[turbine],
                "azimuth": None if azimuth is None else float(azimuth[turbine]),
                "flap_angle": angle[turbine].tolist(),
                "flap_rate": rate[turbine].tolist(),
                "turbulence_intensity": float(intensity[turbine]),
            }
            for turbine in turbines
        ]

    def _start(
        self,
        turbines: NDArray[np.int64],
        generators: Sequence[np.random.Generator],
        chosen: Sequence[Origin],
    ) -> Start:
        """How m episodes begin: what was chosen, and for the rest draws from each one's generator."""
        m, settings, pool = len(turbines), self.settings, self.setup.pool
        azimuth = np.empty(m)
        noise = None if pool else np.empty((m, self.plant.noise_count))
        realisation = np.empty(m, dtype=np.int64) if pool else None
        measured = np.empty((m, self.setup.intervals + 1, BLADES)) if settings.measurement_noise else None
        for row, (generator, each) in enumerate(zip(generators, chosen, strict=True)):
            drawn, seed = generator.uniform(0.0, 2.0 * np.pi), each["realisation_seed"]
            azimuth[row] = drawn if each["azimuth"] is None else each["azimuth"]
            if realisation is not None:
                realisation[row] = generator.integers(pool) if seed is None else seed
            if noise is not None:
                source = generator if seed is None else np.random.default_rng(seed)
                source.standard_normal(out=noise[row])
            if measured is not None:
                generator.standard_normal(out=measured[row])
                measured[row] *= settings.measurement_noise
        return Start(
            azimuth=azimuth,
            flap_angle=np.array([each["flap_angle"] for each in chosen]),
            flap_rate=np.array([each["flap_rate"] for each in chosen]),
            intensity=np.array([each["turbulence_intensity"] for each in chosen]),
            noise=noise,
            realisation=realisation,
            measurement_noise=measured,
            gust=self._gust,
        )


def with_blade_rms(model: TurbineModel) -> TurbineModel:
    """The model with the root moment's open-loop rms of its clamped blade in place of the turbine's."""
    shaping = von_karman_filter(
        model.wind_speed, model.turbulence_intensity, model.length_scale, model.time_step
    )
    joint = series(shaping, model.blade.select(["wind"], ["rbm"]))
    return dataclasses.replace(model, rbm_rms=float(output_rms(joint)[0]))


def numbers(actions: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float32] | Array:
    """Actions as contiguous floats of the right shape, or an error that says what is wrong with them."""
    if actions.__class__ is np.ndarray and (actions.dtype is FLOAT32 or actions.dtype is FLOAT64):
        values: NDArray[np.float32] | Array = actions.copy()
    else:
        try:
            values = _as_floats(actions)
        except UNREADABLE:
            raise ValueError(
                f"action: expected real numbers of shape {shape}, got {shown(actions)}"
            ) from None
    if values.shape != shape:
        raise ValueError(f"action: expected shape {shape}, got {values.shape}")
    return values


def _as_floats(actions: ArrayLike) -> NDArray[np.float32] | Array:
    """Whatever holds real numbers, each of them; else one of the errors above."""
    given = np.asarray(actions)
    if not (given.dtype.kind in "iufb" or (given.dtype.kind == "O" and _all_real(given))):
        raise TypeError
    if isinstance(actions, np.ma.MaskedArray) and np.ma.is_masked(actions):
        raise TypeError
    # Copied into an array of NumPy's own type: one that was pickled, as on its way to another process, has a type that
    # equals it and is another object.
    values = np.empty(given.shape, FLOAT32 if given.dtype == FLOAT32 else FLOAT64)
    if given.dtype.itemsize > FLOAT64.itemsize:
        with np.errstate(over="ignore"):  # what no double holds becomes infinite, which the plant refuses
            given = given.astype(FLOAT64)
    values[...] = given
    return values


def _all_real(given: NDArray[np.object_]) -> bool:
    return all(isinstance(each, Real) for each in given.flat)


def refusal(values: NDArray[np.float32] | Array, status: int, blades: int) -> ValueError:
    """The error for actions of the right shape that a plant did not take."""
    environment, blade = divmod(-2 - status, blades)
    return ValueError(
        f"action: expected finite numbers in [-1, 1], got {values.ravel()[-2 - status]} for blade {blade + 1}"
        + (f" of environment {environment}" if values.ndim > 1 and len(values) > 1 else "")
    )


def generator_state(generator: np.random.Generator) -> dict[str, Any]:
    """A generator's state as plain values: some kinds of generator keep arrays."""
    return _fresh(generator.bit_generator.state)


def _fresh(value: Any) -> Any:
    """A copy of nested plain values, with lists for arrays."""
    if isinstance(value, dict):
        return {name: _fresh(entry) for name, entry in value.items()}
    if isinstance(value, list):
        return list(value)
    return value.tolist() if isinstance(value, np.ndarray) else value


def generator_of(state: Mapping[str, Any]) -> np.random.Generator:
    """A generator in such a state, of a kind that NumPy has."""
    kind = state["bit_generator"]
    if kind not in BIT_GENERATORS:
        raise ValueError(f"bit_generator: expected one of {', '.join(BIT_GENERATORS)}, got {shown(kind)}")
    bits = getattr(np.random, kind)()
    bits.state = _like(bits.state, state)
    return np.random.Generator(bits)


def _like(own: Any, given: Any, name: str = "generator") -> Any:
    """An entry of a generator's state, with arrays where its own has some; NumPy trusts the places in them."""
    if isinstance(own, dict):
        return {name: _like(value, given[name], name) for name, value in own.items()}
    if name in BUFFERS:
        return checked_whole(name, given, BUFFERS[name])
    if isinstance(own, np.ndarray):
        if len(given) != own.size or not all(type(each) is int for each in given):
            raise ValueError(f"{name}: expected {own.size} whole numbers, got {shown(given)}")
        return np.array(given, dtype=own.dtype)
    if type(given) is not type(own):
        raise ValueError(f"{name}: expected {type(own).__name__}, got {shown(given)}")
    return given


def read_entry(state: Mapping[str, Any], name: str, reader: Reader) -> Any:
    """An entry of a state, read; whatever is wrong with it, the error names it."""
    if not isinstance(state, Mapping) or name not in state:
        raise ValueError(f"state: expected what get_state of such an environment returned, it has no {name}")
    try:
        return reader(state[name])
    except _DAMAGE as error:
        raise ValueError(f"state: {name}: damaged ({_reason(error)}); take it from get_state") from None


def _reason(error: Exception) -> str:
    return str(error) if isinstance(error, ValueError) else f"{type(error).__name__}: {error}"


def each_of(count: int, reader: Reader) -> Reader:
    """Reads a list of one entry an environment."""

    def read(entries: Any) -> list[Any]:
        if not isinstance(entries, (list, tuple)) or len(entries) != count:
            raise ValueError(f"expected a list of {count}, got {shown(entries)}")
        return [reader(entry) for entry in entries]

    return read


def true_or_false(given: Any) -> bool:
    """A truth value of a state."""
    if not isinstance(given, (bool, np.bool_)):
        raise ValueError(f"expected True or False, got {shown(given)}")
    return bool(given)


def whole_seed(given: Any) -> int:
    """A seed, whichever library's whole number it is."""
    try:
        seed = -1 if isinstance(given, (bool, np.bool_)) else operator.index(given)
    except TypeError:
        seed = -1
    if seed < 0:
        raise ValueError(f"seed: expected a whole number of at least 0, got {shown(given)}")
    return seed


def seed_number(given: Any) -> int:
    """A seed of a state; -1 stands for a generator that was set."""
    if isinstance(given, bool) or not isinstance(given, (int, np.integer)) or given < -1:
        raise ValueError(f"expected a whole number, got {shown(given)}")
    return int(given)


def state_info(rows: Array, blades: int) -> Info:
    """SI quantities of the last sample, for n turbines; copies, because a view would keep all rows alive."""
    info = {
        name: rows[:, column : column + blades].copy()
        for name, column in (
            ("rbm", layout.RBM),
            ("tip_deflection", layout.TIP),
            ("flap_angle", layout.ANGLE),
            ("flap_rate", layout.RATE),
        )
    }
    if blades == BLADES:
        info["tower_top"] = rows[:, layout.TOWER : layout.TOWER + 2].copy()
    info["wind_perturbation"] = rows[:, layout.WIND].copy()
    if blades == BLADES:
        info["azimuth"] = rows[:, layout.AZIMUTH].copy()
    return info | flap_info(rows, blades)


def flap_info(rows: Array, blades: int) -> Info:
    """What became of the flaps since the reset and in the interval."""
    return {
        "flap_travel": rows[:, layout.TRAVEL : layout.TRAVEL + blades].copy(),
        "flap_stopped": rows[:, layout.STOPPED : layout.STOPPED + blades] != 0.0,
    }


def further_info(rows: Array, blades: int) -> Info:
    """Mean square of each moment over the interval and the reward's terms."""
    return {
        "rbm_mean_square": rows[:, layout.MEAN_SQUARE : layout.MEAN_SQUARE + blades].copy(),
        "reward_rbm": rows[:, layout.REWARD_RBM].copy(),
        "reward_flap_angle": rows[:, layout.REWARD_ANGLE].copy(),
        "reward_tower": rows[:, layout.REWARD_TOWER].copy(),
    }


def sample_info(samples: Array, blades: int) -> Info:
    """Every plant sample of the interval, 1 to k."""
    info = {
        name: samples[:, :, column : column + blades].copy()
        for name, column in (
            ("rbm", layout.SAMPLE_RBM),
            ("tip_deflection", layout.SAMPLE_TIP),
            ("flap_angle", layout.SAMPLE_ANGLE),
            ("flap_rate", layout.SAMPLE_RATE),
        )
    }
    if blades == BLADES:
        info["tower_fore_aft"] = samples[:, :, layout.SAMPLE_TOWER].copy()
        info["tower_side_side"] = samples[:, :, layout.SAMPLE_TOWER + 1].copy()
    info["wind"] = samples[:, :, layout.SAMPLE_WIND].copy()
    return info


def _option(options: Mapping[str, Any], name: str, shape: tuple[int, ...], limit: float = np.inf) -> Array:
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
    if not np.isfinite(value).all() or np.abs(value).max() > limit * (1.0 + 1e-9):
        raise ValueError(
            f"options.{name}: expected finite numbers within +-{number(limit)}, got {shown(options[name])}"
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
