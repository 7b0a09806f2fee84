"""A small, plausible turbine model for tests of everything downstream of the physics.

Three equal blades of one flapwise mode and one aerodynamic lag each, on a tower with one fore-aft and one
side-to-side mode. The blades are written in the rotating frame and carried to the fixed frame by the exact discrete
multi-blade transform, so without the tower coupling the turbine must equal three independent blades. Several flaps a
blade differ in what they do and in their stops.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.linalg

from flapgym.core.arrays import Array
from flapgym.core.state_space import StateSpace
from flapgym.model.signals import (
    BLADE_OUTPUTS,
    blade_inputs,
    flap_names,
    pitch_inputs,
    turbine_inputs,
    turbine_outputs,
)
from flapgym.model.turbine_model import ModelFlap, TurbineModel
from flapgym.turbine import load_case

TIME_STEP = 0.007
ROTOR_SPEED = 77.0 / 63.0
FURTHER = (("tip_speed", True), ("tilt", False), ("hinge", True), ("yaw", False))
"""Outputs beside those of every model, in an order that tells blades and fixed frame apart by name alone."""
STOPS = ((10.0, 100.0, 600.0), (6.0, 80.0, 900.0), (14.0, 60.0, 400.0))
"""Of the flaps, from root to tip: angle, rate, acceleration [deg, deg/s, deg/s^2]."""


def _discrete(a: Array, b: Array) -> tuple[Array, Array]:
    """Zero-order hold of x' = a x + b u over one time step."""
    n, m = b.shape
    phi = scipy.linalg.expm(np.block([[a, b], [np.zeros((m, n + m))]]) * TIME_STEP)
    return phi[:n, :n], phi[:n, n:]


def _load(flaps: int) -> Array:
    """What angles and rates of the flaps and the wind do to a blade, (1, 2 F + 1)."""
    wind, angle, rate = 0.3, 1.6, 0.02
    shares = np.ones(1) if flaps == 1 else np.linspace(0.2, 0.7, flaps)
    return np.array([[*(angle * shares), *(rate * shares[::-1]), wind]])


def synthetic_blade(flaps: int = 1) -> StateSpace:
    """A blade of flap frequency 0.9 Hz: 0.8 MN m and 0.3 m per m/s of wind, 0.075 MN m per degree of flap."""
    omega, damping, lag = 2 * np.pi * 0.9, 0.45, 0.4
    load = _load(flaps)
    stiffness = omega**2
    # States: tip deflection, its rate, lagged half of the aerodynamic load.
    a = np.array([[0, 1, 0], [-stiffness, -2 * damping * omega, 0.5 * stiffness], [0, 0, -1 / lag]])
    b = np.vstack([np.zeros(load.shape), 0.5 * stiffness * load, load / lag])
    ad, bd = _discrete(a, b)
    # Moment: elastic part and a direct aerodynamic part that does not pass through the deflection.
    elastic, direct = 2.4e6, 0.1 / 0.3 * 0.8e6
    c = np.array([[elastic, 0.0, 0.0], [1.0, 0.0, 0.0]])
    d = np.vstack([direct * load, np.zeros(load.shape)])
    return StateSpace(ad, bd, c, d, TIME_STEP, blade_inputs(flaps), BLADE_OUTPUTS)


def _of_three(blade: StateSpace, flaps: int, strips: int) -> tuple[Array, Array, Array, Array]:
    """Three clamped blades in multi-blade coordinates: a, b, and c, d of moment and deflection."""
    n = blade.order
    turn = np.exp(1j * ROTOR_SPEED * TIME_STEP)
    rotation = np.array([[turn.real, -turn.imag], [turn.imag, turn.real]])
    a = scipy.linalg.block_diag(blade.A, np.kron(rotation, blade.A))
    b = np.zeros((3 * n, 6 * flaps + 1 + 3 * strips))
    d = np.zeros((6, b.shape[1]))
    c = np.zeros((6, 3 * n))
    c[[0, 3], :n] = blade.C
    c[np.ix_([1, 4, 2, 5], range(n, 3 * n))] = np.kron(np.eye(2), blade.C)
    wind_b, wind_d = blade.B[:, -1:], blade.D[:, -1:]
    # Each input of the blade, and its column for the mean: cosine and sine stand behind it.
    each = [(3 * j, blade.B[:, j : j + 1], blade.D[:, j : j + 1]) for j in range(2 * flaps)]
    each += [
        (6 * flaps + 1 + 3 * j, wind_b * 2.0 * (j + 1) / (strips * (strips + 1)), 0.5 * wind_d)
        for j in range(strips)
    ]
    for column, to_state, to_output in each:
        b[:n, [column]], d[[0, 3], column] = to_state, to_output[:, 0]
        b[n:, [column + 1, column + 2]] = np.kron(rotation, to_state)
        d[np.ix_([1, 4, 2, 5], [column + 1, column + 2])] = np.kron(np.eye(2), to_output)
    b[:n, [6 * flaps]], d[[0, 3], 6 * flaps] = wind_b, wind_d[:, 0]
    return a, b, c, d


