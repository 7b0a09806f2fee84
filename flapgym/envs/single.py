"""The environment of one turbine; its class docstring is the manual page of both environments."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from math import isfinite
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.error import ResetNeeded
from numpy import empty, ndarray
from numpy.typing import ArrayLike, NDArray

from flapgym.core.wording import shown
from flapgym.envs.actions import FLOAT32, numbers, refuse_not_finite
from flapgym.envs.rendering import Screen
from flapgym.envs.settings import Settings
from flapgym.envs.spec import completed
from flapgym.envs.states import generator_of, generator_state, seed_number, true_or_false, whole_seed
from flapgym.envs.turbines import Info, Turbines
from flapgym.model.turbine_model import TurbineModel
from flapgym.plant import LinearPlant

if TYPE_CHECKING:
    from flapgym.envs.compiled import CompiledTurbine


class FlapEnv(gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    """Load alleviation on a wind turbine with trailing-edge flaps, by default the NREL 5 MW with one flap a blade.

    ## Description

    The turbine runs at rated wind (11 m/s, 11.67 rpm) in homogeneous longitudinal turbulence. Each of its three blades
    carries a flap over 20 % of its lifting span and 10 % of its chord. The agent moves the flaps to reduce the
    flapwise root bending moments (RBM), whose cycles wear the blades out. The plant is the coupled linear model of
    tower, rotating blades and vortex-lattice aerodynamics of Ng et al., exact within the model; all loads and
    deflections are perturbations about the steady equilibrium, positive downwind. With the model `nrel5mw-site` the
    wind may differ over the rotor's disk, and the blades may feel gravity, see Winds over the Disk.

    All arguments are keywords, some of them in families that are plain mappings:

        gymnasium.make(
            "flapgym/NREL5MW-v1",
            task={"observe": ("rbm", "flap_angle", "flap_rate")},
            wind={"turbulence_intensity": 0.0, "gust": {"kind": "extreme_operating_gust", "start": 5.0}},
            sensors={"noise": 2e4},
            steps_per_action=1,
        )

    ## Action Space

    `Box(-1, 1, (3,), float32)`: acceleration of the flaps of blades 1 to 3 as a fraction of the model's limit
    (600 deg/s^2), held for `steps_per_action` plant steps of 0.007 s. Values beyond the bounds are clipped; NaN,
    infinity and a wrong shape raise `ValueError` and leave the state as it was. A positive flap angle (trailing edge to
    the upwind, pressure side) raises lift and RBM. The actuator is a double integrator with hard stops at 10 deg and
    100 deg/s; a stop zeroes the rate that points into it.

    A model may have several flaps a blade, F, each with limits of its own. Then there are 3 F actions, flap angles and
    rates: blade by blade, on each flap by flap from root to tip. With `single_blade=True` there are F.

    With `pitch=True`, on a model with that input such as `nrel5mw-site`, three more actions follow those of the flaps:
    the pitch demanded of blades 1 to 3, as a fraction of the model's stop (5 deg), about the operating point's. A
    positive pitch turns the leading edge upwind, which lowers lift and RBM. The actuator follows its demand with second
    order (0.5 Hz, damping 0.707) within 8 deg/s and the stop.

    ## Observation Space

    `Box` of float32, in the order of the keyword `task.observe`; values beyond the bounds are clipped.

    | name | entries | unit | bound | meaning |
    |---|---|---|---|---|
    | `rbm` | 3 | MN m | 50, or 40 `rbm_rms` if more | flapwise root bending moment of blades 1 to 3 |
    | `flap_angle` | 3 | rad | angle stop, 0.1745 | flap angle of blades 1 to 3 |
    | `flap_rate` | 3 | rad/s | rate stop, 1.745 | flap rate of blades 1 to 3 |
    | `tip_deflection` | 3 | m | 50 | tip deflection of blades 1 to 3, downwind |
    | `azimuth` | 2 | - | 1 | cosine and sine of the azimuth of blade 1 |
    | `tower_top` | 2 | m | 10 | tower-top displacement downwind and sideways |
    | `wind` | 1 | m/s | 50 | wind perturbation along the shaft; in a field its mean over the disk |
    | `pitch_angle` | 3 | rad | angle stop, 0.0873 | with `pitch=True`: pitch from the operating point's |
    | `pitch_rate` | 3 | rad/s | rate stop, 0.1396 | with `pitch=True`: its rate |
    | `wind_speed` | 1 | m/s | 100 | with `nrel5mw-range`: the mean wind, as rotor speed and pitch tell it slowly |
    | `lidar` | 3 | m/s | 50 | with `sensors.lidar`: u_0, u_c, u_s of the wind that comes, made of its beams |
    | `lidar_beams` | N | m/s | 50 | with `sensors.lidar`: wind perturbation along each beam |

    The default, `("rbm",)`, is what the paper measures. RBM alone says too little for a policy without memory: training
    works with `("rbm", "flap_angle", "flap_rate")`. Further outputs of a model, `[signals]` in its case, go by their
    own names, in SI units. `env.unwrapped.observed` says where each name stands in an observation.

    ## Rewards

    `reward_rbm + reward_flap_angle + reward_tower` over all plant samples of the interval:

    - `reward_rbm` = - mean square of RBM over samples and blades / `rbm_rms`^2. The constant is the model's open-loop
      rms at 10 % turbulence: doing nothing earns about -1 a step on average.
    - `reward_flap_angle` = - `task.flap_angle_weight` * mean square of (flap angle / its stop).
    - `reward_tower` = - `task.tower_weight` * mean square of the tower top's fore-aft displacement [m].

    ## Starting State

    Stationary turbulence and the turbine's stationary response to it, drawn from their joint distribution (no run-in);
    azimuth uniform; flaps at rest in the middle. A field's response is stationary, too; a box has
    passed for 20 s. `reset` takes these `options`:

    | option | value | meaning |
    |---|---|---|
    | `realisation_seed` | whole number | seed of the turbulence: the same wind, whatever else the environment draws |
    | `azimuth` | rad | of blade 1; refused beside `wind.pool` where a field, steady inflow or gravity turns |
    | `flap_angle` | rad, number or 3 | within the stop |
    | `flap_rate` | rad/s, number or 3 | within the stop |
    | `pitch_angle`, `pitch_rate` | rad, rad/s, number or 3 | within the stops; with `pitch=True` |
    | `turbulence_intensity` | fraction | of this episode, below 1; 0 is still air; refused beside `wind.field` |

    ## Episode End

    `truncated` after `duration`, rounded up to whole actions; `terminated` only if the state ceases to be finite. The
    number of actions stands in `env.spec.max_episode_steps`, for wrappers that tell the time. An environment made again
    from a specification, `gymnasium.make(env.spec)`, has Gymnasium's own counter around it: it ends there whatever
    `duration` it is given, and planners that set states take `env.unwrapped`.

    ## Information

    `reset` and `step` return a fresh, plain dict in SI units, at the last sample of the interval. Of one environment it
    holds numbers alone, so that a step stays quick:

    | entry | from | meaning |
    |---|---|---|
    | `wind_perturbation` | both | [m/s]; in a field the mean over the disk, without what is steady |
    | `azimuth` | both | of blade 1, 0 to 2 pi [rad] |
    | `reward_rbm`, `reward_flap_angle`, `reward_tower` | `step` | the reward's terms |

    With `full_info=True`, and from `FlapVectorEnv` always, there are arrays, too:

    | entry | from | meaning |
    |---|---|---|
    | `rbm` (3,) | both | root bending moments, without noise, delay and bounds [N m] |
    | `tip_deflection` (3,) | both | [m] |
    | `tower_top` (2,) | both | downwind and sideways [m] |
    | `flap_angle`, `flap_rate` (3,) | both | [rad], [rad/s] |
    | `flap_travel` (3,) | both | way gone since the reset [rad] |
    | `flap_stopped` (3,) | both | whether the flap met a stop in the interval |
    | `pitch_angle`, `pitch_rate`, `pitch_travel`, `pitch_stopped` (3,) | both | with `pitch=True`: the same of pitch |
    | `lidar` (3,), `lidar_beams` (N,) | both | with `sensors.lidar`: as observed [m/s] |
    | `rbm_mean_square` (3,) | `step` | over the interval [N^2 m^2] |

    and a model's further outputs by their names. Where steady inflow or gravity is given, `full_info=True` adds
    `rbm_steady` (3,), their part of `rbm` [N m], for one turbine and for many. With `record_samples=True` a step's
    `samples` is a dict of arrays over the plant samples: `rbm`, `tip_deflection`, `flap_angle`, `flap_rate` (k, 3),
    `tower_fore_aft`, `tower_side_side`, `wind` (k,); with `pitch=True` also `pitch_angle`, `pitch_rate` (k, 3).

    ## Arguments

    A name with a dot is a field of a family: `wind.pool` is given as `wind={"pool": 8}`. A family may also be an object
    of its class: `flapgym.wind.Wind`, `flapgym.envs.task.Task`, `flapgym.envs.settings.Actuators` or `Sensors`. Given
    to `gymnasium.make`, it takes the place of the whole family that an id was registered with.

    | keyword | default | meaning |
    |---|---|---|
    | `model` | `"nrel5mw-corrected"` | name of a shipped model or set of them, or a file of `flapgym build` |
    | `wind_speed` | the model's, 11.0 | [m/s]; of a set it takes the model; one there is no model for is refused |
    | `wind.turbulence_intensity` | the model's, 0.10 | rms over mean wind; `FlapVectorEnv` takes one each |
    | `wind.length_scale` | the model's, 147.0 | of the von Karman spectrum [m], 1 to 100,000 |
    | `wind.gust` | `None` | a wind beside the turbulence, see below |
    | `wind.field` | `None` | turbulence that differs over the disk, in place of the homogeneous one, see below |
    | `wind.inflow` | `None` | shear, yaw error, upflow, the tower ahead of the blades, see below |
    | `gravity` | `False` | whether the blades feel their weight |
    | `pitch` | `False` | whether the pitch of each blade is an action, too |
    | `wind.pool` | 0 | draw from realisations 0 to this - 1, shared in the process; 0, as a gust needs: none |
    | `task.observe` | `("rbm",)` | what is observed, see above |
    | `task.flap_angle_weight`, `task.tower_weight` | 0.0 | of the reward, to 1e6 |
    | `actuators.lag` | 0.0 | time constant [s] of a flap's acceleration behind its command, first order, to 60 |
    | `actuators.stuck` | `(None, None, None)` | angles [rad] at which flaps have long been stuck; `None` moves |
    | `actuators.effectiveness` | `(1.0, 1.0, 1.0)` | factors on what flaps do to the air; 0 floats, aligned with it |
    | `sensors.noise` | 0.0 | rms of white noise on the observed RBM [N m], to 5e7; the reward sees none |
    | `sensors.delay` | 0.0 | by which the observed RBM is late [s], whole plant steps, to 60; the reward is not |
    | `sensors.lidar` | `None` | measures the wind before it comes, see below |
    | `duration` | 20.0 | of an episode [s], 0.001 to 100,000 |
    | `steps_per_action` | 5 | plant steps for which an action is held; 1 is the paper's, 5 to 10 train well |
    | `single_blade` | `False` | the model's clamped blade by itself in place of the turbine |
    | `full_info` | `False` | arrays in `info`, see Information |
    | `record_samples` | `False` | put every plant sample into `info` |
    | `precision` | `"float64"` | `"float32"` halves memory and time of large batches, see docs/speed.md |
    | `backend` | `"auto"` | `"numba"`, `"numpy"`, or the first that can be imported; equal to round-off |
    | `render_mode` | `None` | `"rgb_array"` or `"human"`; `FlapVectorEnv` has the first alone |

    `actuators.stuck` and `actuators.effectiveness` have one entry a blade, for all its flaps, or one a flap.

    ## Winds over the Disk

    `wind.field`, `wind.inflow` and `gravity` need a model with those inputs, such as `nrel5mw-site`, and a rotor that
    turns: `single_blade=True` is refused. What is steady depends on the azimuth alone, and loads are told about their
    means over a revolution under it. `wind.field` is a mapping of its `kind` and entries in SI units, or an object of
    `flapgym.wind.VonKarman`, `Kaimal` or `BoxFile`. It takes the place of `wind.turbulence_intensity` and
    `wind.length_scale`, which are refused beside it. A picture (`render_mode`) shows the wind over the disk by colour.

    | `kind` | further entries | turbulence |
    |---|---|---|
    | `"von_karman"` | `turbulence_intensity`, `length_scale` | isotropic; by default the model's intensity and length |
    | `"kaimal"` | `turbulence`, classes, `turbulence_intensity`, `hub_height` | of IEC 61400-1 (2005), annex B.2 |
    | `"box"` | `file`, `shape`, `spacing`, `start`, `turbulence_intensity`, `hub_height` | of a file, docs/wind.md |

    Kaimal's `turbulence` is `"NTM"` (normal, the default) or `"ETM"` (extreme). `turbulence_class` is `"A"` to `"C"`,
    by default `"A"`; `turbine_class`, `"I"` to `"III"`, by default `"I"`, counts in the extreme one alone. A
    `turbulence_intensity` takes the place of what the standard says. `hub_height` [m], by default the turbine's, sets
    the scale.

    `wind.inflow` is a mapping of these entries, or an object of `flapgym.wind.Inflow`:

    | entry | default | meaning |
    |---|---|---|
    | `shear_exponent` | 0.0 | of the power law, -1 to 1; 0.2 in the standard's normal profile |
    | `roughness_length` | `None` | of the logarithmic law in its place [m], to 10 |
    | `yaw_error` | 0.0 | [rad], below 60 deg; positive where the wind blows to the left of one who looks downwind |
    | `upflow` | 0.0 | inclination of the wind upwards [rad], below 60 deg |
    | `tower_shadow` | `False` | whether the blades feel the tower's dam ahead of it |

    ## Lidar

    `sensors.lidar` is a mapping of these entries, or an object of `flapgym.wind.Lidar`. It sees the wind that the
    blades meet range / mean wind later, a field, a box, the homogeneous turbulence and a gust alike, without what is
    steady (`wind.inflow`). With it a seed brings the same wind as without. docs/wind.md says what it sees.

    | entry | default | meaning |
    |---|---|---|
    | `range` | | from the rotor to where its beams measure [m], 1 to 1000 |
    | `radius` | | of the circle there on which they do [m], to 500; 0 for one beam ahead of the hub |
    | `beams` | 4 | evenly around it, the first upright |
    | `probe_length` | 30.0 | full width at half height of the mean along a beam [m], to 200 |
    | `decay` | 2.0 | a of the coherence exp(-a f range / mean wind) with what arrives, to 100; a box needs 0 |
    | `sample_rate` | 4.0 | measurements a second [Hz], 0.1 to 100; the newest is held |
    | `delay` | 0.0 | until one is told [s], to 60 |
    | `noise` | 0.0 | rms of white noise on each beam [m/s], to 10 |

    ## Gusts

    `wind.gust` is a mapping of plain values in SI units. Its wind comes along the shaft on top of the turbulence; with
    `wind.turbulence_intensity` 0 it comes alone. Times count from the start of the episode, and the turbine begins in
    equilibrium with what the gust was before.

    | `kind` | further entries | wind perturbation |
    |---|---|---|
    | `"step"` | `size`, `start` | `size` from `start` on |
    | `"ramp"` | `size`, `duration`, `start` | a straight rise to `size` over `duration`, which stays |
    | `"sinusoid"` | `amplitude`, `frequency`, `start` | from `start` on, beginning at zero; frequency in Hz |
    | `"extreme_operating_gust"` | classes, `start` | dip, peak and dip within 10.5 s |
    | `"extreme_direction_change"` | `turbulence_class`, `turns`, `start` | what a turn of the wind in 6 s takes off |
    | `"extreme_coherent_gust"` | `turns`, `start` | a rise of 15 m/s and a turn within 10 s, which stay |
    | `"extreme_wind_shear"` | `turbulence_class`, `stronger`, `start` | 12 s of shear; takes winds by strip |
    | `"recorded"` | `file`, `start` | a series from a CSV file |

    `start` is 0 if it is not given; no perturbation may exceed 100 m/s, nor a frequency 50 Hz or half that of the
    plant's steps. The extreme operating gust is that of IEC 61400-1:2005 (third edition), 6.3.2.2; its `turbine_class`
    (`"I"` to `"III"`, default `"I"`) and `turbulence_class` (`"A"` to `"C"`, default `"A"`) may be given, as may
    `rotor_diameter` and `hub_height` [m] in place of the turbine's own. A recording has the header
    `time [s], wind [m/s]`, or `wind_perturbation [m/s]` about the mean wind (also ms, min, h and km/h, kn). Semicolons
    or tabs may stand for the commas, and decimal commas for points then; times may be dates of ISO 8601 under the
    header `time`, counted in seconds from the first. It is linear between its samples and must last for the episode,
    which begins at its moment `start`, by default its first.

    ## Version History

    - v1: the turbine as published and held to OpenFAST, model `nrel5mw-corrected`: beam and lattice joined at the pitch
      axis by station, sections' own lift slope, drag and moment, all linear terms of the loads, a wake that moves.
    - v0: the turbine as the paper reads it, model `nrel5mw-rated`. Its ids stay, with `-v0`.
    """

    metadata = {"render_modes": ["human", "rgb_array"], "render_fps": 30}  # noqa: RUF012 (Gymnasium's form)

    _spec: EnvSpec | None = None

    def __init__(self, render_mode: str | None = None, **keywords: Any) -> None:
        if render_mode is not None and (
            not isinstance(render_mode, str) or render_mode not in self.metadata["render_modes"]
        ):
            raise ValueError(f'render_mode: expected None, "rgb_array" or "human", got {shown(render_mode)}')
        self.render_mode = render_mode
        self.settings = Settings.of(keywords, type(self).__name__)
        self._turbines = Turbines(self.settings, 1, self.settings.full_info)
        self.observation_space = self._turbines.observation_space
        self.action_space = self._turbines.action_space
        self._actions = self.action_space.shape or ()
        self.metadata = type(self).metadata | {"render_fps": round(1.0 / self._turbines.action_time)}
        self._running = False
        self._compiled = self._compile()
        self._elapsed, self._last = 0, self._turbines.stepping.intervals
        self._screen = (
            None
            if render_mode is None
            else Screen(
                self._turbines.model,
                render_mode,
                self._turbines.action_time,
                partial(self._turbines.wind_over_disk, 0),
            )
        )
        self._actions = self.action_space.shape or ()
        self._observed = self._turbines.scoring.columns.size
        self._full = self.settings.full_info or render_mode is not None

    def __getstate__(self) -> dict[str, Any]:
        """A copy has arrays of its own for the compiled code, and shares what its plant shares."""
        if self._compiled is not None:
            self._compiled.store()
        return self.__dict__ | {"_compiled": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._compiled = self._compile()
        if self._compiled is not None:
            self._compiled.load(self._turbines.own_of(0))

    def _compile(self) -> CompiledTurbine | None:
        """The turbine in compiled code, where there is any."""
        plant = self._turbines.plant
        if not (self._turbines.compiles and isinstance(plant, LinearPlant)):
            self._turbines.get_ready()
            return None
        from flapgym.envs.compiled import CompiledTurbine

        return CompiledTurbine(plant, self._turbines.scoring)

    @property
    def model(self) -> TurbineModel:
        """The turbine model behind the environment."""
        return self._turbines.model

    @property
    def observed(self) -> dict[str, range]:
        """Where each observed quantity stands in an observation."""
        return self._turbines.observed

    @property
    def actions(self) -> int:
        """Actions of an episode."""
        return self._turbines.stepping.intervals

    @property
    def spec(self) -> EnvSpec | None:
        """What makes such an environment again, with the number of actions of an episode."""
        return completed(self._spec, self.actions)

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = spec

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], Info]:
        """Begin an episode; see Starting State for the options."""
        turbine = np.zeros(1, dtype=np.int64)
        given = None if seed is None else whole_seed(seed)
        chosen = self._turbines.chosen(
            turbine, options
        )  # before the seed, which a refused reset must not take
        super().reset(seed=given)
        observation, infos = self._turbines.begin(turbine, [self.np_random], chosen)
        self._load()
        self._running = True
        if self._screen is not None:
            self._screen.clear()
            self._show(_only(infos))
        return observation[0], self._told(infos)

    def step(self, action: ArrayLike) -> tuple[NDArray[np.float32], float, bool, bool, Info]:
        """Hold an action for `steps_per_action` plant steps: flap accelerations (blades F,), then pitch if it moves."""
        if not self._running:
            raise ResetNeeded("step: no episode is running; call reset first")
        if self._compiled is None:
            return self._step_uncompiled(action)
        # The very objects, as of every plain array: what else holds numbers is read first.
        # So is a view with gaps, or one that cannot be written to, for which the step would be compiled once more.
        if (
            action.__class__ is not ndarray
            or action.dtype is not FLOAT32
            or action.shape != self._actions
            or not action.flags.carray
        ):
            action = numbers(action, self._actions)
        observation = empty(self._observed, FLOAT32)
        finite, reward, of_moments, of_angles, of_tower, wind, azimuth = self._compiled.step(
            action, observation
        )
        if not finite:
            quantities = self._turbines.quantities
            refuse_not_finite(
                numbers(action, self._actions), blades=quantities.blades, flaps=quantities.flaps
            )
        self._elapsed += 1
        info: Info = {
            "wind_perturbation": wind,
            "azimuth": azimuth,
            "reward_rbm": of_moments,
            "reward_flap_angle": of_angles,
            "reward_tower": of_tower,
        }
        if self.settings.single_blade:  # which does not turn
            del info["azimuth"]
        if self._full:
            told = self._compiled.told
            own = self._turbines.own_of(0)
            infos = self._turbines.info(
                told[None], own[None, min(self._elapsed, self._last)] if own.size else None
            )
            if self._screen is not None:
                self._show(_only(infos))
            if self.settings.full_info:
                info |= _only(infos)
                info["rbm_mean_square"] = told[self._turbines.quantities.size :].copy()
        terminated, truncated = not isfinite(reward), self._elapsed >= self._last
        if terminated or truncated:
            self._running = False
        return observation, reward, terminated, truncated, info

    def _step_uncompiled(self, action: ArrayLike) -> tuple[NDArray[np.float32], float, bool, bool, Info]:
        """The same by the functions that many turbines take."""
        values = numbers(action, self._actions)
        observation, reward, terminated, truncated, infos = self._turbines.step(values[None])
        self._elapsed += 1
        self._running = not (terminated[0] or truncated[0])
        if self._screen is not None:
            self._show(_only(infos))
        return observation[0], float(reward[0]), bool(terminated[0]), bool(truncated[0]), self._told(infos)

    def get_state(self) -> dict[str, Any]:
        """The whole state as plain values, for pickle or JSON: an environment that takes it goes on bit for bit."""
        if self._compiled is not None:
            self._compiled.store()
        return {
            **self._turbines.get_state(),
            "running": self._running,
            "generator": generator_state(self.np_random),
            "seed": self.np_random_seed,
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Go on from a state that an environment of the same model and keywords gave.

        Raises
        ------
        ValueError
            If it is another environment's or damaged; nothing is changed then.
        """
        own = self._turbines.read_state(
            state, {"running": true_or_false, "generator": generator_of, "seed": seed_number}
        )
        if own["running"] and own["turbines"] == [None]:
            raise ValueError("state: running: damaged (no episode has begun); take it from get_state")
        ((now, elapsed),) = self._turbines.go_on(own["turbines"])
        if self._screen is not None:
            self._screen.resume(now, elapsed)
            if self.render_mode == "human":
                self._screen.display()
        self._load()
        self._running, self._elapsed = own["running"], elapsed
        self._np_random, self._np_random_seed = own["generator"], own["seed"]

    def render(self) -> Any:
        """The picture as (height, width, 3) uint8 in mode `rgb_array`; `human` draws by itself."""
        if self._screen is None:
            gymnasium.logger.warn(
                'render: the environment was made without render_mode="rgb_array" or "human"'
            )
            return None
        return self._screen.picture() if self.render_mode == "rgb_array" else None

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._screen is not None:
            self._screen.close()

    def flap_motion(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Angle and rate of every flap, (blades F,) each [rad, rad/s]."""
        if self._compiled is not None:
            self._compiled.store()
        angle, rate = self._turbines.flap_motion()
        return angle[0].copy(), rate[0].copy()

    def _load(self) -> None:
        """Hand the turbine to the compiled code, as it is now."""
        self._elapsed = 0
        if self._compiled is not None:
            self._compiled.load(self._turbines.own_of(0))

    def _told(self, infos: Info) -> Info:
        """What is told of the one turbine: numbers always, arrays under `full_info`, samples where recorded."""
        only = _only(infos)
        if self.settings.full_info:
            return only
        # A model's further outputs are not computed unless they are asked for.
        loads = self._turbines.quantities.fixed_outputs
        return {
            name: value
            for name, value in only.items()
            if not isinstance(value, np.ndarray) and name not in loads
        }

    def _show(self, info: Info) -> None:
        assert self._screen is not None
        self._screen.record(info)
        if self.render_mode == "human":
            self._screen.display()


def _only(infos: Info) -> Info:
    """The only turbine's row of every array; numbers as plain floats."""
    row: Info = {}
    for name, value in infos.items():
        if isinstance(value, dict):
            row[name] = {sample: part[0] for sample, part in value.items()}
        else:
            row[name] = value[0] if value.ndim > 1 else float(value[0])
    return row
