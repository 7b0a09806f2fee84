"""What one and many environments share: n turbines, their task (observation, reward, end) and their randomness."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import ArrayLike, NDArray

from flapgym.aeroelastic.multiblade import BLADES
from flapgym.envs.observation import Instant, Observer
from flapgym.envs.settings import Settings
from flapgym.plant import Interval, Plant
from flapgym.state_space import Array

RESET_OPTIONS = ("realisation_seed", "azimuth", "flap_angle", "flap_rate")

Info = dict[str, Any]


class Fleet:
    """n turbines under one set of settings. Everything it returns has a leading axis of turbines and is fresh.

    Parameters
    ----------
    settings : Settings
    count : int
        Number of turbines n.
    """

    def __init__(self, settings: Settings, count: int) -> None:
        self.settings = settings
        self.model = settings.turbine_model()
        self.plant = Plant(
            self.model,
            count,
            settings.steps_per_action,
            settings.intervals(self.model.time_step),
            settings.length_scale,
            every_sample=settings.record_samples or settings.tower_weight > 0.0,
        )
        self._observer = Observer(settings.observe, self.model)
        self.observation_space = gymnasium.spaces.Box(
            -self._observer.bound, self._observer.bound, dtype=np.float32
        )
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (BLADES,), dtype=np.float32)
        self._travel = np.zeros((count, BLADES))
        self._noise = (
            np.zeros((count, self.plant.intervals + 1, BLADES)) if settings.measurement_noise else None
        )
        self._reward_weights = np.full(BLADES, -1.0 / (BLADES * self.model.rbm_rms**2))
        self._all = np.arange(count)

    def begin(
        self,
        turbines: NDArray[np.int64],
        generators: Sequence[np.random.Generator],
        options: Mapping[str, Any] | None = None,
    ) -> tuple[NDArray[np.float32], Info]:
        """Start an episode of m turbines, each with randomness from its own generator.

        Returns
        -------
        observation : (m, size) float32
        info : dict of arrays (m, ...)
        """
        start = self._start(turbines, generators, dict(options or {}))
        first = self.plant.reset(turbines, *start)
        self._travel[turbines] = 0.0
        now = self._instant(first, turbines)
        noise = None if self._noise is None else self._noise[turbines, 0]
        return self._observer(now, noise), self._info(now, first, turbines)

    def step(
        self, actions: ArrayLike, restarting: NDArray[np.int64] | None = None
    ) -> tuple[NDArray[np.float32], Array, NDArray[np.bool_], NDArray[np.bool_], Info]:
        """Advance every turbine by one action (n, 3).

        Turbines in `restarting` are about to begin a new episode: what is returned for them has no meaning.
        """
        actions = self._checked(actions)
        if restarting is not None:
            # They have no interval left to advance into.
            self.plant.elapsed[restarting] = 0
        interval = self.plant.advance(actions * self.model.acceleration_limit)
        now = self._instant(interval, self._all)
        terms = self._reward_terms(interval)
        angle = interval.flap_angle
        self._travel += np.add.reduce(np.abs(angle[:, 1:] - angle[:, :-1]), axis=1)
        info = self._info(now, interval, self._all) | terms
        if self.settings.record_samples:
            info["samples"] = _samples(interval)
        elapsed = self.plant.elapsed
        noise = None if self._noise is None else self._noise[self._all, elapsed]
        reward = terms["reward_rbm"] + terms["reward_flap_angle"] + terms["reward_tower"]
        return self._observer(now, noise), reward, ~np.isfinite(reward), elapsed >= self.plant.intervals, info

    def _checked(self, actions: ArrayLike) -> Array:
        """Actions as float, clipped to the action space; anything but finite numbers of the right shape is refused."""
        shape = (self.plant.count, BLADES)
        try:
            values = np.asarray(actions, dtype=float)
        except (TypeError, ValueError):
            raise ValueError(f"action: expected numbers of shape {shape}, got {actions!r}") from None
        if values.shape != shape:
            raise ValueError(f"action: expected shape {shape}, got {values.shape}")
        if not np.isfinite(values).all():
            turbine, blade = np.argwhere(~np.isfinite(values))[0]
            raise ValueError(
                f"action: expected finite numbers in [-1, 1], got {values[turbine, blade]} for blade {blade + 1}"
                + (f" of environment {turbine}" if self.plant.count > 1 else "")
            )
        return np.minimum(np.maximum(values, -1.0), 1.0)

    def _start(
        self, turbines: NDArray[np.int64], generators: Sequence[np.random.Generator], options: dict[str, Any]
    ) -> tuple[Array, Array, Array, Array, Array]:
        """Noise, intensity, azimuth, flap angle and rate at the start of m episodes."""
        m, n, settings, model = len(turbines), self.plant.count, self.settings, self.model
        for name in options:
            if name not in RESET_OPTIONS:
                raise ValueError(f"options: no {name!r}; known: {', '.join(RESET_OPTIONS)}")
        angle = _option(options, "flap_angle", (n, BLADES), model.flap_angle_limit)[turbines]
        rate = _option(options, "flap_rate", (n, BLADES), model.flap_rate_limit)[turbines]
        seeds = _seeds(options, n)
        azimuth, noise = np.empty(m), np.empty((m, self.plant.noise_count))
        for row, generator in enumerate(generators):
            azimuth[row] = generator.uniform(0.0, 2.0 * np.pi)
            source = generator if seeds is None else np.random.default_rng(seeds[turbines[row]])
            source.standard_normal(out=noise[row])
            if self._noise is not None:
                drawn = generator.standard_normal(self._noise.shape[1:])
                self._noise[turbines[row]] = settings.measurement_noise * drawn
        if "azimuth" in options:
            azimuth = _option(options, "azimuth", (n,))[turbines]
        return noise, np.full(m, settings.turbulence_intensity), azimuth, angle, rate

    def _instant(self, interval: Interval, turbines: NDArray[np.int64]) -> Instant:
        """The last sample of an interval."""
        return Instant(
            rbm=interval.rbm[:, -1],
            tip_deflection=interval.tip_deflection[:, -1],
            flap_angle=interval.flap_angle[:, -1],
            flap_rate=interval.flap_rate[:, -1],
            tower_top=interval.tower[:, -1],
            wind=interval.wind[:, -1],
            azimuth=self.plant.azimuth[turbines],
        )

    def _reward_terms(self, interval: Interval) -> Info:
        """Each term of the reward, and the mean square of each blade's moment over the interval."""
        k, settings = self.plant.steps_per_action, self.settings
        mean_square = np.einsum("nkb,nkb->nb", interval.rbm, interval.rbm) / k
        zero = np.zeros(self.plant.count)
        angle, tower = zero, zero.copy()
        if settings.flap_angle_weight > 0.0:
            ratio = interval.flap_angle[:, 1:] / self.model.flap_angle_limit
            angle = -settings.flap_angle_weight * np.einsum("nkb,nkb->n", ratio, ratio) / (k * BLADES)
        if settings.tower_weight > 0.0:
            fore_aft = interval.tower[:, :, 0]
            tower = -settings.tower_weight * np.einsum("nk,nk->n", fore_aft, fore_aft) / k
        return {
            "rbm_mean_square": mean_square,
            "reward_rbm": mean_square @ self._reward_weights,
            "reward_flap_angle": angle,
            "reward_tower": tower,
        }

    def _info(self, now: Instant, interval: Interval, turbines: NDArray[np.int64]) -> Info:
        """SI quantities of the instant; copies, because a view would keep the whole interval alive."""
        return {
            "rbm": now.rbm.copy(),
            "tip_deflection": now.tip_deflection.copy(),
            "flap_angle": now.flap_angle.copy(),
            "flap_rate": now.flap_rate.copy(),
            "tower_top": now.tower_top.copy(),
            "wind_perturbation": now.wind.copy(),
            "azimuth": now.azimuth,
            "flap_travel": self._travel[turbines],
            "flap_stopped": interval.stopped,
        }


