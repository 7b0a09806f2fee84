"""A field over the disk as few filtered white noises: what a turning blade meets, as a controller can believe in it.

Of the field's harmonics of the azimuth, u = sum U_m exp(i m theta) (`flapgym.wind.field`), a mean over the blade with
weights by ring is kept: the effective wind, one number a blade. Each harmonic of it is stationary, independent of the
others, and falls with frequency as a low pass does. A blade meets harmonic m turned on by m turns of the rotor, so the
peaks at once, twice, three times the rotor's speed are low passes whose states turn. What is steady of the inflow is of
the same harmonics, at frequency zero: a state that hardly forgets.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg

from flapgym.core.arrays import BLADES, Array, ComplexArray
from flapgym.core.fields import Count, Numbers
from flapgym.core.state_space import StateSpace
from flapgym.wind.field import checked_rings, harmonic_shares
from flapgym.wind.shaping_filter import residues, sampled_low_pass
from flapgym.wind.turbulence import Turbulence

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

HARMONICS = 4
"""Highest harmonic kept by default."""
POLES = 3
"""Of each harmonic's low pass, and it has one zero."""
REACH = 2.0
"""Turns of the rotor from a harmonic's peak up to which its spectrum is fitted; farther off its neighbours' are met."""
WIDEST = 10.0
"""Frequency up to which variances are integrated [Hz]; of von Karman's at a point 0.4 % lies beyond, of a mean over a
blade nothing to speak of."""
MEMORY = 200.0
"""Time after which the steady part is forgotten [s]: long beside a turn, short beside an episode."""


@dataclass(frozen=True, eq=False)
class EffectiveField:
    """Spectra of the harmonics of the effective wind, and how the rotor turns past them.

    Attributes
    ----------
    frequencies : (F,) float
        From zero on, rising [Hz].
    spectra : (M + 1, F) float
        One-sided, of the harmonics 0 to M: their integrals are the E|U_m|^2 [m^2/s].
    steady : (M + 1,) float
        Modulus of U_m of the steady inflow [m/s]; none in harmonic 0, whose mean is the trim's.
    turn : float
        Revolutions of the rotor a second [Hz].
    """

    frequencies: Array
    spectra: Array
    steady: Array
    turn: float

    @property
    def variances(self) -> Array:
        """E|U_m|^2 of the turbulence (M + 1,) [m^2/s^2]."""
        return np.asarray(np.trapezoid(self.spectra, self.frequencies, axis=1))

    def blade_spectrum(self, frequency: Array) -> Array:
        """One-sided spectrum (N,) [m^2/s] of the turbulence one blade meets at frequencies (N,) [Hz]."""
        highest = len(self.spectra) - 1
        return self._sum(frequency, [(m, m) for m in range(-highest, highest + 1)])

    def component_spectra(self, frequency: Array) -> tuple[Array, Array]:
        """The same of the multi-blade components: of u_0, and of either of u_c and u_s."""
        highest = len(self.spectra) - 1
        every = range(-highest, highest + 1)
        thirds = [(m, m) for m in every if m % BLADES == 0]
        # u_c - i u_s = 2 sum U_3k+1 exp(3 i k theta); its real part has both signs of the frequency.
        turned = [(m, m - 1) for m in every if m % BLADES == 1]
        met = self._sum(frequency, turned), self._sum(-np.asarray(frequency), turned)
        return self._sum(frequency, thirds), met[0] + met[1]

    def _sum(self, frequency: Array, harmonics: list[tuple[int, int]]) -> Array:
        """Sum of the spectra of harmonics, each moved by its turns."""
        return np.sum(
            [
                np.interp(np.abs(frequency - turns * self.turn), self.frequencies, self.spectra[abs(m)])
                for m, turns in harmonics
            ],
            axis=0,
        )


