"""The step in numpy, an interval of many turbines in two products: the plant where numba is missing."""

from __future__ import annotations

import numpy as np

from flapgym.core.arrays import BLADES, Array, BoolArray, FloatArray
from flapgym.core.multiblade import blade_azimuths
from flapgym.plant.actuator import TOUCH, Law, flap_step, free_motion
from flapgym.plant.parameters import Episode, Loads, Parameters, State
from flapgym.plant.telling import tell

TINY = {np.dtype(kind): np.finfo(kind).tiny for kind in (np.float32, np.float64)}
"""Smallest normal number of each precision."""


def step(parameters: Parameters, episode: Episode, state: State, actions: FloatArray) -> tuple[State, Loads]:
    """Hold actions for k plant steps.

    Parameters
    ----------
    parameters : Parameters
    episode : Episode
    state : State
        Not changed.
    actions : (n, blades A) float
        Fractions of the flaps' acceleration limits and of the stop of pitch; finite, clipped to +-1.

    Returns
    -------
    state : State
    loads : Loads
    """
    p, n = parameters, len(state.elapsed)
    azimuth = episode.azimuth + p.turn * p.steps * state.elapsed
    command: Array = np.clip(np.asarray(actions, dtype=float), -1.0, 1.0).T * p.acceleration[:, None]
    motion, gained, jumps, stopped = move(p, state.flaps, command)
    transform = _to_blades(azimuth, p.blades)
    given = _components(p, _acting(p, state.flaps, command), transform)
    met = np.flatnonzero(stopped.any(axis=0))
    if met.size:
        given[met, : p.commanded] = 0.0
    modes, rows = _superposed(p, state.modes, given)
    if met.size:
        stepwise = _components(p, np.concatenate([gained, jumps])[..., met], transform[met])
        if p.pitch:
            _settle(p, given[met], stepwise)
        modes[met] += stepwise @ p.push[p.free :]
        rows[met] += stepwise @ p.feed[p.free :]
    at = np.minimum(state.elapsed, p.intervals - 1)
    wind: Array = episode.responses[episode.place, at] * episode.level[:, None]
    rows = rows.astype(float)
    rows += wind[:, : rows.shape[1]]
    flaps = flaps_after(p, state.flaps, motion, command)
    elapsed = state.elapsed + 1
    blade_rows = rows[:, : rows.shape[1] - p.fixed_outputs * p.kept].reshape(n, -1, BLADES) @ transform
    loads = tell(
        p,
        rbm=blade_rows[:, : p.steps],
        others=blade_rows[:, p.steps :].reshape(n, p.blade_outputs - 1, p.kept, p.blades),
        fixed=rows[:, rows.shape[1] - p.fixed_outputs * p.kept :].reshape(n, p.fixed_outputs, p.kept),
        wind=wind[:, rows.shape[1] :],
        motion=motion,
        travel=flaps[3],
        stopped=stopped,
        azimuth=episode.azimuth + p.turn * p.steps * elapsed,
    )
    return State(elapsed, flaps, modes), loads


def move(parameters: Parameters, flaps: Array, command: Array) -> tuple[Array, Array, Array, BoolArray]:
    """Motion of flaps and pitch over an interval.

    Parameters
    ----------
    parameters : Parameters
    flaps : (4, blades A, n) float
        Of the state.
    command : (blades A, n) float
        Accelerations [rad/s^2].

    Returns
    -------
    motion : (k + 1, 2, blades A, n) float
        Angle and rate at samples 0 to k.
    gained, jumps : (k, blades A, n) float
        Of rate and angle in steps 1 to k (`flapgym.plant.actuator.flap_step`), of turbines with a flap near its stop.
    stopped : (blades A, n) bool
        Which met a stop.
    """
    p = parameters
    start = _acting(p, flaps, command)
    motion = np.empty((p.steps + 1, 2, *command.shape))
    for alike in (slice(p.all_flaps), slice(p.all_flaps, None))[: 1 + p.pitch]:
        first = alike.start or 0
        law = Law(p.lag_decay, float(p.lag_gain[first]), float(p.stiffness[first]), float(p.damping[first]))
        of_these = start[:, alike]
        free = free_motion(p.steps, p.time_step, law, p.lags) @ of_these.reshape(len(start), -1)
        motion[:, :, alike] = free.reshape(p.steps + 1, 2, *of_these.shape[1:])
    limits = np.array([p.angle_limit, p.rate_limit])[:, :, None]
    stopped: BoolArray = np.any(np.abs(motion) > limits * (1.0 - TOUCH), axis=(0, 1))
    gained, jumps = np.zeros((2, p.steps, *command.shape))
    near = np.flatnonzero(stopped.any(axis=0))
    # Only turbines with a flap near its stop are marched; it may still miss it.
    gain, stiffness, damping = (each[:, None] for each in (p.lag_gain, p.stiffness, p.damping))
    angle, rate, lagged = flaps[:3, :, near]
    held, met = command[:, near], np.zeros((len(command), near.size), dtype=bool)
    for sample in range(p.steps if near.size else 0):
        acting = held + gain * (lagged - held) - stiffness * angle - damping * rate
        before = rate
        angle, rate, jump, now = flap_step(
            angle, rate, acting, p.time_step, p.angle_limit[:, None], p.rate_limit[:, None]
        )
        lagged = held + p.lag_decay * (lagged - held)
        met |= now
        motion[sample + 1, 0][:, near], motion[sample + 1, 1][:, near] = angle, rate
        gained[sample][:, near], jumps[sample][:, near] = rate - before, jump
    stopped[:, near] = met
    return motion, gained, jumps, stopped


