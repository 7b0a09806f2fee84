"""A flap that is stuck loads its blade steadily: marching the modes leaves them where they were found."""

from __future__ import annotations

import numpy as np

from flapgym.aeroelastic import load_model
from flapgym.aeroelastic.multiblade import to_components
from flapgym.plant.modal import modal_form
from flapgym.plant.stuck import stuck_modes


def test_the_steady_motion_under_stuck_flaps_is_the_one_that_marching_keeps():
    model = load_model()
    flap = modal_form(model.turbine.select(inputs=model.turbine.inputs[:6]))
    turn, angle, theta = model.rotor_speed * model.time_step, np.array([0.0, 0.08, -0.03]), 0.7
    z = stuck_modes(flap, angle, np.array([theta]), turn)[0]
    steps = 200
    for step in range(steps):
        components = to_components(angle, np.array(theta + step * turn))
        z = flap.values * z + flap.drive[:, :3] @ components
    expected = stuck_modes(flap, angle, np.array([theta + steps * turn]), turn)[0]
    np.testing.assert_allclose(z, expected, atol=1e-10 * np.abs(expected).max())


def test_equal_stuck_flaps_load_the_turbine_as_its_steady_gain_says():
    model = load_model()
    flap = modal_form(model.turbine.select(inputs=model.turbine.inputs[:6]))
    turn, azimuth = model.rotor_speed * model.time_step, np.array([0.3, 2.0])
    z = stuck_modes(flap, np.full(3, 0.05), azimuth, turn)
    outputs = (z @ flap.read.T).real + 0.05 * flap.D[:, 0]
    steady = 0.05 * model.turbine.dc_gain()[:, 0]
    # Each quantity by its largest component: symmetry makes some of them zero but for round-off.
    for part in (slice(0, 3), slice(3, 6), slice(6, 8)):
        error = np.abs(outputs[:, part] - steady[part]).max()
        assert error <= 1e-9 * np.abs(steady[part]).max()
