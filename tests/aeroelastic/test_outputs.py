"""Loads on the shaft's end, torsion of the roots, tips in the rotor's plane and the tower top's acceleration."""

from dataclasses import replace

import numpy as np
import pytest

from flapgym.aeroelastic.blade_lattice import BladeLattice
from flapgym.aeroelastic.build import build_model
from flapgym.aeroelastic.equations import Parts, turbine_equations
from flapgym.core.multiblade import WORK_WEIGHTS, derivative_coupling, hub_components
from flapgym.reduction import normal_modes
from flapgym.structure import linear_blade, linear_support
from flapgym.structure.beam import tangent
from flapgym.structure.rotation import rigid_displacement
from flapgym.structure.support import shaft_beam
from flapgym.turbine import Signals, load_case
from flapgym.turbine.case import (
    BLADE_LOADS,
    BLADE_MOTIONS,
    HUB_LOADS,
    TOWER_LOADS,
    TOWER_MOTIONS,
)
from tests.aeroelastic.test_signals import harmonic, small

CASE = load_case("nrel5mw-rated")
MODES = 72
CONE = CASE.turbine.rotor.precone


PRESCRIBED = (*TOWER_LOADS, *TOWER_MOTIONS, *HUB_LOADS)
"""What stands still of a turbine whose rotor speed is prescribed."""


@pytest.fixture(scope="module")
def undamped():
    """All modes of bent blades and of the support, no damping, and a made-up lattice, whose loads drive them."""
    turbine = replace(CASE.turbine, blade_damping_ratio=0.0, tower_damping_ratio=0.0)
    case = replace(
        CASE,
        turbine=turbine,
        reduction=replace(CASE.reduction, tower_modes=66),
        signals=Signals(outputs=(*BLADE_LOADS, *BLADE_MOTIONS, *PRESCRIBED)),
    )
    steady = np.zeros((13, 6))
    steady[1:, :2] = [8e3, -1e3]
    blade = linear_blade(turbine, 12, case.rotor_speed, load=steady)
    frequency, shape = normal_modes(blade.mass, blade.stiffness, MODES)
    lattice = BladeLattice(np.zeros((1, 2 * MODES + 11)), np.zeros((MODES + 6, 3)), MODES, flaps=1, strips=1)
    return Parts(case, blade, linear_support(turbine, case.rotor_speed), frequency, shape, lattice)


def nodal_loads(parts, rng):
    """Random loads on the nodes of all blades, as components (3, MODES + 6) of the lattice's."""
    blade, nodal = parts.blade, rng.standard_normal((3, 12, 6))
    moment = nodal[:, :, 3:] + np.cross(blade.position[1:], nodal[:, :, :3])
    on_modes = nodal.reshape(3, -1) @ parts.shape
    return np.hstack([on_modes, nodal[:, :, :3].sum(axis=1), moment.sum(axis=1)])


