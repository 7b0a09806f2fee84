"""What a lidar measures ahead of a turbine, in the very realisation that its blades meet later.

The lidar's own random numbers come from a generator that is seeded with the realisation's: nothing else draws other
numbers because of it, and a realisation always has the same record.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from flapgym.core.arrays import Array
from flapgym.model.turbine_model import TurbineModel
from flapgym.plant.box_response import BoxResponse
from flapgym.plant.disturbance import Disturbance
from flapgym.plant.field_response import FieldResponse
from flapgym.plant.parameters import Stepping
from flapgym.plant.responses import realisation_noise
from flapgym.plant.start import Start
from flapgym.plant.wind_response import WindResponse
from flapgym.wind import Lidar, von_karman_filter
from flapgym.wind.shaping_filter import filtered
from flapgym.wind.upwind import seen_of_box, seen_of_gust, upwind_turbulence

STREAM = 0x11DA2
"""Beside the realisation's numbers, what the lidar's generator is seeded with."""
BEYOND = 20.0
"""Time [s] for which a homogeneous wind goes on after the last that is measured, for means around it."""


_shaping = lru_cache(maxsize=4)(von_karman_filter)
"""Kept, as a reset would wait for it."""


def known_ahead(response: WindResponse, intervals: int) -> float:
    """Time [s] beyond an episode up to which its wind can be told ahead.

    A field repeats itself after its period: half of what is left of that stays between the two ends. A homogeneous wind
    goes on for as long as it takes; a box stands still after its end.
    """
    if not isinstance(response, FieldResponse):
        return float("inf")
    period = response.prepared(intervals).turbulence.period
    return 0.5 * (period - intervals * response.rows.steps * response.modal.time_step)


def measured_upwind(
    response: WindResponse,
    model: TurbineModel,
    stepping: Stepping,
    lidar: Lidar,
    start: Start,
    arrival: Array,
) -> Array:
    """Speeds along the beams (m, S, N) [m/s] of the turbulence in m episodes, with the lidar's noise.

    Parameters
    ----------
    response : WindResponse
    model : TurbineModel
    stepping : Stepping
    lidar : Lidar
    start : Start
        Of the episodes.
    arrival : (S,) float
        When what is measured arrives at the rotor [s] (`Lidar.schedule`).
    """
    intervals, speeds = stepping.intervals, np.empty((len(start.azimuth), len(arrival), lidar.beams))
    for row, azimuth in enumerate(start.azimuth):
        if start.noise is not None:
            noise = start.noise[row]
        else:
            assert start.realisation is not None
            noise = realisation_noise(int(start.realisation[row]), response.noise_count(intervals))
        generator = np.random.default_rng([STREAM, *noise[:2].view(np.uint64).tolist()])
        wind: Array
        if isinstance(response, FieldResponse):
            wind = _of_field(response, lidar, noise, generator, arrival, float(azimuth), intervals)
        elif isinstance(response, BoxResponse):
            begin = response.field.begins(noise, response.duration(intervals))
            wind = seen_of_box(response.field.box, begin, lidar, arrival)
        else:
            assert isinstance(response, Disturbance)
            level = float(start.intensity[row]) / model.turbulence_intensity
            wind = level * _of_gust(response, model, stepping, lidar, noise, generator, arrival)[:, None]
        of_noise = lidar.noise * generator.standard_normal((len(arrival), lidar.beams))
        speeds[row] = lidar.projection * wind + of_noise
    return speeds


def _of_field(
    response: FieldResponse,
    lidar: Lidar,
    noise: Array,
    generator: np.random.Generator,
    arrival: Array,
    azimuth: float,
    intervals: int,
) -> Array:
    upwind = upwind_turbulence(
        response.field,
        response.prepared(intervals).turbulence,
        response.wind_speed,
        response.turn / response.modal.time_step,
        lidar,
    )
    own = generator.standard_normal(upwind.noise_count)
    return upwind.seen(noise, own, arrival, azimuth) * response.field.deviation(response.wind_speed)


def _of_gust(
    response: Disturbance,
    model: TurbineModel,
    stepping: Stepping,
    lidar: Lidar,
    noise: Array,
    generator: np.random.Generator,
    arrival: Array,
) -> Array:
    """Of the homogeneous turbulence (S,) at the model's intensity: its filter goes on beyond the episode."""
    dt = model.time_step
    shaping = _shaping(model.wind_speed, model.turbulence_intensity, stepping.length_scale, dt)
    samples = max(
        int(np.ceil((arrival[-1] + BEYOND) / dt)) + 1, stepping.intervals * stepping.steps_per_action + 1
    )
    states = response.root.shape[1]
    further = generator.standard_normal(samples - (len(noise) - states))
    white = np.stack([np.concatenate([noise[states:], further]), generator.standard_normal(samples)])
    begins = np.stack([noise[:states], generator.standard_normal(states)])
    # The filter's states stand before the turbine's.
    modes = (begins @ response.root.T).view(complex)
    first = (modes @ response.modal.expand.T).real[:, : shaping.order]
    wind, other = filtered(shaping, first, white)
    seen = seen_of_gust(wind, other, lidar, model.wind_speed, dt)
    return np.interp(arrival, dt * np.arange(samples), seen)
