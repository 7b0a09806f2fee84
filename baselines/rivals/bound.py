"""The least mean square of the root bending moment that any flap motion within its stops can have (non-causal).

The whole wind is known, so one convex programme gives the motion: least squares of the moment over the realisation,
states kept as variables, angle, rate and acceleration bounded. No controller, causal or not, whose acceleration is held
over the same steps does better in that mean square with the same response; the duality gap says how near the solution
is, and at `HOLD` stands what shorter steps are worth.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from flapgym.core.arrays import Array
from flapgym.core.state_space import StateSpace, require_time_step, series
from flapgym.model.turbine_model import TurbineModel
from flapgym.reduction.weighted import balance, relative_error
from flapgym.wind import von_karman_filter

MOMENT = 1e6
"""Unit of the moment in the programme [N m]."""
FLAP_BANDWIDTH, FLAP_DAMPING = 4.0 * np.pi, 0.8
"""Servo behind which the wind moves the flap in the weight of the reduction [rad/s], [-]."""
ACCURACY = 2e-4
"""Rms error of the reduced response to such a motion, over that of the response."""
HOLD = 10
"""Steps over which the acceleration is held: five lower the rms by 4e-4, or 1e-2 where no stop is in reach."""
REACH = 1.0 - 1e-5
"""Share of the angle's stop that a plan uses: the plant would stop a flap that touches it while it still turns."""
PENALTY = 1e-5
"""Price of the mean square of acceleration over its limit [(MN m)^2]: without one the solver is left to choose among
motions of the same load, and shakes the flap. What it costs the mean square is part of the gap."""
TOLERANCE = 1e-8
"""Of the solver."""


CONSTANTS = (MOMENT, FLAP_BANDWIDTH, FLAP_DAMPING, ACCURACY, HOLD, REACH, PENALTY, TOLERANCE)
"""All a bound depends on beside wind and turbine."""


@dataclass(frozen=True, eq=False)
class Bound:
    """The best motion of a flap over one realisation.

    Attributes
    ----------
    angle, rate : (K + 1,) float
        At the ends of the K intervals over which the acceleration is held [rad, rad/s].
    acceleration : (K,) float
        [rad/s^2].
    rbm : (K h,) float
        Moment at samples 1 to K h [N m].
    gap : float
        The least mean square of motions with such held accelerations lies at most this share lower: duality gap and
        penalty.
    residual : float
        Largest violation of the optimality conditions (Karush, Kuhn and Tucker), relative.
    """

    angle: Array
    rate: Array
    acceleration: Array
    rbm: Array
    gap: float
    residual: float

    def motion(self, hold: int, time_step: float) -> Array:
        """Angle and rate (K h, 2) at samples 1 to K h [rad, rad/s], the accelerations held over `hold` steps."""
        time = time_step * np.arange(1, hold + 1)
        rate = self.rate[:-1, None] + time * self.acceleration[:, None]
        angle = (
            self.angle[:-1, None] + time * self.rate[:-1, None] + 0.5 * time**2 * self.acceleration[:, None]
        )
        return np.stack([angle.ravel(), rate.ravel()], axis=1)


def flap_response(model: TurbineModel, plant: StateSpace) -> StateSpace:
    """A small model of angle and rate to moment: of the clamped blade, or of all flaps moved together.

    Parameters
    ----------
    model : TurbineModel
    plant : StateSpace
        `model.blade` or `model.turbine`; of the latter the collective flap and moment are taken.
    """
    suffix = "" if "rbm" in plant.outputs else "_0"
    names = [f"flap_angle{suffix}", f"flap_rate{suffix}"]
    plant = plant.select(names, [f"rbm{suffix}"])
    dt = model.time_step
    kick = np.array([[0.5 * dt**2], [dt]])
    stiffness, damping = FLAP_BANDWIDTH**2, 2.0 * FLAP_DAMPING * FLAP_BANDWIDTH
    a = np.array([[1.0, dt], [0.0, 1.0]]) - kick @ np.array([[stiffness, damping]])
    servo = StateSpace(a, stiffness * kick, np.eye(2), np.zeros((2, 1)), dt, ("wind",), tuple(names))
    wind = von_karman_filter(model.wind_speed, model.turbulence_intensity, model.length_scale, dt, 3)
    weight = series(wind, servo)
    balanced = balance(plant, weight)
    for order in range(8, plant.order, 2):
        try:
            reduced = balanced.truncated(order)
        except ValueError:
            continue
        if relative_error(plant, reduced, weight)[0] <= ACCURACY:
            return reduced
    return plant


