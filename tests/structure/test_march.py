"""Non-linear time marching: energy, the spin-up beam, and the whole turbine against its linear model."""

import numpy as np
import pytest
import scipy.integrate
import scipy.linalg

from flapgym.structure import assemble, linear_blade, linear_support
from flapgym.structure.rotating import component_weights, multi_blade_matrices
from flapgym.structure.rotation import about_x, hat
from flapgym.turbine import load_turbine
from reference.attitude import base_path, quaternion_matrix
from reference.body_motion import Body, FrameMotion
from reference.driven_beam import DrivenBeam
from reference.march import MarchError, march, start
from reference.multibody import MovingTurbine, support_body
from tests.structure.beams import random_beam, uniform_beam

OMEGA = 77.0 / 63.0


@pytest.fixture(scope="module")
def turbine():
    return load_turbine("nrel5mw")


def still(time: float) -> FrameMotion:
    return FrameMotion(np.zeros(6), np.zeros(6))


def spin_up(time: float) -> FrameMotion:
    """Simo and Vu-Quoc 1986: from rest to 6 rad/s in 15 s."""
    ramp = min(time, 15.0) / 15.0
    speed = 6.0 * (ramp - np.sin(2.0 * np.pi * ramp) / (2.0 * np.pi))
    rate = 6.0 / 15.0 * (1.0 - np.cos(2.0 * np.pi * ramp))
    return FrameMotion(np.array([0, 0, 0, speed, 0, 0]), np.array([0, 0, 0, rate, 0, 0]))


def wave_in_power(system: DrivenBeam, motions: list, time_step: float) -> tuple[np.ndarray, np.ndarray]:
    """Energy, and work put in by the trapezoidal rule, over time."""
    power = np.array([system.power(motion) for motion in motions])
    work = np.concatenate([[0.0], np.cumsum(0.5 * time_step * (power[1:] + power[:-1]))])
    return np.array([system.energy(motion) for motion in motions]), work


def test_spin_up_beam_ends_at_the_closed_form_stretch_and_its_energy_is_the_work_put_in() -> None:
    axial, density, length = 2.8e7, 1.2, 10.0
    beam = uniform_beam(10, length, (axial, 1e7, 1e7, 1.4e4, 1.4e4, 1.4e4), density, (1.2e-3, 6e-4, 6e-4))
    system = DrivenBeam(Body.of(beam), spin_up)
    motions = march(system, start((beam.reference,), np.zeros(60)), 0.1, 190)
    tip = np.array([motion.configuration[0].position[-1] for motion in motions])
    wave = 6.0 * np.sqrt(density / axial)
    closed = np.tan(wave * length) / wave - length
    assert tip[-30:, 2].mean() - length == pytest.approx(closed, rel=5e-3)
    # The beam lags while it is sped up and swings by little when it turns steadily.
    assert tip[:, 1].max() > 0.5
    assert np.abs(tip[-30:, 1]).max() < 0.01
    energies, work = wave_in_power(system, motions, 0.1)
    np.testing.assert_allclose(energies, work, atol=1e-4 * energies.max())


def test_energy_of_a_swinging_bent_beam_stays_to_second_order_in_the_time_step() -> None:
    beam = uniform_beam(6, 1.0, (1e3, 1e3, 1e3, 1.0, 1.0, 1.0), 1.0, (2e-3, 1e-3, 1e-3))
    velocity = np.zeros((6, 6))
    velocity[:, 0] = 4.0 * np.arange(1, 7) ** 2 / 36.0  # swings by most of its length
    velocity[:, 4] = 8.0 * np.arange(1, 7) / 6.0
    system = DrivenBeam(Body.of(beam), still)
    drift = []
    for time_step, steps in ((0.01, 40), (0.005, 80)):
        motions = march(system, start((beam.reference,), velocity.ravel()), time_step, steps, 1.0)
        energies = np.array([system.energy(motion) for motion in motions])
        drift.append(np.abs(energies / energies[0] - 1.0).max())
    deflection = np.ptp([motion.configuration[0].position[-1, 0] for motion in motions])
    assert deflection > 0.5
    assert drift[0] < 0.02
    assert drift[1] < 0.35 * drift[0]


