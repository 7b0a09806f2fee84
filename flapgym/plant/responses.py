"""Responses to the wind, one a turbine or a pool of them shared by all plants of the process (superposition)."""

from __future__ import annotations

import weakref
from functools import lru_cache
from typing import Any

import numpy as np

from flapgym.core.arrays import Array, FloatArray, IntArray
from flapgym.plant.disturbance import wind_response
from flapgym.plant.kernel import Kernel
from flapgym.plant.parameters import Stepping
from flapgym.plant.start import GivenWind, Start


class Pool:
    """Realisations 0, 1, ... of the turbulence: number i is the one of seed i. Each is computed when first wanted.

    Parameters
    ----------
    kernel : Kernel
    intervals : int
        Length of an episode.
    size : int
    precision : str
        Of the responses, which take size x intervals x rows numbers.
    """

    def __init__(self, kernel: Kernel, intervals: int, size: int, precision: str) -> None:
        self.first = np.zeros((size, len(kernel.flap.outputs)))
        self.strongest = np.zeros(size)
        self.rows = np.zeros((size, intervals, kernel.rows.count), dtype=precision)
        self._kernel, self._intervals = kernel, intervals
        self._known = np.zeros(size, dtype=bool)

    def __deepcopy__(self, memo: dict[int, Any]) -> Pool:
        """Copies of a plant share it: what it holds is the same for all."""
        memo[id(self.rows)] = self.rows  # a plant's episode shows them, too
        return self

    def fill(self, wanted: IntArray) -> None:
        """Make sure that these realisations are there."""
        if self._known[wanted].all():
            return
        kernel, intervals = self._kernel, self._intervals
        for index in np.unique(wanted[~self._known[wanted]]):
            noise = realisation_noise(int(index), kernel.disturbance.noise_count(intervals))
            azimuth = float(realisation_azimuth(index))
            first, rows = kernel.disturbance.respond(noise, intervals, azimuth)
            if kernel.steady is not None:
                first_steady, steady = steady_rows(kernel, azimuth, intervals)
                first, rows = first + first_steady, rows + steady
            self.first[index], self.rows[index] = first, rows
            self.strongest[index] = strongest_wind(kernel, first, rows)
            self._known[index] = True


def strongest_wind(kernel: Kernel, first: Array, rows: FloatArray) -> float:
    """Largest modulus of the wind [m/s], from outputs and wind at sample 0 (ny + 1,) and rows (intervals, count)."""
    # In this form a third faster than max() of the two: it is done at every reset.
    after = np.abs(rows[:, kernel.rows.structural :]).ravel()
    return max(abs(float(first[-1])), float(after[after.argmax()]))


def realisation_noise(seed: int, count: int) -> Array:
    """Standard normal numbers that make the realisation of a seed."""
    return np.random.default_rng(seed).standard_normal(count)


def realisation_azimuth(seed: IntArray | int) -> Array:
    """Azimuth [rad] at which an episode of a pooled realisation begins, where its response depends on it.

    By the golden ratio: however many there are, they are spread evenly over the turn.
    """
    golden = 0.5 * (np.sqrt(5.0) - 1.0)
    return np.asarray(2.0 * np.pi * ((np.asarray(seed) * golden) % 1.0))


def steady_rows(kernel: Kernel, azimuth: float, intervals: int) -> tuple[Array, Array]:
    """Outputs and wind (ny + 1,) at sample 0 and rows (intervals, count) of what is steady, begun at an azimuth."""
    assert kernel.steady is not None
    samples = np.arange(intervals * kernel.rows.steps + 1, dtype=np.float64)
    outputs = kernel.steady.at(azimuth + kernel.turn * samples)
    return outputs[0], kernel.packed(outputs[1:])


_POOLS: weakref.WeakValueDictionary[tuple[Any, ...], Pool] = weakref.WeakValueDictionary()


def shared_pool(kernel: Kernel, intervals: int, size: int, precision: str) -> Pool:
    """The pool of these properties, made if no plant of the process holds it."""
    key = (kernel, intervals, size, precision)
    pool = _POOLS.get(key)
    if pool is None:
        pool = _POOLS[key] = Pool(kernel, intervals, size, precision)
    return pool


