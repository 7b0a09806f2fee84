"""The whole turbine with a controller on its flaps, as one time-invariant system (extends paper eq. 14).

In multi-blade coordinates three copies of a blade's controller rotate as the whirl aerodynamics do: what a copy carries
from one step to the next is expressed in axes that have turned by Omega dt. Stops are left out; up to them this is
exact.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from flapgym.control.channels import BLADE, ROTOR, controller_channels
from flapgym.core.arrays import Array
from flapgym.core.fields import Count, Quantity
from flapgym.core.state_space import StateSpace, require_time_step, series
from flapgym.model.multiblade import to_blades, to_components
from flapgym.model.turbine_model import TurbineModel
from flapgym.wind import von_karman_filter

LARGEST_EFFECTIVENESS = 8.0
"""Where the search for the stability margin ends."""
EFFECTIVENESS_TOLERANCE = 0.01
"""To which that margin is found."""


def closed_loop(
    model: TurbineModel,
    controller: StateSpace,
    effectiveness: float = 1.0,
    plant: StateSpace | None = None,
) -> StateSpace:
    """Inputs "wind" [m/s] and measurement noise [N m]; outputs of the plant, then flap angle, rate and acceleration.

    Parameters
    ----------
    model : TurbineModel
        The turbine.
    controller : StateSpace
        Of one blade, as `BladeController` takes it, or of the rotor in the plant's frame.
    effectiveness : float
        Factor on everything the flaps do to the turbine, which the controller does not know of.
    plant : StateSpace, optional
        What the loop is closed on, three blades in either frame; by default the turbine. A controller in the blades'
        own frames has a time-invariant loop only with a plant in those, as a turbine frozen at an azimuth.

    Raises
    ------
    ValueError
        If controller or plant has another time step than the model, or the two are of different frames.
    """
    Quantity("number").check(effectiveness, "closed_loop.effectiveness")
    require_model_step("closed_loop.controller", controller, model)
    if plant is not None:
        require_model_step("closed_loop.plant", plant, model)
    plant = with_effectiveness(model.turbine if plant is None else plant, effectiveness)
    frame = controller_channels(plant.inputs)
    plant = plant.select(inputs=[*frame.inputs[3:], "wind"])
    flaps = flaps_loop(_in_frame(controller, model, plant), frame.turn(model.rotor_speed * model.time_step))
    n, m = plant.order, flaps.order
    rows = [plant.outputs.index(name) for name in frame.named("rbm")]
    b_flap, b_wind = plant.B[:, :6], plant.B[:, 6:]
    rbm_x, d_flap, d_wind = plant.C[rows], plant.D[rows, :6], plant.D[rows, 6:]
    # Flap motion is a state of the flaps, so nothing here is an algebraic loop.
    rbm_c = d_flap @ flaps.C[:6]
    a = np.block([[plant.A, b_flap @ flaps.C[:6]], [flaps.B @ rbm_x, flaps.A + flaps.B @ rbm_c]])
    b = np.block([[b_wind, np.zeros((n, 3))], [flaps.B @ d_wind, flaps.B]])
    c = np.vstack(
        [
            np.hstack([plant.C, plant.D[:, :6] @ flaps.C[:6]]),
            np.hstack([np.zeros((6, n)), flaps.C[:6]]),
            np.hstack([flaps.D[6:] @ rbm_x, flaps.C[6:] + flaps.D[6:] @ rbm_c]),
        ]
    )
    d = np.block(
        [
            [plant.D[:, 6:], np.zeros((len(plant.outputs), 3))],
            [np.zeros((6, 4))],
            [flaps.D[6:] @ d_wind, flaps.D[6:]],
        ]
    )
    assert a.shape == (n + m, n + m)
    names = [*frame.named("flap_angle"), *frame.named("flap_rate"), *frame.named("flap_acceleration")]
    return StateSpace(a, b, c, d, model.time_step, ("wind", *frame.named("noise")), (*plant.outputs, *names))


def require_model_step(name: str, system: StateSpace, model: TurbineModel) -> None:
    """Refuse a system that was sampled at another time step than the model."""
    require_time_step(f"{name}.time_step", system.time_step, model.time_step, "the model's")


def with_effectiveness(turbine: StateSpace, effectiveness: float) -> StateSpace:
    """The turbine with every effect of the flaps on it multiplied by `effectiveness`."""
    factor = np.array([effectiveness if name.startswith("flap") else 1.0 for name in turbine.inputs])
    return replace(turbine, B=turbine.B * factor, D=turbine.D * factor)


def _in_frame(controller: StateSpace, model: TurbineModel, plant: StateSpace) -> StateSpace:
    """The controller of three flaps in the plant's frame: three copies, if it is of one blade."""
    frame, own = controller_channels(plant.inputs), controller_channels(controller.inputs)
    if own == frame:
        return controller
    if own != BLADE:
        raise ValueError(
            f"closed_loop: a controller of {', '.join(own.named('rbm'))} has no time-invariant loop with a plant of "
            f"{', '.join(frame.named('rbm'))}"
        )
    # A copy's state is turned on over a step, so A and B carry the rotation; what it reads and gives at one instant,
    # C and D, is in the axes of that instant.
    turn = frame.turn(model.rotor_speed * model.time_step)
    each = np.eye(3)
    return StateSpace(
        A=np.asarray(np.kron(turn, controller.A)),
        # Column by column, because the inputs stand signal by signal: three moments, three angles, three rates.
        B=np.hstack([np.kron(turn, column[:, None]) for column in controller.B.T]),
        C=np.asarray(np.kron(each, controller.C)),
        D=np.hstack([np.kron(each, column[:, None]) for column in controller.D.T]),
        time_step=controller.time_step,
        inputs=frame.inputs,
        outputs=frame.outputs,
    )


