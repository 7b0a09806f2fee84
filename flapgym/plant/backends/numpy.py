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
    p, s, n = parameters, parameters.sizes, len(state.elapsed)
    azimuth = episode.azimuth + p.turn * s.steps * state.elapsed
    command: Array = np.clip(np.asarray(actions, dtype=float), -1.0, 1.0).T * p.acceleration[:, None]
    motion, gained, jumps, stopped = move(p, state.flaps, command)
    transform = blade_transform(azimuth, s.blades)
    given = components(p, _acting(p, state.flaps, command), transform)
    met = np.flatnonzero(stopped.any(axis=0))
    if met.size:
        given[met, : s.commanded] = 0.0
    modes, rows = _superposed(p, state.modes, given)
    if met.size:
        stepwise = components(p, np.concatenate([gained, jumps])[..., met], transform[met])
        if s.pitch:
            _settle(p, given[met], stepwise)
        modes[met] += stepwise @ p.B[s.given :]
        rows[met] += stepwise @ p.D[s.given :]
    at = np.minimum(state.elapsed, s.intervals - 1)
    wind: Array = episode.responses[episode.place, at] * episode.level[:, None]
    rows = rows.astype(float)
    rows += wind[:, : s.rows]
    flaps = flaps_after(p, state.flaps, motion, command)
    elapsed = state.elapsed + 1
    of_blades = s.rows - s.fixed_outputs * s.kept
    blade_rows = rows[:, :of_blades].reshape(n, -1, BLADES) @ transform
    loads = tell(
        p,
        rbm=blade_rows[:, : s.steps],
        others=blade_rows[:, s.steps :].reshape(n, s.blade_outputs - 1, s.kept, s.blades),
        fixed=rows[:, of_blades:].reshape(n, s.fixed_outputs, s.kept),
        wind=wind[:, s.rows :],
        motion=motion,
        travel=flaps[3],
        stopped=stopped,
        azimuth=episode.azimuth + p.turn * s.steps * elapsed,
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
    p, s = parameters, parameters.sizes
    angle_limit, rate_limit, _, _, decay, gain, stiffness, damping = p.actuators[:, :, None]
    start = _acting(p, flaps, command)
    motion = np.empty((s.steps + 1, 2, *command.shape))
    for alike in (slice(p.all_flaps), slice(p.all_flaps, None))[: 1 + s.pitch]:
        law = Law(*p.actuators[4:, alike.start or 0].tolist())
        of_these = start[:, alike]
        free = free_motion(s.steps, p.time_step, law, bool(s.lags)) @ of_these.reshape(len(start), -1)
        motion[:, :, alike] = free.reshape(s.steps + 1, 2, *of_these.shape[1:])
    near_stop = np.array([angle_limit, rate_limit]) * (1.0 - TOUCH)
    stopped: BoolArray = np.any(np.abs(motion) > near_stop, axis=(0, 1))
    gained, jumps = np.zeros((2, s.steps, *command.shape))
    near = np.flatnonzero(stopped.any(axis=0))
    # Only turbines with a flap near its stop are marched; it may still miss it.
    angle, rate, lagged = flaps[:3, :, near]
    held, met = command[:, near], np.zeros((len(command), near.size), dtype=bool)
    for sample in range(s.steps if near.size else 0):
        acting = held + gain * (lagged - held) - stiffness * angle - damping * rate
        before = rate
        angle, rate, jump, now = flap_step(angle, rate, acting, p.time_step, angle_limit, rate_limit)
        lagged = held + decay * (lagged - held)
        met |= now
        motion[sample + 1, 0][:, near], motion[sample + 1, 1][:, near] = angle, rate
        gained[sample][:, near], jumps[sample][:, near] = rate - before, jump
    stopped[:, near] = met
    return motion, gained, jumps, stopped


def _superposed(parameters: Parameters, modes: FloatArray, given: Array) -> tuple[FloatArray, FloatArray]:
    """Modes after the interval (n, 2 M) and rows (n, rows) as if no stop were there."""
    p, free = parameters, parameters.sizes.given
    given = given.astype(modes.dtype)
    after = given @ p.B[:free]
    # Real and imaginary parts at once: half of the calls, which are what few turbines wait for.
    shape = (len(modes), 2, modes.shape[1] // 2)
    (real, imaginary), both, turned = p.decay, modes.reshape(shape), after.reshape(shape)
    across = imaginary * both
    turned += real * both
    turned[:, 0] -= across[:, 1]
    turned[:, 1] += across[:, 0]
    # What flaps at rest leave would decay to denormal numbers, which make a product ten times as long.
    after[np.abs(after) < TINY[after.dtype]] = 0.0
    return after, modes @ p.C + given @ p.D[:free]


def _acting(parameters: Parameters, flaps: Array, command: Array) -> Array:
    """What decides a motion at its start (3 or 4, blades A, n): command, if it lags what acts, angle and rate."""
    start = np.empty((4 if parameters.sizes.lags else 3, *command.shape))
    # np.stack would take as long as the products of a few turbines.
    start[0], start[1], start[-2:] = command, flaps[2], flaps[:2]
    return start


def flaps_after(parameters: Parameters, flaps: Array, motion: Array, command: Array) -> Array:
    """Flaps of the state (4, blades A, n) after a motion."""
    after, decay = np.empty_like(flaps), parameters.actuators[4, :, None]
    after[:2] = motion[-1]
    after[2] = command + decay**parameters.sizes.steps * (flaps[2] - command)
    after[3] = flaps[3] + np.abs(motion[1:, 0] - motion[:-1, 0]).sum(axis=0)
    return after


def components(parameters: Parameters, values: Array, transform: Array) -> Array:
    """Components (n, m A 3) of m quantities of every actuator (m, blades A, n), by the inverse of `blade_transform`."""
    p, s, n = parameters, parameters.sizes, values.shape[-1]
    acting = values * p.effectiveness[:, None]
    flaps = acting[:, : p.all_flaps].reshape(-1, s.blades, s.flaps, n)
    by_blade = np.concatenate([flaps, acting[:, p.all_flaps :, None]], axis=2) if s.pitch else flaps
    # A mean, and a cosine and a sine whose squares sum to half the blades.
    scale = np.array([1.0, 2.0, 2.0])[:, None] / s.blades
    return np.einsum("ncb,mbfn->nmfc", transform * scale, by_blade).reshape(n, -1)


def _settle(parameters: Parameters, given: Array, stepwise: Array) -> None:
    """Take from the rate that pitch gained step by step (m, 6 A k) what angle and rate at its start account for."""
    p, s = parameters, parameters.sizes
    shape = (len(given), -1, s.flaps + s.pitch, BLADES)
    angle, rate = given[:, s.commanded :].reshape(shape)[:, :, -1].swapaxes(0, 1)
    gained = stepwise.reshape(shape)[:, : s.steps, -1]
    gained -= p.settling[:, :1] * angle[:, None] + p.settling[:, 1:] * rate[:, None]


def blade_transform(azimuth: Array, blades: int) -> Array:
    """(n, 3 components, blades): one, cosine and sine of each blade's azimuth; a single blade is the mean."""
    transform = np.zeros((azimuth.size, BLADES, blades))
    transform[:, 0] = 1.0
    if blades == BLADES:
        angle = blade_azimuths(azimuth)
        np.cos(angle, out=transform[:, 1])
        np.sin(angle, out=transform[:, 2])
    return transform
