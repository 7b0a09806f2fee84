"""One actuator between its stops as a programme: a chain of states that commands move, solved by interior points."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from baselines.bounds.response import Actuator
from flapgym.core.arrays import Array

TOLERANCE = 1e-9
"""Of the solver."""


def solve_chain(
    actuator: Actuator, linear: Array, quadratic: Array | None = None, hull: float = 0.0, reach: float = 1.0
) -> tuple[Array, Array]:
    """Minimise linear . v + quadratic . v^2 / 2 of command, angle and rate in shares of their stops, from rest.

    Parameters
    ----------
    actuator : Actuator
    linear : (K, 3) float
        Of command, angle and rate at every interval's start.
    quadratic : (K, 3) float, optional
    hull : float
        Time h [s]: angle + h rate stays within the angle's stop as well.
    reach : float
        Share of the stops that is used.

    Returns
    -------
    motion : (K, 3) float
        In shares of the stops; as feasible as the solver's tolerance.
    multipliers : (K - 1, 2) float
        Of the laws of motion, march state + drive command - next state = 0 in shares of the stops.
    """
    try:
        import piqp
    except ImportError:
        raise ImportError("the bound needs the solver piqp: pip install 'flapgym[baselines]'") from None
    limits, count = actuator.limits, len(linear)
    step = np.hstack([actuator.drive[:, None], actuator.march]) * limits / limits[1:, None]
    chain = sp.kron(sp.eye(count - 1, count), step) - sp.kron(sp.eye(count - 1, count, k=1), np.eye(3)[1:])
    bound = np.full(3 * count, reach)
    bound[1:3] = 0.0
    square = np.zeros(3 * count) if quadratic is None else quadratic.ravel()
    inside: Any = None
    edge = None
    if hull:
        inside = sp.csc_matrix(sp.kron(sp.eye(count), [[0.0, 1.0, hull * limits[2] / limits[1]]]))
        edge = np.full(count, reach)
    solver: Any = piqp.SparseSolver()
    solver.settings.eps_abs = solver.settings.eps_rel = TOLERANCE
    solver.setup(
        sp.csc_matrix(sp.diags(square)),
        linear.ravel(),
        sp.csc_matrix(chain),
        np.zeros(2 * (count - 1)),
        inside,
        None if edge is None else -edge,
        edge,
        -bound,
        bound,
    )
    solver.solve()
    result = solver.result
    return np.asarray(result.x).reshape(count, 3), np.asarray(result.y).reshape(count - 1, 2)