def effective_field(
    field: Turbulence,
    radii: Array,
    weights: Array,
    wind_speed: float,
    rotor_speed: float,
    steady: ComplexArray | None = None,
    harmonics: int = HARMONICS,
) -> EffectiveField:
    """The effective wind of a field.

    Parameters
    ----------
    field : Turbulence
        It knows its strength and scale.
    radii, weights : (R,) float
        Rings, rising [m], and their shares, whose sum is one.
    wind_speed, rotor_speed : float
        [m/s, rad/s]
    steady : (N, R) complex, optional
        Harmonics c_m [m/s] of the steady inflow Re sum c_m exp(i m theta), as `Inflow.harmonics` gives them.
    harmonics : int
        M, at least 1.

    Raises
    ------
    ValueError
        If one of these is out of range, or the field does not know its scale.
    """
    checked_rings(radii, wind_speed, rotor_speed, WIDEST)
    Count(at_least=1, at_most=12).check(harmonics, "field_filter.harmonics")
    weights = Numbers(axes=1).check(weights, "field_filter.weights")
    if weights.shape != radii.shape or abs(weights.sum() - 1.0) > 1e-6:
        raise ValueError(
            f"field_filter.weights: expected {len(radii)} shares whose sum is 1, got {len(weights)}, sum "
            f"{weights.sum():g}"
        )
    turn = rotor_speed / (2.0 * np.pi)
    # Fine about zero, where the spectra of slow eddies have their peak.
    frequencies = np.concatenate([[0.0], np.geomspace(1e-5, WIDEST, 600)])
    at_a_point = field.spectrum(frequencies, wind_speed) * field.deviation(wind_speed) ** 2
    shares = harmonic_shares(field, radii, wind_speed, frequencies, harmonics)
    spectra = at_a_point * np.einsum("r,mfrs,s->mf", weights, shares, weights)
    still = np.zeros(harmonics + 1)
    if steady is not None:
        told = min(len(steady), harmonics + 1)
        still[1:told] = 0.5 * np.abs(steady[1:told] @ weights)
    return EffectiveField(frequencies, spectra, still, turn)


def component_filter(field: EffectiveField, time_step: float) -> StateSpace:
    """From white noises of unit variance a step to the effective wind ``wind_0``, ``wind_c``, ``wind_s`` [m/s].

    Time-invariant, as the components of what blades meet are stationary. Harmonic 0 has three states, every other one
    six, and two more where something is steady. Variances are those of the spectra, exactly.
    """
    rows = [_fixed(field, time_step)]
    for m in range(1, len(field.spectra)):
        # exp(i m theta_b) and its conjugate: of the two the one that is a multiple of three, or one more.
        sign = -1.0 if m % BLADES == BLADES - 1 else 1.0
        turns = sign * m - (0.0 if m % BLADES == 0 else 1.0)
        # 2 Re U_m exp(i m theta) in u_0; else 2 U in u_c - i u_s. Of -m it is the conjugate, as normal as U_m.
        read = np.zeros((BLADES, 2))
        if m % BLADES == 0:
            read[0, 0] = 2.0
        else:
            read[1, 0], read[2, 1] = 2.0, -2.0
        rows += [_turning(part, read, turns * field.turn, time_step) for part in _parts(field, m, time_step)]
    return _joined(rows, ("wind_0", "wind_c", "wind_s"))


def blade_filter(field: EffectiveField, time_step: float) -> StateSpace:
    """From white noises of unit variance a step to the effective ``wind`` [m/s] that one turning blade meets."""
    rows = [_fixed(field, time_step).select(outputs=["wind_0"])]
    read = np.array([[2.0, 0.0]])
    for m in range(1, len(field.spectra)):
        rows += [_turning(part, read, m * field.turn, time_step) for part in _parts(field, m, time_step)]
    return _joined(rows, ("wind",))


def one_sided_spectrum(system: StateSpace, frequency: Array) -> Array:
    """Spectra (ny, N) of a filter's outputs under white noise of unit variance a step, at frequencies (N,) [Hz]."""
    response = system.frequency_response(frequency)
    return np.asarray(2.0 * system.time_step * np.sum(np.abs(response) ** 2, axis=2).T)


def _fixed(field: EffectiveField, time_step: float) -> StateSpace:
    """Harmonic 0, which is real and does not turn, to all three components."""
    part = _low_pass(field, 0, time_step)
    reads = np.vstack([part.C, np.zeros((2, part.order))])
    return StateSpace(
        part.A, part.B, reads, np.zeros((3, 1)), time_step, part.inputs, ("wind_0", "wind_c", "wind_s")
    )


def _parts(field: EffectiveField, m: int, time_step: float) -> list[StateSpace]:
    """Filters of the real (and of the imaginary) part of U_m: turbulence, and what is steady if there is any."""
    parts = [_low_pass(field, m, time_step)]
    if field.steady[m] > 0.0:
        # Of unknown phase: half the square in either part.
        kept, size = np.exp(-time_step / MEMORY), np.sqrt(0.5) * field.steady[m]
        driven = size * np.sqrt(1.0 - kept**2)
        parts.append(
            StateSpace(
                np.array([[kept]]),
                np.array([[driven]]),
                np.eye(1),
                np.zeros((1, 1)),
                time_step,
                ("white",),
                ("wind",),
            )
        )
    return parts