def flaps_loop(controller: StateSpace, turn: Array) -> StateSpace:
    """Double integrators and controller of the three flaps: from moments to angles, rates and accelerations.

    States [angles, rates, controller].
    """
    # The acceleration is held over a step, so the double integrator is exact: dt^2 / 2 and dt.
    dt, m = controller.time_step, controller.order
    to_rbm, to_flap = controller.B[:, :3], controller.B[:, 3:]
    acceleration_input = np.kron([[0.5 * dt**2], [dt]], turn)
    double_integrator = np.kron([[1.0, dt], [0.0, 1.0]], turn)
    a = np.block(
        [
            [double_integrator + acceleration_input @ controller.D[:, 3:], acceleration_input @ controller.C],
            [to_flap, controller.A],
        ]
    )
    return StateSpace(
        A=a,
        B=np.vstack([acceleration_input @ controller.D[:, :3], to_rbm]),
        C=np.vstack([np.eye(6, m + 6), np.hstack([controller.D[:, 3:], controller.C])]),
        D=np.vstack([np.zeros((6, 3)), controller.D[:, :3]]),
        time_step=dt,
        inputs=controller.inputs[:3],
        outputs=(*controller.inputs[3:], *controller.outputs),
    )


@dataclass(frozen=True)
class Stability:
    """Spectral radius of the full closed loop, and how far the flap's effect may grow before it leaves the unit circle.

    `effectiveness_margin` is capped at ``LARGEST_EFFECTIVENESS``.
    """

    spectral_radius: float
    effectiveness_margin: float


def stability(model: TurbineModel, controller: StateSpace) -> Stability:
    """Spectral radius as designed, and the smallest factor above one on the flap's effect that destabilises.

    The factor is bracketed in steps of 10 % and then bisected to 0.01; a loop that is stable again beyond an
    unstable band narrower than a step would be missed. Such a band cannot lie within the gains of the disk margin.
    """
    radius = closed_loop(model, controller).spectral_radius()
    if radius >= 1.0:
        return Stability(radius, 0.0)
    low = high = 1.0
    while high < LARGEST_EFFECTIVENESS:
        low, high = high, min(1.1 * high, LARGEST_EFFECTIVENESS)
        if closed_loop(model, controller, high).spectral_radius() >= 1.0:
            break
    else:
        return Stability(radius, LARGEST_EFFECTIVENESS)
    while high - low > EFFECTIVENESS_TOLERANCE:
        middle = 0.5 * (low + high)
        stable = closed_loop(model, controller, middle).spectral_radius() < 1.0
        low, high = (middle, high) if stable else (low, middle)
    return Stability(radius, low)