def best_flap(free: Array, response: StateSpace, model: TurbineModel, hold: int = HOLD) -> Bound:
    """Solve the programme, the acceleration held over `hold` steps.

    Parameters
    ----------
    free : (T,) float
        Moment without the flap at samples 1 to T, as a record holds it [N m]; the flap is at rest at sample 0.
    response : StateSpace
        From angle [rad] and rate [rad/s] to moment [N m].
    model : TurbineModel
        Gives the limits.
    hold : int
        Steps; with 1 every sample's acceleration is free.

    Raises
    ------
    RuntimeError
        If the solver gives up.
    """
    require_time_step("best_flap.response.time_step", response.time_step, model.time_step, "the model's")
    stage = _lifted(response, model, hold)
    count = free.size // hold
    moment = free[: count * hold].reshape(count, hold) / MOMENT
    programme = _programme(stage, moment)
    result = _solve(programme)
    n, x = stage.order, result.x
    stages = x[: count * (n + 1)].reshape(count, n + 1)
    ends = np.vstack([stages[:, n - 2 : n], x[-2:]])
    rbm = moment + stages @ np.hstack([stage.C, stage.D])[:hold].T
    square = float(np.mean(rbm**2))
    # The least mean square is no lower than the penalised optimum less all the penalty there can be.
    penalty = PENALTY * (1.0 - float(np.mean(stages[:, n] ** 2)))
    return Bound(
        angle=model.flaps[0].angle_limit * ends[:, 0],
        rate=model.flaps[0].rate_limit * ends[:, 1],
        acceleration=model.flaps[0].acceleration_limit * stages[:, n],
        rbm=MOMENT * rbm.ravel(),
        gap=(2.0 * abs(result.info.primal_obj - result.info.dual_obj) + penalty) / square,
        residual=_residual(result, programme),
    )


@dataclass(frozen=True, eq=False)
class _Programme:
    """Minimise x' quadratic x / 2 + linear' x with equality x = 0, |inside x| <= REACH and |x| <= limit.

    Variables stage by stage: state [response, angle, rate], then the acceleration; a last state closes the row.
    """

    quadratic: Any
    linear: Array
    equality: Any
    inside: Any
    limit: Array


