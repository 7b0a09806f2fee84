"""The rotor's own speed: what turns with it, and the loop of torque and collective pitch that holds it.

The generator turns freely about the shaft's axis in place of a prescribed speed. How far it has turned changes nothing,
since rotor and wind look the same at every azimuth in multi-blade coordinates; what is left is its speed, one state.
The loop is linear about the operating point: pitch meets no stop, and torque keeps to the region of its law.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.linalg

from flapgym.aerodynamics.transport import WakeState
from flapgym.core.arrays import Array
from flapgym.core.state_space import StateSpace, feedback
from flapgym.model.signals import GENERATOR_TORQUE, INDUCED_WIND, PITCH_KINDS, turbine_outputs
from flapgym.turbine import Case

ROTOR_SPEED = "rotor_speed"
COLLECTIVE_PITCH = "collective_pitch"
WIND_ESTIMATE = "wind_speed_estimate"
CONTROLLED = (COLLECTIVE_PITCH, GENERATOR_TORQUE, WIND_ESTIMATE)
"""Outputs that the law tells, not the turbine under it."""


def speed_law(case: Case, wake: WakeState | None = None) -> StateSpace:
    """From the rotor's speed to the generator's torque and the blades' collective pitch, all about the operating point.

    Inputs ``rotor_speed`` [rad/s]; outputs the torque on the low-speed side [N m], pitch angle, rate and acceleration
    behind the blades' own actuators [rad, rad/s, rad/s^2], and the wind at the blades as the wake gives way [m/s],
    zero without one. No output answers at once. Sampled with the input held.

    Raises
    ------
    ValueError
        If the case has no such control or no actuators of pitch.
    """
    control, actuator = case.speed_control, case.pitch
    if control is None or actuator is None:
        raise ValueError(
            "speed_control: expected a table [speed_control] and one [pitch], got a case without"
        )
    ratio, pitch = case.turbine.drivetrain.gearbox_ratio, case.operating_point.pitch
    slope = control.torque_slope(ratio * case.rotor_speed, pitch)
    proportional, integral = control.pitch_gains(pitch)
    corner, natural = (2.0 * np.pi * f for f in (control.speed_filter, actuator.natural_frequency))
    # States: the generator's speed behind the low-pass, its integral, pitch angle and rate.
    rates = np.array(
        [
            [-corner, 0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
            [
                natural**2 * proportional,
                natural**2 * integral,
                -(natural**2),
                -2.0 * actuator.damping * natural,
            ],
        ]
    )
    driven = np.array([[corner * ratio], [0.0], [0.0], [0.0]])
    told = np.vstack([[ratio * slope, 0.0, 0.0, 0.0], np.eye(2, 4, 2), rates[3]])
    if pitch <= 0.0:
        # Below rated pitch rests, and an integral that nobody reads would never decay.
        rates, driven, told = rates[:1, :1], driven[:1], told[:, :1]
        told[1:] = 0.0
    told = np.vstack([told, np.zeros((1, len(rates)))])
    if wake is not None:
        rates = scipy.linalg.block_diag(rates, -1.0 / wake.time_constant)
        driven = np.vstack([driven, 1.0 / wake.time_constant])
        told = np.hstack([told, np.eye(len(told), 1, 1 - len(told)) * wake.gain])
    n, dt = len(rates), case.discretisation.time_step
    held = scipy.linalg.expm(dt * np.block([[rates, driven], [np.zeros((1, n + 1))]]))
    outputs = (GENERATOR_TORQUE, *(f"pitch_{kind}_0" for kind in PITCH_KINDS), INDUCED_WIND)
    return StateSpace(held[:n, :n], held[:n, n:], told, np.zeros((5, 1)), dt, (ROTOR_SPEED,), outputs)


def without_azimuth(turbine: StateSpace, place: int) -> StateSpace:
    """The turbine without the state that tells how far the rotor has turned, which nothing depends on."""
    keep = np.arange(turbine.order) != place
    unread = np.delete(turbine.A[:, place], place), turbine.C[:, place]
    assert not any(np.any(part) for part in unread), "the rotor's azimuth has come to count"
    return replace(turbine, A=turbine.A[np.ix_(keep, keep)], B=turbine.B[keep], C=turbine.C[:, keep])


def with_speed_loop(turbine: StateSpace, case: Case, wake: WakeState | None = None) -> StateSpace:
    """The turbine under its speed law, with the outputs that the case asks for; torque is no input any more.

    A pitch of the blades that is given from outside adds to the loop's.
    """
    closed = feedback(turbine, speed_law(case, wake))
    pitch = closed.outputs.index("pitch_angle_0")
    outputs = (*closed.outputs[:pitch], COLLECTIVE_PITCH, *closed.outputs[pitch + 1 :])
    told = with_estimate(replace(closed, outputs=outputs), case)
    given = [name for name in told.inputs if name not in (GENERATOR_TORQUE, INDUCED_WIND)]
    return told.select(given, turbine_outputs(case.signals.further))


def with_estimate(closed: StateSpace, case: Case) -> StateSpace:
    """The turbine with one more state and output: how far its mean wind seems to lie from the operating point's [m/s].

    Below rated it is told by the rotor's speed, above by the pitch, low-passed and over what a steady wind does to it.
    """
    assert case.speed_control is not None
    telling = COLLECTIVE_PITCH if case.operating_point.pitch > 0.0 else ROTOR_SPEED
    seen = closed.select(outputs=[telling])
    per_wind = float(seen.select(inputs=["wind"]).dc_gain().item())
    left = np.exp(-closed.time_step / case.speed_control.estimate_time)
    n, gain = closed.order, (1.0 - left) / per_wind
    return StateSpace(
        A=np.block([[closed.A, np.zeros((n, 1))], [gain * seen.C, left * np.eye(1)]]),
        B=np.vstack([closed.B, gain * seen.D]),
        C=np.block([[closed.C, np.zeros((len(closed.outputs), 1))], [np.zeros((1, n)), np.eye(1)]]),
        D=np.vstack([closed.D, np.zeros((1, len(closed.inputs)))]),
        time_step=closed.time_step,
        inputs=closed.inputs,
        outputs=(*closed.outputs, WIND_ESTIMATE),
    )


def turning(size: int, axis: Array) -> Array:
    """Motion (size,) of the support as its hub, whose place is last, turns about an axis (3,) by a radian."""
    out = np.zeros(size)
    out[-3:] = axis
    return out
