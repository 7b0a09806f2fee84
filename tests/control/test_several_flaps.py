"""Three flaps a blade under every controller: made, saved, loaded, stable, flown; and what more flaps are worth."""

from dataclasses import replace
from itertools import pairwise

import gymnasium
import numpy as np
import pytest
import scipy.linalg

from flapgym.aeroelastic.build import build_model
from flapgym.control import (
    BladeController,
    OpenLoop,
    PDGains,
    PIDGains,
    Policy,
    PredictiveController,
    RotorController,
    Weights,
    closed_loop,
    design_model,
    growth_per_turn,
    load_agent,
    lqg_agent,
    multiblade_pid_agent,
    pd_agent,
    pid_agent,
    save_agent,
    stationary_rms,
    synthesise,
)
from flapgym.control.channels import MULTIBLADE, ROTOR
from flapgym.control.closed_loop import _in_frame
from flapgym.control.margins import delay_margin, disk_margin
from flapgym.control.periodic import periodic_disk_margin
from flapgym.core.state_space import StateSpace
from flapgym.envs import FlapVectorEnv
from flapgym.envs.registration import TURBINE_ID
from flapgym.evaluation import compare, measure, simulate, simulate_together
from flapgym.turbine import load_case
from flapgym.wrappers.single import OneBlade, Residual
from tests.loops import design_loop, priced, riccati_cost
from tests.synthetic import synthetic_model

FLAPS = 3
MODEL = synthetic_model(flaps=FLAPS)
ONE = synthetic_model()
GENTLE = Weights(rbm=0.2, measurement_noise=0.05)
EDGES = (0.45, 0.6, 0.75, 0.9)
SEEDS = range(2)


def _built():
    """A coarse turbine of three flaps of 15 % of the span each."""
    case = load_case("nrel5mw-corrected")
    flaps = tuple(
        replace(case.flaps[0], span_start=start, span_end=end, angle_limit=0.1 + 0.02 * i)
        for i, (start, end) in enumerate(pairwise(EDGES))
    )
    return build_model(
        replace(
            case,
            flaps=flaps,
            discretisation=replace(case.discretisation, chordwise_panels=2, wake_length=0.05, time_step=0.02),
            reduction=replace(case.reduction, blade_modes=4, tower_modes=4, aerodynamic_states=8),
            airloads=replace(case.airloads, mean_wake=0.1, mean_induction=0.2),
        )
    )


@pytest.fixture(scope="module", params=["synthetic", "built"])
def model(request):
    return MODEL if request.param == "synthetic" else _built()


def _policy(per_blade):
    """A small linear law with a little of every other flap's motion in it."""
    rng = np.random.default_rng(0)
    blades = 1 if per_blade else 3
    inputs, actions = blades * (1 + 2 * FLAPS), blades * FLAPS
    weights = 0.01 * rng.standard_normal((actions, inputs))
    weights[:, :blades] -= 0.05
    own = np.arange(actions)
    weights[own, blades + own] -= 2.0
    weights[own, blades + actions + own] -= 0.5
    return Policy(
        name="shared policy" if per_blade else "policy",
        observe=("rbm", "flap_angle", "flap_rate"),
        steps_per_action=1,
        per_blade=per_blade,
        offset=np.zeros(inputs),
        scale=np.ones(inputs),
        weights=(weights,),
        biases=(np.zeros(actions),),
        activation="tanh",
        squash="clip",
    )


def _linear(model):
    """Every kind of linear controller."""
    pid = PIDGains(2e-8, 0.1, 0.1, 9.0, 0.8, 1.0, 2.0)
    return [
        pd_agent("pd", model, PDGains(2e-8, 0.1, 0.1, 9.0, 0.8)),
        pid_agent("pid", model, pid),
        multiblade_pid_agent("individual", model, pid, replace(pid, proportional=1e-8)),
        lqg_agent("lqg", model, GENTLE),
        lqg_agent("multiblade", model, GENTLE, design_model(model, model.turbine)),
    ]