def _low_pass(field: EffectiveField, m: int, time_step: float) -> StateSpace:
    """Of harmonic 0, or of the real part of another one, which has half its variance."""
    variance = field.variances[m]
    poles, zeros = fit_low_pass(
        tuple(field.frequencies.tolist()), tuple((field.spectra[m] / variance).tolist()), REACH * field.turn
    )
    return sampled_low_pass(poles, zeros, np.sqrt(variance if m == 0 else 0.5 * variance), time_step)


def _turning(part: StateSpace, read: Array, turns: float, time_step: float) -> StateSpace:
    """Two copies of a filter, real and imaginary part, whose states are turned on by so many turns a second [Hz].

    White noise is the same when it is turned, so only the state's step turns.
    """
    angle = 2.0 * np.pi * turns * time_step
    rotation = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return StateSpace(
        A=np.asarray(np.kron(rotation, part.A)),
        B=np.asarray(np.kron(np.eye(2), part.B)),
        C=np.asarray(np.kron(read, part.C)),
        D=np.zeros((len(read), 2)),
        time_step=time_step,
        inputs=("white_r", "white_i"),
        outputs=tuple(f"wind_{row}" for row in range(len(read))),
    )


def _joined(rows: list[StateSpace], outputs: tuple[str, ...]) -> StateSpace:
    """Filters side by side whose outputs add up."""
    a, b = (scipy.linalg.block_diag(*(getattr(row, key) for row in rows)) for key in "AB")
    white = tuple(f"white_{i}" for i in range(b.shape[1]))
    c = np.hstack([row.C for row in rows])
    return StateSpace(a, b, c, np.zeros((len(c), len(white))), rows[0].time_step, white, outputs)


@lru_cache(maxsize=64)
def fit_low_pass(
    frequencies: tuple[float, ...], spectrum: tuple[float, ...], reach: float
) -> tuple[Array, Array]:
    """Poles (3,) and a zero (1,) [Hz] of a low pass whose spectrum follows one of unit variance up to a frequency.

    Least squares of the cubed error in decibels, which levels its peaks. Started from two poles and, between or beside
    them, a pole and a zero near each other: of such starts the best end counts. Deterministic; some 0.3 s.
    """
    from scipy.optimize import least_squares  # half a second to import

    f = np.concatenate([[0.0], np.geomspace(5e-3 * reach, reach, 120)])
    wanted = 10.0 * np.log10(np.interp(f, frequencies, spectrum))

    def error(logs: Array) -> Array:
        poles, zeros = _apart(logs)
        residue = residues(poles, zeros)
        # One-sided: the integral over f of |sum r / (i f + p)|^2 is pi times this.
        variance = np.pi * (residue @ (1.0 / np.add.outer(poles, poles)) @ residue)
        level = 10.0 * (
            np.log10(1.0 + (f[:, None] / zeros) ** 2).sum(axis=1)
            - np.log10(1.0 + (f[:, None] / poles) ** 2).sum(axis=1)
        )
        return np.asarray(level - 10.0 * np.log10(variance) - wanted)

    def fitted(start: Array, power: int) -> OptimizeResult:
        # Poles on top of each other have no residues.
        bounds = np.log([1e-4 * reach, 1e2 * reach])
        inside = np.clip(start, *(bounds + [0.1, -0.1]))
        return least_squares(lambda logs: error(logs) ** power, inside, bounds=bounds, max_nfev=80)

    half = float(f[np.argmax(wanted < wanted[0] - 3.0)])  # where the level has fallen by half
    first, apart = np.exp(fitted(np.log([half, half]), 1).x)
    second, ends = first + apart, []
    for place in (0.1 * half, 0.3 * half, first, np.sqrt(first * second), 2.0 * second):
        for ratio in (0.8, 1.25):
            poles = np.sort([first, ratio * place, second])
            start = np.log([poles[0], *np.maximum(np.diff(poles), 0.05 * poles[1:]), place])
            ends.append(fitted(start, 1))
    # The cube has no slope where the error is small and a steep one where it is large: not at first.
    poles, zeros = _apart(fitted(min(ends, key=lambda end: end.cost).x, 3).x)
    poles.flags.writeable = zeros.flags.writeable = False
    return poles, zeros


def _apart(logs: Array) -> tuple[Array, Array]:
    """Poles that rise, by the logarithms of the first and of their distances, and zeros by theirs."""
    count = min(POLES, len(logs))
    return np.cumsum(np.exp(logs[:count])), np.exp(logs[count:])
