"""LQG for any design model: exact predictor and regulator behind turbulence (paper sections III, IV.C, eq. 16).

One synthesis serves the clamped blade, the rotor in the blades' own frames and the whole turbine in multi-blade
coordinates, with any number of flaps a blade. Flap angles and rates are known after the stops, so they enter the
observer as inputs and are no states of it; the regulator sees them as states of the double integrators. Inside the
design, quantities are in MN m and in each flap's limits, and every state is divided by its stationary standard
deviation, which conditions the Riccati equations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from flapgym.control.blade_controller import BladeController, acceleration_limits
from flapgym.control.channels import Channels, controller_channels
from flapgym.control.closed_loop import require_flaps, require_model_step
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

    Of several flaps a blade the squares' mean, each over its own limits: weights then ask the same of flaps that are
    tied together as of the one flap that they make.

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
    """A plant of m moments and p = m F flaps behind its disturbance filter, scaled, and what Riccati equations take.

    x+ = A x + B u + G w, y = C x + D u + H w + v with y the root bending moments [MN m], u the flap angles, then the
    rates, as fractions of their limits, w white of unit variance a step and v measurement noise.

    Attributes
    ----------
    A, B, G, C, D, H : (n, n), (n, 2 p), (n, k), (m, n), (m, 2 p), (m, k) float
        Matrices in scaled states.
    channels : Channels
        The frame of the signals, a blade, three blades, or multi-blade components, and the number of flaps F a blade.
    turn : (p, p) float
        How the frame's axes carry the flaps' signals over one step.
    time_step : float
        [s].
    angle_limit, rate_limit, acceleration_limit : (p,) float
        Units of each flap's angle, rate and acceleration [rad, rad/s, rad/s^2].
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
    angle_limit: Array
    rate_limit: Array
    acceleration_limit: Array
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
        or _0 _c _s; of several flaps ``flap1_angle*`` and so on, as many as the model has. By default the clamped
        blade.
    disturbance : StateSpace, optional
        From white noise to the plant's disturbance inputs, by name. By default the reference turbulence.

    Raises
    ------
    ValueError
        If the plant has another number of flaps a blade than the model, or if a mode that does not decay cannot be
        moved by the flaps or is not seen in the moments, naming its frequency and damping.
    """
    plant = model.blade if plant is None else plant
    require_model_step("design_model.plant", plant, model)
    if disturbance is None:
        disturbance = von_karman_filter(
            model.wind_speed, model.turbulence_intensity, model.length_scale, model.time_step, FILTER_ORDER
        )
    require_model_step("design_model.disturbance", disturbance, model)
    channels = controller_channels(plant.inputs)
    require_flaps("design_model.plant", channels.flaps, model)
    flaps, p = channels.flap_inputs, channels.actions
    driven = plant.select([*flaps, *disturbance.outputs], channels.moments)
    system = series(disturbance, driven).select(inputs=[*flaps, *disturbance.inputs])
    limits = {  # flap by flap, as the inputs stand
        name: np.repeat([getattr(flap, name) for flap in model.flaps], channels.count)
        for name in ("angle_limit", "rate_limit", "acceleration_limit")
    }
    white = np.ones(len(disturbance.inputs))
    unit = np.diag(np.concatenate([limits["angle_limit"], limits["rate_limit"], white]))
    b, d = system.B @ unit, system.D @ unit / RBM_UNIT
    # White flap motion beside the turbulence: a state that only the flap excites needs a scale too.
    deviation = np.sqrt(np.diag(stationary_covariance(system.A, b)))
    scale = np.where(deviation > 1e-12 * deviation.max(), deviation, 1.0)
    a, b, c = system.A * scale / scale[:, None], b / scale[:, None], system.C * scale / RBM_UNIT
    check_stabilisable_and_detectable(a, b[:, : 2 * p], c, model.time_step)
    return DesignModel(
        A=a,
        B=b[:, : 2 * p],
        G=b[:, 2 * p :],
        C=c,
        D=d[:, : 2 * p],
        H=d[:, 2 * p :],
        channels=channels,
        turn=channels.flap_turn(model.rotor_speed * model.time_step),
        time_step=model.time_step,
        **limits,
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
        acceleration_limits(model),
        model.hash,
    )


def synthesise(design: DesignModel, weights: Weights) -> StateSpace:
    """The controller: inputs and outputs of the design's channels in SI units, one step of computing delay.

    Predictor form: the acceleration at step n uses measurements up to n - 1 and the flaps' motion at n.
    """
    observer, _ = predictor_gain(design, weights)
    regulator, _ = regulator_gain(design, weights)
    n, m = design.A.shape[0], design.channels.actions
    flap, limit = flap_units(design), design.acceleration_limit[:, None]
    return StateSpace(
        # No regulator in A: the flap's motion is measured, so the observer need not predict it from its own command.
        A=design.A - observer @ design.C,
        B=np.hstack([observer / RBM_UNIT, (design.B - observer @ design.D) @ flap]),
        C=-limit * regulator[:, :n],
        D=-limit * np.hstack([np.zeros((m, design.channels.count)), regulator[:, n:] @ flap]),
        time_step=design.time_step,
        inputs=design.channels.inputs,
        outputs=design.channels.outputs,
    )


def initial_estimate(design: DesignModel, weights: Weights) -> Array:
    """Controller state (n, m + 2 p) at the start of an episode, per unit of its first inputs [N m, rad, rad/s].

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
    """Regulator gain (p, n + 2 p) on [x, angles, rates] in units of their limits, and the cost matrix."""
    a, b, c = with_actuator(design)
    n, flaps = design.A.shape[0], design.channels.flaps
    # A cyclic component's square counts half in the mean over blades, a flap's a share in the mean over its blade's.
    each = np.diag(design.channels.weight)
    of_flaps = np.kron(np.eye(flaps) / flaps, each)
    # The moment takes in D times the flaps' motion, so the cost couples x with the actuators' states.
    q = weights.rbm * c.T @ each @ c
    angles = slice(n, n + design.channels.actions)
    q[angles, angles] += weights.flap_angle * of_flaps
    r = weights.acceleration * of_flaps
    cost = scipy.linalg.solve_discrete_are(a, b, q, r)
    return np.linalg.solve(r + b.T @ cost @ b, b.T @ cost @ a), cost


