"""What margins are tried on, a narrow mode, the perturbation that ends a margin, peaks; what a design's loop costs."""

from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import minimize_scalar

from flapgym.control import closed_loop
from flapgym.control.channels import controller_channels
from flapgym.control.lqg import (
    RBM_UNIT,
    flap_units,
    noise_covariance,
    predictor_gain,
    regulator_gain,
    with_actuator,
)

NARROW = 1.787
"""Frequency of a mode [Hz]."""
SEEN = 10.0 * np.exp(4.0j)
"""What a moment shows of it [N m]."""


def with_narrow_mode(turbine, frequency=NARROW, damping=1.4e-4, seen=SEEN):
    """Moved by the collective flap angle, seen in the collective moment; as it stands half a millihertz wide."""
    pole = np.exp(2j * np.pi * frequency * (1.0 + damping * 1j) * turbine.time_step)
    b, c = np.zeros((2, len(turbine.inputs))), np.zeros((len(turbine.outputs), 2))
    b[0, turbine.inputs.index("flap_angle_0")] = 1.0
    c[turbine.outputs.index("rbm_0")] = seen.real, seen.imag
    return replace(
        turbine,
        A=block_diag(turbine.A, [[pole.real, -pole.imag], [pole.imag, pole.real]]),
        B=np.vstack([turbine.B, b]),
        C=np.hstack([turbine.C, c]),
    )


def radius_at_worst(model, controller, margin, share):
    """Spectral radius with the three measurements multiplied by the worst matrix of so much of the margin.

    (1 + d/2) / (1 - d/2), d constant, complex and of rank one, from the singular vectors of S - T where the margin is
    least; its norm is `share` of the margin.
    """
    loop = closed_loop(model, controller)
    channels = controller_channels([name for name in loop.outputs if name.startswith("flap_angle")])
    answer = loop.select(channels.named("noise"), channels.named("rbm"))
    # Collective, cosine and sine on equal terms: their squares over the blades.
    scale = np.sqrt(channels.weight)
    to_equal = scale[:, None] / scale
    difference = np.eye(3) + 2.0 * to_equal * answer.frequency_response(margin.frequency)[0]
    left, _, right = np.linalg.svd(difference)
    d = share * margin.alpha * np.outer(right[0].conj(), left[:, 0].conj())
    factor = np.linalg.solve((np.eye(3) - d / 2.0).T, (np.eye(3) + d / 2.0).T).T / to_equal
    # What the factor adds to the measurement is noise that follows the moment.
    added = factor - np.eye(3)
    assert not answer.D.any()
    return np.abs(np.linalg.eigvals(answer.A + answer.B @ added @ answer.C)).max()


def gain_at(system, angle):
    z = np.exp(1j * angle)
    response = system.C @ np.linalg.solve(z * np.eye(system.order) - system.A, system.B) + system.D
    return np.linalg.norm(response, ord=2)


def searched_peak(system, angles):
    """Highest gain found by climbing from every local maximum on a grid."""
    values = np.array([gain_at(system, angle) for angle in angles])
    best = values.max()
    for top in np.flatnonzero((values[1:-1] >= values[:-2]) & (values[1:-1] >= values[2:])) + 1:
        found = minimize_scalar(
            lambda angle: -gain_at(system, angle),
            bounds=(angles[top - 1], angles[top + 1]),
            method="bounded",
            options={"xatol": 1e-12},
        )
        best = max(best, -found.fun)
    return best


def riccati_cost(design, weights):
    """The Riccati value: tr(X G G') + tr(P K' S K), the regulator's share plus the price of not knowing the state."""
    gain, x = regulator_gain(design, weights)
    _, p = predictor_gain(design, weights)
    _, b, _ = with_actuator(design)
    n, channels = design.A.shape[0], design.channels
    r = weights.acceleration / channels.flaps * np.diag(channels.weight * channels.flaps)
    curvature = r + b.T @ x @ b
    known = np.trace(x[:n, :n] @ design.G @ design.G.T)
    return known + np.trace(curvature @ gain[:, :n] @ p @ gain[:, :n].T)


def design_loop(design, controller, weights):
    """Design model, actuators and controller closed by hand; from white noise to moments, angles, accelerations."""
    a, b, c = with_actuator(design)
    n, p = a.shape[0], design.channels.actions
    m = controller.order
    motion = np.hstack([np.zeros((2 * p, n - 2 * p)), np.linalg.inv(flap_units(design))])
    measured = np.vstack([RBM_UNIT * c, motion])
    to_limit = 1.0 / design.acceleration_limit[:, None]
    acceleration = to_limit * np.hstack([controller.D @ measured, controller.C])
    noise = RBM_UNIT * controller.B[:, : design.channels.count]
    loop = np.vstack(
        [
            np.hstack([a, np.zeros((n, m))]) + b @ acceleration,
            np.hstack([controller.B @ measured, controller.A]),
        ]
    )
    # H is zero: the filter of the wind has no direct way to the moment.
    assert not design.H.any()
    white = np.vstack([design.G, np.zeros((2 * p + m, design.G.shape[1]))])
    root = np.sqrt(noise_covariance(design, weights))
    drive = np.hstack([white, np.vstack([np.zeros((n, root.shape[0])), noise @ root])])
    outputs = np.vstack(
        [np.hstack([c, np.zeros((c.shape[0], m))]), np.eye(p, n + m, n - 2 * p), acceleration]
    )
    return loop, drive, outputs


def priced(design, weights):
    """What a square of each output of `design_loop` costs."""
    channels = design.channels
    flaps = np.tile(channels.weight, channels.flaps) / channels.flaps
    return np.concatenate(
        [weights.rbm * np.array(channels.weight), weights.flap_angle * flaps, weights.acceleration * flaps]
    )