@pytest.mark.parametrize("omega", [0.0, 1.5, 12.0])
def test_loads_on_the_shaft_are_its_own_elastic_reaction(undamped, omega):
    """Thrust, torque, tilt and yaw of random loads on all blades, against the strain of the shaft's element."""
    load = nodal_loads(undamped, np.random.default_rng(1)).ravel()
    d, y = harmonic(turbine_equations(undamped), omega, load)
    support, shaft = undamped.support, shaft_beam(undamped.case.turbine)
    q = undamped.modal_support[1] @ d[3 * MODES :]
    top, hub = q[-12:-6], q[-6:]
    arm = shaft.reference.position[:1] - support.tower_position[-1]
    start = np.concatenate([rigid_displacement(arm) @ top, top[3:]])
    held = (tangent(shaft, shaft.reference) @ np.concatenate([start, hub]))[6:]  # what holds the hub's end
    frame = np.kron(np.eye(2), support.shaft_axes.T)
    expected = (frame @ held)[[0, 3, 4, 5]]
    ours = np.array([y[name] for name in HUB_LOADS])
    np.testing.assert_allclose(ours, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("omega", [0.0, 1.5, 12.0])
def test_moments_on_the_shaft_are_those_of_the_three_roots_less_the_hub_s_inertia(undamped, omega):
    """Forces and moments with which the hub holds each root node, from the beam's own matrices of that node."""
    blade, speed, s = undamped.blade, undamped.case.rotor_speed, 1j * omega
    load = nodal_loads(undamped, np.random.default_rng(2)).ravel()
    d, y = harmonic(turbine_equations(undamped), omega, load)
    support, x = undamped.support, undamped.modal_support[1] @ d[3 * MODES :]
    rate = s * np.eye(3) + derivative_coupling(speed)  # of what turns with a blade
    q = d[: 3 * MODES].reshape(3, MODES) @ undamped.shape.T
    nu = s * (hub_components() @ support.hub @ x)  # the hub's motion is given by its velocity
    held = (
        (rate @ rate @ q) @ blade.root_mass.T
        + (rate @ q) @ blade.root_damping.T
        + q @ blade.root_stiffness.T
        + (rate @ nu) @ blade.root_mass_sr.T
        + nu @ blade.root_damping_sr.T
    )
    on_hub = -held
    on_hub[:, 3:] -= np.cross(blade.position[0], held[:, :3])  # carried from the root to the apex
    total = sum(w * part.T @ one for w, part, one in zip(WORK_WEIGHTS, hub_components(), on_hub, strict=True))
    hub = undamped.case.turbine.hub
    motion = support.hub @ x
    polar = hub.inertia_about_shaft * np.array(
        [motion[3] * s**2, speed * s * motion[5], -speed * s * motion[4]]
    )
    thrust = total[0] - hub.mass * s**2 * motion[0]
    expected = np.concatenate([[thrust], total[3:] - polar])
    ours = np.array([y[name] for name in HUB_LOADS])
    np.testing.assert_allclose(ours, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())
    axes = {
        "rbm": [0.0, 1.0, 0.0],
        "rbm_edge": [np.cos(CONE), 0.0, np.sin(CONE)],
        "root_torsion": [-np.sin(CONE), 0.0, np.cos(CONE)],
    }
    moments = np.array([[y[f"{name}_{part}"] for name in axes] for part in ("0", "c", "s")])
    roots = -held[:, 3:] @ np.array(list(axes.values())).T
    np.testing.assert_allclose(moments, roots, rtol=1e-6, atol=1e-6 * np.abs(roots).max())


def test_acceleration_of_the_tower_s_top_is_the_second_derivative_of_its_place(undamped):
    omega = 2.5
    _, y = harmonic(turbine_equations(undamped), omega)
    for name, place in zip(TOWER_MOTIONS, ("tower_fore_aft", "tower_side_side"), strict=True):
        assert y[name] == pytest.approx(-(omega**2) * y[place], rel=1e-12)


def test_tip_moves_in_the_rotor_s_direction_under_a_force_that_way(undamped):
    """Positive as the edgewise moment is; by the blade's own stiffness, hub held."""
    parts = undamped
    force = np.zeros(72)
    force[-5] = -1.0  # at azimuth zero a blade travels towards -y
    moved = np.linalg.solve(parts.blade.stiffness, force)
    a = np.linalg.lstsq(parts.shape, moved, rcond=None)[0]
    equations = turbine_equations(parts)
    row = equations.output.position[equations.outputs.index("tip_in_plane_0"), :MODES]
    assert row @ a == pytest.approx(-moved[-5], rel=1e-9)


def test_gust_adds_to_thrust_and_torque_and_its_thrust_bends_the_tower_over_the_hub_s_height():
    model = build_model(small(outputs=(*HUB_LOADS, *TOWER_MOTIONS, "tower_base_fore_aft", "root_torsion")))
    gain = dict(
        zip(model.turbine.outputs, model.turbine.select(inputs=["wind"]).dc_gain()[:, 0], strict=True)
    )
    assert gain["rotor_thrust"] > 0.0
    assert gain["shaft_torque"] > 0.0
    assert max(abs(gain[name]) for name in TOWER_MOTIONS) < 1e-9
    height = CASE.turbine.hub_height
    level = gain["rotor_thrust"] * np.cos(CASE.turbine.rotor.tilt) * height
    assert gain["tower_base_fore_aft"] == pytest.approx(level, rel=0.03)  # the rest is the blades' own moment


@pytest.mark.parametrize("name", ["thrust", "yaw", "tower_top_acceleration"])
def test_outputs_that_are_none_are_refused_with_those_there_are(name):
    with pytest.raises(
        ValueError, match=r"signals.outputs\[0\]: expected rbm_edge, root_torsion, tip_in_plane, "
    ):
        Signals(outputs=(name,))
