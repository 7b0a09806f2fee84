"""LQG for one blade: exact predictor and regulator on the clamped blade with turbulence (paper section III, eq. 16).

The flap's angle and rate are known after the stops, so they enter the observer as inputs and are no states of it; the
regulator sees them as states of the double integrator. Inside the design, quantities are in MN m and in the flap's
limits, and every state is divided by its stationary standard deviation, which conditions the Riccati equations well.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from flapgym.aeroelastic.model import TurbineModel
from flapgym.control.blade_controller import CONTROLLER_INPUTS, CONTROLLER_OUTPUTS, BladeController
from flapgym.state_space import Array, StateSpace, series
from flapgym.turbulence import von_karman_filter

RBM_UNIT = 1e6
"""One unit of the root bending moment in the cost and the observer [N m]."""

FILTER_ORDER = 3


@dataclass(frozen=True)
class Weights:
    """Cost per step rbm (M / 1 MN m)^2 + flap_angle (beta / limit)^2 + acceleration (a / limit)^2, and the noise.

    Attributes
    ----------
    rbm, flap_angle, acceleration : float
        Weights; the last two positive. Without a weight on the angle the optimum cancels slow gusts at no cost and
        spends the stroke there.
    measurement_noise : float
        Rms of the noise the observer expects, as a fraction of the open-loop rms of the root bending moment.
    """

    rbm: float
    flap_angle: float = 1.0
    acceleration: float = 0.0036
    measurement_noise: float = 0.01

    def __post_init__(self) -> None:
        if not (np.isfinite(self.rbm) and self.rbm >= 0.0):
            raise ValueError(f"weights.rbm: expected a number >= 0, got {self.rbm}")
        for name in ("flap_angle", "acceleration", "measurement_noise"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"weights.{name}: expected a positive number, got {value}")


@dataclass(frozen=True, eq=False)
class DesignModel:
    """The clamped blade behind its turbulence filter, scaled, and the Riccati data that follow from it.

    x+ = A x + B u + G w, y = C x + D u + H w + v with y the root bending moment [MN m], u the flap angle and rate as
    fractions of their limits, w white of unit variance a step and v measurement noise.

    Attributes
    ----------
    A, B, G, C, D, H : (n, n), (n, 2), (n, 1), (1, n), (1, 2), (1, 1) float
        Matrices in scaled states.
    time_step : float
        [s].
    angle_limit, rate_limit, acceleration_limit : float
        Units of the flap's angle, rate and acceleration [rad, rad/s, rad/s^2].
    rbm_rms : float
        Open-loop rms of the turbine model's root bending moment [MN m].
    """

    A: Array
    B: Array
    G: Array
    C: Array
    D: Array
    H: Array
    time_step: float
    angle_limit: float
    rate_limit: float
    acceleration_limit: float
    rbm_rms: float


def design_model(model: TurbineModel) -> DesignModel:
    """The design model of `model`, with its own reference turbulence.

    Raises
    ------
    ValueError
        If the blade is unstable, naming the fastest growing mode's frequency.
    """
    wind = von_karman_filter(
        model.wind_speed, model.turbulence_intensity, model.length_scale, model.time_step, FILTER_ORDER
    )
    system = series(wind, model.blade.select(outputs=["rbm"])).select(
        inputs=["flap_angle", "flap_rate", "white"]
    )
    _refuse_unstable(system)
    unit = np.diag([model.flap_angle_limit, model.flap_rate_limit, 1.0])
    b, d = system.B @ unit, system.D @ unit / RBM_UNIT
    # White flap motion beside the turbulence: a state that only the flap excites needs a scale too.
    spread = np.sqrt(np.diag(replace(system, B=b, D=d * RBM_UNIT).stationary_covariance()))
    scale = np.where(spread > 1e-12 * spread.max(), spread, 1.0)
    a, b = system.A * scale / scale[:, None], b / scale[:, None]
    return DesignModel(
        A=a,
        B=b[:, :2],
        G=b[:, 2:],
        C=system.C * scale / RBM_UNIT,
        D=d[:, :2],
        H=d[:, 2:],
        time_step=model.time_step,
        angle_limit=model.flap_angle_limit,
        rate_limit=model.flap_rate_limit,
        acceleration_limit=model.acceleration_limit,
        rbm_rms=model.rbm_rms / RBM_UNIT,
    )


def lqg_agent(name: str, model: TurbineModel, weights: Weights) -> BladeController:
    """The LQG designed on the clamped blade of `model`, three copies of it, under the name given."""
    design = design_model(model)
    return BladeController(
        name,
        synthesise(design, weights),
        first_estimate(design, weights),
        model.acceleration_limit,
        model.hash,
    )


def synthesise(design: DesignModel, weights: Weights) -> StateSpace:
    """The controller of one blade: inputs [N m, rad, rad/s], output [rad/s^2], one step of computing delay.

    Predictor form: the acceleration at step n uses measurements up to n - 1 and the flap's motion at n.
    """
    observer, _ = predictor_gain(design, weights)
    regulator, _ = regulator_gain(design, weights)
    n = design.A.shape[0]
    flap = np.diag([1.0 / design.angle_limit, 1.0 / design.rate_limit])
    return StateSpace(
        A=design.A - observer @ design.C,
        B=np.hstack([observer / RBM_UNIT, (design.B - observer @ design.D) @ flap]),
        C=-design.acceleration_limit * regulator[:, :n],
        D=-design.acceleration_limit * np.hstack([np.zeros((1, 1)), regulator[:, n:] @ flap]),
        time_step=design.time_step,
        inputs=CONTROLLER_INPUTS,
        outputs=CONTROLLER_OUTPUTS,
    )


def first_estimate(design: DesignModel, weights: Weights) -> Array:
    """Controller state (n, 3) at the start of an episode, per unit of its first inputs [N m, rad, rad/s].

    The expectation of a blade in stationary turbulence given the first measurement: P C' / (C P C' + R).
    """
    covariance = scipy.linalg.solve_discrete_lyapunov(design.A, design.G @ design.G.T)
    seen = design.C @ covariance
    noise = (weights.measurement_noise * design.rbm_rms) ** 2
    gain = seen.T / ((seen @ design.C.T) + design.H @ design.H.T + noise)
    flap = np.diag([1.0 / design.angle_limit, 1.0 / design.rate_limit])
    return gain @ np.hstack([np.array([[1.0 / RBM_UNIT]]), -design.D @ flap])


def predictor_gain(design: DesignModel, weights: Weights) -> tuple[Array, Array]:
    """Kalman gain (n, 1) of the one-step predictor and its error covariance (n, n).

    A disturbance that reaches the measurement directly (H) correlates with the process noise; the Riccati equation
    takes their cross-covariance as `s`.
    """
    noise = (weights.measurement_noise * design.rbm_rms) ** 2
    r = np.array([[noise]]) + design.H @ design.H.T
    cross = design.G @ design.H.T
    covariance = scipy.linalg.solve_discrete_are(design.A.T, design.C.T, design.G @ design.G.T, r, s=cross)
    innovation = design.C @ covariance @ design.C.T + r
    return (design.A @ covariance @ design.C.T + cross) / innovation, covariance


def regulator_gain(design: DesignModel, weights: Weights) -> tuple[Array, Array]:
    """Regulator gain (1, n + 2) on [x, angle, rate] in units of their limits, and the cost matrix (n + 2, n + 2)."""
    a, b, c = with_actuator(design)
    q = weights.rbm * c.T @ c
    q[-2, -2] += weights.flap_angle
    r = np.array([[weights.acceleration]])
    cost = scipy.linalg.solve_discrete_are(a, b, q, r)
    return np.linalg.solve(r + b.T @ cost @ b, b.T @ cost @ a), cost


def with_actuator(design: DesignModel) -> tuple[Array, Array, Array]:
    """Matrices (A, B, C) of the design model driven by flap acceleration, states [x, angle, rate]."""
    n, dt = design.A.shape[0], design.time_step
    rate, acceleration = design.rate_limit / design.angle_limit, design.acceleration_limit
    actuator = np.array([[1.0, dt * rate], [0.0, 1.0]])
    a = np.block([[design.A, design.B], [np.zeros((2, n)), actuator]])
    kick = [0.5 * dt**2 * acceleration / design.angle_limit, dt * acceleration / design.rate_limit]
    b = np.concatenate([np.zeros(n), kick])[:, None]
    return a, b, np.hstack([design.C, design.D])


def _refuse_unstable(system: StateSpace) -> None:
    values = np.linalg.eigvals(system.A)
    worst = values[np.argmax(np.abs(values))]
    if abs(worst) >= 1.0:
        rate = np.log(worst) / system.time_step
        raise ValueError(
            f"design model: unstable mode at {abs(rate.imag) / (2 * np.pi):.3g} Hz "
            f"(damping ratio {-rate.real / abs(rate):.3g}); a flap cannot hold a blade that diverges"
        )
