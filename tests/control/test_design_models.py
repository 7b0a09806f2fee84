"""LQG on design models of three flaps: they fall apart into blades where the plant does, and refuse what they must."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from flapgym.control import (
    BladeController,
    RotorController,
    Weights,
    closed_loop,
    design_model,
    growth_per_turn,
    load_agent,
    lqg_agent,
    save_agent,
    stationary_rms,
    synthesise,
    white_wind,
)
from flapgym.control.channels import MULTIBLADE, ROTOR
from flapgym.control.closed_loop import _in_frame
from flapgym.control.lqg import predictor_gain, regulator_gain, with_actuator
from flapgym.core.state_space import StateSpace
from flapgym.evaluation import root_mean_square, simulate
from flapgym.wind import von_karman_filter
from tests.synthetic import synthetic_model

MODEL = synthetic_model()
WEIGHTS = Weights(rbm=2.0, measurement_noise=0.05)
FREQUENCY = np.array([0.02, 0.2, 0.9, 5.0])


def _three_blades(winds):
    """Three uncoupled blades in their own frames, in one wind or each in its own."""
    blade = MODEL.blade.select(outputs=["rbm"])
    each = [np.kron(np.eye(3), blade.B[:, [i]]) for i in range(3)]
    direct = [np.kron(np.eye(3), blade.D[:, [i]]) for i in range(3)]
    if len(winds) == 1:
        each[2], direct[2] = (part.sum(axis=1, keepdims=True) for part in (each[2], direct[2]))
    return StateSpace(
        np.kron(np.eye(3), blade.A),
        np.hstack(each),
        np.kron(np.eye(3), blade.C),
        np.hstack(direct),
        MODEL.time_step,
        (*ROTOR.named("flap_angle"), *ROTOR.named("flap_rate"), *winds),
        ROTOR.named("rbm"),
    )


def _own_winds():
    wind = von_karman_filter(11.0, 0.1, 147.0, MODEL.time_step, 3)
    three = {key: np.kron(np.eye(3), getattr(wind, key)) for key in "ABCD"}
    return StateSpace(
        **three,
        time_step=MODEL.time_step,
        inputs=("white_1", "white_2", "white_3"),
        outputs=("wind_1", "wind_2", "wind_3"),
    )


def test_three_blades_each_in_its_own_wind_get_three_copies_of_the_blades_lqg():
    plant = _three_blades(("wind_1", "wind_2", "wind_3"))
    rotor = synthesise(design_model(MODEL, plant, _own_winds()), WEIGHTS).frequency_response(FREQUENCY)
    blade = synthesise(design_model(MODEL), WEIGHTS).frequency_response(FREQUENCY)
    for signal in range(3):
        part, alone = rotor[:, :, 3 * signal : 3 * signal + 3], blade[:, 0, signal]
        expected = alone[:, None, None] * np.eye(3)
        np.testing.assert_allclose(part, expected, atol=1e-6 * np.abs(alone).max())


def test_in_one_wind_the_blades_share_their_measurements_and_the_mean_has_a_third_of_the_noise():
    rotor = synthesise(design_model(MODEL, _three_blades(("wind",))), WEIGHTS).frequency_response(FREQUENCY)
    quieter = replace(WEIGHTS, measurement_noise=WEIGHTS.measurement_noise / np.sqrt(3.0))
    blade = synthesise(design_model(MODEL), quieter).frequency_response(FREQUENCY)
    collective = rotor[:, :, :3].sum(axis=2).mean(axis=1)
    np.testing.assert_allclose(collective, blade[:, 0, 0], rtol=1e-5)


def test_in_multi_blade_coordinates_the_collective_channel_is_the_same():
    loose = synthetic_model(tower_coupling=0.0)
    turbine = synthesise(design_model(loose, loose.turbine), WEIGHTS).frequency_response(FREQUENCY)
    quieter = replace(WEIGHTS, measurement_noise=WEIGHTS.measurement_noise / np.sqrt(3.0))
    blade = synthesise(design_model(loose), quieter).frequency_response(FREQUENCY)
    np.testing.assert_allclose(turbine[:, 0, 0], blade[:, 0, 0], rtol=1e-5)


@pytest.mark.parametrize("plant", [MODEL.turbine, _three_blades(("wind",))], ids=["multiblade", "rotor"])
def test_riccati_equations_of_three_flaps_are_solved(plant):
    d = design_model(MODEL, plant)
    gain, p = predictor_gain(d, WEIGHTS)
    residual = d.A @ p @ (d.A - gain @ d.C).T + d.G @ (d.G - gain @ d.H).T - p
    assert np.abs(residual).max() < 1e-9 * np.abs(p).max()
    a, b, c = with_actuator(d)
    gain, x = regulator_gain(d, WEIGHTS)
    n, weight = d.A.shape[0], np.diag(d.channels.weight)
    q = WEIGHTS.rbm * c.T @ weight @ c
    q[n : n + 3, n : n + 3] += WEIGHTS.flap_angle * weight
    residual = a.T @ x @ (a - b @ gain) + q - x
    assert np.abs(residual).max() < 1e-9 * np.abs(x).max()


def test_poles_of_the_whole_turbine_with_its_lqg_are_those_of_regulator_and_predictor():
    """The design model is the turbine: separation holds on the real loop, beside the filter's own poles."""
    d = design_model(MODEL, MODEL.turbine)
    found = np.linalg.eigvals(closed_loop(MODEL, synthesise(d, WEIGHTS)).A)
    a, b, _ = with_actuator(d)
    regulator = np.linalg.eigvals(a - b @ regulator_gain(d, WEIGHTS)[0])
    predictor = np.linalg.eigvals(d.A - predictor_gain(d, WEIGHTS)[0] @ d.C)
    wind = np.diag(von_karman_filter(11.0, 0.1, 147.0, MODEL.time_step, 3).A)
    for value in np.concatenate([regulator, predictor]):
        if np.abs(value - wind).min() > 1e-6:
            assert np.abs(found - value).min() < 1e-6


