"""The native vector environment: n turbines in one set of arrays, with every autoreset mode of Gymnasium."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.error import ResetNeeded
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from flapgym.core.arrays import Array, IntArray
from flapgym.core.wording import number, shown
from flapgym.envs.actions import UNREADABLE, numbers
from flapgym.envs.rendering import SHOWN, Screen
from flapgym.envs.settings import Settings
from flapgym.envs.spec import completed
from flapgym.envs.states import (
    checked_observation,
    each_of,
    generator_of,
    generator_state,
    seed_number,
    true_or_false,
    whole_seed,
)
from flapgym.envs.turbines import Info, Turbines
from flapgym.model.turbine_model import TurbineModel

if TYPE_CHECKING:
    from flapgym.envs.range_turbines import RangeTurbines

Step = tuple[NDArray[np.float32], Array, NDArray[np.bool_], NDArray[np.bool_], Info]
MOST_TURBINES = 1_000_000
"""Beyond, a count is a slip: each takes some hundred kilobytes."""
NO_TURBINES = np.empty(0, dtype=np.int64)


class FlapVectorEnv(VectorEnv[NDArray[np.float32], NDArray[np.float32], Any]):
    """Many turbines at once; task and keywords are those of `FlapEnv`, whose trajectories it gives for the same seeds.

    `gymnasium.make_vec("flapgym/NREL5MW-v1", num_envs=1024)` makes it. Environment i has its own generator:
    `reset(seed=s)` seeds it with s + i, a list gives one seed each. Reset options may be single values or have a
    leading axis of environments. `info` holds one array a name, those of `full_info` always among them, with the mask
    `_name` of Gymnasium beside it, which is locked.

    Parameters
    ----------
    num_envs : int
        Number of turbines.
    autoreset_mode : AutoresetMode or str
        `NEXT_STEP` (default): the step after an episode's end ignores the action and returns the first observation of
        the next. `SAME_STEP`: the ending step returns it, and `info["final_obs"]` and `info["final_info"]` keep the
        last. `DISABLED`: call `reset(options={"reset_mask": mask})`. A spec goes to JSON with the string ("NextStep",
        "SameStep", "Disabled") alone.
    render_mode : str, optional
        `"rgb_array"`: `render` gives a tuple of pictures, one a turbine. A window is `FlapEnv`'s alone.
    **keywords
        Those of `FlapEnv`; `wind={"turbulence_intensity": (0.05, 0.1, ...)}` may have one for each turbine.
    """

    _spec: EnvSpec | None = None

    def __init__(
        self,
        num_envs: int = 1,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        **keywords: Any,
    ) -> None:
        whole = isinstance(num_envs, (int, np.integer)) and not isinstance(num_envs, bool)
        # NumPy's own may be of eight bits, and overflow when counted with.
        num_envs = int(num_envs) if whole else num_envs
        if not whole or not 1 <= num_envs <= MOST_TURBINES:
            raise ValueError(
                f"num_envs: expected a whole number from 1 to {MOST_TURBINES}, got {shown(num_envs)}"
            )
        if not (render_mode is None or (isinstance(render_mode, str) and render_mode == "rgb_array")):
            raise ValueError(
                f'render_mode: expected None or "rgb_array", got {shown(render_mode)}; a window shows a FlapEnv'
            )
        modes = [mode.value for mode in AutoresetMode]
        if not isinstance(autoreset_mode, (str, AutoresetMode)) or autoreset_mode not in (
            *AutoresetMode,
            *modes,
        ):
            raise ValueError(
                f"autoreset_mode: expected one of {', '.join(modes)}, got {shown(autoreset_mode)}"
            )
        self.num_envs = num_envs
        self.render_mode = render_mode
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        # `make_vec` of a specification hands its limit on.
        limit = keywords.pop("max_episode_steps", None)
        try:
            self._turbines = self._made(keywords, num_envs)
        except MemoryError as error:
            raise ValueError(
                f"num_envs: {num_envs} turbines do not fit into memory ({error}); take fewer"
            ) from None
        self.settings = self._turbines.settings
        self._turbines.get_ready()
        if limit is not None and limit != self._turbines.stepping.intervals:
            raise ValueError(
                f"max_episode_steps: expected {self._turbines.stepping.intervals}, the actions of the duration of "
                f"{number(self.settings.duration)} s, or none, got {shown(limit)}; give duration in its place"
            )
        period = self._turbines.action_time
        self.metadata = {
            "render_modes": ["rgb_array"],
            "render_fps": round(1.0 / period),
            "autoreset_mode": self.autoreset_mode,
        }
        self._screens = [
            Screen(self.model, "rgb_array", period, partial(self._turbines.wind_over_disk, turbine))
            for turbine in range(num_envs if render_mode else 0)
        ]
        self.single_observation_space = self._turbines.observation_space
        self.single_action_space = self._turbines.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._generators: list[np.random.Generator] | None = None
        self._seeds: list[int] = []
        self._ended = np.ones(num_envs, dtype=bool)
        self._started = np.zeros(num_envs, dtype=bool)
        self._observation = np.zeros(self.observation_space.shape or (), dtype=np.float32)
        self._everyone = np.ones(num_envs, dtype=bool)

    def _made(self, keywords: dict[str, Any], count: int) -> Turbines | RangeTurbines:
        """The turbines."""
        return Turbines(Settings.of(keywords, type(self).__name__), count)

    @property
    def model(self) -> TurbineModel:
        """The turbine model behind the environments."""
        return self._turbines.model

    @property
    def observed(self) -> dict[str, range]:
        """Where each observed quantity stands in the observation of one environment."""
        return self._turbines.observed

    @property
    def spec(self) -> EnvSpec | None:
        """What makes such an environment again, with the number of actions of an episode."""
        return completed(self._spec, self._turbines.stepping.intervals)

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = spec

    @property  # type: ignore[override]
    def np_random(self) -> tuple[np.random.Generator, ...]:
        """One generator per environment."""
        return tuple(self._seeded(None))

    @np_random.setter  # type: ignore[override]
    def np_random(self, generators: Sequence[np.random.Generator]) -> None:
        if len(generators) != self.num_envs or not all(
            isinstance(each, np.random.Generator) for each in generators
        ):
            raise ValueError(f"np_random: expected {self.num_envs} numpy generators, got {shown(generators)}")
        self._generators, self._seeds = list(generators), [-1] * self.num_envs

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """The seed of each."""
        self._seeded(None)
        return tuple(self._seeds)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], Info]:
        """Begin an episode in every environment; with `options["reset_mask"]` only those begin and take seeds."""
        mask = checked_mask(options, self.num_envs)
        turbines = np.flatnonzero(mask)
        further = {name: value for name, value in (options or {}).items() if name != "reset_mask"}
        chosen = self._turbines.chosen(
            turbines, further
        )  # before the seed, which a refused reset must not take
        generators = self._seeded(seed, mask)
        observation, info = self._turbines.begin(turbines, [generators[index] for index in turbines], chosen)
        self._observation[turbines] = observation
        self._ended[turbines], self._started[turbines] = False, True
        info = _scattered(info, turbines, self.num_envs)
        self._show(info, turbines, turbines)
        return self._observation.copy(), _masked(info, mask.copy())

    def step(self, actions: ArrayLike) -> Step:
        """Advance every environment by one action (num_envs, blades F)."""
        if np.count_nonzero(self._started) < self.num_envs:
            raise ResetNeeded("step: call reset first")
        if self.autoreset_mode is AutoresetMode.NEXT_STEP:
            return self._step_then_reset_next(actions)
        if np.count_nonzero(self._ended):
            raise ResetNeeded('step: an episode has ended; call reset with options={"reset_mask": mask}')
        step = self._turbines.step(actions)
        if self.autoreset_mode is AutoresetMode.SAME_STEP:
            return self._reset_ended(*step)
        observation, reward, terminated, truncated, info = step
        self._ended = terminated | truncated
        self._observation = observation.copy()  # what was returned is the caller's
        self._show(info)
        return observation, reward, terminated, truncated, _masked(info, self._everyone.copy())

    def advance(self, actions: ArrayLike) -> tuple[NDArray[np.float32], Array]:
        """`step` for whoever wants observations and plant samples alone: no reward and no info are made.

        With `record_samples=True` and the autoreset mode "Disabled".

        Returns
        -------
        observation : (num_envs, n) float32
        samples : (num_envs, steps_per_action, size) float
            What `sampled` names, in SI units.
        """
        if np.count_nonzero(self._ended):
            raise ResetNeeded("advance: call reset first, and again once an episode has ended")
        observation, loads = self._turbines.advance(actions)
        self._ended = self._turbines.over
        self._observation = observation.copy()
        return observation, loads.samples

    @property
    def sampled(self) -> dict[str, IntArray | int]:
        """Columns of each quantity of `info["samples"]` among the samples of `advance`."""
        return self._turbines.sampled

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Pictures (height, width, 3) of all turbines in mode `rgb_array`."""
        if self.render_mode is None:
            gymnasium.logger.warn('render: the environment was made without render_mode="rgb_array"')
            return None
        return tuple(screen.picture() for screen in self._screens)

    def get_state(self) -> dict[str, Any]:
        """The whole state as plain values, for pickle or JSON: an environment that takes it goes on bit for bit."""
        return {
            **self._turbines.get_state(),
            "generators": [generator_state(generator) for generator in self._seeded(None)],
            "seeds": list(self._seeds),
            "ended": self._ended.tolist(),
            "started": self._started.tolist(),
            "observation": self._observation.tolist(),
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Go on from a state that an environment of the same model, size and keywords gave.

        Raises
        ------
        ValueError
            If it is another environment's or damaged; nothing is changed then.
        """
        shape = self._observation.shape
        own = self._turbines.read_state(
            state,
            {
                "generators": each_of(self.num_envs, generator_of),
                "seeds": each_of(self.num_envs, seed_number),
                "ended": each_of(self.num_envs, true_or_false),
                "started": each_of(self.num_envs, true_or_false),
                "observation": lambda rows: checked_observation(rows, shape),
            },
        )
        if any(
            started and episode is None
            for started, episode in zip(own["started"], own["turbines"], strict=True)
        ):
            raise ValueError("state: started: damaged (no episode has begun); take it from get_state")
        instants = self._turbines.go_on(own["turbines"])
        for screen, (now, elapsed) in zip(self._screens, instants, strict=False):
            screen.resume(now, elapsed)
        self._generators, self._seeds = own["generators"], own["seeds"]
        self._ended, self._started = np.array(own["ended"]), np.array(own["started"])
        self._observation = own["observation"]

    def _step_then_reset_next(self, actions: ArrayLike) -> Step:
        restart = self._ended.nonzero()[0]
        if restart.size:  # their actions count for nothing, whatever they are
            values = numbers(actions, self.action_space.shape or ())
            values[restart] = 0.0
            actions = values
        observation, reward, terminated, truncated, info = self._turbines.step(actions)
        if restart.size:
            first, first_info = self._begin(restart)
            observation[restart], reward[restart] = first, 0.0
            terminated[restart] = truncated[restart] = False
            _overwrite(info, first_info, restart)
        self._show(info, restart)
        told = _masked(info, self._everyone.copy())
        if restart.size:
            of_steps = {name: info[name] for name in STEP_INFO & info.keys()}
            told |= _masked(of_steps, ~self._ended)
        self._ended = terminated | truncated
        self._observation = observation.copy()
        return observation, reward, terminated, truncated, told

    def _reset_ended(
        self,
        observation: NDArray[np.float32],
        reward: Array,
        terminated: NDArray[np.bool_],
        truncated: NDArray[np.bool_],
        info: Info,
    ) -> Step:
        ended = terminated | truncated
        restart = ended.nonzero()[0]
        final: Info = {}
        if restart.size:
            last = np.full(self.num_envs, None, dtype=object)
            for index in restart:
                last[index] = observation[index].copy()
            final = _masked({"final_obs": last, "final_info": _copied(info)}, ended)
            first, first_info = self._begin(restart)
            observation[restart] = first
            _overwrite(info, first_info, restart)
        self._show(info, restart)
        self._observation = observation.copy()
        return observation, reward, terminated, truncated, _masked(info, self._everyone.copy()) | final

    def flap_motion(self) -> tuple[Array, Array]:
        """Angle and rate of every flap, (num_envs, blades F) each [rad, rad/s]."""
        angle, rate = self._turbines.flap_motion()
        return angle.copy(), rate.copy()

    def steady(self, azimuth: Array) -> dict[str, Array]:
        """What steady inflow and gravity do to each output at azimuths of blade 1 (T,) [rad], flaps at rest.

        By name, in SI units about the mean over a revolution: of the blades' outputs (T, blades), of the fixed ones
        (T,). Of the model's outputs those that are computed, all under `record_samples`. Empty where nothing is steady.
        """
        return self._turbines.steady(azimuth)

    def _show(
        self, info: Info, begun: NDArray[np.int64] = NO_TURBINES, turbines: NDArray[np.int64] | None = None
    ) -> None:
        """Add an instant of all turbines, or of some, to their pictures; those that begin anew forget the past."""
        for index, screen in enumerate(self._screens):
            if index in begun:
                screen.clear()
            if turbines is None or index in turbines:
                screen.record({name: info[name][index].copy() for name in SHOWN if name in info})

    def _begin(self, turbines: NDArray[np.int64]) -> tuple[NDArray[np.float32], Info]:
        generators = self._seeded(None)
        chosen = self._turbines.chosen(turbines)
        return self._turbines.begin(turbines, [generators[index] for index in turbines], chosen)

    def _seeded(
        self, seed: int | Sequence[int | None] | None, mask: NDArray[np.bool_] | None = None
    ) -> list[np.random.Generator]:
        """The generators, made anew where a seed is given to an environment of the mask, and on first use."""
        seeds = self._one_seed_each(seed)
        if self._generators is None or any(each is not None for each in seeds):
            before = self._generators
            pairs = [
                (before[index], self._seeds[index])
                if before is not None and (each is None or (mask is not None and not mask[index]))
                else seeding.np_random(each)
                for index, each in enumerate(seeds)
            ]
            self._generators = [pair[0] for pair in pairs]
            self._seeds = [pair[1] for pair in pairs]
        return self._generators

    def _one_seed_each(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        """A seed for every environment, None where none is given."""
        if seed is None:
            return [None] * self.num_envs
        listed = isinstance(seed, Sequence) and not isinstance(seed, (str, bytes))
        several = listed or (isinstance(seed, np.ndarray) and seed.ndim == 1)
        try:
            if not several:
                first = whole_seed(seed)
                return [first + index for index in range(self.num_envs)]
            each = [None if entry is None else whole_seed(entry) for entry in seed]  # type: ignore[union-attr]
        except ValueError:
            each = []
        if len(each) != self.num_envs:
            raise ValueError(
                f"seed: expected one whole number of at least 0, or a list of {self.num_envs} of them or None, "
                f"got {shown(seed)}"
            )
        return each


def checked_mask(options: Mapping[str, Any] | None, count: int) -> NDArray[np.bool_]:
    """The environments of a reset's `options["reset_mask"]`, (count,); all without one."""
    if options is not None and not isinstance(options, Mapping):
        raise ValueError(f'options: expected a dict, such as {{"reset_mask": mask}}, got {shown(options)}')
    given = None if options is None else options.get("reset_mask")
    if given is None:
        return np.ones(count, dtype=bool)
    try:
        mask = np.asarray(given)
    except UNREADABLE:
        mask = np.empty(0)
    if mask.shape != (count,) or mask.dtype != np.bool_ or not mask.any():
        raise ValueError(
            f'options["reset_mask"]: expected {count} booleans of which one at least is true, got {shown(given)}'
        )
    return mask


STEP_INFO = frozenset(("rbm_mean_square", "reward_rbm", "reward_flap_angle", "reward_tower", "samples"))
"""Entries of `info` that a step gives and a reset does not."""


def _copied(value: Any) -> Any:
    return (
        {name: _copied(entry) for name, entry in value.items()} if isinstance(value, dict) else value.copy()
    )


def _overwrite(info: Info, first: Info, turbines: NDArray[np.int64]) -> None:
    """Replace the rows of environments that began anew by those of their first sample."""
    for name, value in first.items():
        info[name][turbines] = value


def _scattered(info: Info, turbines: NDArray[np.int64], count: int) -> Info:
    """Rows of some environments spread over all; the others are zero and masked."""
    if len(turbines) == count:
        return info
    spread = {name: np.zeros((count, *value.shape[1:]), dtype=value.dtype) for name, value in info.items()}
    for name, value in info.items():
        spread[name][turbines] = value
    return spread


def _masked(info: Info, mask: NDArray[np.bool_]) -> Info:
    """Add Gymnasium's mask `_name` beside every entry, also inside of nested ones: one array, locked, for them all."""
    mask.setflags(write=False)
    result: Info = {}
    for name, value in info.items():
        result[name] = _masked(value, mask) if type(value) is dict else value
        result["_" + name] = mask
    return result
