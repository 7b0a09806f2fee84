"""PID and its channels in multi-blade coordinates: what they have in common with PD, and what azimuth means to them."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flapgym.control import PDGains, PIDGains, load_agent, multiblade_pid_agent, pid_agent, save_agent
from flapgym.control.pd import pd_controller
from flapgym.control.pid import pid_controller
from tests.synthetic import synthetic_model

MODEL = synthetic_model()
GAINS = PIDGains(3e-8, 0.2, 0.1, 9.0, 0.8, integral_gain=2.0, leak_time=1.5)
CYCLIC = PIDGains(1e-8, 0.1, 0.05, 9.0, 0.8, integral_gain=20.0, leak_time=4.0)
FREQUENCY = np.array([0.0, 0.05, 0.4, 3.0, 20.0])


def test_without_an_integral_it_is_the_pd():
    pid = pid_controller(replace(GAINS, integral_gain=0.0), MODEL.time_step)
    pd = pd_controller(PDGains(3e-8, 0.2, 0.1, 9.0, 0.8), MODEL.time_step)
    np.testing.assert_allclose(
        pid.frequency_response(FREQUENCY), pd.frequency_response(FREQUENCY), rtol=1e-12, atol=0.0
    )


def test_a_steady_moment_counts_once_and_as_often_again_as_the_integrals_gain():
    gain = pid_controller(GAINS, MODEL.time_step).dc_gain()[0, 0]
    assert gain == pytest.approx(-(9.0**2) * 3e-8 * (1.0 + 2.0), rel=1e-9)


def _observations(steps, azimuth):
    """Random loads and flap motions of a rotor that turns on from an azimuth."""
    rng = np.random.default_rng(0)
    signals = rng.standard_normal((steps, 9)) * np.repeat([0.3, 0.02, 0.05], 3)
    theta = azimuth + MODEL.rotor_speed * MODEL.time_step * np.arange(steps)
    return np.hstack([signals, np.cos(theta)[:, None], np.sin(theta)[:, None]])


def _actions(agent, observations):
    state, actions = None, []
    for observation in observations:
        action, state = agent.predict(observation, state)
        actions.append(action)
    return np.array(actions)


@settings(max_examples=20, deadline=None)
@given(st.floats(-10.0, 10.0))
def test_tilt_and_yaw_channels_know_no_origin_of_the_azimuth(origin):
    agent = multiblade_pid_agent("individual", MODEL, GAINS, CYCLIC)
    there = _actions(agent, _observations(40, origin))
    np.testing.assert_allclose(there, _actions(agent, _observations(40, 0.0)), atol=2e-6)
    assert np.abs(there).max() < 1.0


def test_alike_gains_on_every_channel_answer_a_common_load_as_each_blades_own_pid_does():
    common = _observations(40, 0.3)
    common[:, :9] = np.repeat(common[:, :9:3], 3, axis=1)
    individual = _actions(multiblade_pid_agent("individual", MODEL, GAINS, CYCLIC), common)
    np.testing.assert_allclose(individual, _actions(pid_agent("pid", MODEL, GAINS), common[:, :9]), atol=2e-6)


def test_tilt_and_yaw_alone_leave_a_common_load_as_it_is():
    silent = replace(GAINS, proportional=0.0)
    common = _observations(40, 0.3)
    common[:, :3], common[:, 3:9] = common[:, :1], 0.0
    actions = _actions(multiblade_pid_agent("tilt_yaw", MODEL, silent, CYCLIC), common)
    np.testing.assert_allclose(actions, 0.0, atol=1e-12)


def test_individual_flap_control_comes_back_from_its_file(tmp_path):
    agent = multiblade_pid_agent("individual", MODEL, GAINS, CYCLIC)
    save_agent(tmp_path / "agent.json", agent, MODEL, "three channels", {})
    observations = _observations(20, 1.0)
    loaded = load_agent(tmp_path / "agent.json", MODEL)
    np.testing.assert_array_equal(_actions(loaded, observations), _actions(agent, observations))


@pytest.mark.parametrize(
    ("field", "value"), [("integral_gain", -1.0), ("leak_time", 0.0), ("filter_time", 0.0)]
)
def test_gains_that_make_no_controller_are_refused_by_name(field, value):
    with pytest.raises(ValueError, match=field):
        replace(GAINS, **{field: value})