def test_every_agent_goes_to_a_file_and_flies_stably(model, tmp_path):
    agents = []
    for agent in (*_linear(model), _policy(True), _policy(False)):
        path = tmp_path / f"{agent.name}.json"
        save_agent(path, agent, model, "A test.", {})
        agents.append(load_agent(path, model))
        assert agents[-1].flaps == FLAPS
        seen = sum({"rbm": 3, "azimuth": 2}.get(name, 3 * FLAPS) for name in agent.observe)
        observations = 0.1 * np.random.default_rng(1).standard_normal((5, 4, seen)).astype(np.float32)
        mine = theirs = None
        for observation in observations:
            ours, mine = agents[-1].predict(observation, mine)
            saved, theirs = agent.predict(observation, theirs)
            np.testing.assert_array_equal(ours, saved)
            assert ours.shape == (4, 3 * FLAPS)
    for agent in agents[:5]:
        assert closed_loop(model, agent.system).spectral_radius() < 1.0
        assert 0.2 < disk_margin(model, agent.system).alpha < 2.0
        assert delay_margin(model, agent.system, longest=2) == 2
    records = simulate_together([OpenLoop(), *agents], model, SEEDS, 20.0)
    stops = np.tile([flap.angle_limit for flap in model.flaps], 3)
    still, *others = (measure(record) for record in records)
    assert still.flap_angle_max.max() == 0.0
    for record, metrics in zip(records[1:], others, strict=True):
        assert record.flap_angle.shape == (2, 1000 if model is not MODEL else 2857, 3 * FLAPS)
        assert 0.0 < np.abs(record.flap_angle / stops).max() <= 1.0
        assert metrics.rbm_rms.mean() < still.rbm_rms.mean()


def test_side_by_side_they_do_as_alone():
    agents = [*_linear(MODEL), _policy(True)]
    for agent, record in zip(agents, simulate_together(agents, MODEL, SEEDS, 3.0), strict=True):
        env = FlapVectorEnv(2, model=MODEL, task={"observe": agent.observe}, steps_per_action=1)
        state = None
        observation, _ = env.reset(seed=list(SEEDS))
        for step in range(100):
            action, state = agent.predict(observation, state)
            observation, *_, info = env.step(action)
            np.testing.assert_allclose(
                info["flap_angle"], record.flap_angle[:, step], atol=1e-6, err_msg=agent.name
            )
        env.close()


def _three_blades():
    """Three uncoupled blades in their own frames, in one wind."""
    blade, each = MODEL.blade, np.eye(3)
    columns, direct = blade.B[:, : 2 * FLAPS].T, blade.D[:, : 2 * FLAPS]
    channels = ROTOR.with_flaps(FLAPS)
    names = (*channels.named("rbm"), *channels.named("tip_deflection"))
    return StateSpace(
        np.kron(each, blade.A),
        np.hstack(
            [*(np.kron(each, column[:, None]) for column in columns), np.tile(blade.B[:, -1:], (3, 1))]
        ),
        np.vstack([np.kron(each, row[None]) for row in blade.C]),
        np.hstack([np.kron(direct, each), np.repeat(blade.D[:, -1:], 3, axis=0)]),
        MODEL.time_step,
        (*channels.flap_inputs, "wind"),
        names,
    )


def test_copies_written_in_either_frame_of_the_rotor_act_as_the_copies_do():
    """Angles stand flap by flap in a controller's channels and blade by blade in an action."""
    blade = lqg_agent("blade", MODEL, GENTLE)
    start = np.hstack([np.kron(np.eye(3), column[:, None]) for column in blade.start.T])
    copies = simulate(blade, MODEL, SEEDS, 8.0).flap_angle
    assert np.abs(copies.reshape(*copies.shape[:2], 3, FLAPS)).max(axis=(0, 1)).min() > 1e-3
    for plant in (MODEL.turbine, _three_blades()):
        system = _in_frame(blade.system, MODEL, plant)
        rotor = RotorController("rotor", system, start, blade.acceleration_limits)
        found = simulate(rotor, MODEL, SEEDS, 8.0).flap_angle
        np.testing.assert_allclose(found, copies, atol=1e-5 * np.abs(copies).max())