def test_work_of_a_tumbling_frame_and_loads_is_the_energy_of_a_crooked_beam() -> None:
    beam = random_beam(3, 11)
    beam = type(beam)(beam.reference, beam.stiffness + 20.0 * np.eye(6), beam.mass)

    def frame(time: float) -> FrameMotion:
        """Two seconds of a smooth tumble."""
        wave, slope = np.sin(np.pi * time / 2.0) ** 2, 0.5 * np.pi * np.sin(np.pi * time)
        direction = np.array([0.5, -0.3, 0.2, 0.3, 0.2, -0.4])
        return FrameMotion(wave * direction, slope * direction)

    def load(time: float) -> np.ndarray:
        out = np.zeros((4, 6))
        out[-1] = np.sin(np.pi * time / 2.0) ** 2 * np.array([0.3, 0.2, -0.1, 0.2, 0.1, 0.3])
        return out

    system = DrivenBeam(Body.of(beam), frame, load)
    motions = march(system, start((beam.reference,), np.zeros(18)), 0.01, 200, 1.0)
    energies, work = wave_in_power(system, motions, 0.01)
    assert energies.max() > 0.1
    np.testing.assert_allclose(energies, work, atol=1e-3 * energies.max())


def test_a_step_too_long_says_when_and_what_to_try() -> None:
    beam = uniform_beam(6, 1.0, (1e3, 1e3, 1e3, 1.0, 1.0, 1.0))
    velocity = np.tile([1e4, 0, 0, 0, 9e4, 0.0], 6)
    with pytest.raises((MarchError, ValueError), match="smaller"):
        march(DrivenBeam(Body.of(beam), still), start((beam.reference,), velocity), 0.1, 1)


def test_support_chain_has_the_linear_supports_modes(turbine) -> None:
    # The chain's stiff link stands for the linear model's rigid one; the hub's mass is the rotor frame's.
    from flapgym.structure.beam import tangent
    from flapgym.structure.inertia import linearise_inertia
    from reference.multibody import hub_mass

    body, support = support_body(turbine), linear_support(turbine)
    mass = linearise_inertia(body.distribution, body.beam.reference, np.zeros(3)).mass[6:, 6:]
    axes = np.kron(np.eye(2), support.shaft_axes)
    mass[-6:, -6:] += axes @ hub_mass(turbine) @ axes.T
    stiffness = tangent(body.beam, body.beam.reference)[6:, 6:]
    # The largest eigenvalues of the flexibility are the lowest modes, free of the massless link's infinite ones.
    chain = np.sort(scipy.linalg.eigvals(np.linalg.solve(stiffness, mass)).real)[::-1][:8]
    linear = np.sort(scipy.linalg.eigvals(np.linalg.solve(support.stiffness, support.mass)).real)[::-1][:8]
    np.testing.assert_allclose(np.sqrt(chain), np.sqrt(linear), rtol=1e-3)


def test_the_steady_turbine_balances_and_keeps_turning(turbine) -> None:
    system = MovingTurbine(turbine, 12, OMEGA)
    steady = system.steady()
    scale = np.abs(system.blades[0].distribution).max() * OMEGA**2 * 63.0
    assert np.abs(system.residual(steady)).max() < 1e-8 * scale
    last = march(system, steady, 0.05, 4, 0.8)[-1]
    for before, after in zip(steady.configuration, last.configuration, strict=True):
        np.testing.assert_allclose(after.position, before.position, atol=1e-8)


def tip_push(amplitude: float):
    """Push on blade 1's tip, out of and in the plane, over 0.4 s."""

    def load(time: float) -> tuple[np.ndarray]:
        out = np.zeros((13, 6))
        out[-1, :2] = amplitude * np.array([1.0, 0.5]) * np.sin(np.pi * min(time, 0.4) / 0.4) ** 2
        return (out,)

    return load


