"""Disk margin of a controller in the blades' own frames on the turning turbine, whose loop is periodic.

A signal at one frequency comes back at others, whole revolutions per second apart. The loop is lifted: one matrix a
frequency relates the harmonics to each other (Wereley 1991), and its largest singular value is the gain over all
signals, as that of a time-invariant loop is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flapgym.control.channels import MULTIBLADE, ROTOR, controller_channels
from flapgym.control.closed_loop import flaps_loop, growth_per_turn, require_flaps, require_model_step
from flapgym.control.margins import DiskMargin
from flapgym.core.arrays import Array
from flapgym.core.multiblade import blade_azimuths
from flapgym.core.state_space import StateSpace, TransferFunction
from flapgym.model.turbine_model import TurbineModel

Response = NDArray[np.complexfloating]
Indices = NDArray[np.integer]

HARMONICS = 1
"""To either side of a frequency; two change the margin of the design on a frozen turbine by 1e-8."""
RESOLUTION = 32
"""Intervals per revolution a second at the start of the search, besides those the open loop's own modes begin."""
TOLERANCE = 1e-5
"""Of the margin, relative: between the frequencies looked at it is nowhere smaller by more than that."""
CURVATURE_ALLOWANCE = 2.0
"""Bound on the open loop's change within an interval, over its change from end to end; a straight line has one."""
TURNS = np.array([0, 1, -1])
"""Revolutions a second by which the rotating frame sees the components 0, + and - faster."""


def periodic_disk_margin(
    model: TurbineModel, controller: StateSpace, harmonics: int = HARMONICS
) -> DiskMargin:
    """The disk margin of `flapgym.control.margins` for a controller of the rotor in the blades' own frames.

    It guarantees the same: stability for all complex factors on the three measurements within the disk, the gain of the
    periodic S - T taken over all signals. Each blade's signal is the sum of three components that turn with the rotor,
    e^(i k theta_b) a_k / sqrt 3 with k = 0, 1, -1, in which the turbine is time-invariant.

    Parameters
    ----------
    model : TurbineModel
    controller : StateSpace
        Three moments and all flaps' angles and rates to their accelerations. One whose loop grows
        (`growth_per_turn`) has the margin 0, at a frequency that is not known, NaN.
    harmonics : int
        Kept to either side of each frequency.
    """
    channels = controller_channels(controller.inputs)
    if controller.inputs != ROTOR.with_flaps(channels.flaps).inputs:
        raise ValueError(
            f"periodic_disk_margin: expected a controller of {', '.join(ROTOR.moments)}, got one of "
            f"{', '.join(controller.inputs)}"
        )
    require_model_step("periodic_disk_margin.controller", controller, model)
    require_flaps("periodic_disk_margin.controller", channels.flaps, model)
    if growth_per_turn(model, controller) >= 1.0:
        return DiskMargin(0.0, np.nan)
    loop = _LiftedLoop(model, controller, harmonics)
    peak, frequency = _peak(loop)
    # Of the harmonics the one that takes most part.
    worst = _difference(np.linalg.inv(loop(np.array([frequency]))))[0]
    share = np.abs(np.linalg.svd(worst)[2][0]).argmax() // 3 - harmonics
    return DiskMargin(2.0 / peak, float(abs(frequency + share * loop.turn)))


