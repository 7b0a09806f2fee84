"""Direct assembly, the Lagrange-multiplier joint and multi-blade coordinates against each other and statics."""

from dataclasses import replace

import numpy as np
import pytest

from flapgym.structure import assemble, linear_blade, linear_support, parked_modes, solve_equilibrium
from flapgym.structure.body import linearise
from flapgym.structure.rotating import multi_blade_matrices
from flapgym.structure.rotation import about_x
from flapgym.structure.support import LinearSupport
from flapgym.turbine import load_turbine
from reference.joint import (
    accelerations,
    frozen_frequencies,
    join,
    static_response,
    steady_load_tangent,
)
from tests.structure.beams import uniform_beam

OMEGA = 77.0 / 63.0


@pytest.fixture(scope="module")
def turbine():
    return load_turbine("nrel5mw")


@pytest.fixture(scope="module")
def blade(turbine):
    return linear_blade(turbine, 12, OMEGA)


@pytest.fixture(scope="module")
def support(turbine):
    return linear_support(turbine, OMEGA)


def test_multipliers_and_direct_assembly_give_the_same_parked_frequencies(turbine) -> None:
    joined = join([linear_blade(turbine, 12)] * 3, linear_support(turbine))
    direct, _ = parked_modes(turbine, 12, 20)
    np.testing.assert_allclose(frozen_frequencies(joined, 20), direct, rtol=1e-8)


def test_multipliers_and_direct_assembly_give_the_same_static_response(turbine) -> None:
    blades, support = [linear_blade(turbine, 12)] * 3, linear_support(turbine)
    for azimuth in (0.0, 0.9):
        joined, (_, _, stiffness) = join(blades, support, azimuth), assemble(blades, support, azimuth)
        load = np.zeros(joined.size + 6)
        load[12 * 6 - 6 : 12 * 6 - 3] = force = np.array([1e4, 2e4, -3e4])  # at the tip of blade 1
        load[-6:] = np.concatenate([force, np.cross(blades[0].position[-1], force)])
        into_hub = np.kron(np.eye(2), about_x(azimuth)) @ load[-6:]
        direct_load = load[:-6].copy()
        direct_load[216:] = support.hub.T @ into_hub
        response, multipliers = static_response(joined, load)
        direct = np.linalg.solve(stiffness, direct_load)
        np.testing.assert_allclose(response, direct, atol=1e-8 * np.abs(direct).max())
        # The joint carries the whole load into the support.
        np.testing.assert_allclose(multipliers, into_hub, rtol=1e-8, atol=1e-3)


@pytest.mark.parametrize("azimuth", [0.0, 0.7, 4.0])
def test_multipliers_and_direct_assembly_accelerate_alike_under_rotation(
    blade, support, azimuth: float
) -> None:
    joined = join([blade] * 3, support, azimuth)
    mass, damping, stiffness = assemble([blade] * 3, support, azimuth)
    rng = np.random.default_rng(1)
    displacement, velocity, load = rng.normal(size=(3, joined.size))
    hub = np.kron(np.eye(2), about_x(-azimuth)) @ support.hub @ velocity[216:]
    found, _ = accelerations(joined, displacement, np.append(velocity, hub), np.append(load, np.zeros(6)))
    expected = np.linalg.solve(mass, load - damping @ velocity - stiffness @ displacement)
    np.testing.assert_allclose(found[:-6], expected, atol=1e-9 * np.abs(expected).max())


def test_equal_blades_leave_no_steady_multipliers_and_thrust_shifts_no_mode_by_a_thousandth(turbine) -> None:
    blade, support = linear_blade(turbine, 12, OMEGA), linear_support(turbine)
    turns = [np.kron(np.eye(2), about_x(2.0 * np.pi * index / 3)) for index in range(3)]
    total = sum(turn @ blade.hub_load for turn in turns)
    assert np.abs(total).max() < 1e-8 * np.abs(blade.hub_load).max()
    thrust = np.array([740e3, 0.0, 0.0, 0.0, 0.0, 0.0])
    mass, _, stiffness = assemble([linear_blade(turbine, 12)] * 3, support)
    changed = stiffness.copy()
    changed[216:, 216:] += steady_load_tangent(support, thrust)
    before, after = (
        np.sort(np.linalg.eigvals(np.linalg.solve(mass, matrix)).real)[:14] for matrix in (stiffness, changed)
    )
    np.testing.assert_allclose(np.sqrt(after), np.sqrt(before), rtol=1e-3)


