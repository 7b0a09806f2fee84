"""The response of a turbine to a turbulent field over its disk, from the spectra: no wind is made strip by strip.

What turning blades meet is stationary in multi-blade components (`flapgym.wind.blade_field`), and so is what it does. A
realisation is a sum of waves, each with independent normal numbers; the turbine answers each by its frequency
response. Strips, rotor and field are folded into one small matrix a frequency, and an episode is one inverse Fourier
transform of the outputs. It is exact for the waves, and stationary from the first sample: there is no run-in.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.fft import irfft, next_fast_len

from flapgym.core.arrays import BLADES, Array, ComplexArray
from flapgym.core.fields import Quantity
from flapgym.core.modal import Modal
from flapgym.plant.frame import OutputRows
from flapgym.plant.wind_response import Blowing
from flapgym.wind.blade_field import PARTS, BladeTurbulence, FieldOnDisk, blade_turbulence, field_on_disk
from flapgym.wind.field import SCALES_APART, interpolation_weights, time_scale
from flapgym.wind.turbulence import Turbulence

HIGHEST = 3.0
"""Frequency [Hz] up to which the blades meet all that the field has."""
MEMORIES_APART = 5.0
"""Time constants of the slowest mode from an episode's end to the repetition of its beginning: of what it does there,
exp(-5), 0.7 %, is left."""
SAMPLES_A_WAVE = 8
"""At least, of the shortest wave, that the inverse Fourier transform has."""
TAPS = 12
"""Of these samples that one step is made of: to 1e-9 of a wave (`interpolation_weights`)."""


@dataclass(frozen=True, eq=False)
class FieldResponse:
    """A turbulent field (`flapgym.plant.wind_response.WindResponse`), stationary in multi-blade components.

    Attributes
    ----------
    modal : Modal
        Winds by strip, in multi-blade components, to the outputs that have rows, and to the wind behind them.
    rows : OutputRows
        Rows of one interval.
    turn : float
        Azimuth of one step [rad].
    field : Turbulence
    radii : (R,) float
        Of the strips, rising [m].
    wind_speed : float
        [m/s]
    """

    modal: Modal
    rows: OutputRows
    turn: float
    field: Turbulence
    radii: Array
    wind_speed: float

    def noise_count(self, intervals: int) -> int:
        """Numbers of the waves."""
        return self.prepared(intervals).turbulence.noise_count

    def prepared(self, intervals: int) -> Synthesis:
        """What is made once for episodes of so many intervals.

        Raises
        ------
        ValueError
            If the model's steps are too long for the waves of the field; the message names the value.
        """
        step = self.modal.time_step
        memory = max(
            SCALES_APART * time_scale(self.field, self.wind_speed),
            MEMORIES_APART * -step / math.log(np.abs(self.modal.values).max()),
        )
        # The same numbers make another wind where it is to last longer. So lengths are few: whoever holds actions
        # longer, and has to round its episode up to whole ones, meets the same wind.
        period = 2.0 ** (math.ceil(4.0 * math.log2(intervals * self.rows.steps * step + memory)) / 4.0)
        return _synthesis(self, period)

    def on_disk(self, noise: Array, intervals: int) -> FieldOnDisk:
        """The field over the disk."""
        turbulence = self.prepared(intervals).turbulence
        return field_on_disk(self.field, turbulence, self.wind_speed, self.turn / self.modal.time_step, noise)

    def respond(self, noise: Array, intervals: int, azimuth: float) -> tuple[Array, Array]:
        """Outputs at sample 0, and rows; told of the wind is its mean over the disk. The azimuth counts for nothing."""
        outputs = self.prepared(intervals).outputs(noise, intervals * self.rows.steps + 1)
        flat = outputs[1:].reshape(intervals, -1)
        return outputs[0], flat @ self.rows.matrix(self.turn).T

    def blowing(self, noise: Array, intervals: int, azimuth: float) -> Blowing:
        """The field, and the turbine's stationary motion in it."""
        prepared, modal = self.prepared(intervals), self.modal
        waves = prepared.turbulence.waves(noise) * self.field.deviation(self.wind_speed)
        waves = waves.reshape(len(waves), -1)
        ahead = np.exp(2j * np.pi * prepared.turbulence.frequencies * modal.time_step)[:, None]
        # The wind is the real part of its waves, half of each and half of its conjugate: a mode, complex, hears both.
        push, back = waves @ modal.B.T, waves.conj() @ modal.B.T
        modes = 0.5 * (push / (ahead - modal.values) + back / (ahead.conj() - modal.values)).sum(axis=0)
        waves[1:] *= 0.5
        spectrum = np.vstack([waves.T, prepared.of_average(noise)])
        winds = prepared.sampled(spectrum, intervals * self.rows.steps + 1)
        return Blowing((modal.expand @ modes).real, winds[:, :-1], winds[:, -1])


