"""LQG for any design model: exact predictor and regulator behind turbulence (paper sections III, IV.C, eq. 16).

One synthesis serves the clamped blade, the rotor in the blades' own frames and the whole turbine in multi-blade
coordinates. Flap angles and rates are known after the stops, so they enter the observer as inputs and are no states of
it; the regulator sees them as states of the double integrators. Inside the design, quantities are in MN m and in the
flap's limits, and every state is divided by its stationary standard deviation, which conditions the Riccati equations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from flapgym.control.blade_controller import BladeController
from flapgym.control.channels import Channels, controller_channels
from flapgym.control.closed_loop import require_model_step
from flapgym.control.rotor_controller import RotorController
from flapgym.core.arrays import Array
from flapgym.core.fields import Quantity
from flapgym.core.state_space import StateSpace, series
from flapgym.model.turbine_model import TurbineModel
from flapgym.wind import von_karman_filter

RBM_UNIT = 1e6
"""One unit of the root bending moment in the cost and the observer [N m]."""

FILTER_ORDER = 3


@dataclass(frozen=True)
class Weights:
    """Cost a step and blade, rbm (M / 1 MN m)^2 + flap_angle (beta / limit)^2 + acceleration (a / limit)^2, and noise.

    Attributes
    ----------
    rbm, flap_angle, acceleration : float
        Weights; the last two positive. Without a weight on the angle the optimum cancels slow gusts at no cost and
        spends the flap's range there.
    measurement_noise : float
        Rms of the noise the observer expects, as a fraction of the open-loop rms of the root bending moment.
    """

    rbm: float
    flap_angle: float = 1.0
    acceleration: float = 0.0036
    measurement_noise: float = 0.01

    def __post_init__(self) -> None:
        Quantity("number", at_least=0.0).check(self.rbm, "weights.rbm")
        for name in ("flap_angle", "acceleration", "measurement_noise"):
            Quantity("number", above=0.0).check(getattr(self, name), f"weights.{name}")


@dataclass(frozen=True, eq=False)
class DesignModel:
    """A plant of m flaps behind its disturbance filter, scaled, and the Riccati data that follow from it.

    x+ = A x + B u + G w, y = C x + D u + H w + v with y the root bending moments [MN m], u the flap angles, then the
    rates, as fractions of their limits, w white of unit variance a step and v measurement noise.

    Attributes
    ----------
    A, B, G, C, D, H : (n, n), (n, 2 m), (n, k), (m, n), (m, 2 m), (m, k) float
        Matrices in scaled states.
    channels : Channels
        The frame of the m signals: a blade, three blades, or multi-blade components.
    turn : (m, m) float
        How the frame's axes carry a flap's signal over one step.
    time_step : float
        [s].
    angle_limit, rate_limit, acceleration_limit : float
        Units of the flap's angle, rate and acceleration [rad, rad/s, rad/s^2].
    rbm_rms : float
        Open-loop rms of the turbine model's root bending moment [MN m].
    scale : (n,) float
        What one unit of each scaled state is in the disturbance's and the plant's own states, in this order.
    """

    A: Array
    B: Array
    G: Array
    C: Array
    D: Array
    H: Array
    channels: Channels
    turn: Array
    time_step: float
    angle_limit: float
    rate_limit: float
    acceleration_limit: float
    rbm_rms: float
    scale: Array


def design_model(
    model: TurbineModel, plant: StateSpace | None = None, disturbance: StateSpace | None = None
) -> DesignModel:
    """What a controller for `model` is designed on.

    Parameters
    ----------
    model : TurbineModel
        Gives limits, turbulence and rotor speed.
    plant : StateSpace, optional
        Inputs ``flap_angle*``, ``flap_rate*`` and disturbances, outputs ``rbm*`` among others, with * empty, _1 _2 _3
        or _0 _c _s. By default the clamped blade.
    disturbance : StateSpace, optional
        From white noise to the plant's disturbance inputs, by name. By default the reference turbulence.

    Raises
    ------
    ValueError
        If a mode that does not decay cannot be moved by the flaps or is not seen in the moments, naming its frequency
        and damping.
    """
    plant = model.blade if plant is None else plant
    require_model_step("design_model.plant", plant, model)
    if disturbance is None:
        disturbance = von_karman_filter(
            model.wind_speed, model.turbulence_intensity, model.length_scale, model.time_step, FILTER_ORDER
        )
    require_model_step("design_model.disturbance", disturbance, model)
    channels = controller_channels(plant.inputs)
    flaps, m = channels.inputs[channels.count :], channels.count
    driven = plant.select([*flaps, *disturbance.outputs], channels.inputs[:m])
    system = series(disturbance, driven).select(inputs=[*flaps, *disturbance.inputs])
    white = len(disturbance.inputs)
    unit = np.diag([*[model.flap_angle_limit] * m, *[model.flap_rate_limit] * m, *[1.0] * white])
    b, d = system.B @ unit, system.D @ unit / RBM_UNIT
    # White flap motion beside the turbulence: a state that only the flap excites needs a scale too.
    deviation = np.sqrt(np.diag(stationary_covariance(system.A, b)))
    scale = np.where(deviation > 1e-12 * deviation.max(), deviation, 1.0)
    a, b, c = system.A * scale / scale[:, None], b / scale[:, None], system.C * scale / RBM_UNIT
    check_stabilisable_and_detectable(a, b[:, : 2 * m], c, model.time_step)
    return DesignModel(
        A=a,
        B=b[:, : 2 * m],
        G=b[:, 2 * m :],
        C=c,
        D=d[:, : 2 * m],
        H=d[:, 2 * m :],
        channels=channels,
        turn=channels.turn(model.rotor_speed * model.time_step),
        time_step=model.time_step,
        angle_limit=model.flap_angle_limit,
        rate_limit=model.flap_rate_limit,
        acceleration_limit=model.acceleration_limit,
        rbm_rms=model.rbm_rms / RBM_UNIT,
        scale=scale,
    )


def white_wind(model: TurbineModel) -> StateSpace:
    """Turbulence of which only the variance is known: white, the design without the filter (section IV.C)."""
    sigma = model.turbulence_intensity * model.wind_speed
    none = np.zeros((0, 0))
    return StateSpace(
        none, np.zeros((0, 1)), np.zeros((1, 0)), np.array([[sigma]]), model.time_step, ("white",), ("wind",)
    )


def lqg_agent(
    name: str, model: TurbineModel, weights: Weights, design: DesignModel | None = None
) -> BladeController | RotorController:
    """The LQG of a design model, by default of the clamped blade, three copies of it, under the name given."""
    design = design_model(model) if design is None else design
    kind = BladeController if design.channels.count == 1 else RotorController
    return kind(
        name,
        synthesise(design, weights),
        initial_estimate(design, weights),
        model.acceleration_limit,
        model.hash,
    )


def synthesise(design: DesignModel, weights: Weights) -> StateSpace:
    """The controller: inputs and outputs of the design's channels in SI units, one step of computing delay.

    Predictor form: the acceleration at step n uses measurements up to n - 1 and the flaps' motion at n.
    """
    observer, _ = predictor_gain(design, weights)
    regulator, _ = regulator_gain(design, weights)
    n, m = design.A.shape[0], design.channels.count
    flap = flap_units(design)
    return StateSpace(
        # No regulator in A: the flap's motion is measured, so the observer need not predict it from its own command.
        A=design.A - observer @ design.C,
        B=np.hstack([observer / RBM_UNIT, (design.B - observer @ design.D) @ flap]),
        C=-design.acceleration_limit * regulator[:, :n],
        D=-design.acceleration_limit * np.hstack([np.zeros((m, m)), regulator[:, n:] @ flap]),
        time_step=design.time_step,
        inputs=design.channels.inputs,
        outputs=design.channels.outputs,
    )


def initial_estimate(design: DesignModel, weights: Weights) -> Array:
    """Controller state (n, 3 m) at the start of an episode, per unit of its first inputs [N m, rad, rad/s].

    The expectation in stationary turbulence given the first measurement: P C' (C P C' + H H' + R)^-1.
    """
    seen = design.C @ stationary_covariance(design.A, design.G)
    innovation = seen @ design.C.T + design.H @ design.H.T + noise_covariance(design, weights)
    gain = np.linalg.solve(innovation, seen).T
    # y - D u: what the flaps do to the moment at once says nothing of the state.
    measured = np.hstack([np.eye(design.channels.count) / RBM_UNIT, -design.D @ flap_units(design)])
    return np.asarray(gain @ measured)


def predictor_gain(design: DesignModel, weights: Weights) -> tuple[Array, Array]:
    """Kalman gain (n, m) of the one-step predictor and its error covariance (n, n).

    A disturbance that reaches the measurement directly (H) correlates with the process noise; the Riccati equation
    takes their cross-covariance as `s`.
    """
    r = noise_covariance(design, weights) + design.H @ design.H.T
    cross = design.G @ design.H.T
    covariance = scipy.linalg.solve_discrete_are(design.A.T, design.C.T, design.G @ design.G.T, r, s=cross)
    innovation = design.C @ covariance @ design.C.T + r
    gain = np.linalg.solve(innovation, (design.A @ covariance @ design.C.T + cross).T).T
    return np.asarray(gain), covariance


def regulator_gain(design: DesignModel, weights: Weights) -> tuple[Array, Array]:
    """Regulator gain (m, n + 2 m) on [x, angles, rates] in units of their limits, and the cost matrix."""
    a, b, c = with_actuator(design)
    n, m = design.A.shape[0], design.channels.count
    # A cyclic component's square counts half in the mean over blades.
    each = np.diag(design.channels.weight)
    # The moment takes in D times the flap's motion, so the cost couples x with the actuator's states.
    q = weights.rbm * c.T @ each @ c
    q[n : n + m, n : n + m] += weights.flap_angle * each
    r = weights.acceleration * each
    cost = scipy.linalg.solve_discrete_are(a, b, q, r)
    return np.linalg.solve(r + b.T @ cost @ b, b.T @ cost @ a), cost


def with_actuator(design: DesignModel) -> tuple[Array, Array, Array]:
    """Matrices (A, B, C) of the design model driven by flap accelerations, states [x, angles, rates]."""
    n, m, dt = design.A.shape[0], design.channels.count, design.time_step
    rate, acceleration = design.rate_limit / design.angle_limit, design.acceleration_limit
    # A flap that rests on its blade has other multi-blade components a step later: `turn` takes the old to the new.
    actuator = np.kron([[1.0, dt * rate], [0.0, 1.0]], design.turn)
    a = np.block([[design.A, design.B], [np.zeros((2 * m, n)), actuator]])
    acceleration_input = np.array(
        [[0.5 * dt**2 * acceleration / design.angle_limit], [dt * acceleration / design.rate_limit]]
    )
    return (
        a,
        np.vstack([np.zeros((n, m)), np.kron(acceleration_input, design.turn)]),
        np.hstack([design.C, design.D]),
    )


def noise_covariance(design: DesignModel, weights: Weights) -> Array:
    """Of the measurement noise in the design's channels, (m, m) [(MN m)^2]."""
    return np.diag((weights.measurement_noise * design.rbm_rms) ** 2 * np.array(design.channels.noise))