def _superposed(parameters: Parameters, modes: FloatArray, given: Array) -> tuple[FloatArray, FloatArray]:
    """Modes after the interval (n, 2 M) and rows (n, rows) as if no stop were there."""
    p, shape = parameters, (len(modes), 2, modes.shape[1] // 2)
    given = given.astype(modes.dtype)
    after = given @ p.push[: p.free]
    # Real and imaginary parts at once: half of the calls, which are what few turbines wait for.
    (real, imaginary), both, turned = p.decay, modes.reshape(shape), after.reshape(shape)
    across = imaginary * both
    turned += real * both
    turned[:, 0] -= across[:, 1]
    turned[:, 1] += across[:, 0]
    # What flaps at rest leave would decay to denormal numbers, which make a product ten times as long.
    after[np.abs(after) < TINY[after.dtype]] = 0.0
    return after, modes @ p.read + given @ p.feed[: p.free]


def _acting(parameters: Parameters, flaps: Array, command: Array) -> Array:
    """What decides a motion at its start (3 or 4, blades A, n): command, if it lags what acts, angle and rate."""
    start = np.empty((4 if parameters.lags else 3, *command.shape))
    # np.stack would take as long as the products of a few turbines.
    start[0], start[1], start[-2:] = command, flaps[2], flaps[:2]
    return start


def flaps_after(parameters: Parameters, flaps: Array, motion: Array, command: Array) -> Array:
    """Flaps of the state (4, blades A, n) after a motion."""
    after = np.empty_like(flaps)
    after[:2] = motion[-1]
    after[2] = command + parameters.lag_decay**parameters.steps * (flaps[2] - command)
    after[3] = flaps[3] + np.abs(motion[1:, 0] - motion[:-1, 0]).sum(axis=0)
    return after


def _components(parameters: Parameters, values: Array, transform: Array) -> Array:
    """Components (n, m A 3) of m quantities of every actuator (m, blades A, n), by the inverse of `_to_blades`."""
    p, n = parameters, values.shape[-1]
    acting = values * p.effectiveness[:, None]
    flaps = acting[:, : p.all_flaps].reshape(-1, p.blades, p.flaps, n)
    by_blade = np.concatenate([flaps, acting[:, p.all_flaps :, None]], axis=2) if p.pitch else flaps
    # A mean, and a cosine and a sine whose squares sum to half the blades.
    scale = np.array([1.0, 2.0, 2.0])[:, None] / p.blades
    return np.einsum("ncb,mbfn->nmfc", transform * scale, by_blade).reshape(n, -1)


def _settle(parameters: Parameters, given: Array, stepwise: Array) -> None:
    """Take from the rate that pitch gained step by step (m, 6 A k) what angle and rate at its start account for."""
    p = parameters
    angle, rate = (
        given[:, p.commanded : p.free].reshape(len(given), 2, p.actuators, BLADES)[:, :, -1].swapaxes(0, 1)
    )
    gained = stepwise.reshape(len(given), 2 * p.steps, p.actuators, BLADES)[:, : p.steps, -1]
    gained -= p.settling[:, :1] * angle[:, None] + p.settling[:, 1:] * rate[:, None]


def _to_blades(azimuth: Array, blades: int) -> Array:
    """(n, 3 components, blades): one, cosine and sine of each blade's azimuth; a single blade is the mean."""
    transform = np.zeros((azimuth.size, BLADES, blades))
    transform[:, 0] = 1.0
    if blades == BLADES:
        angle = blade_azimuths(azimuth)
        np.cos(angle, out=transform[:, 1])
        np.sin(angle, out=transform[:, 2])
    return transform
