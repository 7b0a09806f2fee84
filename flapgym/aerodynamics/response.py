"""Response of the vortex lattice in the z-domain and by time marching (paper eq. 8 and 12).

The wake is a pure shift register, so with Gamma^{t-k} = z^-k Gamma^t each cyclic component obeys
H(z) Gamma = -w with H(z) = A_b + W(z) S, W(z) = sum_k z^-k A_w,k, of which only the strips' last circulations
S Gamma need be solved for at each frequency (capacitance form).
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flapgym.aerodynamics.loads import FullLoads
from flapgym.aerodynamics.model import Aerodynamics
from flapgym.core.arrays import Array, ComplexArray

_BLOCK = 512  # frequencies handled at once: keeps the table of powers of z below some MB


def _project(
    aero: Aerodynamics,
    component: int,
    downwash: NDArray[np.generic],
    load: NDArray[np.generic],
    full: FullLoads | None,
) -> tuple[ComplexArray, ComplexArray]:
    """What the strips' last circulations, then the loads lag by lag, take from inputs and from the wake.

    Returns ([nz,] q, nu) and (q, strips, K) with q = strips + lags ny.
    """
    bound, wake = aero.bound_influence[component], aero.wake_influence[component]
    n, strips, rows = wake.shape
    by_lag = [np.asarray(load @ force, dtype=complex) for force in aero.force]
    if full is not None:
        near, far = (part[component] for part in aero.leading_influence)
        by_lag[0] = by_lag[0] + full.circulation + full.induced @ near
    wanted = np.concatenate([np.eye(n)[-strips:], *by_lag])
    wanted = np.linalg.solve(bound.T, wanted.T).T
    per_input, per_wake = -wanted @ downwash, -(wanted @ wake.reshape(n, -1))
    if full is not None:
        # The wake induces velocities on the mean circulation, past the bound rings' answer to it.
        present, ny = slice(strips, strips + len(load)), len(load)
        per_wake[present] += full.induced @ far.reshape(far.shape[0], -1)
        direct = np.zeros((len(wanted), per_input.shape[-1]))
        direct[strips : strips + ny] = full.direct
        per_input = per_input + direct
    return per_input, per_wake.reshape(-1, strips, rows)


def transfer_function(
    aero: Aerodynamics,
    component: int,
    z: ArrayLike,
    downwash: ArrayLike,
    load: ArrayLike,
    full: FullLoads | None = None,
) -> ComplexArray:
    """Loads per unit input of one cyclic component at points z of the complex plane.

    Parameters
    ----------
    component : int
        0 collective, 1 whirl (circulation of blade b is exp(+2j pi b / 3) times that of blade 1).
    z : (nz,) complex
        exp(j omega dt), or any other point with |z| > 0.
    downwash : (n, nu) or (nz, n, nu) float or complex
        Downwash at the collocation points per unit of every input [m/s], the same for every z or not.
    load : (ny, 3 P) float
        Outputs as sums over the forces at `aero.force_point` [1/N].
    full : FullLoads, optional
        What the mean circulation adds to them.

    Returns
    -------
    (nz, ny, nu) complex: output at a step per input at the same step.
    """
    z, downwash, load = np.atleast_1d(np.asarray(z)), np.asarray(downwash), np.asarray(load)
    per_input, per_wake = _project(aero, component, downwash, load, full)
    _, strips, rows = per_wake.shape
    lags, ny, nu = aero.force.shape[0], load.shape[0], downwash.shape[-1]
    response = np.empty((z.size, ny, nu), dtype=complex)
    for first in range(0, z.size, _BLOCK):
        block = slice(first, first + _BLOCK)
        powers = z[block, None] ** -np.arange(1.0, rows + 1.0)
        feedback = (powers @ per_wake.reshape(-1, rows).T).reshape(len(powers), -1, strips)
        direct = per_input[block] if per_input.ndim == 3 else per_input[None]
        shed = np.linalg.solve(np.eye(strips) - feedback[:, :strips], direct[:, :strips])
        by_lag = (direct[:, strips:] + feedback[:, strips:] @ shed).reshape(-1, lags, ny, nu)
        shift = z[block, None] ** -np.arange(float(lags))
        response[block] = np.einsum("zl,zlyu->zyu", shift, by_lag)
    return response


def collective_response(
    aero: Aerodynamics,
    signal: ArrayLike,
    downwash: ArrayLike,
    load: ArrayLike,
    full: FullLoads | None = None,
) -> Array:
    """Loads (T, ny) in time, from rest, under inputs (T, nu) that are equal on all blades.

    The shift register of the wake is kept, all else is projected on the strips' last circulations and the loads as
    in the z-domain: some 20 microseconds a step for each thousand wake rings.
    """
    signal, downwash, load = np.asarray(signal, float), np.asarray(downwash, float), np.asarray(load, float)
    per_input, per_wake = (part.real for part in _project(aero, 0, downwash, load, full))
    _, strips, rows = per_wake.shape
    per_wake = per_wake.reshape(-1, strips * rows)
    lags, ny = aero.force.shape[0], load.shape[0]
    shed = np.zeros((strips, rows))
    by_lag = np.zeros((len(signal) + lags, lags, ny))
    for t, direct in enumerate(signal @ per_input.T):
        value = direct + per_wake @ shed.ravel()
        by_lag[t] = value[strips:].reshape(lags, ny)
        shed[:, 1:] = shed[:, :-1].copy()
        shed[:, 0] = value[:strips]
    output = np.zeros((len(signal), ny))
    for lag in range(lags):
        output[lag:] += by_lag[: len(signal) - lag, lag]
    return output


def steady_circulation(aero: Aerodynamics, downwash: ArrayLike) -> Array:
    """Circulation (n, nu) [m^2/s] of each blade under steady downwash (n, nu) [m/s], equal on all blades."""
    total = aero.bound_influence[0].real.copy()
    strips = aero.lattice.strips
    total[:, -strips:] += aero.wake_influence[0].real.sum(axis=2)
    return np.asarray(-np.linalg.solve(total, np.asarray(downwash)))


def steady_response(
    aero: Aerodynamics, downwash: ArrayLike, load: Array, full: FullLoads | None = None
) -> Array:
    """Loads (ny, nu) under steady downwash (n, nu) [m/s], equal on all blades; `full` as for `transfer_function`."""
    circulation = steady_circulation(aero, downwash)
    loads = load @ aero.force.sum(axis=0) @ circulation
    if full is None:
        return np.asarray(loads)
    near, far = (part[0].real for part in aero.leading_influence)
    velocity = near @ circulation + far.sum(axis=2) @ circulation[-aero.lattice.strips :]
    return np.asarray(loads + full.circulation @ circulation + full.induced @ velocity + full.direct)


class RotorWake:
    """Bound and wake circulations of all blades in time, every one of them a state; the reference for all else.

    Attributes
    ----------
    per_downwash : (blades n, blades n) float
        Bound circulation at a step per downwash at that step [m].
    """

    def __init__(self, aero: Aerodynamics) -> None:
        self._blades, self._aero = aero.blades, aero
        self.per_downwash = -np.linalg.inv(self._between_blades(aero.bound_pair))
        self._wake = self._between_blades(aero.wake_pair)
        self._shed = np.zeros((aero.blades, aero.lattice.strips, aero.wake_rows))

    def _between_blades(self, pair: Array) -> Array:
        """What every blade feels of every other, (blades m, blades k), from what blade 1 feels (blades, m, ...)."""
        blades = self._blades
        # What blade j feels of blade i depends on (i - j) alone.
        order = (np.arange(blades)[None] - np.arange(blades)[:, None]) % blades
        own = pair.reshape(blades, pair.shape[1], -1)
        return own[order].transpose(0, 2, 1, 3).reshape(blades * pair.shape[1], -1)

    def from_wake(self) -> Array:
        """Bound circulation (blades n,) [m^2/s] that the wake alone calls for at the next step."""
        return np.asarray(self.per_downwash @ (self._wake @ self._shed.ravel()))

    @cached_property
    def leading(self) -> tuple[Array, Array]:
        """Velocity (blades 3 n,) on the leading segments per bound and per wake circulation [1/m]."""
        bound, wake = self._aero.leading_pair
        return self._between_blades(bound), self._between_blades(wake)

    def leading_from_wake(self) -> Array:
        """Velocity (blades 3 n,) [m/s] that the wake induces on the leading segments at the next step."""
        return np.asarray(self.leading[1] @ self._shed.ravel())

    def advance(self, circulation: Array) -> None:
        """Shed the strips' last circulations of a step, (blades n,) [m^2/s], into the wake."""
        strips = self._shed.shape[1]
        last = circulation.reshape(self._blades, -1)[:, -strips:, None]
        self._shed = np.concatenate([last, self._shed[:, :, :-1]], axis=2)


def march(aero: Aerodynamics, downwash: ArrayLike) -> tuple[Array, Array]:
    """Reference solution in time of all blades' full state, from rest; nothing in production uses it.

    Parameters
    ----------
    downwash : (T, blades, n) float
        Downwash at the collocation points of each blade [m/s].

    Returns
    -------
    circulation : (T, blades, n) float
        Bound circulations [m^2/s].
    force : (T, blades, P, 3) float
        Forces at `force_point` of each blade, in that blade's own axes [N].
    """
    downwash = np.asarray(downwash, dtype=float)
    steps, blades, n = downwash.shape
    wake = RotorWake(aero)
    past = np.zeros((aero.force.shape[0], blades, n))
    circulation = np.empty((steps, blades, n))
    force = np.empty((steps, blades, aero.force_point.size))
    for t in range(steps):
        gamma = wake.per_downwash @ downwash[t].ravel() + wake.from_wake()
        wake.advance(gamma)
        circulation[t] = gamma.reshape(blades, n)
        past = np.concatenate([circulation[t][None], past[:-1]])
        force[t] = np.einsum("lfn,lbn->bf", aero.force, past)
    return circulation, force.reshape(steps, blades, -1, 3)