def test_periodic_and_time_invariant_form_of_one_loop_have_one_margin_and_one_decay():
    controller = lqg_agent("blade", MODEL, GENTLE).system
    own = _in_frame(controller, MODEL, _three_blades())
    assert periodic_disk_margin(MODEL, own).alpha == pytest.approx(
        disk_margin(MODEL, controller).alpha, rel=1e-4
    )
    turn = 2 * np.pi / (MODEL.rotor_speed * MODEL.time_step)
    expected = closed_loop(MODEL, controller).spectral_radius() ** turn
    assert growth_per_turn(MODEL, own) == pytest.approx(expected, rel=0.04)


@pytest.mark.parametrize("frame", ["blade", "multiblade"])
def test_the_loops_stationary_cost_is_the_riccati_value(model, frame):
    design = design_model(model, None if frame == "blade" else model.turbine)
    loop, drive, outputs = design_loop(design, synthesise(design, GENTLE), GENTLE)
    covariance = scipy.linalg.solve_discrete_lyapunov(loop, drive @ drive.T)
    cost = np.diag(outputs @ covariance @ outputs.T) @ priced(design, GENTLE)
    assert cost == pytest.approx(riccati_cost(design, GENTLE), rel=1e-6)


def test_the_measured_cost_is_the_riccati_value_within_sampling_error():
    """Four hundred stationary minutes, as for one flap."""
    design = design_model(MODEL)
    loop, drive, outputs = design_loop(design, synthesise(design, GENTLE), GENTLE)
    values, vectors = np.linalg.eigh(scipy.linalg.solve_discrete_lyapunov(loop, drive @ drive.T))
    rng = np.random.default_rng(0)
    x = vectors @ (np.sqrt(np.maximum(values, 0.0))[:, None] * rng.standard_normal((len(loop), 400)))
    steps, squares = round(60.0 / design.time_step), np.zeros(len(outputs))
    for _ in range(steps):
        squares += np.mean((outputs @ x) ** 2, axis=1)
        x = loop @ x + drive @ rng.standard_normal((drive.shape[1], 400))
    assert squares / steps @ priced(design, GENTLE) == pytest.approx(riccati_cost(design, GENTLE), rel=0.1)


def test_flown_rms_is_that_of_the_lyapunov_equation():
    agent, seeds = lqg_agent("lqg", MODEL, Weights(0.05)), range(40, 56)
    flown, still = (simulate(each, MODEL, seeds, 60.0) for each in (agent, OpenLoop()))
    stops = np.tile([flap.angle_limit for flap in MODEL.flaps], 3)
    assert np.abs(flown.flap_angle / stops).max() < 1.0
    expected, reference = stationary_rms(MODEL, agent.system), stationary_rms(MODEL)
    settled = slice(3000, None)
    ratio = np.sqrt(np.mean(flown.rbm[:, settled] ** 2) / np.mean(still.rbm[:, settled] ** 2))
    assert ratio == pytest.approx(expected["rbm"] / reference["rbm"], abs=0.01)
    # Which flap moves by how much, of wind that is alike in both.
    moved = np.sqrt((flown.flap_angle[:, settled].reshape(16, -1, 3, FLAPS) ** 2).mean(axis=(0, 1, 2)))
    wanted = np.array([expected[f"flap{i}_angle"] for i in (1, 2, 3)])
    np.testing.assert_allclose(moved / moved.sum(), wanted / wanted.sum(), atol=0.01)


def _alike(model):
    """The same model with the stops of its first flap on all."""
    return replace(model, flaps=tuple(replace(model.flaps[0], name=flap.name) for flap in model.flaps))


def _tied(model):
    """A model of one flap a blade, the flaps of another, all alike in their stops, moved as one."""

    def summed(system, blades):
        def joined(matrix):
            motion = matrix[:, : 2 * FLAPS * blades].reshape(-1, 2, FLAPS, blades).sum(axis=2)
            return np.hstack([motion.reshape(-1, 2 * blades), matrix[:, 2 * FLAPS * blades :]])

        channels = MULTIBLADE.flap_inputs if blades == 3 else ("flap_angle", "flap_rate")
        names = (*channels, *system.inputs[2 * FLAPS * blades :])
        return replace(system, B=joined(system.B), D=joined(system.D), inputs=names)

    return replace(
        model,
        turbine=summed(model.turbine, 3),
        blade=summed(model.blade, 1),
        flaps=(replace(model.flaps[0], name="flap"),),
    )