class _LiftedLoop:
    """1 - L at any frequencies, L from measured moments to the moments they cause, harmonic by harmonic."""

    def __init__(self, model: TurbineModel, controller: StateSpace, harmonics: int) -> None:
        channels = MULTIBLADE.with_flaps(len(model.flaps))
        turbine = model.turbine.select(channels.flap_inputs, channels.moments)
        own = ROTOR.with_flaps(channels.flaps)
        flaps = flaps_loop(controller, np.eye(3)).select(outputs=own.flap_inputs)
        self._signals = 2 * channels.flaps  # of flap motion: angles, then rates
        self._turbine, self._flaps = (
            TransferFunction(each.A, each.B, each.C, each.D) for each in (turbine, flaps)
        )
        self._step = model.time_step
        self.turn = model.rotor_speed / (2.0 * np.pi)
        self.orders = np.arange(-harmonics, harmonics + 1)
        self._components = np.sqrt(3.0) * np.array([[1.0, 0.0, 0.0], [0.0, 0.5, -0.5j], [0.0, 0.5, 0.5j]])
        self._blades = np.exp(1j * np.outer(blade_azimuths(0.0), TURNS)) / np.sqrt(3.0)

    def starting_grid(self) -> Array:
        """Frequencies [Hz] up to half the sampling rate: even, and where the open loop's own modes stand.

        A mode narrower than an interval so begins one, and what it does shows at that interval's ends.
        """
        own = [each.poles[np.abs(each.poles) > 0.5] for each in (self._turbine, self._flaps)]
        modes = np.angle(np.concatenate(own)) / (2.0 * np.pi * self._step)
        shifts = np.arange(self.orders[0] - 1, self.orders[-1] + 2)
        shifted = (modes[:, None] + self.turn * shifts).ravel()
        highest = 0.5 / self._step
        even = np.arange(0.0, highest, self.turn / RESOLUTION)
        inside = shifted[(shifted > 0.0) & (shifted < highest)]
        return np.unique(np.concatenate([even, inside, [highest]]))

    def __call__(self, frequency: Array) -> Response:
        """(nf, m, m), three components for each harmonic."""
        count, first = self.orders.size, self.orders[0]
        shifts = np.arange(first - 1, self.orders[-1] + 2)
        signals = self._signals
        back = np.kron(np.eye(signals), self._blades.conj().T)
        motion = back @ self._at(self._flaps, frequency, shifts) @ self._blades
        # Rows and columns harmonic by harmonic, three components each; harmonics beyond the last are left out.
        flap_motion = np.zeros((frequency.size, signals, 3 * count, 3 * count), dtype=complex)
        for index, shift in enumerate(shifts):
            # What the rotor sees at one frequency are components at three frequencies of the tower's frame.
            row = shift - TURNS - first
            inside = np.flatnonzero((row >= 0) & (row < count))
            place = 3 * row[inside] + inside
            one = motion[:, index].reshape(-1, signals, 3, 3)
            flap_motion[:, :, place[:, None], place] = one[:, :, inside[:, None], inside]
        back = np.kron(np.eye(signals), np.linalg.inv(self._components))
        turbine = self._components @ self._at(self._turbine, frequency, self.orders) @ back
        result = np.tile(np.eye(3 * count, dtype=complex), (frequency.size, 1, 1))
        for row in range(count):
            here = slice(3 * row, 3 * row + 3)
            # Minus L; the measured moment comes with its own sign, the controller holds the feedback's.
            for signal in range(signals):
                own = turbine[:, row, :, 3 * signal : 3 * signal + 3]
                result[:, here] -= own @ flap_motion[:, signal, here]
        return result

    def _at(self, transfer: TransferFunction, frequency: Array, orders: Indices) -> Response:
        """Response (nf, orders, ny, nu) at frequencies and what lies whole turns beside them, each asked for once."""
        # A turn further stands another frequency of an even grid, but for rounding.
        frequencies = np.round(frequency[:, None] + self.turn * orders, 12)
        unique, where = np.unique(frequencies, return_inverse=True)
        response = np.stack([transfer(z) for z in np.exp(2j * np.pi * unique * self._step)])
        return np.asarray(response[where.reshape(frequencies.shape)])


def _peak(loop: _LiftedLoop) -> tuple[float, float]:
    """Largest singular value of S - T and its frequency [Hz], by halving every interval in which it may be larger.

    Where 1 - L begins an interval at 1 / S and changes from there by E, |S E| <= q < 1, S changes by |S| q / (1 - q) at
    most. L has no modes but the open loop's, however narrow those of the closed loop are.
    """
    nodes = loop.starting_grid()
    response = loop(nodes)
    begin, end = nodes[:-1], nodes[1:]
    first, last = response[:-1], response[1:]
    best, at = 0.0, 0.0
    while begin.size:
        sensitivity = np.linalg.inv(first)
        size = _norm(_difference(sensitivity))
        if size.max() > best:
            best, at = float(size.max()), float(begin[size.argmax()])
        change = CURVATURE_ALLOWANCE * _norm(sensitivity @ (last - first))
        with np.errstate(divide="ignore"):
            bound = np.where(change < 1.0, size + 2.0 * _norm(sensitivity) * change / (1.0 - change), np.inf)
        left = bound > (1.0 + TOLERANCE) * best
        begin, end, first, last = begin[left], end[left], first[left], last[left]
        middle = 0.5 * (begin + end)
        between = loop(middle) if middle.size else first
        begin, end = np.concatenate([begin, middle]), np.concatenate([middle, end])
        first, last = np.concatenate([first, between]), np.concatenate([between, last])
    return best, at


def _difference(sensitivity: Response) -> Response:
    """S - T from S."""
    return np.asarray(2.0 * sensitivity - np.eye(sensitivity.shape[-1]))


def _norm(matrices: Response) -> Array:
    return np.asarray(np.linalg.norm(matrices, ord=2, axis=(1, 2)))
