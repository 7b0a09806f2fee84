"""LQG on each blade that is told by a lidar what wind comes: feedforward of the part of the wind that the lidar knows.

The wind is split in two. What the beams tell of it is a known input: it drives observer and plant alike, and its coming
part is answered before it is there. What they do not tell stays turbulence, which the LQG's own filter stands for. With
no lidar, or one that tells nothing, the controller is the LQG of the same weights.

Of a cost's quadratic optimum the accelerations that answer a known wind w_0, w_1, ... are

    f = sum_j g_j w_j,   g_0 = -S^-1 B' P B_w,   g_j = -S^-1 B' (closed')^(j - 1) (closed' P B_w + C' q D_w),

with the regulator's Riccati matrix P, S = R + B' P B and closed = A - B K (`preview_gains`). On a blade the wind is
that of its place, w_0 + w_c cos(theta_b) + w_s sin(theta_b), and the blade goes on turning while it comes.

What is known of w_0, and of w_c and w_s, at a moment is the best linear estimate from the beams' estimates in memory,
by the field's cross-spectra on their circle (`Estimator`). As the gains and these estimates are linear, both together
are one row of weights on the memory, for each age that the newest measurement may have.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from flapgym.control.agent import Floats, blade_entries, by_blade
from flapgym.control.blade_controller import OBSERVED, acceleration_limits, step_matrix
from flapgym.control.lqg import (
    RBM_UNIT,
    DesignModel,
    Weights,
    design_model,
    initial_estimate,
    predictor_gain,
    regulator_gain,
    synthesise,
    with_actuator,
)
from flapgym.core.arrays import BLADES, Array
from flapgym.core.fields import Quantity
from flapgym.core.multiblade import blade_azimuths
from flapgym.model.turbine_model import TurbineModel
from flapgym.wind import Lidar
from flapgym.wind.field import harmonic_shares
from flapgym.wind.turbulence import Turbulence

HIGHEST = 2.0
"""Frequency [Hz] up to which the estimates count what the field has: a mean along beams leaves nothing beyond."""
RESOLUTION = 1e-3
"""Between frequencies [Hz]: correlations repeat themselves after a thousand seconds."""
AGES = 12
"""For which the newest measurement has weights of its own, between its arrival and the next."""
PAST = 10.0
"""Time [s] for which what has arrived stays in memory."""
SPACING = 0.02
"""Of the lags at which correlations are computed [s]: between them a wave of `HIGHEST` errs by 1 %."""
LONGEST = 30.0
"""Time [s] ahead for which correlations are known."""
NEGLIGIBLE = 1e-3
"""Of the gains over the largest, where the look ahead ends."""


class LidarLQG:
    """Three copies of an LQG of the clamped blade, with feedforward of what a lidar tells of the coming wind.

    Parameters
    ----------
    name : str
        What tables call it.
    model : TurbineModel
        Its clamped blade is the design model.
    weights : Weights
        Of the LQG.
    lidar : Lidar
        That of the environment (`sensors.lidar`).
    field : Turbulence
        Of the environment (`wind.field`), on the turbine (`Turbulence.on_turbine`).
    share : float
        Of what is known of the wind that counts: 1 is the optimum, 0 the LQG.
    """

    observe: tuple[str, ...] = (*OBSERVED, "azimuth", "lidar")
    steps_per_action = 1
    per_blade = False

    def __init__(
        self,
        name: str,
        model: TurbineModel,
        weights: Weights,
        lidar: Lidar,
        field: Turbulence,
        share: float = 1.0,
    ) -> None:
        Quantity("number", at_least=0.0, at_most=2.0).check(share, f"agent {name}: share")
        self.name, self.model_hash, self.time_step = name, model.hash, model.time_step
        self.flaps, self._lidar = len(model.flaps), lidar
        design = design_model(model)
        self._start = initial_estimate(design, weights)
        observer = synthesise(design, weights)
        self._order = observer.order
        self._step = step_matrix(observer, np.array(acceleration_limits(model)))
        gains, self._observed_wind = preview_gains(model, design, weights)
        estimator = Estimator.of(lidar, field, model.wind_speed)
        self._memory = estimator.count
        turned = np.exp(1j * model.rotor_speed * model.time_step * np.arange(gains.shape[1]))
        ages = lidar.delay + (np.arange(AGES) + 0.5) / (AGES * lidar.sample_rate)
        ahead = model.time_step * np.arange(gains.shape[1], dtype=np.float64)
        mean = np.stack([estimator.mean(ahead, age) for age in ages])  # (ages, ahead, memory)
        cyclic = np.stack([estimator.cyclic(ahead, age) for age in ages])
        self._mean = share * np.concatenate([gains @ mean, mean[:, :1]], axis=1)
        """Weights of accelerations and of the wind now on the memory of u_0, (ages, F + 1, memory)."""
        self._cyclic = share * np.concatenate([(gains * turned) @ cyclic, cyclic[:, :1]], axis=1)
        """The same on that of u_c - i u_s, complex."""

    def predict(
        self,
        observation: Floats,
        state: Array | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], Array | None]:
        """Action (..., 3 F) and next state (..., 3, n + memory + 1) for an observation (..., 3 + 6 F + 5).

        A row of the state has a blade's estimate; the lidar's u_0, u_c or u_s in memory, the newest first; and the
        steps since the episode's start.
        """
        values = np.asarray(observation, dtype=float)
        signals = BLADES * blade_entries(OBSERVED, self.flaps)
        if values.shape[-1] != signals + 2 + BLADES:
            raise ValueError(
                f"agent {self.name}: expected {signals + 2 + BLADES} observations ({', '.join(self.observe)}), "
                f"got {values.shape[-1]}"
            )
        measured = by_blade(values[..., :signals], OBSERVED, self.flaps)
        azimuth = np.arctan2(values[..., signals + 1], values[..., signals])
        n, told = self._order, values[..., signals + 2 :, None]
        batch = measured.shape[:-2]
        begun = np.zeros((*batch, BLADES, n + self._memory + 1))
        begun[..., :n] = measured @ self._start.T
        begun[..., n : n + 1] = told
        if state is None:
            state = begun
        elif episode_start is not None and np.any(episode_start):
            begins = np.broadcast_to(np.asarray(episode_start, dtype=bool).reshape(-1), batch or (1,))
            state = np.where(begins.reshape(*batch, 1, 1), begun, state)
        # Turbines step together, but may have begun apart.
        estimate, memory, steps = state[..., :n], state[..., n:-1], state[..., 0, -1]
        number, age = self._newest(steps)
        before, _ = self._newest(steps - 1.0)
        fresh = (number > before)[..., None, None] & (steps > 0.0)[..., None, None]
        memory = np.where(fresh, np.concatenate([told, memory[..., :-1]], axis=-1), memory)
        wind = self._known(memory, age, azimuth)
        after = np.concatenate([estimate, measured], axis=-1) @ self._step
        following = after[..., :n] + wind[..., -1:] * self._observed_wind
        action = np.clip(after[..., n:] + wind[..., :-1], -1.0, 1.0).astype(np.float32)
        later = np.concatenate([following, memory, state[..., -1:] + 1.0], axis=-1)
        return action.reshape(*batch, BLADES * self.flaps), later

    def _newest(self, steps: Array) -> tuple[Array, NDArray[np.int64]]:
        """Number of the newest measurement told after so many steps, and which of the ages it has."""
        since = (steps * self.time_step - self._lidar.delay) * self._lidar.sample_rate + 1e-9
        number = np.floor(since)
        return number, np.clip(np.floor((since - number) * AGES), 0, AGES - 1).astype(np.int64)

    def _known(self, memory: Array, age: NDArray[np.int64], azimuth: Array) -> Array:
        """Accelerations that answer it and the wind now, (..., 3, F + 1), of each blade."""
        of_mean = np.einsum("...km,...m->...k", self._mean[age], memory[..., 0, :])
        turning = memory[..., 1, :] - 1j * memory[..., 2, :]
        of_cyclic = np.einsum("...km,...m->...k", self._cyclic[age], turning)
        place = np.exp(1j * blade_azimuths(azimuth))[..., None]
        return np.asarray(of_mean[..., None, :] + (of_cyclic[..., None, :] * place).real)


def preview_gains(model: TurbineModel, design: DesignModel, weights: Weights) -> tuple[Array, Array]:
    """Answers (F, M) to a known wind of 1 m/s now and in the next steps, as fractions of full actions; see above.

    Returns
    -------
    gains : (F, M) float
        [s / m]
    observed : (n,) float
        What 1 m/s of known wind now adds to the observer's estimate.
    """
    blade = model.blade.select(["wind"], design.channels.moments)
    order = design.A.shape[0] - blade.order
    b_wind = np.concatenate([np.zeros(order), blade.B[:, 0] / design.scale[order:]])
    d_wind = blade.D[:, 0] / RBM_UNIT
    a, b, c = with_actuator(design)
    gain, cost = regulator_gain(design, weights)
    flaps = design.channels.flaps
    closed = a - b @ gain
    curvature = weights.acceleration / flaps * np.eye(flaps) + b.T @ cost @ b
    # What the moment feels at once of the wind now cannot be helped any more; of the wind to come it can.
    gains, costate = list[Array](), cost @ np.concatenate([b_wind, np.zeros(2 * flaps)])
    while not gains or np.abs(gains[-1]).max() > NEGLIGIBLE * np.abs(gains).max():
        gains.append(-np.linalg.solve(curvature, b.T @ costate))
        costate = closed.T @ costate
        if len(gains) == 1:
            costate = costate + weights.rbm * c.T @ d_wind
    observer, _ = predictor_gain(design, weights)
    return np.stack(gains, axis=1), b_wind - observer @ d_wind


@dataclass(frozen=True, eq=False)
class Estimator:
    """The best linear estimate of the wind that arrives from a lidar's estimates in memory, by cross-spectra.

    The wind is that of harmonic 0, or 1, of the azimuth on the beams' circle; both have even spectra, so that weights
    are real, and the same for u_c and u_s.

    Attributes
    ----------
    arrives : (n,) float
        When what is in memory arrives, the newest first, if it was measured now [s].
    lags : (K,) float
        Times between an arrival and the wind estimated [s].
    shared : (2, K) float
        Of harmonics 0 and 1: correlation of the wind with the lidar's estimate of it, over the variance at a point.
    inverse : (2, n, n) float
        Of the covariance of what is in memory.
    """

    arrives: Array
    lags: Array
    shared: Array
    inverse: Array

    @classmethod
    def of(cls, lidar: Lidar, field: Turbulence, wind_speed: float) -> Estimator:
        """For a lidar in a field at a mean wind [m/s]."""
        ahead = lidar.range / wind_speed
        count = math.floor((ahead + PAST) * lidar.sample_rate)
        back = np.arange(count, dtype=np.float64) / lidar.sample_rate
        frequencies = RESOLUTION * (np.arange(round(HIGHEST / RESOLUTION), dtype=np.float64) + 0.5)
        power = RESOLUTION * field.spectrum(frequencies, wind_speed)
        averaging = lidar.averaging(frequencies, wind_speed)
        own = harmonic_shares(field, np.array([lidar.radius]), wind_speed, frequencies, 1)[..., 0, 0]
        # All harmonics that the beams cannot tell from 0 and from 1 stand in what they tell.
        chords = 2.0 * lidar.radius * np.sin(0.5 * lidar.azimuths)
        coherence = field.coherence(field.decay(frequencies, wind_speed)[:, None] * chords)
        mixed = np.fft.fft(coherence, axis=1).real.T[:2] / lidar.beams
        noise = (lidar.noise / (lidar.projection * field.deviation(wind_speed))) ** 2 / lidar.beams
        shared = power * averaging * lidar.likeness(frequencies, wind_speed) * own
        inverse = np.zeros((2, count, count))
        waves = np.cos(2.0 * np.pi * np.outer(back, frequencies))
        for harmonic in range(2 if lidar.beams > 2 else 1):
            correlation = waves @ (power * averaging**2 * mixed[harmonic])
            covariance = scipy.linalg.toeplitz(correlation)
            # Round-off of a smooth record, beside the noise.
            covariance += (noise + 1e-6 * correlation[0]) * np.eye(count)
            inverse[harmonic] = np.linalg.inv(covariance)
        lags = np.arange(0.0, ahead + PAST + LONGEST, SPACING)
        waves = np.cos(2.0 * np.pi * np.outer(lags, frequencies))
        return cls(ahead - back, lags, shared @ waves.T, inverse)

    @property
    def count(self) -> int:
        """Measurements in memory."""
        return len(self.arrives)

    def mean(self, time: Array, age: float) -> Array:
        """Weights (T, n) of u_0 in memory in the estimate of what arrives at times from now (T,) [s].

        Parameters
        ----------
        time : (T,) float
            [s]
        age : float
            Of the newest measurement [s].
        """
        return self._weights(0, time, age)

    def cyclic(self, time: Array, age: float) -> Array:
        """The same of u_c and of u_s; none if the beams do not tell them."""
        return self._weights(1, time, age)

    def _weights(self, harmonic: int, time: Array, age: float) -> Array:
        apart = np.abs(time[:, None] - (self.arrives - age))
        return np.asarray(np.interp(apart, self.lags, self.shared[harmonic]) @ self.inverse[harmonic])