def test_copies_of_a_blades_controller_in_multi_blade_coordinates_act_as_the_copies_do():
    blade = lqg_agent("blade", MODEL, WEIGHTS)
    system = _in_frame(blade.system, MODEL, MODEL.turbine)
    start = np.hstack([np.kron(np.eye(3), column[:, None]) for column in blade.start.T])
    rotor = RotorController("rotor", system, start, (MODEL.flaps[0].acceleration_limit,))
    ours, copies = (simulate(agent, MODEL, range(2), 12.0) for agent in (rotor, blade))
    np.testing.assert_allclose(
        ours.flap_angle, copies.flap_angle, atol=1e-5 * np.abs(copies.flap_angle).max()
    )


def test_simulated_rms_of_the_multi_blade_lqg_is_that_of_its_lyapunov_equation():
    agent = lqg_agent("multiblade", MODEL, Weights(0.2), design_model(MODEL, MODEL.turbine))
    record, reference = (simulate(each, MODEL, range(40, 56), 60.0) for each in (agent, _no_flap()))
    assert np.abs(record.flap_angle).max() < MODEL.flaps[0].angle_limit
    settled = slice(3000, None)
    ratio = root_mean_square(record.rbm[:, settled], axis=None) / root_mean_square(
        reference.rbm[:, settled], axis=None
    )
    expected = stationary_rms(MODEL, agent.system)["rbm"] / stationary_rms(MODEL)["rbm"]
    assert ratio == pytest.approx(expected, abs=0.01)


def _no_flap():
    return lqg_agent("none", MODEL, Weights(0.0))


def test_measurement_noise_is_worth_the_same_in_either_frame():
    """Three copies on three blades: only the frame in which the loop is written differs."""
    loose = synthetic_model(tower_coupling=0.0)
    controller = synthesise(design_model(loose), WEIGHTS)
    plant = _three_blades(("wind",))
    quiet = np.zeros((5, plant.order)), np.zeros((5, 7))
    plant = replace(
        plant,
        C=np.vstack([plant.C, quiet[0]]),
        D=np.vstack([plant.D, quiet[1]]),
        outputs=(*plant.outputs, *ROTOR.named("tip_deflection"), "tower_fore_aft", "tower_side_side"),
    )
    noise = 0.1 * loose.rbm_rms
    own = stationary_rms(loose, controller, measurement_noise=noise, plant=plant)
    fixed = stationary_rms(loose, controller, measurement_noise=noise)
    calm = stationary_rms(loose, controller)
    assert own["flap_rate"] == pytest.approx(fixed["flap_rate"], rel=1e-6)
    assert fixed["flap_rate"] > 1.02 * calm["flap_rate"]


