"""A turbine's response to what depends on the azimuth alone: steady inflow, gravity, the imbalance of unequal blades.

It is periodic, and solved for once by harmonic balance. Of equal blades it has the harmonics of three times the rotor's
speed alone, each by the frequency response; of unequal ones all harmonics, which the periodic part of the matrices
mixes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.constants import g as STANDARD_GRAVITY

from flapgym.core.arrays import BLADES, Array, ComplexArray
from flapgym.core.multiblade import to_blades, to_components
from flapgym.core.state_space import StateSpace
from flapgym.model.harmonics import PeriodicPart
from flapgym.model.nameplate import nameplate
from flapgym.model.signals import COMPONENTS, grouped, strip_inputs
from flapgym.model.turbine_model import TurbineModel
from flapgym.wind import Inflow

LEFT_OUT = 1e-10
"""Share of the steady wind's variance in each strip that harmonics may leave out. By default it is much more, as it is
of no account for the wind; but edgewise loads and the tower's acceleration are mostly of the highest harmonics."""
AZIMUTHS = 64
"""Around the revolution, at least, for the steady motion of an unbalanced rotor."""
_ENOUGH = 1e-12


@dataclass(frozen=True, eq=False)
class Steady:
    """The response to what is steady, about its mean over a revolution: that mean is a matter of the trim.

    Attributes
    ----------
    outputs : tuple of str
        Of the turbine, ny, the blades' in multi-blade coordinates.
    harmonics : (N + 1, ny + 1) complex
        Outputs in multi-blade coordinates, and the wind, are the real part of their sum times exp(i n `every` azimuth).
    mean : (ny + 1,) float
        What is left out: of the blades as components at azimuth zero, of the fixed outputs.
    every : int
        Of the rotor's harmonics, which there are: every third of equal blades, all of unequal ones.
    """

    outputs: tuple[str, ...]
    harmonics: ComplexArray
    mean: Array
    every: int = BLADES

    def at(self, azimuth: Array) -> Array:
        """Outputs and wind (T, ny + 1) at azimuths (T,) [rad]."""
        # Powers of one exponential: another exponential costs ten times a product.
        turns = np.vander(np.exp(1j * self.every * azimuth), len(self.harmonics), increasing=True)
        return np.asarray((turns @ self.harmonics).real)

    def told(self, azimuth: Array) -> dict[str, Array]:
        """Outputs by name at azimuths of blade 1 (T,) [rad]: the blades' (T, 3), the fixed ones (T,)."""
        found, told = self.at(azimuth), dict[str, Array]()
        for base, of_blades in grouped(self.outputs):
            at = self.outputs.index(f"{base}_{COMPONENTS[0]}" if of_blades else base)
            told[base] = to_blades(found[:, at : at + BLADES], azimuth) if of_blades else found[:, at]
        return told


def steady_inputs(
    model: TurbineModel, inflow: Inflow | None, gravity: bool
) -> list[tuple[list[str], ComplexArray]]:
    """What is steady: inputs of the turbine, and their harmonics (N, nu) of three times the rotor's speed."""
    forced: list[tuple[list[str], ComplexArray]] = []
    if inflow is not None:
        plate = nameplate(model.case)
        assert plate.disk is not None
        found = inflow.components(plate.strip_radii, plate.disk, model.wind_speed, left_out=LEFT_OUT)
        forced.append((list(strip_inputs(model.strips)), found.reshape(len(found), -1)))
    if gravity:
        forced.append((["gravity"], np.full((1, 1), STANDARD_GRAVITY, dtype=complex)))
    return forced


def steady_response(
    model: TurbineModel, inflow: Inflow | None, gravity: bool, outputs: tuple[str, ...]
) -> Steady:
    """Of equal blades: the turbine's frequency response at three, six, ... times the rotor's speed.

    The outputs wanted are the turbine's; the wind is told behind them, and is zero.
    """
    forced = steady_inputs(model, inflow, gravity)
    count = max(len(forcing) for _, forcing in forced)
    frequency = BLADES * np.arange(count) * model.rotor_speed / (2.0 * np.pi)
    harmonics = np.zeros((count, len(outputs) + 1), dtype=complex)
    for inputs, forcing in forced:
        part = model.turbine.select(inputs=inputs, outputs=list(outputs))
        response = part.frequency_response(frequency[: len(forcing)])
        harmonics[: len(forcing), :-1] += np.einsum("nyu,nu->ny", response, forcing)
    constant = [i for i, name in enumerate(outputs) if not name.endswith(("_c", "_s"))]
    mean = np.zeros(len(outputs) + 1)
    mean[constant] = harmonics[0, constant].real
    harmonics[0, constant] = 0.0
    return Steady(outputs, harmonics, mean)