@pytest.mark.parametrize("weight", [0.05, 0.5, 5.0])
@pytest.mark.parametrize("frame", ["blade", "multiblade"])
def test_free_flaps_cost_less_than_the_same_tied_together(model, frame, weight):
    """For one set of weights whatever three flaps do as one, three free ones may do, too: a bound, no tolerance."""
    free = _alike(model)
    costs = [
        riccati_cost(design_model(each, None if frame == "blade" else each.turbine), Weights(weight))
        for each in (free, _tied(free))
    ]
    assert costs[0] < costs[1]


def test_flaps_that_do_the_same_are_moved_as_the_one_flap_they_make():
    """Weights mean what they did: three flaps of a third of the effect, each with the one flap's law."""

    def shares(system, blades):
        def split(matrix):
            motion = matrix[:, : 2 * blades].reshape(-1, 2, 1, blades).repeat(FLAPS, axis=2) / FLAPS
            return np.hstack([motion.reshape(-1, 2 * FLAPS * blades), matrix[:, 2 * blades :]])

        names = (MODEL.turbine if blades == 3 else MODEL.blade).inputs
        return replace(system, B=split(system.B), D=split(system.D), inputs=names)

    parted = replace(
        ONE, turbine=shares(ONE.turbine, 3), blade=shares(ONE.blade, 1), flaps=_alike(MODEL).flaps
    )
    assert parted.flaps[0] == replace(ONE.flaps[0], name="flap1")
    for of in (lambda each: design_model(each), lambda each: design_model(each, each.turbine)):
        assert riccati_cost(of(parted), GENTLE) == pytest.approx(riccati_cost(of(ONE), GENTLE), rel=1e-6)
    several, one = (
        simulate(lqg_agent("lqg", each, GENTLE), each, SEEDS, 5.0).flap_angle for each in (parted, ONE)
    )
    np.testing.assert_allclose(several, np.repeat(one, FLAPS, axis=2), atol=1e-5 * np.abs(one).max())


def test_one_demand_moves_all_flaps_of_a_blade_alike():
    free = _alike(MODEL)
    for agent in _linear(free)[:3]:
        angle = simulate(agent, free, SEEDS, 5.0).flap_angle.reshape(2, -1, 3, FLAPS)
        assert np.abs(angle).max() > 1e-3
        np.testing.assert_allclose(angle, angle[..., :1].repeat(FLAPS, axis=-1), atol=1e-6)
    # With weights of its own each has a use.
    lqg = simulate(lqg_agent("lqg", free, GENTLE), free, SEEDS, 5.0).flap_angle.reshape(2, -1, 3, FLAPS)
    assert np.abs(np.ptp(lqg, axis=-1)).max() > 1e-2


def test_a_shared_policy_sees_and_moves_its_own_blade():
    policy = _policy(True)
    rng = np.random.default_rng(3)
    rbm, angle, rate = (
        rng.standard_normal(3),
        rng.standard_normal((3, FLAPS)),
        rng.standard_normal((3, FLAPS)),
    )
    seen = 0.1 * np.concatenate([rbm, angle.ravel(), rate.ravel()])
    action, _ = policy.predict(seen)
    for blade in range(3):
        own = 0.1 * np.concatenate([rbm[blade : blade + 1], angle[blade], rate[blade]])
        expected = np.clip(policy.weights[0] @ own, -1.0, 1.0)
        np.testing.assert_allclose(action.reshape(3, FLAPS)[blade], expected, atol=1e-6)
        alone, _ = OneBlade(policy, FLAPS).predict(own)
        np.testing.assert_allclose(alone, expected, atol=1e-6)


def test_predictive_control_is_the_lqg_while_no_stop_is_in_sight(model):
    pytest.importorskip("daqp")
    agent, lqg = PredictiveController("mpc", model, Weights(0.02)), lqg_agent("lqg", model, Weights(0.02))
    assert disk_margin(model, agent.unconstrained).alpha == pytest.approx(
        disk_margin(model, lqg.system).alpha, rel=1e-6
    )
    ours, theirs = (simulate(each, model, SEEDS, 10.0).flap_angle for each in (agent, lqg))
    np.testing.assert_allclose(ours, theirs, atol=1e-5 * np.abs(theirs).max())