def with_actuator(design: DesignModel) -> tuple[Array, Array, Array]:
    """Matrices (A, B, C) of the design model driven by flap accelerations, states [x, angles, rates]."""
    n, p, dt = design.A.shape[0], design.channels.actions, design.time_step
    rate, acceleration = design.rate_limit / design.angle_limit, design.acceleration_limit
    # A flap that rests on its blade has other multi-blade components a step later: `turn` takes the old to the new.
    turn = design.turn
    actuator = np.block([[turn, turn * (dt * rate)], [np.zeros((p, p)), turn]])
    a = np.block([[design.A, design.B], [np.zeros((2 * p, n)), actuator]])
    # By column, which is by flap: every flap has limits of its own.
    to_angle = turn * (0.5 * dt**2 * acceleration / design.angle_limit)
    to_rate = turn * (dt * acceleration / design.rate_limit)
    return (
        a,
        np.vstack([np.zeros((n, p)), to_angle, to_rate]),
        np.hstack([design.C, design.D]),
    )


def noise_covariance(design: DesignModel, weights: Weights) -> Array:
    """Of the measurement noise in the design's channels, (m, m) [(MN m)^2]."""
    return np.diag((weights.measurement_noise * design.rbm_rms) ** 2 * np.array(design.channels.noise))


def flap_units(design: DesignModel) -> Array:
    """Diagonal (2 p, 2 p) that takes angles [rad] and rates [rad/s] to fractions of their limits."""
    return np.diag(1.0 / np.concatenate([design.angle_limit, design.rate_limit]))


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