def flap_units(design: DesignModel) -> Array:
    """Diagonal (2 m, 2 m) that takes angles [rad] and rates [rad/s] to fractions of their limits."""
    m = design.channels.count
    return np.diag([*[1.0 / design.angle_limit] * m, *[1.0 / design.rate_limit] * m])


def stationary_covariance(a: Array, noise_input: Array) -> Array:
    """Covariance (n, n) of x+ = a x + noise_input w; a model that grows is slowed down until it has one."""
    radius = np.abs(np.linalg.eigvals(a)).max()
    # Its only use is the scale of states and of a first estimate, for which the order of magnitude is enough.
    a = a * min(1.0, 0.999 / radius) if radius >= 1.0 else a
    return np.asarray(scipy.linalg.solve_discrete_lyapunov(a, noise_input @ noise_input.T))


def check_stabilisable_and_detectable(a: Array, b: Array, c: Array, time_step: float) -> None:
    """Raise on a mode that does not decay and that the inputs cannot move, or the outputs do not show (Hautus)."""
    values = np.linalg.eigvals(a)
    for value in values[np.abs(values) >= 1.0]:
        shifted = a - value * np.eye(a.shape[0])
        for kind, pencil in (
            ("unstabilisable: the flaps cannot move", np.hstack([shifted, b])),
            ("undetectable: the root bending moment does not show", np.vstack([shifted, c])),
        ):
            # Of no full rank at this mode; relative, because the largest singular value sets the round-off.
            singular = np.linalg.svd(pencil, compute_uv=False)
            if singular[-1] < 1e-9 * singular[0]:
                raise ValueError(f"design model: {kind} its {_named(value, time_step)}, which does not decay")


def _named(value: complex, time_step: float) -> str:
    rate = np.log(complex(value)) / time_step
    damping = -rate.real / abs(rate) if abs(rate) > 0.0 else 0.0
    return f"mode at {abs(rate.imag) / (2 * np.pi):.3g} Hz (damping ratio {damping:.3g})"