def _samples(interval: Interval) -> Info:
    """Every plant sample of the interval, 1 to k."""
    return {
        "rbm": interval.rbm.copy(),
        "tip_deflection": interval.tip_deflection.copy(),
        "flap_angle": interval.flap_angle[:, 1:].copy(),
        "flap_rate": interval.flap_rate[:, 1:].copy(),
        "tower_fore_aft": interval.tower[:, :, 0].copy(),
        "tower_side_side": interval.tower[:, :, 1].copy(),
        "wind": interval.wind.copy(),
    }


def _option(options: Mapping[str, Any], name: str, shape: tuple[int, ...], limit: float = np.inf) -> Array:
    """A reset option as an array of the shape wanted; zero if it is not given."""
    try:
        value = np.broadcast_to(np.asarray(options.get(name, 0.0), dtype=float), shape).copy()
    except (TypeError, ValueError):
        raise ValueError(
            f"options.{name}: expected numbers that fit shape {shape}, got {options[name]!r}"
        ) from None
    if not np.isfinite(value).all() or np.abs(value).max() > limit * (1.0 + 1e-9):
        raise ValueError(f"options.{name}: expected finite numbers within +-{limit:g}, got {options[name]!r}")
    return np.clip(value, -limit, limit)


def _seeds(options: Mapping[str, Any], n: int) -> list[int] | None:
    """Seeds of the realisations, one a turbine; None leaves them to the environment's generator."""
    given = options.get("realisation_seed")
    if given is None:
        return None
    seeds = np.asarray(given)
    if seeds.dtype.kind not in "iu" or seeds.shape not in ((), (n,)) or seeds.min() < 0:
        raise ValueError(
            f"options.realisation_seed: expected one non-negative whole number, or one for each of {n} environments, "
            f"got {given!r}"
        )
    return np.broadcast_to(seeds, (n,)).tolist()