def test_a_turn_of_the_periodic_loop_shrinks_as_the_time_invariant_one_says():
    """Three copies of a blade's controller can be written in either frame: the same loop."""
    controller = synthesise(design_model(MODEL), WEIGHTS)
    steps = 2 * np.pi / (MODEL.rotor_speed * MODEL.time_step)
    expected = closed_loop(MODEL, controller).spectral_radius() ** steps
    own = _in_frame(controller, MODEL, _three_blades(("wind",)))
    assert growth_per_turn(MODEL, own) == pytest.approx(expected, rel=0.02)


def test_without_the_filter_the_wind_is_white_with_the_turbulences_variance():
    design = design_model(MODEL, disturbance=white_wind(MODEL))
    assert design.A.shape == MODEL.blade.A.shape
    np.testing.assert_allclose(design.H * 1e6, 1.1 * MODEL.blade.D[:1, 2:])


def _growing(flap, seen):
    """A blade with a mode of 0.9 Hz that grows by 0.1 % a step."""
    step = 2 * np.pi * 0.9 * MODEL.time_step
    mode = 1.001 * np.array([[np.cos(step), np.sin(step)], [-np.sin(step), np.cos(step)]])
    blade = MODEL.blade
    b = np.vstack([blade.B, np.hstack([np.full((2, 2), flap), np.ones((2, 1))])])
    c = np.hstack([blade.C, np.array([[seen, 0.0], [0.0, 0.0]])])
    return replace(blade, A=scipy.linalg.block_diag(blade.A, mode), B=b, C=c)


@pytest.mark.parametrize(
    ("flap", "seen", "text"),
    [
        (0.0, 1e6, "unstabilisable: the flaps cannot move"),
        (1.0, 0.0, "undetectable: the root bending moment"),
    ],
)
def test_a_mode_out_of_reach_is_refused_with_its_frequency_and_damping(flap, seen, text):
    with pytest.raises(ValueError, match=rf"{text}.*mode at 0\.9 Hz \(damping ratio -0\.0252\)"):
        design_model(MODEL, _growing(flap, seen))


def test_a_growing_mode_within_reach_is_held():
    d = design_model(MODEL, _growing(1.0, 1e6))
    a, b, _ = with_actuator(d)
    assert np.abs(np.linalg.eigvals(d.A)).max() > 1.0
    assert np.abs(np.linalg.eigvals(a - b @ regulator_gain(d, WEIGHTS)[0])).max() < 1.0
    assert np.abs(np.linalg.eigvals(d.A - predictor_gain(d, WEIGHTS)[0] @ d.C)).max() < 1.0


@pytest.mark.parametrize("plant", [MODEL.turbine, _three_blades(("wind",))], ids=["multiblade", "rotor"])
def test_a_rotor_controller_comes_back_from_its_file_and_runs_in_batches(tmp_path, plant):
    agent = lqg_agent("rotor", MODEL, WEIGHTS, design_model(MODEL, plant))
    assert not isinstance(agent, BladeController)
    assert ("azimuth" in agent.observe) == (agent.channels == MULTIBLADE)
    save_agent(tmp_path / "rotor.json", agent, MODEL, "three flaps", {})
    loaded = load_agent(tmp_path / "rotor.json", MODEL)
    rng = np.random.default_rng(0)
    size = 9 + 2 * ("azimuth" in agent.observe)
    observations = rng.standard_normal((5, 4, size)).astype(np.float32) * 0.05
    state, alone = None, None
    for observation in observations:
        action, state = loaded.predict(observation, state)
        single, alone = agent.predict(observation[2], alone)
        assert action.shape == (4, 3)
        np.testing.assert_allclose(action[2], single, atol=1e-6)
    fresh, _ = agent.predict(observation[0])
    again, _ = agent.predict(observation, state, episode_start=np.array([True, False, False, False]))
    np.testing.assert_allclose(again[0], fresh, atol=1e-6)


def test_a_rotors_controller_has_no_time_invariant_loop_with_the_turning_turbine():
    controller = synthesise(design_model(MODEL, _three_blades(("wind",))), WEIGHTS)
    with pytest.raises(ValueError, match="no time-invariant loop"):
        closed_loop(MODEL, controller)