def test_equal_blades_make_the_matrices_independent_of_azimuth_and_a_heavier_one_does_not(
    blade, support
) -> None:
    reference = multi_blade_matrices([blade] * 3, support)
    heavier = replace(
        blade,
        **{
            name: 1.01 * getattr(blade, name)
            for name in (
                "mass",
                "mass_sr",
                "mass_rs",
                "mass_rr",
                "damping",
                "damping_sr",
                "damping_rs",
                "damping_rr",
            )
        },
    )
    unequal = multi_blade_matrices([blade, blade, heavier], support)
    for azimuth in (0.4, 1.3, 2.9, 5.5):
        turned = multi_blade_matrices([blade] * 3, support, azimuth)
        for first, second in zip(reference, turned, strict=True):
            np.testing.assert_allclose(second, first, rtol=0.0, atol=1e-12 * np.abs(first).max())
        lost = multi_blade_matrices([blade, blade, heavier], support, azimuth)
        difference = max(
            np.abs(a - b).max() / np.abs(a).max() for a, b in zip(unequal[:2], lost[:2], strict=True)
        )
        assert difference > 1e-3


def test_without_multi_blade_coordinates_the_couplings_depend_on_azimuth(blade, support) -> None:
    first, second = (assemble([blade] * 3, support, azimuth)[0][:216, 216:] for azimuth in (0.0, 0.5))
    assert np.abs(first - second).max() > 0.1 * np.abs(first).max()


@pytest.mark.parametrize("speed", [0.0, 1.0, 2.0, 3.0])
def test_a_rotor_on_one_sideways_spring_has_the_frequencies_of_the_two_mass_model(speed: float) -> None:
    # Three uniform blades (EI = rho A = L = 1), soft in the plane, on a mass M held by a spring sideways. With y the
    # hub and d the in-plane motion of a blade, a mass p^2 on a spring (first mode of a cantilever: p^2 = 0.6131):
    #   (M + 3 m) y'' + k y + 3/2 p d_c'' = 0,  d_c'' + 2 Omega d_s' + (w^2 - Omega^2) d_c + p y'' = 0,
    #   d_s'' - 2 Omega d_c' + (w^2 - Omega^2) d_s = 0,  w^2 = w_flap^2(Omega) - Omega^2 (Wright et al. 1982).
    flapwise = {0.0: 3.5160, 1.0: 3.6816, 2.0: 4.1373, 3.0: 4.7973}[speed]
    squared, part, hub_mass, spring = flapwise**2 - speed**2, np.sqrt(0.6131), 20.0, 60.0
    mass = np.array([[hub_mass + 3.0, 1.5 * part, 0.0], [part, 1.0, 0.0], [0.0, 0.0, 1.0]])
    damping = 2.0 * speed * np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    stiffness = np.diag([spring, squared - speed**2, squared - speed**2])
    analytic = natural_frequencies(mass, damping, stiffness)[:3]

    beam = uniform_beam(30, stiffness=(1e6, 1e6, 1e6, 1e3, 1.0, 1e3), rotary=(2e-5, 1e-5, 1e-5))
    blade = linearise(beam, solve_equilibrium(beam, np.array([speed, 0.0, 0.0])), speed)
    sideways = LinearSupport(
        mass=np.array([[hub_mass]]),
        damping=np.zeros((1, 1)),
        stiffness=np.array([[spring]]),
        hub=np.eye(6)[:, 1:2],
        tower_top=np.eye(6)[:, 1:2],
        apex=np.zeros(3),
        shaft_axes=np.eye(3),
        tower_position=np.zeros((1, 3)),
        weight=np.zeros(1),
    )
    ours = natural_frequencies(*multi_blade_matrices([blade] * 3, sideways))
    # Edgewise in the collective is decoupled from the hub; look for each analytic frequency.
    nearest = [ours[np.abs(ours - value).argmin()] for value in analytic]
    np.testing.assert_allclose(nearest, analytic, rtol=3e-3)


def natural_frequencies(mass: np.ndarray, damping: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
    """Imaginary parts of the eigenvalues, ascending, positive ones."""
    size = len(mass)
    state = np.block(
        [
            [np.zeros((size, size)), np.eye(size)],
            [-np.linalg.solve(mass, stiffness), -np.linalg.solve(mass, damping)],
        ]
    )
    values = np.linalg.eigvals(state).imag
    return np.sort(values[values > 1e-6])
