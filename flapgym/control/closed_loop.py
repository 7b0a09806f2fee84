"""The whole turbine with a controller on its flaps, as one time-invariant system (extends paper eq. 14).

In multi-blade coordinates three copies of a blade's controller rotate as the whirl aerodynamics do: what a copy carries
from one step to the next is expressed in axes that have turned by Omega dt. Stops are left out; up to them this is
exact.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from flapgym.control.channels import BLADE, MULTIBLADE, ROTOR, controller_channels
from flapgym.core.arrays import Array
from flapgym.core.fields import Count, Quantity
from flapgym.core.multiblade import to_blades, to_components
from flapgym.core.state_space import StateSpace, require_time_step, series
from flapgym.model.signals import flap_names
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
    """Inputs "wind" [m/s] and measurement noise [N m]; outputs of the plant, then flap angles, rates, accelerations.

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
        If controller or plant has another time step than the model, or the two are of different frames or of different
        numbers of flaps.
    """
    Quantity("number").check(effectiveness, "closed_loop.effectiveness")
    require_model_step("closed_loop.controller", controller, model)
    if plant is not None:
        require_model_step("closed_loop.plant", plant, model)
    plant = with_effectiveness(model.turbine if plant is None else plant, effectiveness)
    frame = controller_channels(plant.inputs)
    plant = plant.select(inputs=[*frame.flap_inputs, "wind"])
    flaps = flaps_loop(_in_frame(controller, model, plant), frame.turn(model.rotor_speed * model.time_step))
    n, m = plant.order, flaps.order
    motion = 2 * frame.actions
    rows = [plant.outputs.index(name) for name in frame.moments]
    b_flap, b_wind = plant.B[:, :motion], plant.B[:, motion:]
    rbm_x, d_flap, d_wind = plant.C[rows], plant.D[rows, :motion], plant.D[rows, motion:]
    # Flap motion is a state of the flaps, so nothing here is an algebraic loop.
    rbm_c = d_flap @ flaps.C[:motion]
    a = np.block([[plant.A, b_flap @ flaps.C[:motion]], [flaps.B @ rbm_x, flaps.A + flaps.B @ rbm_c]])
    b = np.block([[b_wind, np.zeros((n, 3))], [flaps.B @ d_wind, flaps.B]])
    c = np.vstack(
        [
            np.hstack([plant.C, plant.D[:, :motion] @ flaps.C[:motion]]),
            np.hstack([np.zeros((motion, n)), flaps.C[:motion]]),
            np.hstack([flaps.D[motion:] @ rbm_x, flaps.C[motion:] + flaps.D[motion:] @ rbm_c]),
        ]
    )
    d = np.block(
        [
            [plant.D[:, motion:], np.zeros((len(plant.outputs), 3))],
            [np.zeros((motion, 4))],
            [flaps.D[motion:] @ d_wind, flaps.D[motion:]],
        ]
    )
    assert a.shape == (n + m, n + m)
    names = [*frame.flap_inputs, *frame.of_flaps("acceleration")]
    return StateSpace(a, b, c, d, model.time_step, ("wind", *frame.named("noise")), (*plant.outputs, *names))


def require_model_step(name: str, system: StateSpace, model: TurbineModel) -> None:
    """Refuse a system that was sampled at another time step than the model."""
    require_time_step(f"{name}.time_step", system.time_step, model.time_step, "the model's")


def require_flaps(name: str, flaps: int, model: TurbineModel) -> None:
    """Refuse what has another number of flaps a blade than the model."""
    if flaps != len(model.flaps):
        raise ValueError(
            f"{name}: expected {len(model.flaps)} {'flap' if len(model.flaps) == 1 else 'flaps'} a blade, as the model "
            f"{model.name} has, got {flaps}; make it for this model"
        )


def with_effectiveness(turbine: StateSpace, effectiveness: float) -> StateSpace:
    """The turbine with every effect of the flaps on it multiplied by `effectiveness`."""
    factor = np.array([effectiveness if name.startswith("flap") else 1.0 for name in turbine.inputs])
    return replace(turbine, B=turbine.B * factor, D=turbine.D * factor)


def _in_frame(controller: StateSpace, model: TurbineModel, plant: StateSpace) -> StateSpace:
    """The controller of three flaps in the plant's frame: three copies, if it is of one blade."""
    frame, own = controller_channels(plant.inputs), controller_channels(controller.inputs)
    require_flaps("closed_loop.plant", frame.flaps, model)
    require_flaps("closed_loop.controller", own.flaps, model)
    if own == frame:
        return controller
    if own.suffixes != BLADE.suffixes:
        raise ValueError(
            f"closed_loop: a controller of {', '.join(own.moments)} has no time-invariant loop with a plant of "
            f"{', '.join(frame.moments)}"
        )
    # A copy's state is turned on over a step, so A and B carry the rotation; what it reads and gives at one instant,
    # C and D, is in the axes of that instant.
    turn = frame.turn(model.rotor_speed * model.time_step)
    each = np.eye(3)
    return StateSpace(
        A=np.asarray(np.kron(turn, controller.A)),
        # Column by column, because the inputs stand signal by signal: three moments, of each flap three angles, three
        # rates; and row by row, because the accelerations do.
        B=np.hstack([np.kron(turn, column[:, None]) for column in controller.B.T]),
        C=np.vstack([np.kron(each, row[None]) for row in controller.C]),
        D=np.asarray(np.kron(controller.D, each)),
        time_step=controller.time_step,
        inputs=frame.inputs,
        outputs=frame.outputs,
    )


