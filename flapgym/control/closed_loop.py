"""The whole turbine with a controller on each blade, as one time-invariant system (extends paper eq. 14).

In multi-blade coordinates the three copies rotate as the whirl aerodynamics do: what a copy carries from one step to
the next is expressed in axes that have turned by Omega dt. Stops are left out; up to them this is exact.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from flapgym.aeroelastic.model import TurbineModel
from flapgym.state_space import Array, StateSpace, series
from flapgym.turbulence import von_karman_filter

LARGEST_EFFECTIVENESS = 8.0
"""Where the search for the stability margin ends."""


def closed_loop(model: TurbineModel, controller: StateSpace, effectiveness: float = 1.0) -> StateSpace:
    """Input "wind" [m/s]; outputs those of the turbine, then flap angle, rate and acceleration (0, c, s).

    Parameters
    ----------
    model : TurbineModel
        The turbine.
    controller : StateSpace
        Of one blade, as `BladeController` takes it.
    effectiveness : float
        Factor on everything the flaps do to the turbine, which the controller does not know of.
    """
    turbine = with_effectiveness(model.turbine, effectiveness)
    copies = _three_copies(controller, model.rotor_speed)
    n, m = turbine.order, copies.order
    b_flap, b_wind = turbine.B[:, :6], turbine.B[:, 6:]
    d_flap, d_wind = turbine.D[:3, :6], turbine.D[:3, 6:]
    # Flap motion is a state of the copies, so nothing here is an algebraic loop.
    rbm_x, rbm_c = turbine.C[:3], d_flap @ copies.C[:6]
    a = np.block([[turbine.A, b_flap @ copies.C[:6]], [copies.B @ rbm_x, copies.A + copies.B @ rbm_c]])
    b = np.vstack([b_wind, copies.B @ d_wind])
    flap = np.hstack([copies.D[6:] @ rbm_x, copies.C[6:] + copies.D[6:] @ rbm_c])
    c = np.vstack(
        [
            np.hstack([turbine.C, turbine.D[:, :6] @ copies.C[:6]]),
            np.hstack([np.zeros((6, n)), copies.C[:6]]),
            flap,
        ]
    )
    d = np.vstack([turbine.D[:, 6:], np.zeros((6, 1)), copies.D[6:] @ d_wind])
    assert a.shape == (n + m, n + m)
    return StateSpace(a, b, c, d, model.time_step, ("wind",), turbine.outputs + copies.outputs)


def with_effectiveness(turbine: StateSpace, effectiveness: float) -> StateSpace:
    """The turbine with all it feels of the flaps multiplied by `effectiveness`."""
    factor = np.array([effectiveness if name.startswith("flap") else 1.0 for name in turbine.inputs])
    return replace(turbine, B=turbine.B * factor, D=turbine.D * factor)


def _three_copies(controller: StateSpace, rotor_speed: float) -> StateSpace:
    """Actuator and controller of the three blades in multi-blade coordinates.

    Inputs rbm (0, c, s); outputs flap angle, rate and acceleration (0, c, s). States [collective, cosine, sine] of
    [flap angle, rate, controller].
    """
    dt, m = controller.time_step, controller.order
    to_rbm, to_flap = controller.B[:, :1], controller.B[:, 1:]
    kick = np.array([[0.5 * dt**2], [dt]])
    a = np.block(
        [
            [np.array([[1.0, dt], [0.0, 1.0]]) + kick @ controller.D[:, 1:], kick @ controller.C],
            [to_flap, controller.A],
        ]
    )
    b = np.vstack([kick @ controller.D[:, :1], to_rbm])
    angle, rate = np.eye(2, m + 2)[:1], np.eye(2, m + 2)[1:]
    acceleration = np.hstack([controller.D[:, 1:], controller.C])
    cosine, sine = np.cos(rotor_speed * dt), np.sin(rotor_speed * dt)
    turn = np.array([[1.0, 0.0, 0.0], [0.0, cosine, -sine], [0.0, sine, cosine]])
    each = np.eye(3)
    axes = ("0", "c", "s")
    return StateSpace(
        A=np.kron(turn, a),
        B=np.kron(turn, b),
        C=np.vstack([np.kron(each, angle), np.kron(each, rate), np.kron(each, acceleration)]),
        D=np.vstack([np.zeros((6, 3)), controller.D[0, 0] * each]),
        time_step=dt,
        inputs=tuple(f"rbm_{axis}" for axis in axes),
        outputs=tuple(
            f"{name}_{axis}" for name in ("flap_angle", "flap_rate", "flap_acceleration") for axis in axes
        ),
    )


@dataclass(frozen=True)
class Stability:
    """Spectral radius of the full closed loop, and how far the flap's effect may grow before it leaves the unit circle.

    `effectiveness_margin` is capped at ``LARGEST_EFFECTIVENESS``.
    """

    spectral_radius: float
    effectiveness_margin: float


def stability(model: TurbineModel, controller: StateSpace, tolerance: float = 0.01) -> Stability:
    """Spectral radius as designed, and the smallest factor above one on the flap's effect that destabilises.

    The factor is bracketed in steps of 10 % and then bisected to `tolerance`; a loop that is stable again beyond an
    unstable band narrower than a step would be missed.
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
    while high - low > tolerance:
        middle = 0.5 * (low + high)
        stable = closed_loop(model, controller, middle).spectral_radius() < 1.0
        low, high = (middle, high) if stable else (low, middle)
    return Stability(radius, low)


def stationary_rms(
    model: TurbineModel, controller: StateSpace | None = None, filter_order: int = 5
) -> dict[str, float]:
    """Rms of a blade's moment, tip deflection, flap motion and of the tower under the reference turbulence.

    From the Lyapunov equation of the linear system: what any simulation that stays off the stops must come to. Blade
    signals are averaged over azimuth, so over blades: variance P_00 + (P_cc + P_ss) / 2.

    Returns
    -------
    dict of str to float
        "rbm" [N m], "tip_deflection" [m], "tower_fore_aft", "tower_side_side" [m], "wind" [m/s]; with a controller also
        "flap_angle" [rad], "flap_rate" [rad/s] and "flap_acceleration" [rad/s^2].
    """
    wind = von_karman_filter(
        model.wind_speed, model.turbulence_intensity, model.length_scale, model.time_step, filter_order
    )
    system = model.turbine.select(inputs=["wind"]) if controller is None else closed_loop(model, controller)
    driven = series(wind, system)
    covariance = driven.stationary_covariance()
    output: Array = np.diag(driven.C @ covariance @ driven.C.T + driven.D @ driven.D.T)
    variance = dict(zip(driven.outputs, output, strict=True))
    result = {"wind": model.turbulence_intensity * model.wind_speed}
    for name in [name for name in variance if name.endswith("_0")]:
        signal = name.removesuffix("_0")
        mean_square = variance[name] + 0.5 * (variance[f"{signal}_c"] + variance[f"{signal}_s"])
        result[signal] = float(np.sqrt(mean_square))
    for name in ("tower_fore_aft", "tower_side_side"):
        result[name] = float(np.sqrt(variance[name]))
    return result