@dataclass(frozen=True, eq=False)
class Synthesis:
    """From normal numbers to the outputs of an episode.

    Attributes
    ----------
    turbulence : BladeTurbulence
    response : (F, ny + 1, 4 R) complex
        From its noise to the waves of the outputs and the wind, halved but for the zeroth: of `irfft`.
    coarse : int
        Steps from one sample of the inverse Fourier transform to the next.
    points : int
        Samples of the transform.
    weights : (coarse, TAPS) float
        What steps take of the samples around them.
    """

    turbulence: BladeTurbulence
    response: ComplexArray
    coarse: int
    points: int
    weights: Array

    def outputs(self, noise: Array, steps: int) -> Array:
        """Outputs and wind (steps, ny + 1) from time zero on."""
        waves = self.turbulence.parts(noise).reshape(len(self.response), -1, 1)
        return self.sampled(np.ascontiguousarray((self.response @ waves)[..., 0].T), steps)

    def of_average(self, noise: Array) -> ComplexArray:
        """Waves (F,) of the mean over the disk, halved but for the zeroth."""
        return np.einsum(
            "fp,fp->f", self.response[:, -1], self.turbulence.parts(noise).reshape(len(self.response), -1)
        )

    def sampled(self, spectrum: ComplexArray, steps: int) -> Array:
        """Steps (steps, k) from time zero on of what has waves (k, F), halved but for the zeroth."""
        samples = irfft(spectrum, self.points, axis=1, norm="forward")
        blocks = -(-steps // self.coarse)
        # The first weight belongs to a sample before time zero; the series is periodic.
        around = samples[:, np.arange(1 - TAPS // 2, blocks + TAPS // 2) % self.points]
        windows = np.lib.stride_tricks.sliding_window_view(around, TAPS, axis=1)
        fine = windows @ self.weights.T
        return np.ascontiguousarray(fine.reshape(len(fine), -1)[:, :steps].T)


# An environment over wind speeds goes from one to another of some ten; what it had dropped would take a second again.
@lru_cache(maxsize=16)
def _synthesis(response: FieldResponse, period: float) -> Synthesis:
    modal = response.modal
    step, rotor_speed = modal.time_step, response.turn / modal.time_step
    highest = HIGHEST + rotor_speed / (2.0 * np.pi)  # as components have it
    Quantity("time", above=0.0, below=0.5 / highest).check(step, "field.time_step")
    coarse = max(1, math.floor(1.0 / (SAMPLES_A_WAVE * highest * step)))
    points = next_fast_len(math.ceil(period / (coarse * step)), real=True)
    turbulence = blade_turbulence(
        response.field, response.radii, response.wind_speed, rotor_speed, points * coarse * step, HIGHEST
    )
    deviation = response.field.deviation(response.wind_speed)
    # Of strips and components, those of one strip together: to outputs from the parts of which the noise is.
    answers = modal.frequency_response(turbulence.frequencies)
    answers = answers.reshape(*answers.shape[:2], len(response.radii), BLADES)
    folded = np.einsum("fyrc,cp,fprs->fyps", answers, PARTS, turbulence.root, optimize=True)
    # The mean over the disk is of U_0 alone.
    folded[:, -1, 1:] = 0.0
    folded *= deviation
    folded[1:] *= 0.5
    weights = interpolation_weights(coarse, highest * step, TAPS)
    return Synthesis(turbulence, folded.reshape(*folded.shape[:2], -1), coarse, points, weights)