def synthetic_turbine(
    tower_coupling: float = 1.0, flaps: int = 1, further: bool = False, strips: int = 0
) -> StateSpace:
    """Three such blades and a tower in multi-blade coordinates; zero coupling leaves three clamped blades."""
    blade = synthetic_blade(flaps)
    n = blade.order
    a, b, c, d = _of_three(blade, flaps, strips)
    tower = []
    for frequency, damping in ((0.32, 0.08), (0.31, 0.01)):
        w = 2 * np.pi * frequency
        tower.append(_discrete(np.array([[0, 1], [-(w**2), -2 * damping * w]]), np.array([[0], [w**2]])))
    at = scipy.linalg.block_diag(*(part[0] for part in tower))
    bt = scipy.linalg.block_diag(*(part[1] for part in tower))
    # Mean moment pushes the tower downwind, a tilting moment pushes it sideways; its velocity is wind on the blades.
    push = tower_coupling * np.array([[4e-8, 0, 0], [0, 1e-9, 2e-9]])
    feel = np.zeros((3 * n, 4))
    feel[:, 1] = -0.2 * tower_coupling * b[:, 6 * flaps]
    feel[:, 3] = 0.05 * tower_coupling * b[:, 1]
    a_full = np.block([[a, feel], [bt @ push @ c[:3], at]])
    b_full = np.vstack([b, bt @ push @ d[:3]])
    c_tower = np.zeros((2, 3 * n + 4))
    c_tower[0, 3 * n], c_tower[1, 3 * n + 2] = 1.0, 1.0
    c_full = np.vstack([np.hstack([c, np.zeros((6, 4))]), c_tower])
    d_full = np.vstack([d, np.zeros((2, b.shape[1]))])
    if further:
        c_more, d_more = _further(c_full, d_full, n, flaps)
        c_full, d_full = np.vstack([c_full, c_more]), np.vstack([d_full, d_more])
    outputs = turbine_outputs(FURTHER if further else ())
    return StateSpace(a_full, b_full, c_full, d_full, TIME_STEP, turbine_inputs(flaps, strips), outputs)


def _further(c: Array, d: Array, n: int, flaps: int) -> tuple[Array, Array]:
    """Rows of `FURTHER`: tip speed, tilt, hinge moment of the first flap, yaw."""
    tip_speed = np.zeros((3, c.shape[1]))
    tip_speed[[0, 1, 2], [1, n + 1, 2 * n + 1]] = 1.0
    tilt, yaw = c[1:2] + 1e6 * c[6:7], 0.5 * c[2:3]
    hinge = np.zeros((3, c.shape[1]))
    hinge[[0, 1, 2], [2, n + 2, 2 * n + 2]] = 3e3
    direct = np.zeros((3, d.shape[1]))
    direct[:, :3] = 1e4 * np.eye(3)
    still = np.zeros((3, d.shape[1]))
    return np.vstack([tip_speed, tilt, hinge, yaw]), np.vstack([still, d[1:2], direct, 0.5 * d[2:3]])


PITCH = {"angle_limit": 0.07, "rate_limit": 0.14, "natural_frequency": 0.5, "damping": 0.7}
"""Its actuator."""


def with_pitch(turbine: StateSpace) -> StateSpace:
    """The turbine with pitch: angle and rate act as the flap's do, some weaker; acceleration on all there is."""
    rng = np.random.default_rng(0)
    angle_and_rate = np.zeros((len(turbine.inputs), 6))
    angle_and_rate[[0, 1, 2, 3, 4, 5], [0, 1, 2, 3, 4, 5]] = [0.8, 0.8, 0.8, 1.5, 1.5, 1.5]
    b = np.hstack([turbine.B, turbine.B @ angle_and_rate, 1e-4 * rng.standard_normal((turbine.order, 3))])
    d = np.hstack(
        [turbine.D, turbine.D @ angle_and_rate, 1e4 * rng.standard_normal((len(turbine.outputs), 3))]
    )
    return replace(turbine, B=b, D=d, inputs=(*turbine.inputs, *pitch_inputs()))


def synthetic_model(
    tower_coupling: float = 1.0,
    flaps: int = 1,
    further: bool = False,
    strips: int = 0,
    pitch: bool = False,
) -> TurbineModel:
    """The model file's content around the synthetic turbine, at the base case's operating point."""
    turbine = synthetic_turbine(tower_coupling, flaps, further, strips)
    if pitch:
        turbine = with_pitch(turbine)
    wind_speed, intensity, length = 11.0, 0.10, 147.0
    frequency = np.geomspace(1e-4, 0.5 / TIME_STEP, 4000)
    time = length / wind_speed
    spectrum = 4 * (intensity * wind_speed) ** 2 * time / (1 + 70.8 * (frequency * time) ** 2) ** (5 / 6)
    gain = np.abs(turbine.select(["wind"], ["rbm_0"]).frequency_response(frequency)[:, 0, 0]) ** 2
    return TurbineModel(
        turbine=turbine,
        blade=synthetic_blade(flaps),
        name="synthetic",
        wind_speed=wind_speed,
        rotor_speed=ROTOR_SPEED,
        time_step=TIME_STEP,
        turbulence_intensity=intensity,
        length_scale=length,
        flaps=tuple(
            ModelFlap(name, *np.deg2rad(stops).tolist())
            for name, stops in zip(flap_names(flaps), STOPS, strict=False)
        ),
        rbm_rms=float(np.sqrt(np.trapezoid(gain * spectrum, frequency))),
        inputs_hash="0" * 64,
        case=load_case("nrel5mw-rated").to_dict()
        | {"name": "synthetic"}
        | ({"pitch": PITCH} if pitch else {}),
    )