def unequal_steady_response(model: TurbineModel, inflow: Inflow | None, gravity: bool) -> Steady:
    """Of a model with a periodic part: all its outputs, about each blade's own mean over a revolution.

    As with equal blades a mean is a matter of the trim, and the blades' trims are their own.

    Raises
    ------
    ValueError
        If the blades differ by so much that the motion is not found (`steady_motion`).
    """
    assert model.periodic is not None
    turbine, part, n = model.turbine, model.periodic, model.turbine.order
    forced = steady_inputs(model, inflow, gravity)
    highest = BLADES * (max(len(forcing) for _, forcing in forced) - 1) + part.harmonics
    # At least two azimuths a wave, and as many again for what the turning part adds to it.
    azimuth = _around(max(AZIMUTHS, 1 << (4 * highest - 1).bit_length()))
    inputs = np.zeros((len(azimuth), len(turbine.inputs)))
    for names, forcing in forced:
        phase = np.exp(1j * BLADES * azimuth[:, None] * np.arange(len(forcing)))
        inputs[:, [turbine.inputs.index(name) for name in names]] += (phase @ forcing).real
    push = inputs @ np.vstack([turbine.B, turbine.D]).T
    push += _turning(part, azimuth, inputs @ part.right[:, n:].T)
    motion = _summed(steady_motion(turbine, part, model.rotor_speed * model.time_step, push[:, :n]))
    outputs = push[:, n:] + motion @ turbine.C.T
    outputs += _turning(part, azimuth, motion @ part.right[:, :n].T)[:, n:]
    mean = np.zeros(outputs.shape[1] + 1)
    for base, of_blades in grouped(turbine.outputs):
        if of_blades:
            place = [turbine.outputs.index(f"{base}_{component}") for component in COMPONENTS]
            blades = to_blades(outputs[:, place], azimuth)
            own = blades.mean(axis=0)
            outputs[:, place] = to_components(blades - own, azimuth)
            mean[place] = to_components(own, np.zeros(()))
        else:
            place = [turbine.outputs.index(base)]
            mean[place] = outputs[:, place].mean(axis=0)
            outputs[:, place] -= mean[place]
    harmonics = _harmonics(outputs)
    kept = np.flatnonzero((np.abs(harmonics) > _ENOUGH * np.abs(outputs).max(axis=0)).any(axis=1))
    harmonics = np.pad(harmonics[: kept.max(initial=0) + 1], ((0, 0), (0, 1)))
    return Steady(turbine.outputs, harmonics, mean, every=1)


def imbalance_motion(model: TurbineModel) -> ComplexArray:
    """States that the unequal blades' own steady loads keep up; as `steady_motion`."""
    assert model.periodic is not None
    force = model.periodic.forcing_at(_around(AZIMUTHS))[:, : model.turbine.order]
    return steady_motion(model.turbine, model.periodic, model.rotor_speed * model.time_step, force)


def steady_motion(mean: StateSpace, periodic: PeriodicPart, turn: float, force: Array) -> ComplexArray:
    """States that a force keeps up, x(theta) = Re sum_k X[k] exp(j k theta), shape (A / 2, n).

    The periodic part is small, so its answer to itself is found by repetition: each harmonic by the mean's resolvent.

    Parameters
    ----------
    mean : StateSpace
    periodic : PeriodicPart
    turn : float
        Azimuth of one step [rad].
    force : (A, n) float
        What is added to the next state, at A azimuths around the revolution.

    Raises
    ------
    ValueError
        If the blades differ by so much that repetition does not converge.
    """
    azimuth, n = _around(len(force)), mean.order
    values, vectors = np.linalg.eig(mean.A)
    resolvent = 1.0 / (np.exp(1j * turn * np.arange(len(force) // 2))[:, None] - values)
    to_modes = np.linalg.inv(vectors).T
    motion, first = np.zeros_like(force), 0.0
    for _ in range(100):
        push = force + _turning(periodic, azimuth, motion @ periodic.right[:, :n].T)[:, :n]
        answer = np.asarray((resolvent * (_harmonics(push) @ to_modes)) @ vectors.T)
        before, motion = motion, _summed(answer)
        change = np.abs(motion - before).max()
        if change <= _ENOUGH * np.abs(motion).max():
            return answer
        first = first or change
        if change > 10.0 * first:
            break
    raise ValueError(
        "periodic plant: the steady motion of the unbalanced rotor was not found; blades differ too much"
    )


def _around(count: int) -> Array:
    """Azimuths (count,) around a revolution [rad]."""
    return 2.0 * np.pi / count * np.arange(count, dtype=np.float64)


def _turning(part: PeriodicPart, azimuth: Array, reached: Array) -> Array:
    """What the turning part adds (T, n + ny) at azimuths (T,) to what reaches it (T, s)."""
    return np.einsum("ars,as->ar", part.core_at(azimuth), reached) @ part.left.T


def _harmonics(values: Array) -> ComplexArray:
    """Of values (A, n) around the revolution, (A / 2, n): their real part is summed."""
    series = np.fft.rfft(values, axis=0)[: len(values) // 2] / len(values)
    series[1:] *= 2.0
    return np.asarray(series)


def _summed(series: ComplexArray) -> Array:
    """Values (2 k, n) around the revolution, from their harmonics (k, n)."""
    halved = np.concatenate([series[:1], 0.5 * series[1:]])
    return np.fft.irfft(halved, 2 * len(series), axis=0, norm="forward")