def test_predictive_control_asks_no_flap_beyond_its_own_stops():
    """Nothing holds these flaps but the plan; the one with the narrowest stop meets it first."""
    pytest.importorskip("daqp")
    agent = PredictiveController("mpc", MODEL, Weights(30.0, 1.0, 1.0, 0.05))
    angles, rates, accelerations = (
        np.array([getattr(flap, f"{kind}_limit") for flap in MODEL.flaps])
        for kind in ("angle", "rate", "acceleration")
    )
    rng, dt, state = np.random.default_rng(0), MODEL.time_step, None
    loads = np.cumsum(rng.standard_normal((600, 3)), axis=0) * 0.15
    angle, rate, share = np.zeros((3, FLAPS)), np.zeros((3, FLAPS)), []
    for load in loads:
        action, state = agent.predict(np.concatenate([load, angle.ravel(), rate.ravel()]), state)
        acceleration = action.astype(float).reshape(3, FLAPS) * accelerations
        angle, rate = angle + dt * rate + 0.5 * dt**2 * acceleration, rate + dt * acceleration
        share.append([np.abs(angle / angles).max(axis=0), np.abs(rate / rates).max(axis=0)])
    # Where blocking leaves no plan the flaps brake, which takes them over by a ten-thousandth at most.
    assert np.max(share) <= 1.0 + 1e-3
    assert np.max(np.array(share)[:, 0], axis=0).max() > 0.999


AGENT = pd_agent("mine", ONE, PDGains(2e-8, 0.1, 0.1, 9.0, 0.8))
REFUSED = {
    "a shipped controller": lambda folder: load_agent("lqg", MODEL),
    "a shipped controller of the rotor": lambda folder: load_agent("individual_flap", MODEL),
    "a shipped policy": lambda folder: load_agent("ppo", MODEL),
    "a file": lambda folder: save_agent(folder / "mine.json", AGENT, MODEL, "A test.", {}),
    "a simulation": lambda folder: simulate(AGENT, MODEL, [1], 1.0),
    "a comparison": lambda folder: compare([AGENT], MODEL, realisations=1, duration=5.0),
    "an environment": lambda folder: Residual(
        gymnasium.make(TURBINE_ID, model=MODEL, task={"observe": AGENT.observe}, steps_per_action=1), AGENT
    ),
    "a single blade": lambda folder: Residual(
        gymnasium.make(
            "flapgym/NREL5MWBlade-v1", model=MODEL, task={"observe": AGENT.observe}, steps_per_action=1
        ),
        AGENT,
    ),
}


@pytest.mark.parametrize("meeting", REFUSED.values(), ids=REFUSED)
def test_an_agent_of_one_flap_is_refused_by_name_with_both_numbers_and_what_to_do(meeting, tmp_path):
    with pytest.raises(ValueError) as caught:
        meeting(tmp_path)
    message = str(caught.value)
    assert message.startswith("agent ")
    assert "made for 1 flap a blade, the model synthetic has 3; tune or train it on this model" in message
    assert "\n" not in message


def test_systems_of_another_number_of_flaps_are_refused():
    for refused in (
        lambda: closed_loop(MODEL, AGENT.system),
        lambda: growth_per_turn(MODEL, _in_frame(AGENT.system, ONE, ONE.turbine)),
        lambda: design_model(MODEL, ONE.blade),
    ):
        with pytest.raises(ValueError, match="expected 3 flaps a blade, as the model synthetic has, got 1"):
            refused()


def test_the_other_way_round_too():
    three = pd_agent("mine", MODEL, PDGains(2e-8, 0.1, 0.1, 9.0, 0.8))
    assert isinstance(three, BladeController)
    with pytest.raises(ValueError, match="agent mine: made for 3 flaps a blade, the model synthetic has 1; "):
        simulate(three, ONE, [1], 1.0)


class _Own:
    """An agent that does not tell for how many flaps it is."""

    name, observe, steps_per_action, model_hash = "own", ("rbm",), 10, None

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        return np.zeros((len(observation), 3), dtype=np.float32), None


def test_actions_for_other_flaps_are_refused_by_the_agents_name():
    with pytest.raises(
        ValueError, match=r"agent own: expected actions of shape \(1, 9\), 3 a blade, got \(1, 3\)"
    ):
        simulate(_Own(), MODEL, [1], 1.0)
