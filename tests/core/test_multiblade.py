"""Multi-blade coordinates against three blades written out one by one in their own rotating frames."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from flapgym.aeroelastic.coupling import multiblade_aerodynamics, turbine_structure
from flapgym.core.multiblade import blade_azimuths, hub_components, to_blades, to_components
from flapgym.reduction import ReducedSystem

OMEGA = 1.2
RNG = np.random.default_rng(3)
azimuths = st.floats(-10.0, 10.0)


def rotation(angle):
    """Rotation about x, written out."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


@given(azimuths)
def test_hub_components_are_the_rotation_into_the_blade_frame(azimuth):
    axial, cosine, sine = hub_components()
    expected = np.kron(np.eye(2), rotation(azimuth).T)
    np.testing.assert_allclose(
        axial + cosine * np.cos(azimuth) + sine * np.sin(azimuth), expected, atol=1e-12
    )


@given(azimuths, st.lists(st.floats(-1e3, 1e3), min_size=3, max_size=3))
def test_blades_and_components_are_each_others_inverse(azimuth, values):
    blades = np.array(values)
    np.testing.assert_allclose(to_blades(to_components(blades, azimuth), azimuth), blades, atol=1e-9)


@given(azimuths, st.floats(-1e3, 1e3), st.floats(-1e3, 1e3))
def test_twice_a_turn_is_the_cyclic_pattern_that_whirls_backward(azimuth, cosine, sine):
    """M_2c + i M_2s = exp(3 i psi) (M_c - i M_s), of blades written out one by one."""
    blades = np.array(
        [
            cosine * np.cos(2.0 * angle) + sine * np.sin(2.0 * angle)
            for angle in (azimuth, azimuth + 2.0 * np.pi / 3.0, azimuth + 4.0 * np.pi / 3.0)
        ]
    )
    np.testing.assert_allclose(to_blades(np.array([0.0, cosine, sine]), azimuth, 2), blades, atol=1e-9)
    np.testing.assert_allclose(to_components(blades, azimuth, 2), [0.0, cosine, sine], atol=1e-9)
    _, once_c, once_s = to_components(blades, azimuth)
    turned = np.exp(3j * azimuth) * (once_c - 1j * once_s)
    np.testing.assert_allclose([turned.real, turned.imag], [cosine, sine], atol=1e-9)


def test_turbine_equations_equal_three_blades_and_a_hub_written_out_at_any_azimuth():
    modes, support_modes = 2, 4
    size, nd = modes + 6, 3 * modes + support_modes
    blade = tuple(RNG.standard_normal((size, size)) for _ in range(3))
    blade[2][:, modes:] = 0.0  # the hub has no stiffness of its own
    support = tuple(RNG.standard_normal((support_modes, support_modes)) for _ in range(3))
    hub = RNG.standard_normal((6, support_modes))
    components = np.zeros((3, size, nd))
    for i, part in enumerate(hub_components()):
        components[i, :modes, i * modes : (i + 1) * modes] = np.eye(modes)
        components[i, modes:, 3 * modes :] = part @ hub
    structure, *_ = turbine_structure(blade, support, components, OMEGA)
    d, v, a = RNG.standard_normal((3, nd))
    ours = structure.mass @ a + structure.damping @ v + structure.stiffness @ d

    def motion(t, azimuth):
        """Blade modes (3, m) and hub velocities in the blade frames (3, 6) at time t."""
        theta = azimuth + OMEGA * t
        now, speed = d + v * t + a * t**2 / 2, v + a * t
        modal = to_blades(now[: 3 * modes].reshape(3, modes).T, theta).T
        hub_speed = hub @ speed[3 * modes :]
        turned = [np.kron(np.eye(2), rotation(angle).T) @ hub_speed for angle in blade_azimuths(theta)]
        return modal, np.stack(turned)

    h = 1e-3
    for azimuth in (0.0, 0.7, 2.9):
        before, now, after = (motion(t, azimuth) for t in (-h, 0.0, h))
        rate = (after[0] - before[0]) / (2 * h)
        acceleration = np.hstack(
            [(after[0] - 2 * now[0] + before[0]) / h**2, (after[1] - before[1]) / (2 * h)]
        )
        force = (
            acceleration @ blade[0].T
            + np.hstack([rate, now[1]]) @ blade[1].T
            + np.hstack([now[0], np.zeros((3, 6))]) @ blade[2].T
        )
        angles = blade_azimuths(azimuth)
        weights = np.stack([np.ones(3), np.cos(angles), np.sin(angles)])
        on_modes = (weights @ force[:, :modes]).ravel()
        on_hub = sum(np.kron(np.eye(2), rotation(angle)) @ force[b, modes:] for b, angle in enumerate(angles))
        own = support[0] @ a[3 * modes :] + support[1] @ v[3 * modes :] + support[2] @ d[3 * modes :]
        theirs = np.concatenate([on_modes, hub.T @ on_hub + own])
        np.testing.assert_allclose(ours, theirs, rtol=1e-4, atol=1e-4)


def test_rotor_aerodynamics_equal_their_cyclic_components_stepped_in_the_rotor_frame():
    order, inputs, outputs, dt, steps = 3, 2, 2, 0.05, 60
    collective = ReducedSystem(
        *(0.3 * RNG.standard_normal(s) for s in shapes(order, inputs, outputs)), np.ones(3)
    )
    whirl = ReducedSystem(
        *(
            0.3 * (RNG.standard_normal(s) + 1j * RNG.standard_normal(s))
            for s in shapes(order, inputs, outputs)
        ),
        np.ones(3),
    )
    fixed = multiblade_aerodynamics(collective, whirl, OMEGA, dt)
    blades = RNG.standard_normal((steps, inputs, 3))
    azimuth = 0.4 + OMEGA * dt * np.arange(steps)

    phase = np.exp(2j * np.pi * np.arange(3) / 3)
    x0, x1, expected = np.zeros(order), np.zeros(order, complex), []
    for u in blades:
        u0, u1 = u.mean(axis=1), (u * phase.conj()).mean(axis=1)
        y0, y1 = collective.C @ x0 + collective.D @ u0, whirl.C @ x1 + whirl.D @ u1
        expected.append(y0[:, None] + 2.0 * (y1[:, None] * phase).real)
        x0, x1 = collective.A @ x0 + collective.B @ u0, whirl.A @ x1 + whirl.B @ u1

    x, ours = np.zeros(3 * order), []
    for u, theta in zip(blades, azimuth, strict=True):
        components = to_components(u, theta).T.ravel()
        y = fixed.C @ x + fixed.D @ components
        ours.append(to_blades(y.reshape(3, outputs).T, theta))
        x = fixed.A @ x + fixed.B @ components
    np.testing.assert_allclose(ours, expected, rtol=1e-9, atol=1e-9)


def shapes(order, inputs, outputs):
    return (order, order), (order, inputs), (outputs, order), (outputs, inputs)
