"""What the environments' page says of azimuth, blade order and signs holds for the shipped model."""

from __future__ import annotations

import numpy as np
import pytest

from flapgym.core.multiblade import blade_azimuths
from flapgym.envs import FlapEnv
from flapgym.structure.rotation import about_x

DEGREE = np.pi / 180.0


def _settled(env, action=None):
    """The last info of an episode in still air, the flaps held."""
    action = np.zeros(3) if action is None else action
    while True:
        *_, truncated, info = env.step(action)
        if truncated:
            return info


@pytest.mark.parametrize("cause", ["wind", "flap"])
def test_more_wind_and_positive_flaps_raise_every_load_and_push_the_tower_top_to_the_right(cause):
    gust = {"kind": "step", "size": 1.0} if cause == "wind" else None
    stuck = (None if cause == "wind" else 3.0 * DEGREE,) * 3
    env = FlapEnv(
        wind={"turbulence_intensity": 0.0, "gust": gust},
        actuators={"stuck": stuck},
        full_info=True,
        duration=120.0,
    )
    env.reset(seed=0)
    info = _settled(env)
    assert (info["rbm"] > 1e5).all()
    assert (info["tip_deflection"] > 0.05).all()
    fore_aft, sideways = info["tower_top"]
    assert fore_aft > 0.005
    assert sideways < -0.0005


def test_a_positive_action_moves_the_flap_to_more_lift():
    env = FlapEnv(wind={"turbulence_intensity": 0.0}, full_info=True)
    env.reset(seed=0)
    for _ in range(14):  # by then the lift has overcome the blade's inertia
        *_, info = env.step([0.1, 0.0, 0.0])
    assert info["flap_rate"][0] > 0.0
    assert info["flap_angle"][0] > 0.0
    assert info["rbm"][0] > 5.0 * np.abs(info["rbm"][1:]).max()


def test_the_azimuth_grows_with_the_rotor_s_speed_and_begins_anew_with_every_turn():
    env = FlapEnv(duration=30.0)
    _, info = env.reset(seed=0, options={"azimuth": 6.0})
    told = [info["azimuth"]] + [env.step(np.zeros(3))[-1]["azimuth"] for _ in range(200)]
    assert told[0] == 6.0
    assert 0.0 <= min(told) < 0.1
    assert 6.2 < max(told) < 2.0 * np.pi
    np.testing.assert_allclose(np.diff(np.unwrap(told)), env.model.rotor_speed * 0.035, rtol=1e-9)


def test_blades_pass_the_top_in_the_order_1_3_2_clockwise_from_upwind():
    # In axes x downwind, z up: y is to the left of one who looks downwind. The rotor turns about +x.
    tips = [about_x(azimuth) @ [0.0, 0.0, 1.0] for azimuth in blade_azimuths(30.0 * DEGREE)]
    assert tips[0][1] < 0.0  # blade 1 has gone to the right
    until_top = np.mod(-blade_azimuths(30.0 * DEGREE), 2.0 * np.pi)
    assert list(1 + np.argsort(until_top)) == [3, 2, 1]