@lru_cache(maxsize=4)
def gust_response(kernel: Kernel, wind: bytes, before: tuple[float, ...]) -> tuple[Array, Array]:
    """Outputs and wind (ny + 1,) at sample 0 and rows (intervals, count) under a given wind, once for all plants.

    Parameters
    ----------
    kernel : Kernel
    wind : bytes
        Of the samples (T + 1, nu) float64 [m/s]: what it is counts, not where it came from.
    before : tuple of nu float
        [m/s]; one for the disk, or more by strip.
    """
    modal = kernel.wind if len(before) == 1 else kernel.strips
    outputs = wind_response(modal, np.frombuffer(wind).reshape(-1, len(before)), np.array(before))
    return outputs[0], kernel.packed(outputs[1:])


class Responses:
    """What the wind does to n turbines over an episode.

    Attributes
    ----------
    rows : (places, intervals, count) float
        In the frame of the interval's start; the pool's, or its own.
    place : (n,) int
        Where each turbine's response is.
    level : (n,) float
        Factor on it.
    strongest : (n,) float
        Largest modulus of the wind, mean over the rotor, in the episode [m/s]; what is steady over the disk apart.
    """

    def __init__(self, kernel: Kernel, count: int, stepping: Stepping, reference_intensity: float) -> None:
        self._kernel, self._stepping, self._reference = kernel, stepping, reference_intensity
        intervals, precision = stepping.intervals, stepping.precision
        self._pool = shared_pool(kernel, intervals, stepping.pool, precision) if stepping.pool else None
        if self._pool is None:
            self.rows: FloatArray = np.zeros((count, intervals, kernel.rows.count), dtype=precision)
            self.place = np.arange(count)
        else:
            self.rows, self.place = self._pool.rows, np.zeros(count, dtype=np.int64)
        self.level = np.ones(count)
        self.strongest = np.zeros(count)
        self._gust: tuple[GivenWind, Array, Array] | None = None

    def draw(self, turbines: IntArray, start: Start) -> Array:
        """Prepare m episodes; the outputs and wind (m, ny + 1) at sample 0.

        One turbine after another: then a realisation is the same to the last bit, whoever else is reset with it.
        """
        kernel, intervals = self._kernel, self._stepping.intervals
        # A field knows how strong it is.
        levels = np.asarray(start.intensity) / self._reference
        if self._stepping.surroundings.field is not None:
            levels = np.ones(len(turbines))
        if self._pool is not None:
            if start.realisation is None or start.gust is not None:
                raise ValueError("start: a pool of realisations takes their numbers, and no other wind")
            self._pool.fill(start.realisation)
            self.place[turbines], self.level[turbines] = start.realisation, levels
            self.strongest[turbines] = self._pool.strongest[start.realisation] * levels
            return self._pool.first[start.realisation] * levels[:, None]
        first = np.zeros((len(turbines), len(kernel.flap.outputs)))
        for index, (turbine, level) in enumerate(zip(turbines, levels, strict=True)):
            azimuth = float(start.azimuth[index])
            if level > 0.0 and start.noise is not None:
                begin, rows = kernel.disturbance.respond(start.noise[index], intervals, azimuth)
                first[index] = begin * level
                np.multiply(rows, level, out=self.rows[turbine], casting="same_kind")
            else:
                self.rows[turbine] = 0.0
            if kernel.steady is not None:
                begin, rows = steady_rows(kernel, azimuth, intervals)
                first[index] += begin
                self.rows[turbine] += rows.astype(self.rows.dtype)
        if start.gust is not None:
            begin, rows = self._gust_response(start.gust)
            first += begin
            self.rows[turbines] += rows.astype(self.rows.dtype)
        for index, turbine in enumerate(turbines):
            self.strongest[turbine] = strongest_wind(kernel, first[index], self.rows[turbine])
        return first

    def _gust_response(self, gust: GivenWind) -> tuple[Array, Array]:
        if self._gust is None or self._gust[0] is not gust:
            wind = np.asarray(gust.wind, dtype=float).tobytes()
            before = tuple(np.atleast_1d(gust.before).tolist())
            self._gust = (gust, *gust_response(self._kernel, wind, before))
        return self._gust[1:]
