"""Response of the turbine to turbulence or a given wind over a whole episode, computed at once (superposition).

The plant is linear up to the flap's stops, so what the wind does to the loads does not depend on the flaps. Filter and
turbine are one system driven by white noise; its first state is drawn from the exact stationary distribution, so
an episode has no run-in.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from flapgym.core.arrays import Array
from flapgym.core.state_space import StateSpace, series
from flapgym.model.turbine_model import TurbineModel
from flapgym.plant.frame import OutputRows
from flapgym.plant.lifted import Lifted, lift
from flapgym.plant.modal import Modal, modal_form
from flapgym.wind import von_karman_filter

RESPONSE_CHUNK = 2048
"""Samples of a given wind whose states are kept at once."""
BLOCK_STEPS = 64
"""Steps taken at once, rounded to whole intervals: about where products and recursion cost the same."""


def disturbance_system(model: TurbineModel, length_scale: float) -> StateSpace:
    """White noise to the turbine's outputs and the wind [m/s], at the model's turbulence intensity."""
    shaping = von_karman_filter(model.wind_speed, model.turbulence_intensity, length_scale, model.time_step)
    joint = series(shaping, model.turbine.select(inputs=["wind"]))
    wind = np.hstack([shaping.C, np.zeros((1, model.turbine.order))])
    return replace(
        joint,
        C=np.vstack([joint.C, wind]),
        D=np.vstack([joint.D, shaping.D]),
        outputs=(*joint.outputs, "wind"),
    )


def stationary_covariance(modal: Modal) -> Array:
    """Covariance (n, n) of the states under unit white noise, at the cost of a product.

    In modal coordinates the Lyapunov equation is solved entry by entry: E[z_i conj(z_j)] =
    b_i b_j' / (1 - l_i conj(l_j)) with b_j conjugate, and E[z_i z_j] alike without the conjugates.
    """
    b, values, expand = modal.drive, modal.values, modal.expand
    direct = b @ b.conj().T / (1.0 - np.outer(values, values.conj()))
    mirrored = b @ b.T / (1.0 - np.outer(values, values))
    return np.asarray(0.5 * (expand @ direct @ expand.conj().T + expand @ mirrored @ expand.T).real)


def stationary_root(modal: Modal) -> Array:
    """Map (2 m, n) of standard normal numbers to stationary modes, real and imaginary parts alternating.

    The symmetric root of the states' covariance, each state scaled to unit variance: unlike a factor of the modes' it
    does not depend on the order and the phase in which a machine happens to return its eigenvectors.
    """
    covariance = stationary_covariance(modal)
    scale = np.sqrt(np.diag(covariance))
    scale[scale == 0.0] = 1.0
    weights, vectors = scipy.linalg.eigh(covariance / np.outer(scale, scale))
    root = scale[:, None] * (vectors * np.sqrt(np.clip(weights, 0.0, None))) @ vectors.T
    modes = modal.project @ root
    return np.stack([modes.real, modes.imag], axis=1).reshape(2 * modal.order, -1)


@dataclass(frozen=True, eq=False)
class Disturbance:
    """Draws realisations and gives the outputs they cause.

    Attributes
    ----------
    modal : Modal
        White noise to outputs.
    root : (2 m, n) float
        Normal numbers to stationary modes.
    block : Lifted
        Several intervals at once.
    intervals_per_block : int
    rows : OutputRows
        Rows of one interval.
    """

    modal: Modal
    root: Array
    block: Lifted
    intervals_per_block: int
    rows: OutputRows

    @classmethod
    def of(cls, modal: Modal, root: Array, rows: OutputRows, turn: float) -> Disturbance:
        """For intervals of `rows`; `turn` is the azimuth [rad] of one step."""
        intervals = max(1, round(BLOCK_STEPS / rows.steps))
        block = lift(
            modal,
            intervals * rows.steps,
            np.asarray(np.kron(np.eye(intervals), rows.matrix(turn)), dtype=float),
        )
        return cls(modal, root, block, intervals, rows)

    def noise_count(self, intervals: int) -> int:
        """Random numbers one realisation of so many intervals takes: first state, then one a sample."""
        return self.root.shape[1] + intervals * self.rows.steps + 1

    def respond(self, noise: Array, intervals: int, azimuth: float) -> tuple[Array, Array]:
        """Outputs caused by a realisation of the turbulence at the model's intensity.

        Parameters
        ----------
        noise : (noise_count,) float
            Standard normal numbers.
        intervals : int
            Length of the episode.
        azimuth : float
            At its start, which counts for nothing: the wind is the same everywhere.

        Returns
        -------
        first : (ny + 1,) float
            Outputs at sample 0, blades in multi-blade coordinates, and the wind.
        rows : (intervals, rows.count) float
            Rows of every interval.
        """
        start = self.root.shape[1]
        span = self.intervals_per_block * self.rows.steps
        blocks = -(-intervals // self.intervals_per_block)
        state = self.root @ noise[:start]
        white = np.zeros(blocks * span + 1)
        white[: len(noise) - start] = noise[start:]
        # Copied, because products of overlapping views do not reach the fast matrix product.
        windows = np.lib.stride_tricks.sliding_window_view(white, span + 1)[::span].copy()
        pushes = (windows[:, :span] @ self.block.drive).view(complex)
        modes = state.view(complex)
        first = (self.modal.read @ modes).real + self.modal.D[:, 0] * white[0]
        rows = self.block.march(modes, pushes) @ self.block.read + windows @ self.block.feed
        return first, rows.reshape(blocks * self.intervals_per_block, self.rows.count)[:intervals]


def wind_modes(model: TurbineModel) -> Modal:
    """Wind [m/s] to the turbine's outputs and the wind itself."""
    turbine = model.turbine.select(inputs=["wind"])
    return modal_form(
        replace(
            turbine,
            C=np.vstack([turbine.C, np.zeros((1, turbine.order))]),
            D=np.vstack([turbine.D, np.ones((1, 1))]),
            outputs=(*turbine.outputs, "wind"),
        )
    )


def wind_response(modal: Modal, wind: Array, before: float | Array) -> Array:
    """Outputs and wind (T, ny + 1) of a turbine to a wind series [m/s] known in advance, such as a gust.

    Parameters
    ----------
    modal : Modal
        Of `wind_modes`, or from winds by strip.
    wind : (T,) or (T, nu) float
        At samples 0 to T - 1 [m/s], one for each input.
    before : float or (nu,) float
        What has always blown before [m/s]: the turbine starts in equilibrium with it.
    """
    winds = wind.reshape(len(wind), -1)
    outputs = np.empty((len(winds), len(modal.outputs)))
    state = modal.drive @ np.atleast_1d(before) / (1.0 - modal.values)
    states = np.empty((RESPONSE_CHUNK, modal.order), dtype=complex)
    for first in range(0, len(winds), RESPONSE_CHUNK):
        pushes = winds[first : first + RESPONSE_CHUNK] @ modal.drive.T
        for row, push in enumerate(pushes):
            states[row] = state
            state = modal.values * state + push
        outputs[first : first + len(pushes)] = (states[: len(pushes)] @ modal.read.T).real
    return outputs + winds @ modal.D.T


def disturbance_modes(model: TurbineModel, length_scale: float) -> tuple[Modal, Array]:
    """Modal form of the disturbance system and the factor of its stationary covariance."""
    modal = modal_form(disturbance_system(model, length_scale))
    return modal, stationary_root(modal)