def flaps_loop(controller: StateSpace, turn: Array) -> StateSpace:
    """Double integrators and controller of all flaps: from three moments to angles, rates and accelerations.

    States [angles, rates, controller]; `turn` (3, 3) carries what a flap keeps over one step.
    """
    # The acceleration is held over a step, so the double integrator is exact: dt^2 / 2 and dt.
    dt, m, motion = controller.time_step, controller.order, 2 * len(controller.outputs)
    to_rbm, to_flap = controller.B[:, :3], controller.B[:, 3:]
    turns = np.kron(np.eye(len(controller.outputs) // 3), turn)
    acceleration_input = np.kron([[0.5 * dt**2], [dt]], turns)
    double_integrator = np.kron([[1.0, dt], [0.0, 1.0]], turns)
    a = np.block(
        [
            [double_integrator + acceleration_input @ controller.D[:, 3:], acceleration_input @ controller.C],
            [to_flap, controller.A],
        ]
    )
    return StateSpace(
        A=a,
        B=np.vstack([acceleration_input @ controller.D[:, :3], to_rbm]),
        C=np.vstack([np.eye(motion, m + motion), np.hstack([controller.D[:, 3:], controller.C])]),
        D=np.vstack([np.zeros((motion, 3)), controller.D[:, :3]]),
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
    channels = MULTIBLADE.with_flaps(controller_channels(controller.inputs).flaps)
    require_flaps("growth_per_turn.controller", channels.flaps, model)
    turbine = model.turbine.select(channels.flap_inputs, channels.moments)
    step = model.rotor_speed * model.time_step
    flaps, motion = flaps_loop(controller, np.eye(3)), 2 * channels.actions
    x, y = np.random.default_rng(0).standard_normal((2, max(turbine.order, flaps.order)))
    x, y = x[: turbine.order], y[: flaps.order]
    y[:motion] *= 1e-9  # flap motion in proportion to the load it makes
    turn = round(2.0 * np.pi / step)
    logs, taken = np.empty((turns, turn)), 0.0
    for n in range(turns * turn):
        # Flaps in the blades' frames, turbine in components: to and fro by this step's azimuth.
        to_axes = to_components(np.eye(3), n * step).T
        flap = flaps.C[:motion] @ y
        u = (flap.reshape(-1, 3) @ to_axes.T).ravel()
        moment = turbine.C @ x + turbine.D @ u
        y = flaps.A @ y + flaps.B @ to_blades(moment, n * step)
        x = turbine.A @ x + turbine.B @ u
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
        "flap_angle" [rad], "flap_rate" [rad/s] and "flap_acceleration" [rad/s^2], of several flaps a blade
        "flap1_angle" and so on.
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
    share = np.array(channels.weight) / (3.0 if channels.suffixes == ROTOR.suffixes else 1.0)
    result = {"wind": model.turbulence_intensity * model.wind_speed}
    signals = ["rbm", "tip_deflection"]
    if controller is not None:
        kinds = ("angle", "rate", "acceleration")
        signals += [f"{flap}_{kind}" for kind in kinds for flap in flap_names(channels.flaps)]
    for signal in signals:
        result[signal] = float(np.sqrt(share @ [variance[name] for name in channels.named(signal)]))
    for name in ("tower_fore_aft", "tower_side_side"):
        result[name] = float(np.sqrt(variance[name]))
    return result