def growth_per_turn(model: TurbineModel, controller: StateSpace, turns: int = 40) -> float:
    """Factor by which what decays slowest grows over a revolution: stable below one.

    For controllers in the blades' own frames, whose loop with the turning turbine is periodic: the power iteration of
    its Floquet multipliers, from the rms moment over the revolution in the middle to that over the last one. To about
    4 % at forty turns where several modes decay alike. Infinite beyond the range of numbers.
    """
    Count(at_least=2).check(turns, "growth_per_turn.turns")
    require_model_step("growth_per_turn.controller", controller, model)
    turbine = model.turbine
    step = model.rotor_speed * model.time_step
    flaps = flaps_loop(controller, np.eye(3))
    x, y = np.random.default_rng(0).standard_normal((2, max(turbine.order, flaps.order)))
    x, y = x[: turbine.order], y[: flaps.order]
    y[:6] *= 1e-9  # flap motion in proportion to the load it makes
    turn = round(2.0 * np.pi / step)
    logs, taken = np.empty((turns, turn)), 0.0
    for n in range(turns * turn):
        # Flaps in the blades' frames, turbine in components: to and fro by this step's azimuth.
        to_axes = to_components(np.eye(3), n * step).T
        flap = flaps.C[:6] @ y
        u = np.concatenate([to_axes @ flap[:3], to_axes @ flap[3:]])
        moment = turbine.C[:3] @ x + turbine.D[:3, :6] @ u
        y = flaps.A @ y + flaps.B @ to_blades(moment, n * step)
        x = turbine.A @ x + turbine.B[:, :6] @ u
        size = np.linalg.norm(moment)
        logs[n // turn, n % turn] = taken + np.log(size)
        if size > 1e100:
            # What grows fast would leave the range of numbers within some turns.
            x, y, taken = x / size, y / size, taken + np.log(size)
    rms = 0.5 * logsumexp(2.0 * logs, axis=1)
    half = turns // 2
    with np.errstate(over="ignore"):
        return float(np.exp((rms[-1] - rms[half - 1]) / (turns - half)))


def stationary_rms(
    model: TurbineModel,
    controller: StateSpace | None = None,
    filter_order: int = 5,
    *,
    effectiveness: float = 1.0,
    length_scale: float | None = None,
    measurement_noise: float = 0.0,
    plant: StateSpace | None = None,
) -> dict[str, float]:
    """Rms of a blade's moment, tip deflection, flap motion and of the tower under turbulence.

    From the Lyapunov equation of the linear system: what any simulation that stays off the stops must come to. Blade
    signals are averaged over azimuth, so over blades: variance P_00 + (P_cc + P_ss) / 2.

    Parameters
    ----------
    model, controller, effectiveness, plant
        As of `closed_loop`; no controller means the open loop.
    filter_order : int
        Of the turbulence filter.
    length_scale : float, optional
        Of the turbulence [m]; by default the reference's.
    measurement_noise : float
        Rms of white noise on each blade's measured moment [N m]; what is reported is the true moment.

    Returns
    -------
    dict of str to float
        "rbm" [N m], "tip_deflection" [m], "tower_fore_aft", "tower_side_side" [m], "wind" [m/s]; with a controller also
        "flap_angle" [rad], "flap_rate" [rad/s] and "flap_acceleration" [rad/s^2].
    """
    Quantity("number").check(effectiveness, "stationary_rms.effectiveness")
    Quantity("moment", at_least=0.0).check(measurement_noise, "stationary_rms.measurement_noise")
    length = model.length_scale if length_scale is None else length_scale
    wind = von_karman_filter(
        model.wind_speed, model.turbulence_intensity, length, model.time_step, filter_order
    )
    plant = model.turbine if plant is None else plant
    channels = controller_channels(plant.inputs)
    noise = np.array([])
    if controller is None:
        system = plant.select(inputs=["wind"])
    else:
        system = closed_loop(model, controller, effectiveness, plant)
        noise = measurement_noise * np.sqrt(channels.noise)
    driven = series(wind, system)
    # The Lyapunov equation takes white inputs of unit variance.
    intensity = np.concatenate([[1.0], noise])
    driven = replace(driven, B=driven.B * intensity, D=driven.D * intensity)
    covariance = driven.stationary_covariance()
    output: Array = np.diag(driven.C @ covariance @ driven.C.T + driven.D @ driven.D.T)
    variance = dict(zip(driven.outputs, output, strict=True))
    # The mean over blades: of components by their weights, of three blades by a third each.
    share = np.array(channels.weight) / (3.0 if channels == ROTOR else 1.0)
    result = {"wind": model.turbulence_intensity * model.wind_speed}
    signals = ["rbm", "tip_deflection"]
    signals += [] if controller is None else ["flap_angle", "flap_rate", "flap_acceleration"]
    for signal in signals:
        result[signal] = float(np.sqrt(share @ [variance[name] for name in channels.named(signal)]))
    for name in ("tower_fore_aft", "tower_side_side"):
        result[name] = float(np.sqrt(variance[name]))
    return result
