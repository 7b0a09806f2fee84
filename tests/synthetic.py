"""A small, plausible turbine model for tests of everything downstream of the physics.

Three equal blades of one flapwise mode and one aerodynamic lag each, on a tower with one fore-aft and one
side-to-side mode. The blades are written in the rotating frame and carried to the fixed frame by the exact discrete
multi-blade transform, so without the tower coupling the turbine must equal three independent blades.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg

from flapgym.core.arrays import Array
from flapgym.core.state_space import StateSpace
from flapgym.model.turbine_model import (
    BLADE_INPUTS,
    BLADE_OUTPUTS,
    TURBINE_INPUTS,
    TURBINE_OUTPUTS,
    ModelFlap,
    TurbineModel,
)
from flapgym.turbine import load_case

TIME_STEP = 0.007
ROTOR_SPEED = 77.0 / 63.0


def _discrete(a: Array, b: Array) -> tuple[Array, Array]:
    """Zero-order hold of x' = a x + b u over one time step."""
    n, m = b.shape
    phi = scipy.linalg.expm(np.block([[a, b], [np.zeros((m, n + m))]]) * TIME_STEP)
    return phi[:n, :n], phi[:n, n:]


def synthetic_blade() -> StateSpace:
    """A blade of flap frequency 0.9 Hz: 0.8 MN m and 0.3 m per m/s of wind, 0.075 MN m per degree of flap."""
    omega, damping, lag = 2 * np.pi * 0.9, 0.45, 0.4
    wind, angle, rate = 0.3, 1.6, 0.02
    stiffness = omega**2
    # States: tip deflection, its rate, lagged half of the aerodynamic load.
    a = np.array([[0, 1, 0], [-stiffness, -2 * damping * omega, 0.5 * stiffness], [0, 0, -1 / lag]])
    load = np.array([[angle, rate, wind]])
    b = np.vstack([np.zeros((1, 3)), 0.5 * stiffness * load, load / lag])
    ad, bd = _discrete(a, b)
    # Moment: elastic part and a direct aerodynamic part that does not pass through the deflection.
    elastic, direct = 2.4e6, 0.1 / 0.3 * 0.8e6
    c = np.array([[elastic, 0.0, 0.0], [1.0, 0.0, 0.0]])
    d = np.vstack([direct * load, np.zeros((1, 3))])
    return StateSpace(ad, bd, c, d, TIME_STEP, BLADE_INPUTS, BLADE_OUTPUTS)


def synthetic_turbine(tower_coupling: float = 1.0) -> StateSpace:
    """Three such blades and a tower in multi-blade coordinates; zero coupling leaves three clamped blades."""
    blade = synthetic_blade()
    n = blade.order
    turn = np.exp(1j * ROTOR_SPEED * TIME_STEP)
    rotation = np.array([[turn.real, -turn.imag], [turn.imag, turn.real]])
    a = scipy.linalg.block_diag(blade.A, np.kron(rotation, blade.A))
    b = np.zeros((3 * n, 7))
    b[:n, [0, 3, 6]] = blade.B
    b[n:, [1, 2, 4, 5]] = np.kron(rotation, blade.B[:, :2])[:, [0, 2, 1, 3]]
    c = np.zeros((6, 3 * n))
    c[[0, 3], :n] = blade.C
    c[np.ix_([1, 4, 2, 5], range(n, 3 * n))] = np.kron(np.eye(2), blade.C)
    d = np.zeros((6, 7))
    d[np.ix_([0, 3], [0, 3, 6])] = blade.D
    d[np.ix_([1, 4, 2, 5], [1, 4, 2, 5])] = np.kron(np.eye(2), blade.D[:, :2])
    tower = []
    for frequency, damping in ((0.32, 0.08), (0.31, 0.01)):
        w = 2 * np.pi * frequency
        tower.append(_discrete(np.array([[0, 1], [-(w**2), -2 * damping * w]]), np.array([[0], [w**2]])))
    at = scipy.linalg.block_diag(*(part[0] for part in tower))
    bt = scipy.linalg.block_diag(*(part[1] for part in tower))
    # Mean moment pushes the tower downwind, a tilting moment pushes it sideways; its velocity is wind on the blades.
    push = tower_coupling * np.array([[4e-8, 0, 0], [0, 1e-9, 2e-9]])
    feel = np.zeros((3 * n, 4))
    feel[:, 1] = -0.2 * tower_coupling * b[:, 6]
    feel[:, 3] = 0.05 * tower_coupling * b[:, 1]
    a_full = np.block([[a, feel], [bt @ push @ c[:3], at]])
    b_full = np.vstack([b, bt @ push @ d[:3]])
    c_tower = np.zeros((2, 3 * n + 4))
    c_tower[0, 3 * n], c_tower[1, 3 * n + 2] = 1.0, 1.0
    c_full = np.vstack([np.hstack([c, np.zeros((6, 4))]), c_tower])
    d_full = np.vstack([d, np.zeros((2, 7))])
    return StateSpace(a_full, b_full, c_full, d_full, TIME_STEP, TURBINE_INPUTS, TURBINE_OUTPUTS)


def synthetic_model(tower_coupling: float = 1.0) -> TurbineModel:
    """The model file's content around the synthetic turbine, at the base case's operating point."""
    turbine = synthetic_turbine(tower_coupling)
    wind_speed, intensity, length = 11.0, 0.10, 147.0
    frequency = np.geomspace(1e-4, 0.5 / TIME_STEP, 4000)
    time = length / wind_speed
    spectrum = 4 * (intensity * wind_speed) ** 2 * time / (1 + 70.8 * (frequency * time) ** 2) ** (5 / 6)
    gain = np.abs(turbine.select(["wind"], ["rbm_0"]).frequency_response(frequency)[:, 0, 0]) ** 2
    return TurbineModel(
        turbine=turbine,
        blade=synthetic_blade(),
        name="synthetic",
        wind_speed=wind_speed,
        rotor_speed=ROTOR_SPEED,
        time_step=TIME_STEP,
        turbulence_intensity=intensity,
        length_scale=length,
        flaps=(ModelFlap("flap", *np.deg2rad([10.0, 100.0, 600.0]).tolist()),),
        rbm_rms=float(np.sqrt(np.trapezoid(gain * spectrum, frequency))),
        inputs_hash="0" * 64,
        case=load_case("nrel5mw-rated").to_dict() | {"name": "synthetic"},
    )
