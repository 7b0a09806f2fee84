"""What a table says of a linear loop: eigenvalues of the loop itself, and what steps by hand do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flapgym.control import (
    OpenLoop,
    PDGains,
    Policy,
    RotorController,
    Weights,
    individual_pitch_agent,
    load_agent,
    lqg_agent,
    pd_agent,
    pitch_margin,
)
from flapgym.control.blade_controller import BladeController
from flapgym.control.closed_loop import closed_loop, with_effectiveness
from flapgym.control.growth import growth
from flapgym.control.linear_loop import held_policy_loop, linear_loop
from flapgym.control.margins import disk_margin
from flapgym.core.multiblade import to_blades, to_components
from flapgym.core.state_space import StateSpace
from flapgym.evaluation import simulate
from flapgym.model import load_model
from tests.synthetic import synthetic_model

MODEL = synthetic_model()
LIMIT = MODEL.flaps[0].acceleration_limit
GAINS = np.array([-0.05, -0.8, -0.4])  # of moment [MN m], angle [rad] and rate [rad/s], in actions


def policy(gains=GAINS, **changes):
    """A network of no hidden layer: its action is the sum of what it sees times gains."""
    values = {
        "name": "policy",
        "observe": ("rbm", "flap_angle", "flap_rate"),
        "steps_per_action": 5,
        "per_blade": True,
        "offset": np.zeros(3),
        "scale": np.ones(3),
        "weights": (gains[None],),
        "biases": (np.zeros(1),),
        "activation": "tanh",
        "squash": "clip",
    }
    return Policy(**(values | changes))


def test_a_linear_controller_s_loop_is_told_by_its_eigenvalues_and_margin():
    agent = pd_agent("pd", MODEL, PDGains(5e-8, 0.1, 0.1, 9.0, 0.8))
    found = linear_loop(agent, MODEL)
    assert found.stable
    assert found.growth is None
    assert found.margin == disk_margin(MODEL, agent.system)
    strong = replace(MODEL, turbine=with_effectiveness(MODEL.turbine, 10.0))
    wild = linear_loop(lqg_agent("wild", MODEL, Weights(30.0)), strong)
    assert not wild.stable
    assert wild.margin.alpha == 0.0
    assert wild.growth == growth(closed_loop(strong, lqg_agent("wild", MODEL, Weights(30.0)).system))


def test_of_flaps_at_rest_and_of_unknown_agents_nothing_is_told():
    assert linear_loop(OpenLoop(), MODEL) is None
    nine = {
        "offset": np.zeros(9),
        "scale": np.ones(9),
        "weights": (np.zeros((3, 9)),),
        "biases": (np.zeros(3),),
    }
    assert linear_loop(policy(per_blade=False, **nine), MODEL) is None
    seeing = policy(observe=("rbm", "flap_angle", "tip_deflection"))
    assert linear_loop(seeing, MODEL) is None
    with pytest.raises(
        ValueError, match="held_policy_loop: expected a policy of each blade alone that observes rbm"
    ):
        held_policy_loop(seeing, MODEL)


def test_a_policy_that_acts_at_every_step_has_the_loop_of_the_controller_with_its_gains():
    fast = policy(steps_per_action=1)
    gains = LIMIT * GAINS * [1e-6, 1.0, 1.0]
    system = StateSpace(
        np.zeros((0, 0)), np.zeros((0, 3)), np.zeros((1, 0)), gains[None], MODEL.time_step,
        ("rbm", "flap_angle", "flap_rate"), ("acceleration",),
    )  # fmt: skip
    ours, theirs = held_policy_loop(fast, MODEL), closed_loop(MODEL, system)
    assert ours.spectral_radius() == pytest.approx(theirs.spectral_radius(), abs=1e-9)
    found = linear_loop(fast, MODEL).margin
    expected = disk_margin(MODEL, system)
    assert (found.alpha, found.frequency) == pytest.approx((expected.alpha, expected.frequency), rel=1e-4)


def test_between_actions_the_loop_does_what_steps_by_hand_do():
    """Turbine in components, each blade's flap in its own frame with its acceleration held for five steps."""
    agent = policy()
    loop = held_policy_loop(agent, MODEL)
    plant = MODEL.turbine.select(
        [f"flap_{kind}_{part}" for kind in ("angle", "rate") for part in "0cs"], ["rbm_0", "rbm_c", "rbm_s"]
    )
    rng = np.random.default_rng(3)
    state = 1e-3 * rng.standard_normal(loop.order)
    x, azimuth, dt = state[: plant.order].copy(), 0.0, MODEL.time_step
    angle, rate = (to_blades(part, azimuth) for part in np.split(state[plant.order :], 2))
    for _ in range(5):
        u = np.concatenate([to_components(angle, azimuth), to_components(rate, azimuth)])
        moment = to_blades(plant.C @ x + plant.D @ u, azimuth)
        push = LIMIT * (np.stack([moment / 1e6, angle, rate], axis=-1) @ GAINS)
        for _ in range(5):
            u = np.concatenate([to_components(angle, azimuth), to_components(rate, azimuth)])
            x = plant.A @ x + plant.B @ u
            angle, rate = angle + dt * rate + 0.5 * dt**2 * push, rate + dt * push
            azimuth += MODEL.rotor_speed * dt
        state = loop.A @ state
        expected = np.concatenate([x, to_components(angle, azimuth), to_components(rate, azimuth)])
        np.testing.assert_allclose(state, expected, rtol=1e-9, atol=1e-12)