def _programme(stage: StateSpace, moment: Array) -> _Programme:
    count, hold = moment.shape
    n = stage.order
    width, size = n + 1, count * (n + 1) + n
    rows = np.hstack([stage.C, stage.D])
    read, swing = rows[:hold], rows[hold:]
    cost = read.T @ read
    cost[n, n] += hold * PENALTY
    share = 1.0 / (count * hold)

    def every(block: Array) -> Any:
        return sp.kron(sp.identity(count), sp.csc_matrix(block))

    chain = np.arange(count * n)
    following = sp.csc_matrix(
        (np.ones(chain.size), (chain, (chain // n + 1) * width + chain % n)), shape=(chain.size, size)
    )
    march = sp.hstack([every(np.hstack([stage.A, stage.B])), sp.csc_matrix((chain.size, n))]) - following
    at_rest = sp.csc_matrix((np.ones(n), (range(n), range(n))), shape=(n, size))
    limit = np.full(size, np.inf)
    for bounded, share_used in ((n - 2, REACH), (n - 1, 1.0), (n, 1.0)):
        limit[bounded::width] = share_used
    return _Programme(
        quadratic=sp.block_diag([every(share * cost), sp.csc_matrix((n, n))], format="csc"),
        linear=np.concatenate([(share * moment @ read).ravel(), np.zeros(n)]),
        equality=sp.vstack([at_rest, march], format="csc"),
        inside=sp.hstack([every(swing), sp.csc_matrix((count * len(swing), n))], format="csc"),
        limit=limit,
    )


def _solve(programme: _Programme) -> Any:
    """The solution of an interior-point method that knows the chain of stages."""
    try:
        import piqp
    except ImportError:
        raise ImportError("the bound needs the solver piqp: pip install 'flapgym[baselines]'") from None
    solver = piqp.SparseSolver()
    solver.settings.eps_abs = solver.settings.eps_rel = TOLERANCE
    solver.settings.kkt_solver = piqp.KKTSolver.sparse_multistage
    p, reach = programme, np.full(programme.inside.shape[0], REACH)
    nought = np.zeros(p.equality.shape[0])
    solver.setup(p.quadratic, p.linear, p.equality, nought, p.inside, -reach, reach, -p.limit, p.limit)
    status = solver.solve()
    if status != piqp.PIQP_SOLVED:
        raise RuntimeError(f"bound: the solver gave up ({status})")
    return solver.result


def _residual(result: Any, programme: _Programme) -> float:
    """Largest violation of stationarity, feasibility and complementarity, in units of the largest gradient."""
    p, x = programme, result.x
    gradient = np.abs(p.linear).max()
    pull = p.equality.T @ result.y + p.inside.T @ (result.z_u - result.z_l) + result.z_bu - result.z_bl
    stationary = np.abs(p.quadratic @ x + p.linear + pull).max() / gradient
    finite = np.isfinite(p.limit)
    # Everything that is bounded, in its limits, with its multipliers.
    value = np.concatenate([x[finite] / p.limit[finite], p.inside @ x / REACH])
    high = np.concatenate([result.z_bu[finite], result.z_u])
    low = np.concatenate([result.z_bl[finite], result.z_l])
    beyond = max(np.abs(value).max() - 1.0, 0.0)
    wrong_sign = max(0.0, -high.min(), -low.min()) / gradient
    slack = np.abs(np.concatenate([high * (1.0 - value), low * (1.0 + value)])).max() / gradient
    return float(max(stationary, np.abs(p.equality @ x).max(), beyond, wrong_sign, slack))


def _lifted(response: StateSpace, model: TurbineModel, hold: int) -> StateSpace:
    """From a held acceleration to the moment [MN m] at the next `hold` samples, and the angle between its ends.

    Flap motion and acceleration in their limits; between the ends of an interval the rate is between its end values,
    but the angle may swing out.
    """
    dt, n = response.time_step, response.order
    units = np.diag([model.flaps[0].angle_limit, model.flaps[0].rate_limit])
    turn = np.linalg.inv(units) @ np.array([[1.0, dt], [0.0, 1.0]]) @ units
    kick = np.linalg.inv(units) @ np.array([[0.5 * dt**2], [dt]]) * model.flaps[0].acceleration_limit
    a = np.block([[response.A, response.B @ units], [np.zeros((2, n)), turn]])
    b = np.vstack([np.zeros((n, 1)), kick])
    c = np.hstack([response.C, response.D @ units]) / MOMENT
    state, drive = np.eye(n + 2), np.zeros((n + 2, 1))
    seen, swing = [], []
    for _ in range(hold):
        state, drive = a @ state, a @ drive + b
        seen.append(np.hstack([c @ state, c @ drive]))
        swing.append(np.hstack([state[-2:-1], drive[-2:-1]]))
    rows = np.vstack(seen + swing[:-1])
    names = [f"rbm at {step}" for step in range(1, hold + 1)] + [
        f"angle at {step}" for step in range(1, hold)
    ]
    return StateSpace(state, drive, rows[:, :-1], rows[:, -1:], hold * dt, ("acceleration",), tuple(names))
