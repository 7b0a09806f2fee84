"""The NREL 5 MW turbine's structure: Table 1, the rotating blade, the couplings."""

import numpy as np
import pytest
import scipy.linalg

from flapgym.structure import linear_blade, linear_support, mean_gravity_load
from flapgym.turbine import load_turbine

OMEGA = 77.0 / 63.0


@pytest.fixture(scope="module")
def turbine():
    return load_turbine("nrel5mw")


@pytest.mark.parametrize("elements, speed", [(12, 0.0), (12, OMEGA), (48, OMEGA)])
def test_blade_matrices_are_symmetric_and_skew(turbine, elements: int, speed: float) -> None:
    blade = linear_blade(turbine, elements, speed)
    for matrix, sign in ((blade.mass, 1.0), (blade.stiffness, 1.0), (blade.damping, -1.0)):
        np.testing.assert_allclose(
            matrix, sign * matrix.T, rtol=0.0, atol=1e-13 * np.abs(blade.stiffness).max()
        )
    np.testing.assert_allclose(
        blade.mass_sr, blade.mass_rs.T, rtol=0.0, atol=1e-13 * np.abs(blade.mass_sr).max()
    )


def test_rotating_clamped_blade_has_the_known_frequencies(turbine) -> None:
    # An independent prototype's values, 12 elements; its shear stiffness is not known.
    blade = linear_blade(turbine, 12, OMEGA)
    size = len(blade.mass)
    state = np.block(
        [
            [np.zeros((size, size)), np.eye(size)],
            [-np.linalg.solve(blade.mass, blade.stiffness), -np.linalg.solve(blade.mass, blade.damping)],
        ]
    )
    eigenvalues = scipy.linalg.eigvals(state)
    np.testing.assert_allclose(eigenvalues.real, 0.0, atol=1e-6)
    hertz = np.sort(eigenvalues.imag[eigenvalues.imag > 0.0])[:4] / (2.0 * np.pi)
    np.testing.assert_allclose(hertz, [0.746, 1.099, 2.089, 4.052], rtol=0.01)


def test_blade_mass_and_moments_are_the_documented_ones(turbine) -> None:
    # Trapezoid over the 49 stations, reference figures: mass 17608.8 kg; first moment about the root 361109 kg m.
    blade = linear_blade(turbine, 48)
    total = blade.mass_rr[0, 0]
    assert total == pytest.approx(17608.8, rel=1e-5)
    out = np.array([-np.sin(turbine.rotor.precone), 0.0, np.cos(turbine.rotor.precone)])
    offset = np.array([blade.mass_rr[2, 4], blade.mass_rr[0, 5], blade.mass_rr[1, 3]]) * -1.0
    along = offset @ out
    assert along - turbine.rotor.hub_radius * total == pytest.approx(361109.0, rel=2e-3)


def test_three_blades_leave_the_hub_without_steady_load(turbine) -> None:
    blade = linear_blade(turbine, 12, OMEGA)
    # Thirds of a turn about x cancel all but the components along x; equilibrium of a rotor without load has none.
    assert abs(blade.hub_load[0]) < 1e-9 * abs(blade.hub_load[2])
    assert abs(blade.hub_load[3]) < 1e-9 * abs(blade.hub_load[4])


def test_static_hub_load_bends_the_tower_as_beam_theory_says(turbine) -> None:
    # Unit thrust at the apex: tower-top deflection by Castigliano on the piecewise tower, shaft and link rigid.
    support = linear_support(turbine)
    push = np.zeros(6)
    push[0] = 1.0
    response = np.linalg.solve(support.stiffness, support.hub.T @ push)
    force = support.shaft_axes[:, 0]
    height, bending = turbine.tower.height, turbine.tower.bending_stiffness
    top = height[-1]
    deflection = 0.0
    for low, high, first, second in zip(height[:-1], height[1:], bending[:-1], bending[1:], strict=True):
        z = 0.5 * (low + high)
        moment = force[0] * (support.apex[2] - z) - force[2] * support.apex[0]
        deflection += moment * (top - z) * (high - low) / (0.5 * (first + second))
    assert support.tower_top[0] @ response == pytest.approx(deflection, rel=2e-3)


def test_shaft_twists_by_the_documented_spring(turbine) -> None:
    support = linear_support(turbine)
    torque = np.zeros(6)
    torque[3] = 1.0
    response = np.linalg.solve(support.stiffness, support.hub.T @ torque)
    twist = (support.hub @ response)[3] - support.shaft_axes[:, 0] @ (support.tower_top @ response)[3:]
    assert twist == pytest.approx(1.0 / turbine.drivetrain.torsion_spring, rel=1e-6)


def test_hub_gyroscopic_moment_is_the_textbook_one(turbine) -> None:
    support = linear_support(turbine, OMEGA)
    # A hub that yaws (about z of H) at rate one needs the moment Omega I about y of H: d/dt (I Omega e_x).
    yaw = support.hub.T @ np.array([0.0, 0, 0, 0, 0, 1.0])
    moment = support.hub @ (support.damping @ yaw)
    expected = np.cross([0.0, 0.0, 1.0], [turbine.hub.inertia_about_shaft * OMEGA, 0.0, 0.0])
    np.testing.assert_allclose(moment[3:], expected, atol=1e-6)
    np.testing.assert_allclose(support.damping, -support.damping.T, atol=1e-9)


def test_mean_gravity_is_the_blades_weight_down_the_shaft(turbine) -> None:
    load = mean_gravity_load(turbine)
    parked, hung = linear_blade(turbine, 12), linear_blade(turbine, 12, load=load)
    weight = parked.mass_rr[0, 0] * turbine.gravity * np.sin(turbine.rotor.tilt)
    np.testing.assert_allclose(load[:, :3].sum(axis=0), [weight, 0.0, 0.0], rtol=1e-12, atol=1e-9)
    # The moment about the apex is the weight's at the centre of mass: mass_rr holds m and m x.
    moments = (load[:, 3:] + np.cross(parked.position, load[:, :3])).sum(axis=0)
    lever = parked.mass_rr[3:, 0] / parked.mass_rr[0, 0]
    np.testing.assert_allclose(moments, weight * lever, rtol=1e-9, atol=1e-6)
    # Downwind by what the linear blade gives, some ten centimetres.
    sag = np.linalg.solve(parked.stiffness, load[1:].ravel())[-6]
    assert hung.position[-1, 0] - parked.position[-1, 0] == pytest.approx(sag, rel=0.02)
    assert sag > 0.05