def test_a_policy_told_unstable_leaves_rest_in_simulation_and_one_told_stable_comes_to_it():
    calm = {"wind": {"gust": {"kind": "step", "size": 0.02, "start": 0.5}, "turbulence_intensity": 0.0}}
    for gains, stable in ((GAINS, True), (GAINS * [30.0, 1.0, 0.0], False)):
        agent = policy(gains)
        assert linear_loop(agent, MODEL).stable is stable
        moment = simulate(agent, MODEL, [1], 40.0, **calm).rbm[0]
        early, late = (np.ptp(part, axis=0).max() for part in np.array_split(moment, 10)[2::7])
        assert bool(late < 0.1 * early) is stable


def test_the_slope_of_a_policy_at_rest_is_that_of_its_action():
    rng = np.random.default_rng(0)
    for activation, squash in (("tanh", "tanh"), ("relu", "clip")):
        deep = policy(
            offset=0.1 * rng.standard_normal(3),
            scale=rng.uniform(0.5, 2.0, 3),
            weights=(rng.standard_normal((8, 3)), 0.1 * rng.standard_normal((1, 8))),
            biases=(rng.standard_normal(8), np.array([0.1])),
            activation=activation,
            squash=squash,
        )
        step = 1e-2
        seen = np.zeros((3, 9))
        seen[:, ::3] = step * np.eye(3)  # what blade 1 sees, one after the other
        there, back = (deep.predict(sign * seen)[0][:, 0].astype(float) for sign in (1.0, -1.0))
        np.testing.assert_allclose(
            deep.slope_at_rest()[0], (there - back) / (2.0 * step), rtol=2e-3, atol=1e-4
        )


def test_individual_pitch_alone_is_told_by_its_margin():
    model = load_model("nrel5mw-site")
    alone = individual_pitch_agent("individual_pitch", model, 0.3)
    found = linear_loop(alone, model)
    assert found.stable is None
    assert found.margin == pitch_margin(model, alone)
    assert linear_loop(load_agent("individual_pitch+pd", model), model) is None


def test_of_a_controller_in_the_blades_own_frames_stability_is_told_alone():
    agent = pd_agent("pd", MODEL, PDGains(5e-8, 0.1, 0.1, 9.0, 0.8))
    assert isinstance(agent, BladeController)
    system, each = agent.system, np.eye(3)
    names = [f"{name}_{b}" for name in ("rbm", "flap_angle", "flap_rate") for b in (1, 2, 3)]
    copies = StateSpace(
        np.kron(each, system.A),
        np.hstack([np.kron(each, column[:, None]) for column in system.B.T]),
        np.kron(each, system.C),
        np.hstack([np.kron(each, column[:, None]) for column in system.D.T]),
        MODEL.time_step,
        tuple(names),
        ("acceleration_1", "acceleration_2", "acceleration_3"),
    )
    own = RotorController("own", copies, np.zeros((copies.order, 9)), (10.0,))
    found = linear_loop(own, MODEL)
    assert found.stable
    assert found.margin is None