def linear_response(turbine, time_step: float, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """Tip and hub displacement per newton of `tip_push`, from the linear model in multi-blade coordinates.

    By the trapezoidal rule with a step ten times finer than asked for.
    """
    blade, support = linear_blade(turbine, 12, OMEGA), linear_support(turbine, OMEGA)
    mass, damping, stiffness = multi_blade_matrices([blade] * 3, support)
    size, h = len(mass), 0.1 * time_step

    def load(time: float) -> np.ndarray:
        force, weights = tip_push(1.0)(time)[0][-1, :3], component_weights(OMEGA * time)[0]
        hub = np.concatenate([force, np.cross(blade.position[-1], force)])
        out = np.zeros(size)
        for component in range(3):
            out[component * 72 + 66 : component * 72 + 69] = weights[component] * force
        out[216:] = support.hub.T @ np.kron(np.eye(2), about_x(OMEGA * time)) @ hub
        return out

    factors = scipy.linalg.lu_factor(mass + 0.5 * h * damping + 0.25 * h * h * stiffness)
    q, v, a = np.zeros(size), np.zeros(size), np.zeros(size)
    history = [q]
    for step in range(1, 10 * steps + 1):
        q, v = q + h * v + 0.25 * h * h * a, v + 0.5 * h * a
        a = scipy.linalg.lu_solve(factors, load(step * h) - damping @ v - stiffness @ q)
        q, v = q + 0.25 * h * h * a, v + 0.5 * h * a
        history.append(q)
    sampled = np.array(history[::10])
    weights = np.array([component_weights(OMEGA * time_step * step)[0] for step in range(steps + 1)])
    tip = np.sum([weights[:, c : c + 1] * sampled[:, c * 72 + 66 : c * 72 + 69] for c in range(3)], axis=0)
    return tip, sampled[:, 276:279]


def test_linear_turbine_is_the_limit_of_the_non_linear_one_for_small_motion(turbine) -> None:
    tip, hub = linear_response(turbine, 0.04, 20)
    errors = []
    for time_step, steps in ((0.04, 20), (0.02, 40)):
        system = MovingTurbine(turbine, 12, OMEGA, load=tip_push(10.0))
        motions = march(system, system.steady(), time_step, steps, 0.8)[:: steps // 20]
        moved_tip, moved_hub = (
            np.array([motion.configuration[body].position[-1] for motion in motions]) for body in (0, -1)
        )
        # The joint's velocities agree at every step.
        assert max(np.abs(system.constraint(motion)).max() for motion in motions) < 1e-10
        errors.append(
            [
                np.abs((moved - moved[0]) / 10.0 - linear).max() / np.abs(linear).max()
                for moved, linear in ((moved_tip, tip), (moved_hub, hub))
            ]
        )
    # What is left is the time step's, of second order.
    assert max(errors[1]) < 0.03
    assert (np.array(errors[1]) < 0.35 * np.array(errors[0])).all()


def test_energy_of_the_turning_turbine_is_the_work_of_push_and_drive(turbine) -> None:
    # The drive that holds Omega does the work -lambda_x Omega, lambda_x being the rotor's torque on the shaft.
    push, time_step = tip_push(1e5), 0.02
    system = MovingTurbine(turbine, 12, OMEGA, load=push)
    motions = march(system, system.steady(), time_step, 30, 0.9)

    def power(motion) -> float:
        position = motion.configuration[0].position[-1]
        tip = motion.velocity[66:69] + motion.velocity[-6:-3] + np.cross(motion.velocity[-3:], position)
        return push(motion.time)[0][-1, :3] @ tip - OMEGA * motion.multipliers[3]

    powers, energies = (np.array([f(motion) for motion in motions]) for f in (power, system.energy))
    work = np.concatenate([[0.0], np.cumsum(0.5 * time_step * (powers[1:] + powers[:-1]))])
    gained = energies - energies[0]
    assert np.abs(gained).max() > 1e5
    np.testing.assert_allclose(gained, work, atol=0.01 * np.abs(gained).max())


def test_a_shaken_base_loads_the_turbine_as_inertia_does(turbine) -> None:
    # Parked; base acceleration a acts as the load -M T a, T the unit translation of the support.
    h, steps, size = 0.02, 30, 0.02

    def base(time: float) -> FrameMotion:
        wave = 2.0 * np.pi * time / 0.6
        direction = np.array([0.8, 0.6, 0.0, 0.0, 0.0, 0.0])
        speed = size * 0.5 * (1.0 - np.cos(wave))
        return FrameMotion(speed * direction, size * np.pi / 0.6 * np.sin(wave) * direction)

    system = MovingTurbine(turbine, 12, 0.0, base=base)
    motions = march(system, system.steady(), h, steps, 0.8)
    hub = np.array([motion.configuration[-1].position[-1] for motion in motions])
    mass, damping, stiffness = assemble([linear_blade(turbine, 12)] * 3, linear_support(turbine))
    carried = np.zeros((len(mass), 6))
    carried[216:] = np.tile(np.eye(6), (11, 1))
    q, v, a = np.zeros(len(mass)), np.zeros(len(mass)), np.zeros(len(mass))
    fine = h / 10.0
    factors = scipy.linalg.lu_factor(mass + 0.25 * fine**2 * stiffness)
    history = [np.zeros(3)]
    for step in range(1, 10 * steps + 1):
        q, v = q + fine * v + 0.25 * fine**2 * a, v + 0.5 * fine * a
        load = -mass @ carried @ base(step * fine).acceleration
        a = scipy.linalg.lu_solve(factors, load - damping @ v - stiffness @ q)
        q, v = q + 0.25 * fine**2 * a, v + 0.5 * fine * a
        history.append(q[276:279])
    linear = np.array(history[::10])
    assert np.abs(hub - hub[0] - linear).max() < 0.01 * np.abs(linear).max()


def test_the_joint_carries_the_weight_of_the_rotor(turbine) -> None:
    # Gravity comes on slowly; then lambda is the rotor's weight along the tilted shaft and across it.
    weight = np.array([0.0, 0.0, -9.81])

    def gravity(time: float) -> np.ndarray:
        return weight * np.sin(np.pi * min(time, 20.0) / 40.0) ** 2

    system = MovingTurbine(turbine, 12, 0.0, gravity=gravity)
    last = march(system, system.steady(), 1.0, 30, 0.3)[-1]
    mass = turbine.hub.mass + 3.0 * linear_blade(turbine, 12).mass_rr[0, 0]
    axes = last.configuration[-1].orientation[-1] @ system.hub_axes
    np.testing.assert_allclose(
        last.multipliers[:3], mass * axes.T @ weight, rtol=5e-3, atol=5e-3 * mass * 9.81
    )
    # Upright but for the tilt and what the tower gives.
    assert last.multipliers[0] == pytest.approx(mass * 9.81 * np.sin(turbine.rotor.tilt), rel=0.2)


def test_attitude_of_a_base_is_the_integral_of_its_velocities() -> None:
    def base(time: float) -> FrameMotion:
        velocity = [np.cos(time), 0.3 * time, 1.0, 0.5 * np.cos(2.0 * time), np.sin(time), 0.3 + 0.2 * time]
        return FrameMotion(np.array(velocity), np.zeros(6))

    def rate(time: float, state: np.ndarray) -> np.ndarray:
        turn, velocity = state[:9].reshape(3, 3), base(time).velocity
        return np.concatenate([(turn @ hat(velocity[3:])).ravel(), turn @ velocity[:3]])

    start_at = np.concatenate([np.eye(3).ravel(), np.zeros(3)])
    exact = scipy.integrate.solve_ivp(rate, (0.0, 2.0), start_at, rtol=1e-12, atol=1e-12).y[:, -1]
    errors = []
    for steps in (20, 40):
        quaternions, positions = base_path(base, 2.0 / steps, steps)
        np.testing.assert_allclose(np.linalg.norm(quaternions, axis=1), 1.0, rtol=1e-14)
        turn = quaternion_matrix(quaternions[-1])
        errors.append([np.abs(turn.ravel() - exact[:9]).max(), np.abs(positions[-1] - exact[9:]).max()])
    (attitude, place), (finer_attitude, finer_place) = errors
    assert finer_attitude < attitude / 12.0 < 1e-6
    assert finer_place < place / 3.5 < 1e-3
