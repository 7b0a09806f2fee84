"""What a predictive controller minimises over its horizon, condensed: offsets from the regulator's own law.

The accelerations of a blade's flaps are a_k = -K z_k + f_k + d_k with K the LQG's regulator, f_k its feedforward of
wind known in advance and d_k the offsets. With the Riccati matrix as terminal cost the LQG's cost over an infinite
horizon is then sum d_k' S d_k and a constant (Kouvaritakis and Cannon 2016, the closed-loop paradigm): without an
active stop the optimum is d = 0, the LQG itself, whatever the horizon and however the offsets are blocked. What is left
to solve is the nearest point of a polytope.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flapgym.control.lqg import DesignModel, Weights, regulator_gain, with_actuator
from flapgym.core.arrays import Array
from flapgym.core.state_space import StateSpace

BLOCKS = (1, 1, 1, 1, 2, 2, 4, 4, 8, 8, 16, 16, 32, 32, 64)
"""Steps over which each offset is held: 192 steps, 1.3 s."""
CONSTRAINED = ((16, 1), (48, 4), (192, 8))
"""Steps up to which the stops are constraints, and how often: each of the first sixteen, and so on."""


@dataclass(frozen=True, eq=False)
class Horizon:
    """The programme of one blade of F flaps; angles, rates and accelerations are fractions of their limits.

    With z = [x, angles, rates], x the design model's scaled states, and w the innovations of the wind known in advance:
    minimise |e|^2 / 2 such that abs(from_state z + from_wind w + from_offsets e) <= 1.

    Attributes
    ----------
    gain : (F, n + 2 F) float
        Regulator K.
    preview_gain : (F, M) float
        Accelerations now per innovation known in advance: f_0.
    first_offset : (F, F) float
        Accelerations now per unit of the first F entries of e: the offsets times the root of their block's length and,
        but for a factor, a root of S.
    from_state, from_wind, from_offsets : (rows, n + 2 F), (rows, M), (rows, blocks F) float
        Predicted accelerations, angles and rates of all flaps at the constrained instants.
    """

    gain: Array
    preview_gain: Array
    first_offset: Array
    from_state: Array
    from_wind: Array
    from_offsets: Array


def condense(
    design: DesignModel, weights: Weights, preview: int, blocks: tuple[int, ...] = BLOCKS
) -> Horizon:
    """The programme of a design model of one blade, with so many innovations of its one wind known in advance.

    Raises
    ------
    ValueError
        If the design model is of three blades, or has several white inputs and innovations are known.
    """
    if design.channels.count != 1:
        raise ValueError(
            f"horizon: expected the design model of one blade, got one of {design.channels.count} blades"
        )
    if preview and design.G.shape[1] != 1:
        raise ValueError(
            f"horizon: expected a design model of one white input for a preview, got {design.G.shape[1]}"
        )
    a, b, _ = with_actuator(design)
    gain, cost = regulator_gain(design, weights)
    n, steps, flaps = a.shape[0], sum(blocks), design.channels.flaps
    closed = a - b @ gain
    curvature = weights.acceleration / flaps * np.eye(flaps) + b.T @ cost @ b
    # Of several white inputs none is known, and this is not used.
    noise_input = np.concatenate([design.G[:, 0], np.zeros(2 * flaps)])
    # f_k = -S^-1 B' sum_j (closed')^(j - k) P G w_j, the feedforward of innovations from k on.
    feedforward, adjoint = np.empty((flaps, preview)), cost @ noise_input
    for ahead in range(preview):
        feedforward[:, ahead] = -np.linalg.solve(curvature, b.T @ adjoint)
        adjoint = closed.T @ adjoint

    lengths = np.array(blocks)
    block = np.repeat(np.arange(lengths.size), lengths)
    # Flaps share the blade's moment, so their offsets' costs are coupled: in e = L' d, S = L L', they are not. The
    # factor left out leaves numbers near one, and one flap's offsets as they are.
    offset = np.linalg.inv(np.linalg.cholesky(curvature / curvature[0, 0])).T
    # By the root of a block's length, so that |e|^2 is the cost whatever the blocks.
    unit = 1.0 / np.sqrt(lengths)
    # Sensitivities of the state to z, w and e side by side, marched over the horizon.
    total = n + preview + lengths.size * flaps
    state = np.hstack([np.eye(n), np.zeros((n, total - n))])
    constrained = _instants(steps)
    rows = []
    for k in range(steps):
        added_acceleration = np.zeros((flaps, total))
        added_acceleration[:, n + k : n + preview] = feedforward[:, : max(preview - k, 0)]
        first = n + preview + block[k] * flaps
        added_acceleration[:, first : first + flaps] = unit[block[k]] * offset
        acceleration = added_acceleration - gain @ state
        # The acceleration at k moves the flaps from k to k + 1: it is bounded with the motion it leads to.
        state = a @ state + b @ acceleration
        if k < preview:
            state[:, n + k] += noise_input
        if k in constrained:
            rows += [acceleration, state[-2 * flaps :].copy()]
    table = np.vstack(rows)
    return Horizon(
        gain=gain,
        preview_gain=feedforward,
        first_offset=unit[0] * offset,
        from_state=table[:, :n],
        from_wind=table[:, n : n + preview],
        from_offsets=np.ascontiguousarray(table[:, n + preview :]),
    )


def _instants(steps: int) -> frozenset[int]:
    instants, first = set(), 0
    for last, every in CONSTRAINED:
        instants |= set(range(first, min(last, steps), every))
        first = last
    return frozenset(instants | {steps - 1})


def innovations(filter_: StateSpace, steps: int) -> tuple[Array, Array]:
    """Innovations w_0.. of a filter without feedthrough from its state x_0 and its outputs y_1..y_M.

    The filter is inverted exactly: y_k = C A^k x_0 + sum_{j < k} C A^(k - 1 - j) B w_j.

    Returns
    -------
    from_output, from_state : (M, M), (M, n) float
        w = from_output y + from_state x_0.
    """
    impulse, free_response = np.empty(steps), np.empty((steps, filter_.order))
    row = filter_.C[0]
    for k in range(steps):
        impulse[k] = row @ filter_.B[:, 0]
        row = row @ filter_.A
        free_response[k] = row
    lag = np.subtract.outer(np.arange(steps), np.arange(steps))
    # Lower triangular with C B on the diagonal: w_0 moves y_1 and all that follow, never y_0.
    pulse = np.where(lag >= 0, impulse[np.maximum(lag, 0)], 0.0) if steps else np.zeros((0, 0))
    inverse = np.linalg.inv(pulse)
    return np.asarray(inverse), np.asarray(-inverse @ free_response)
